# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials made of the Radar Material group, a few presets, and the Ring Emitter on a light."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import bpy

from ...errors import ConfigError, SceneError
from ...physics.checks import real_array
from ...signal.scene import is_conductor
from ..state import SettingsRestorer
from .groups import ensure_group, group_input, group_node
from .physical_material import GRAZING_TRANSMISSION
from .radar_material import (
    EXTINCTION,
    INDEX,
    KIND,
    RING_EMITTER_KIND,
    ROUGHNESS,
    SPECULARITY,
    TRANSMISSION,
)

_INPUTS = (INDEX, EXTINCTION, SPECULARITY, ROUGHNESS)
PRESET_PROPERTY = "radarsim_preset"
#: Volume step rate of radarsim's materials. The interior is uniform along a ray, so one step is
#: exact. The physical material depends on the ray, so Cycles would take steps of a tenth of the
#: object's size and stop where 1e-6 is left: echoes below -60 dB would be too strong.
VOLUME_STEP_RATE = 1000.0


@dataclass(frozen=True)
class MaterialPreset:
    """Named set of inputs of the Radar Material group.

    The index n + j kappa has a normalised kappa: power falls as exp(-4 pi kappa d / Lambda). With
    Lambda = wavelength it is the physical kappa. With another Lambda, waves penetrate as many
    Lambda as they would penetrate wavelengths.
    """

    label: str
    #: Names the source of the index.
    description: str
    n: float
    kappa: float
    #: Typical values for the surface, not measured.
    specularity: float
    roughness: float
    #: The interior absorbs and delays. False for a conductor.
    penetrable: bool = True


_ITU = "Index at 5.3 GHz after ITU-R P.2040-3, Table 3"

#: By identifier, in the order of the menu.
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


def is_radar_material(material: bpy.types.Material) -> bool:
    """Return whether a material has the Radar Material group, and so encodes the range."""
    return group_node(material) is not None


def transmission_inputs(material: bpy.types.Material) -> list[Any]:
    """Return the sockets that scale the power passing a face, None where a node is linked."""
    node = group_node(material)
    if node is None:
        return []
    names = (TRANSMISSION, GRAZING_TRANSMISSION)
    return [group_input(material, name) for name in names if name in node.inputs]


def volume_link(material: bpy.types.Material) -> Any | None:
    """Return the link to the Volume of the output of a Radar Material; None without."""
    if group_node(material) is None:
        return None
    output = material.node_tree.get_output_node("CYCLES")
    links = () if output is None else output.inputs["Volume"].links
    return links[0] if links else None


def disconnect_volume(recorder: SettingsRestorer, material: bpy.types.Material, link: Any) -> None:
    """Remove the link to the Volume of a material's output, until the recorder restores it."""
    links, source, target = material.node_tree.links, link.from_socket, link.to_socket
    links.remove(link)
    recorder.on_restore(f"Volume of {material.name}", lambda: links.new(source, target))


def link_group(material: bpy.types.Material, group: Any, penetrable: bool) -> Any:
    """Replace the nodes of a material by a radarsim group; return the group's node."""
    if material.node_tree is None:  # Blender 5.0 always has one, and use_nodes warns there
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
    # The material emits nothing; sampling it as a light would only take time.
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
    penetrable: bool | None = None,
) -> Any:
    """Make a material with the Radar Material group, of index n + j kappa as in `MaterialPreset`.

    `specularity` is the fraction of the reflected power in the specular lobe and `roughness` that
    lobe's (alpha = roughness^2), 0 to 1. `penetrable` links the interior; None: unless it is a
    conductor. Raises ConfigError for a number outside its limits.
    """
    real_array("Index of refraction n", n, minimum=1.0)
    real_array("Extinction coefficient kappa", kappa, minimum=0.0)
    real_array("Specularity", specularity, "", 0.0, 1.0)
    real_array("Roughness", roughness, "", 0.0, 1.0)
    group = ensure_group(KIND)
    material = bpy.data.materials.new(name)
    try:
        enters = not is_conductor(complex(n, kappa)) if penetrable is None else penetrable
        node = link_group(material, group, enters)
        for socket, value in zip(_INPUTS, (n, kappa, specularity, roughness), strict=True):
            node.inputs[socket].default_value = value
    except BaseException:
        bpy.data.materials.remove(material)
        raise
    return material


