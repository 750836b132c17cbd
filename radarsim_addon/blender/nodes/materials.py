# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials made of the Radar Material group, and a few presets."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import bpy

from ...errors import ConfigError, SceneError
from .fresnel import OPAQUE_BELOW_TRANSMITTANCE
from .group_search import group_input, group_node
from .groups import ensure_group
from .radar_material import EXTINCTION, INDEX, KIND, ROUGHNESS, SPECULARITY

PRESET_PROPERTY = "radarsim_preset"
VOLUME_STEP_RATE = 1000.0
"""Of materials of ours. Along a ray inside an object they are uniform, so one step is exact. The
physical one depends on the ray, so Cycles marches through it in steps, of a tenth of the object's
size unless told otherwise, and stops absorbing as soon as 1e-6 is left: echoes below -60 dB would
come out too strong."""


@dataclass(frozen=True)
class MaterialPreset:
    """Inputs of the Radar Material group under a name.

    Parameters
    ----------
    label, description
        For menus. The description names the origin of the index.
    n, kappa
        Complex index n + j kappa. kappa is normalised: power falls as exp(-4 pi kappa d / Lambda),
        so with Lambda = wavelength it is the physical one, and with another Lambda waves enter
        as many Lambda as they really enter wavelengths.
    specularity, roughness
        Kind of surface: chosen to be typical, not measured.
    penetrable
        Whether the interior absorbs and delays. A conductor lets nothing in.
    """

    label: str
    description: str
    n: float
    kappa: float
    specularity: float
    roughness: float
    penetrable: bool = True


_ITU = "Index at 5.3 GHz after ITU-R P.2040-3, Table 3"

PRESETS: dict[str, MaterialPreset] = {
    "metal": MaterialPreset(
        "Metal",
        "Opaque, reflects 99.98 % (index 1e4 + j1e4, the target of the paper)",
        1e4,
        1e4,
        0.5,
        0.5,
        penetrable=False,
    ),
    "paper_object": MaterialPreset(
        "Paper's object",
        "Partly transparent object of the paper (index 1.4 + j1.0, extinction normalised to the "
        "model's scale); reflects 17 % at normal incidence",
        1.4,
        1.0,
        0.5,
        0.5,
    ),
    "concrete": MaterialPreset("Concrete", f"{_ITU}: concrete", 2.2926, 0.1259, 0.3, 0.6),
    "ground": MaterialPreset(
        "Ground", f"{_ITU}: medium dry ground, rough", 3.5721, 0.2519, 0.1, 0.8
    ),
    "wood": MaterialPreset("Wood", f"{_ITU}: wood", 1.4111, 0.0337, 0.2, 0.6),
    "glass": MaterialPreset("Glass", f"{_ITU}: glass, smooth", 2.5121, 0.0227, 0.9, 0.2),
}
"""Presets by identifier, in the order of the menu."""


def is_radar_material(material: Any) -> bool:
    """Whether a material scatters by the Radar Material group, and so carries the range code."""
    return group_node(material) is not None


def lets_nothing_through(material: Any) -> bool:
    """Whether a material is a Radar Material that is opaque whatever the ray: a conductor with
    fixed numbers (see :func:`.fresnel.transmittance`)."""
    index, extinction = group_input(material, INDEX), group_input(material, EXTINCTION)
    if index is None or extinction is None:
        return False
    return is_conductor(complex(index.default_value, extinction.default_value))


def is_conductor(index: complex) -> bool:
    """Whether the groups take a medium as opaque, with certainty (see :func:`.fresnel.is_open`)."""
    # Twice as sure as the node group, which rounds.
    passed = 4 * index.real / ((index.real + 1) ** 2 + index.imag**2)
    return passed < OPAQUE_BELOW_TRANSMITTANCE / 2


def link_group(material: Any, group: Any, penetrable: bool) -> Any:
    """Give a material a group of ours as its only nodes; returns the group's node."""
    if material.node_tree is None:  # always there from 5.0 on, where use_nodes warns
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    output.location = (260, 0)
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    node.label = group.name
    node.width = 220
    tree.links.new(node.outputs["Surface"], output.inputs["Surface"])
    if penetrable:
        tree.links.new(node.outputs["Volume"], output.inputs["Volume"])
    # Nothing here shines; sampling it as a light would only cost time.
    material.cycles.emission_sampling = "NONE"
    material.cycles.volume_step_rate = VOLUME_STEP_RATE
    return node


