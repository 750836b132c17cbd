# SPDX-License-Identifier: GPL-3.0-or-later
"""Remove from a measurement what does not encode the range: other lights, other materials.

Light of another source is not encoded at the transmitter, and light from another material is not
encoded at that surface, so both would have wrong ranges. radarsim hides other lights. Objects
without a Radar Material absorb, so they cast a radar shadow but return no echo. A
`SettingsRestorer` takes all changes back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any

import bpy

from ...findings import Finding, finding
from ..materials import (
    SURFACE_TYPES,
    MaterialAssignment,
    assigned_materials,
    foreign_objects,
    slot_materials,
)
from ..nodes import is_radar_material
from ..state import SettingsRestorer

#: Object types that Cycles renders and that have no radar model.
_UNSUPPORTED_TYPES = {"VOLUME", "GPENCIL", "GREASEPENCIL"}
_SCATTERING_NODES = {
    "ShaderNodeSubsurfaceScattering",
    "ShaderNodeVolumePrincipled",
    "ShaderNodeVolumeScatter",
}
ABSORBER_NAME = "radarsim absorber (temporary)"


def isolate(
    recorder: SettingsRestorer, scene: Any, emitter: Any, depsgraph: Any, any_material: bool = False
) -> list[Finding]:
    """Hide other lights than the transmitter, and what cannot echo.

    Parameters
    ----------
    recorder
        Records the changes.
    scene : bpy.types.Scene
    emitter : bpy.types.Object
        Transmitter.
    depsgraph : bpy.types.Depsgraph
        Up to date.
    any_material
        A world volume encodes the range, so surfaces of all materials echo. Only volumes are
        hidden, because their paths have no vertex on a surface.

    Returns
    -------
    list of Finding
        Objects that give no echo.
    """
    _hide_other_lights(recorder, emitter)
    assigned = assigned_materials(depsgraph)
    if any_material:
        return [*_optical(depsgraph), *_isolate_any_material(recorder, scene, assigned)]
    is_radar = cache(is_radar_material)
    foreign = set(foreign_objects(depsgraph, is_radar))
    silent = [
        one.item.name
        for one in assigned
        if one.item in foreign and not any(map(is_radar, one.materials))
    ]
    rendered = _rendered(scene)
    unsupported = [
        item.name for item in rendered if item.type in _UNSUPPORTED_TYPES and not item.hide_render
    ]
    _absorb_other_materials(recorder)
    _absorb_bare_objects(recorder, assigned)
    for item in rendered:
        if item.type in _UNSUPPORTED_TYPES:
            _hide(recorder, item)
    findings = []
    if silent:
        findings.append(finding("no-radar-material", *silent))
    if unsupported:
        findings.append(finding("object-without-surface", *unsupported))
    return findings


def _optical(depsgraph: Any) -> list[Finding]:
    """Name the objects whose echoes are those of an optical material."""
    known = cache(lambda material: is_radar_material(material) or _is_fog(material))
    names = dict.fromkeys(item.name for item in foreign_objects(depsgraph, known))
    return [finding("optical-material", *names)] if names else []


def _isolate_any_material(
    recorder: SettingsRestorer, scene: Any, assigned: Sequence[MaterialAssignment]
) -> list[Finding]:
    fog = [
        item
        for item in _rendered(scene)
        if not item.hide_render
        and (
            item.type in _UNSUPPORTED_TYPES
            or (item.material_slots and all(_is_fog(s.material) for s in item.material_slots))
        )
    ]
    for item in fog:
        _hide(recorder, item)
    for material in bpy.data.materials:
        if not material.is_grease_pencil and material.node_tree is not None:
            # Cycles samples emissive surfaces like lights, with samples of the transmitter.
            recorder.set(material.cycles, "emission_sampling", "NONE")
    shown = dict.fromkeys(material for one in assigned for material in one.materials)
    scattering = [
        material.name
        for material in shown
        if material is not None
        and material.node_tree is not None
        and not is_radar_material(material)
        and not _is_fog(material)
        and _scatters_inside(material)
    ]
    findings = []
    if fog:
        findings.append(finding("object-without-surface", *(item.name for item in fog)))
    if scattering:
        findings.append(finding("subsurface-scattering", *scattering))
    return findings


def _is_fog(material: Any) -> bool:
    """Return whether a material has a volume and no surface."""
    if material is None or material.node_tree is None:
        return False
    return _has_volume_only(material.node_tree.get_output_node("CYCLES"))


def _has_volume_only(output: Any) -> bool:
    """Return whether a material output, or None, has a volume and no surface."""
    return output is not None and (
        output.inputs["Volume"].is_linked and not output.inputs["Surface"].is_linked
    )


def _scatters_inside(material: Any) -> bool:
    for node in material.node_tree.nodes:
        if node.bl_idname in _SCATTERING_NODES:
            return True
        weight = node.inputs.get("Subsurface Weight")
        if weight is not None and (weight.is_linked or weight.default_value > 0):
            return True
    return False


def echoes(item: Any, is_radar: Callable[[Any], bool] = is_radar_material) -> bool:
    """Return whether an object can echo: a Radar Material in a slot or from Geometry Nodes.

    Parameters
    ----------
    item : bpy.types.Object
    is_radar
        `is_radar_material`, or the same with a memory.

    Returns
    -------
    bool
        True also where Geometry Nodes might assign a Radar Material.
    """
    if item.type not in SURFACE_TYPES:
        return False
    if any(is_radar(material) for material in slot_materials(item)):
        return True
    return any(modifier.type == "NODES" for modifier in item.modifiers)


def _rendered(scene: Any) -> list[Any]:
    """Return the objects of a scene and of the collections that it instances."""
    found: dict[Any, None] = {}
    waiting = list(scene.objects)
    while waiting:
        item = waiting.pop()
        if item in found:
            continue
        found[item] = None
        if item.instance_type == "COLLECTION" and item.instance_collection is not None:
            waiting += item.instance_collection.all_objects
    return sorted(found, key=lambda item: item.name_full)


def _hide_other_lights(recorder: SettingsRestorer, emitter: Any) -> None:
    # Even a weak light takes samples of the transmitter. scene.objects does not contain the lights
    # of instanced collections, so this checks all objects of the file.
    for item in bpy.data.objects:
        if item.type in {"LIGHT", "LIGHT_PROBE"} and item != emitter:
            _hide(recorder, item)
    _mute_animation(recorder, emitter, "hide_render")


def _hide(recorder: SettingsRestorer, item: Any) -> None:
    _mute_animation(recorder, item, "hide_render")
    recorder.set(item, "hide_render", True)


def _mute_animation(recorder: SettingsRestorer, item: Any, data_path: str) -> None:
    """Prevent animation from changing a setting at the next frame."""
    for curve in animation_curves(item.animation_data):
        if curve.data_path == data_path:
            recorder.set(curve, "mute", True)


def animation_curves(animation: Any) -> Iterator[Any]:
    """Yield F-curves and drivers of a data-block: layered actions (Blender 4.4) and older ones.

    Parameters
    ----------
    animation : bpy.types.AnimData or None

    Yields
    ------
    bpy.types.FCurve
        One at a time.
    """
    if animation is None:
        return
    yield from animation.drivers
    if animation.action is not None:
        yield from action_curves(animation.action, getattr(animation, "action_slot", None))


def action_curves(action: Any, slot: Any = None) -> Iterator[Any]:
    """Yield the F-curves of an action: a layered one (Blender 4.4) or an older one.

    Parameters
    ----------
    action : bpy.types.Action
    slot : bpy.types.ActionSlot, optional
        Only the curves of this slot of a layered action.

    Yields
    ------
    bpy.types.FCurve
        One at a time.
    """
    if not hasattr(action, "layers"):
        yield from action.fcurves
        return
    for layer in action.layers:
        for strip in layer.strips:
            for bag in strip.channelbags:
                if slot is None or bag.slot == slot:
                    yield from bag.fcurves


def _absorb_other_materials(recorder: SettingsRestorer) -> None:
    for material in bpy.data.materials:
        if material.is_grease_pencil or is_radar_material(material):
            continue
        if bpy.app.version < (5, 0, 0):  # always on later
            recorder.set(material, "use_nodes", True)
        if material.node_tree is not None:
            _absorb(recorder, material)


def _absorb(recorder: SettingsRestorer, material: Any) -> None:
    """Add an active output to a material that absorbs."""
    nodes = material.node_tree.nodes
    outputs = [node for node in nodes if node.bl_idname == "ShaderNodeOutputMaterial"]
    volume_only = _has_volume_only(material.node_tree.get_output_node("CYCLES"))
    output = nodes.new("ShaderNodeOutputMaterial")
    output.name = ABSORBER_NAME
    added = [output]

    def undo() -> None:
        for node in added:
            nodes.remove(node)

    recorder.on_restore(material.name, undo)
    if volume_only:
        # Fog has no surface, so without its volume nothing remains.
        clear = nodes.new("ShaderNodeBsdfTransparent")
        added.append(clear)
        material.node_tree.links.new(clear.outputs[0], output.inputs["Surface"])
    else:
        added.append(_link_black(material.node_tree, output))
    for other in outputs:
        recorder.set(other, "is_active_output", False)
    output.is_active_output = True
    # Cycles samples emissive meshes like lights.
    recorder.set(material.cycles, "emission_sampling", "NONE")


def _link_black(tree: Any, output: Any) -> Any:
    """Connect a black surface; an unconnected output differs between Blender versions."""
    black = tree.nodes.new("ShaderNodeEmission")
    black.inputs["Strength"].default_value = 0.0
    tree.links.new(black.outputs[0], output.inputs["Surface"])
    return black


def _absorb_bare_objects(recorder: SettingsRestorer, assigned: list[MaterialAssignment]) -> None:
    """Make objects without a material absorb; Blender's grey default does not encode the range."""
    bare = [
        one.item.data
        for one in assigned
        if not any(one.materials)
        and not any(modifier.type == "NODES" for modifier in one.item.modifiers)
    ]
    if not bare:
        return
    absorber = bpy.data.materials.new(ABSORBER_NAME)
    recorder.on_restore(ABSORBER_NAME, lambda: bpy.data.materials.remove(absorber))
    if absorber.node_tree is None:
        absorber.use_nodes = True
    tree = absorber.node_tree
    tree.nodes.clear()
    _link_black(tree, tree.nodes.new("ShaderNodeOutputMaterial"))
    for data in dict.fromkeys(bare):
        if len(data.materials) == 0:
            data.materials.append(absorber)
            # pop() would leave an empty slot on the object.
            recorder.on_restore(data.name, data.materials.clear)
        else:
            for index in range(len(data.materials)):
                _fill_slot(recorder, data, index, absorber)


def _fill_slot(recorder: SettingsRestorer, data: Any, index: int, absorber: Any) -> None:
    data.materials[index] = absorber

    def undo() -> None:
        data.materials[index] = None

    recorder.on_restore(data.name, undo)