def preset_material(preset: str) -> Any:
    """Return the file's material for a key of `PRESETS`; make one if missing or changed."""
    values = PRESETS.get(preset)
    if values is None:
        raise ConfigError(
            f"There is no material preset {preset!r}. Choose one of: {', '.join(PRESETS)}."
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
    """Assign the material of a preset to objects, as `assign_to`."""
    usable = _with_materials(objects)  # fails before a material is made
    return assign_to(usable, preset_material(preset))


def assign_to(objects: Iterable[Any], material: bpy.types.Material) -> list[Any]:
    """Assign a material to all material slots of objects; return those that have it now.

    Objects without materials (empties, lights, cameras...) are skipped. Raises SceneError if none
    of the objects can have a material.
    """
    usable = _with_materials(objects)
    for obj in usable:
        if not obj.material_slots:
            obj.data.materials.append(material)
        for slot in obj.material_slots:
            if slot.link == "DATA" and obj.data.library is not None:
                slot.link = "OBJECT"  # a linked mesh cannot be changed
            slot.material = material
    return usable


def _with_materials(objects: Iterable[Any]) -> list[Any]:
    """Return the objects that can have a material. Raises SceneError if there are none."""
    objects = list(objects)
    usable = [
        obj
        for obj in objects
        if hasattr(obj.data, "materials") and (obj.library is None or obj.override_library)
    ]
    if not usable:
        found = ", ".join(f"{obj.name} ({obj.type.lower()})" for obj in objects) or "nothing"
        raise SceneError(
            f"No selected object can have a Radar Material: {found} selected. "
            "Select one or more meshes that are not linked from another file."
        )
    return usable


def _holds(material: bpy.types.Material, values: MaterialPreset) -> bool:
    """Return whether a material still has the values of a preset, and none of them is linked."""
    node = group_node(material)
    if node is None:
        return False
    expected = (values.n, values.kappa, values.specularity, values.roughness)
    sockets = zip((node.inputs.get(name) for name in _INPUTS), expected, strict=True)
    return all(
        socket is not None
        and not socket.is_linked
        and math.isclose(socket.default_value, value, rel_tol=1e-6, abs_tol=1e-9)
        for socket, value in sockets
    )


def setup_emitter(light: bpy.types.Light) -> Any:
    """Make a Point light the radar's transmitter; return the group node in its tree.

    The light becomes a true point, because a radius would blur ranges, and gets the Ring Emitter in
    its node tree. Power, colour and position do not change. A second call changes nothing. Raises
    SceneError if the light is of another type, or linked from a library.
    """
    if light.type != "POINT":
        raise SceneError(
            f"Light {light.name!r} is of type {light.type}. Only a Point light can be the "
            "transmitter. Choose a Point light, or press Radar > Set Up Radar."
        )
    if light.library is not None:
        raise SceneError(
            f"Light {light.name!r} is linked from {light.library.filepath!r}, so radarsim cannot "
            "change it. Make it local, or press Radar > Set Up Radar."
        )
    group = ensure_group(RING_EMITTER_KIND)
    _make_point(light)
    return _link_emission(light.node_tree, group)


def _make_point(light: bpy.types.Light) -> None:
    light.shadow_soft_size = 0.0
    light.use_shadow = True
    if hasattr(light, "use_soft_falloff"):
        light.use_soft_falloff = False  # it changes the power near the light
    if hasattr(light, "normalize"):
        light.normalize = True  # else the power is not divided by the light's area
    light.cycles.max_bounces = 1024
    light.cycles.use_multiple_importance_sampling = False
    with warnings.catch_warnings():  # needed up to 5.0, deprecated afterwards
        warnings.simplefilter("ignore", DeprecationWarning)
        light.use_nodes = True


def _link_emission(tree: bpy.types.NodeTree, group: Any) -> Any:
    """Connect the group to the light's output; return its node."""
    output = next((n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputLight"), None)
    if output is None:
        output = tree.nodes.new("ShaderNodeOutputLight")
        output.location = (300, 0)
    node = next(
        (n for n in tree.nodes if n.bl_idname == "ShaderNodeGroup" and n.node_tree == group), None
    )
    if node is None:
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        node.label = group.name
        node.location = (output.location.x - 220, output.location.y)
    if not any(link.from_node == node for link in output.inputs["Surface"].links):
        tree.links.new(node.outputs["Emission"], output.inputs["Surface"])
    return node