def make_material(
    name: str,
    n: float,
    kappa: float,
    specularity: float = 0.5,
    roughness: float = 0.5,
    *,
    penetrable: bool = True,
) -> Any:
    """Make a material with the Radar Material group.

    Parameters
    ----------
    name
        Name of the data-block; Blender numbers it where taken.
    n, kappa
        Complex index of refraction n + j kappa, kappa normalised (see :class:`MaterialPreset`).
    specularity
        Share of the specular lobe, 0 to 1.
    roughness
        Of the specular lobe, 0 to 1 (alpha = roughness^2).
    penetrable
        Link the interior's absorption and delay. False for conductors.

    Returns
    -------
    bpy.types.Material

    Raises
    ------
    ConfigError
        A number outside its limits.
    """
    _check("Index of refraction n", n, 1.0, math.inf)
    _check("Extinction coefficient kappa", kappa, 0.0, math.inf)
    _check("Specularity", specularity, 0.0, 1.0)
    _check("Roughness", roughness, 0.0, 1.0)
    group = ensure_group(KIND)
    material = bpy.data.materials.new(name)
    try:
        node = link_group(material, group, penetrable)
        for socket, value in (
            (INDEX, n),
            (EXTINCTION, kappa),
            (SPECULARITY, specularity),
            (ROUGHNESS, roughness),
        ):
            node.inputs[socket].default_value = value
    except BaseException:
        bpy.data.materials.remove(material)
        raise
    return material


def preset_material(preset: str) -> Any:
    """The file's material for a preset, made where missing or where its values were changed.

    Raises
    ------
    ConfigError
        No preset of that name.
    """
    values = PRESETS.get(preset)
    if values is None:
        raise ConfigError(
            f"There is no material preset {preset!r}; there are: {', '.join(PRESETS)}."
        )
    for material in bpy.data.materials:
        ours = material.library is None and material.get(PRESET_PROPERTY) == preset
        if ours and _holds(material, values):
            return material
    material = make_material(
        f"Radar {values.label}",
        values.n,
        values.kappa,
        values.specularity,
        values.roughness,
        penetrable=values.penetrable,
    )
    material[PRESET_PROPERTY] = preset
    return material


def assign_radar_material(objects: Iterable[Any], preset: str) -> list[Any]:
    """Give objects the material of a preset; as `assign_to`.

    Raises
    ------
    ConfigError
        No preset of that name.
    SceneError
        None of the objects can carry a material.
    """
    return assign_to(objects, preset_material(preset))


def assign_to(objects: Iterable[Any], material: Any) -> list[Any]:
    """Give objects a material, in all their material slots.

    Parameters
    ----------
    objects : iterable of bpy.types.Object
        Objects that cannot carry a material (empties, lights, cameras) are passed over.
    material : bpy.types.Material

    Returns
    -------
    list of bpy.types.Object
        The objects that got the material.

    Raises
    ------
    SceneError
        None of the objects can carry a material.
    """
    objects = list(objects)
    usable = [
        obj
        for obj in objects
        if hasattr(obj.data, "materials") and (obj.library is None or obj.override_library)
    ]
    if not usable:
        found = ", ".join(f"{obj.name} ({obj.type.lower()})" for obj in objects) or "nothing"
        raise SceneError(
            f"No object for a radar material: {found} selected. "
            "Select one or more meshes that are not linked from another file."
        )
    for obj in usable:
        if not obj.material_slots:
            obj.data.materials.append(material)
        for slot in obj.material_slots:
            if slot.link == "DATA" and obj.data.library is not None:
                slot.link = "OBJECT"  # the linked mesh itself cannot be changed
            slot.material = material
    return usable


def _holds(material: Any, values: MaterialPreset) -> bool:
    """Whether a preset's material still has the preset's values, and none of them is linked."""
    node = group_node(material)
    if node is None:
        return False
    expected = (
        (INDEX, values.n),
        (EXTINCTION, values.kappa),
        (SPECULARITY, values.specularity),
        (ROUGHNESS, values.roughness),
    )
    for name, value in expected:
        socket = node.inputs.get(name)
        if socket is None or socket.is_linked:
            return False
        if not math.isclose(socket.default_value, value, rel_tol=1e-6, abs_tol=1e-9):
            return False
    return True


def _check(name: str, value: float, low: float, high: float) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        limits = f"from {low:g} up" if high == math.inf else f"from {low:g} to {high:g}"
        raise ConfigError(f"{name} is {value!r}; expected a number {limits}.")
