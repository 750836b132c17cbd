# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads materials as surfaces: the only place that asks nodes what they reflect and let through."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import bpy

from ...errors import ConfigError
from ...signal.scene import Clutter, Kind, Shader, Surface
from ..nodes.groups import (
    KIND_PROPERTY,
    find_group,
    input_number,
    shaders_at_output,
)
from ..nodes.materials import volume_link
from ..nodes.physical_material import (
    CLUTTER_ROW,
    GRAZING_TRANSMISSION,
    PHYSICAL_KIND,
    SHEET_KIND,
    THICKNESS,
)
from ..nodes.radar_material import (
    EXTINCTION,
    INDEX,
    KIND,
    ROUGHNESS,
    SPECULARITY,
    TRANSMISSION,
)
from ..state import Snapshot
from .clutter import CLUTTER, clutter_of
from .physical_materials import inputs_at, rough_surface_of

#: Custom property of a material: exponent of its directive lobe.
LOBE_EXPONENT = "radarsim_lobe_exponent"
#: Inputs of the groups, and the fields of a surface that have them.
FIELDS = {
    INDEX: "n",
    EXTINCTION: "kappa",
    SPECULARITY: "specularity",
    ROUGHNESS: "roughness",
    THICKNESS: "thickness",
}
_KINDS: dict[str, Kind] = {KIND: "simple", PHYSICAL_KIND: "physical", SHEET_KIND: "sheet"}
#: Inputs that say what colour a shader has.
_COLOURS = ("Base Color", "Color")


def read_surface(material: bpy.types.Material) -> Surface:
    """Return what a material is, or an empty slot (None), by its numbers as they are set now."""
    if material is None:
        return Surface(is_default=True)
    common = {
        "name": material.name,
        "rough": rough_surface_of(material),
        "clutter": _clutter(material),
        "exponent": material.get(LOBE_EXPONENT),
    }
    found = find_group(material)
    if found is None:
        shaders, output = shaders_at_output(material)
        return Surface(
            **common,
            shaders=tuple(map(_shader, shaders)),
            output=None if output is None else _shader(output),
            is_default=material.node_tree is None,
        )
    there = {name: field for name, field in FIELDS.items() if name in found.node.inputs}
    values: Any = {name: input_number(found, name) for name in there}
    passed = (TRANSMISSION, GRAZING_TRANSMISSION)
    return Surface(
        **common,
        **dict(zip(there.values(), values.values(), strict=True)),
        kind=_KINDS[found.node.node_tree.get(KIND_PROPERTY)],
        unlinked={
            field: float(found.node.inputs[name].default_value)
            for name, field in there.items()
            if values[name] is None
        },
        transmissions=tuple(
            input_number(found, name) for name in passed if name in found.node.inputs
        ),
        has_clutter_row=input_number(found, CLUTTER_ROW) is not None,
        volume=volume_link(material) is not None,
    )


def surface_at(material: bpy.types.Material, carrier_hz: float, beyond_band: str) -> Surface:
    """Return what a material will be at a carrier; its nodes are not changed.

    Raises ConfigError if its medium cannot be evaluated there.
    """
    surface = read_surface(material)
    if surface.kind not in ("physical", "sheet"):
        return surface
    given = inputs_at(material, carrier_hz, beyond_band)
    values = {FIELDS[name]: value for name, value in given.items() if name in FIELDS}
    # what a node sets stays unknown
    known = {name: x for name, x in values.items() if getattr(surface, name) is not None}
    return replace(surface, **known)  # type: ignore[arg-type]


def _clutter(material: bpy.types.Material) -> Clutter | None:
    try:
        return clutter_of(material)
    except ConfigError:  # a run refuses it by name; its model is unknown until then
        return Clutter(str(material[CLUTTER]))


def _shader(node: bpy.types.Node) -> Shader:
    inputs: dict[str, float | None] = {}
    for socket in node.inputs:
        value: Any = getattr(socket, "default_value", None)
        if socket.is_linked:
            inputs[socket.name] = None
        elif socket.type == "RGBA":
            inputs[socket.name] = max(value[:3])
        elif socket.type == "VALUE":
            inputs[socket.name] = float(value)
        else:
            inputs[socket.name] = 0.0
    colours = [node.inputs[name] for name in _COLOURS if name in node.inputs]
    free = [sum(one.default_value[:3]) / 3 for one in colours if not one.is_linked]
    albedo = free[0] if free else None
    return Shader(node.bl_idname.removeprefix("ShaderNode").removeprefix("Bsdf"), inputs, albedo)


class Surfaces(dict[Any, Surface]):
    """The surfaces of materials at one moment, each read when it is first asked for."""

    def __missing__(self, material: bpy.types.Material) -> Surface:
        self[material] = found = read_surface(material)
        return found

    def of(self, materials: Iterable[Any]) -> list[Surface]:
        """Return the surface of each material."""
        return [self[one] for one in materials]


_of_snapshots: WeakKeyDictionary[Snapshot, Surfaces] = WeakKeyDictionary()


def surfaces_of(snapshot: Snapshot) -> Surfaces:
    """Return the surfaces of a snapshot's materials.

    A snapshot lasts until Blender evaluates something, as it does when a number of a node changes.
    """
    return _of_snapshots.setdefault(snapshot, Surfaces())
