# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials as the live preview draws them: closed forms with the inputs of their node groups."""

from __future__ import annotations

from typing import Any, NamedTuple

import bpy

from ...signal.draft import DraftSurface
from ..materials import clutter_of, mirror_of, scattered_lobe_of
from ..materials.physical_materials import inputs_at
from ..nodes.group_search import group_input, group_node
from ..nodes.groups import KIND_PROPERTY
from ..nodes.physical_material import KIND as PHYSICAL_KIND
from ..nodes.physical_material import SMOOTH_BELOW
from ..nodes.radar_material import EXTINCTION, INDEX, KIND, ROUGHNESS, SPECULARITY
from ..nodes.sheet import KIND as SHEET_KIND

#: Albedo of a surface without a material in Cycles, and of one whose colour is not known.
_DEFAULT_ALBEDO, _GUESSED_ALBEDO = 0.8, 0.5
_COLOURS = {"ShaderNodeBsdfPrincipled": "Base Color", "ShaderNodeBsdfDiffuse": "Color"}


class LiveMaterial(NamedTuple):
    """A material in the preview.

    guessed: whether its numbers are. mirrors: whether it mirrors. lobe: whether it has a scattered
    lobe, which is left out.
    """

    surface: DraftSurface
    guessed: bool = False
    mirrors: bool = False
    lobe: bool = False


def live_material(
    material: Any, carrier_hz: float, beyond_band: str, polarisation: str, any_material: bool
) -> LiveMaterial:
    """Return a material at a carrier [Hz]; a ConfigError where its medium cannot be evaluated.

    any_material: materials of Cycles echo, too.
    """
    node = group_node(material)
    if node is None:
        return _foreign(material) if any_material else LiveMaterial(DraftSurface("silent"))
    kind = node.node_tree.get(KIND_PROPERTY)
    if kind == SHEET_KIND:
        return LiveMaterial(DraftSurface("silent"), mirrors=True)
    names = (INDEX, EXTINCTION, SPECULARITY, ROUGHNESS)
    sockets = {name: group_input(material, name) for name in names if name in node.inputs}
    values = {
        name: float((socket or node.inputs[name]).default_value) for name, socket in sockets.items()
    }
    guessed = any(socket is None for socket in sockets.values())
    mirrors = mirror_of(material) is not None
    lobe = scattered_lobe_of(material) is not None
    if kind == KIND:
        surface = DraftSurface(
            "simple",
            values[INDEX],
            values[EXTINCTION],
            values[SPECULARITY],
            0.0 if mirrors else values[ROUGHNESS],
        )
        return LiveMaterial(surface, guessed, mirrors, lobe)
    assert kind == PHYSICAL_KIND
    given = inputs_at(material, carrier_hz, beyond_band)
    values |= {name: given[name] for name in values if name in given and sockets[name] is not None}
    smooth = values[ROUGHNESS] <= SMOOTH_BELOW
    clutter = clutter_of(material)
    surface = DraftSurface(
        "physical",
        values[INDEX],
        values[EXTINCTION],
        roughness=0.0 if smooth else values[ROUGHNESS],
        clutter="" if clutter is None else clutter.name,
        clutter_path=bpy.path.abspath(clutter.path) if clutter and clutter.path else "",
        clutter_parameters={} if clutter is None else clutter.parameters,
        polarisation=polarisation,
    )
    return LiveMaterial(surface, guessed, smooth and clutter is None, lobe)


def _foreign(material: Any) -> LiveMaterial:
    """A material of Cycles: a Lambert surface of the colour at its output, as far as known."""
    if material is None or material.node_tree is None:
        return LiveMaterial(DraftSurface("lambert", albedo=_DEFAULT_ALBEDO))
    output = material.node_tree.get_output_node("CYCLES")
    links = () if output is None else output.inputs["Surface"].links
    shader = links[0].from_node if links else None
    name = _COLOURS.get("" if shader is None else shader.bl_idname)
    if shader is None or name is None or shader.inputs[name].is_linked:
        return LiveMaterial(DraftSurface("lambert", albedo=_GUESSED_ALBEDO), guessed=True)
    albedo = sum(shader.inputs[name].default_value[:3]) / 3
    exact = shader.bl_idname == "ShaderNodeBsdfDiffuse"
    return LiveMaterial(DraftSurface("lambert", albedo=float(albedo)), guessed=not exact)
