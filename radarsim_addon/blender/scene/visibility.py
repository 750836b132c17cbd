# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendered objects: made visible to Blender's evaluated scene, without what encodes no range.

Poses, meshes, extents and ground truth come from the scene of the viewport, which does not contain
objects that are hidden there, and whose modifiers may have other settings. Cycles renders them
nevertheless, so radarsim shows during a measurement what renders (`show_what_renders`,
`show_as_rendered`). Objects in a collection that does not render are not part of it.

Light of another source is not encoded at the transmitter, and light from another material is not
encoded at that surface, so both would have wrong ranges. `isolate` hides other lights. Objects
without a Radar Material absorb, so they cast a radar shadow but return no echo. A
`SettingsRestorer` takes all changes back.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from functools import cache
from typing import Any

import bpy
import numpy as np

from ...arrays import Indices, Mask
from ...findings import Finding, finding
from ..materials import (
    SURFACE_TYPES,
    MaterialAssignment,
    assigned_materials,
    foreign_objects,
    slot_materials,
)
from ..materials.physical_materials import READY, suggest_material
from ..nodes import is_radar_material
from ..nodes.shader_trees import is_fog, replace_by_false, scatters_inside
from ..state import SettingsRestorer, Snapshot

#: Object types that Cycles renders and that have no radar model.
_UNSUPPORTED_TYPES = {"VOLUME", "GPENCIL", "GREASEPENCIL"}
ABSORBER_NAME = "radarsim absorber (temporary)"
#: Settings of modifiers for the viewport, each with that for renders.
_RENDER_SETTINGS = {
    "levels": "render_levels",
    "steps": "render_steps",
    "viewport_resolution": "resolution",
}
#: Objects whose visibility is read in one part.
_PART = 256
#: Thickness of a pane that is modelled as an open mesh [m].
_PANE_M = 4e-3


def isolate(
    recorder: SettingsRestorer,
    scene: bpy.types.Scene,
    emitter: bpy.types.Object,
    snapshot: Snapshot,
    any_material: bool = False,
) -> list[Finding]:
    """Hide all lights except the transmitter, and all objects that cannot echo; return findings on
    objects without an echo.

    With `any_material`, a world volume encodes the range, so surfaces of all materials echo. Then
    only volumes are hidden, because their paths have no vertex on a surface.
    """
    # Even a weak light takes samples of the transmitter. scene.objects does not contain the lights
    # of instanced collections, so this checks all objects of the file.
    for item in bpy.data.objects:
        if item.type in {"LIGHT", "LIGHT_PROBE"} and item != emitter:
            _hide(recorder, item)
    _mute_animation(recorder, emitter, "hide_render")
    assigned = assigned_materials(snapshot)
    if any_material:
        known = cache(lambda material: is_radar_material(material) or is_fog(material))
        optical = dict.fromkeys(item.name for item in foreign_objects(snapshot, known))
        found = [finding("optical-material", *optical)] if optical else []
        return found + _isolate_any_material(recorder, scene, assigned)
    is_radar = cache(is_radar_material)
    foreign = set(foreign_objects(snapshot, is_radar))
    silent = [
        one.item.name
        for one in assigned
        if one.item in foreign and not any(map(is_radar, one.materials))
    ]
    rendered = _rendered(scene)
    unsupported = [
        item.name for item in rendered if item.type in _UNSUPPORTED_TYPES and not item.hide_render
    ]
    for material in bpy.data.materials:
        if not (material.is_grease_pencil or is_radar_material(material)):
            _absorb(recorder, material)
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


def _isolate_any_material(
    recorder: SettingsRestorer, scene: bpy.types.Scene, assigned: Sequence[MaterialAssignment]
) -> list[Finding]:
    fog = [
        item
        for item in _rendered(scene)
        if not item.hide_render
        and (
            item.type in _UNSUPPORTED_TYPES
            or (item.material_slots and all(is_fog(s.material) for s in item.material_slots))
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
        and not is_fog(material)
        and scatters_inside(material)
    ]
    findings = []
    if fog:
        findings.append(finding("object-without-surface", *(item.name for item in fog)))
    if scattering:
        findings.append(finding("subsurface-scattering", *scattering))
    return findings


def _hide(recorder: SettingsRestorer, item: bpy.types.Object) -> None:
    _mute_animation(recorder, item, "hide_render")
    recorder.set(item, "hide_render", True)


def _mute_animation(recorder: SettingsRestorer, item: bpy.types.Object, data_path: str) -> None:
    """Prevent animation from changing a setting at the next frame."""
    for curve in animation_curves(item.animation_data):
        if curve.data_path == data_path:
            recorder.set(curve, "mute", True)


def _rendered(scene: bpy.types.Scene) -> list[Any]:
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


def _absorb(recorder: SettingsRestorer, material: bpy.types.Material) -> None:
    """Add an active output to a material that absorbs."""
    if bpy.app.version < (5, 0, 0):  # always on later
        recorder.set(material, "use_nodes", True)
    if material.node_tree is None:
        return
    nodes = material.node_tree.nodes
    outputs = [node for node in nodes if node.bl_idname == "ShaderNodeOutputMaterial"]
    volume_only = is_fog(material)
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


def _link_black(tree: bpy.types.NodeTree, output: Any) -> Any:
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


def echoes(item: bpy.types.Object, is_radar: Callable[[Any], bool] = is_radar_material) -> bool:
    """Return whether an object can echo, by a Radar Material in a slot or from Geometry Nodes.

    `is_radar` may be a cached version of `is_radar_material`.
    """
    if item.type not in SURFACE_TYPES:
        return False
    if any(is_radar(material) for material in slot_materials(item)):
        return True
    return any(modifier.type == "NODES" for modifier in item.modifiers)


def animation_curves(animation: Any) -> Iterator[Any]:
    """Yield F-curves and drivers of a data-block's animation data, or of None."""
    if animation is None:
        return
    yield from animation.drivers
    if animation.action is not None:
        yield from action_curves(animation.action, getattr(animation, "action_slot", None))


def action_curves(action: Any, slot: Any = None) -> Iterator[Any]:
    """Yield the F-curves of an action, layered (Blender 4.4) or older; of one slot if given."""
    if not hasattr(action, "layers"):
        yield from action.fcurves
        return
    for layer in action.layers:
        for strip in layer.strips:
            for bag in strip.channelbags:
                if slot is None or bag.slot == slot:
                    yield from bag.fcurves


def show_what_renders(recorder: SettingsRestorer, view_layer: bpy.types.ViewLayer) -> None:
    """Make all rendered objects visible in the viewport, also those that only instances show."""
    rendered = set()
    for layer in _rendered_collections(view_layer):
        recorder.set(layer, "hide_viewport", False)
        recorder.set(layer.collection, "hide_viewport", False)
        rendered.update(layer.collection.objects)
    layers = _view_layers(view_layer)
    for item in rendered:
        if item.hide_render:
            continue
        if item.hide_viewport:  # asked here, of many objects: `set` takes longer
            recorder.set(item, "hide_viewport", False)
        for layer in layers:
            if item.hide_get(view_layer=layer):
                item.hide_set(False, view_layer=layer)
                recorder.on_restore(
                    f"{item.name}: hidden",
                    lambda item=item, layer=layer: item.hide_set(True, view_layer=layer),
                )

    # Others are there by what instances them; what is in the view layer follows its own rules.
    present = {
        layer.collection
        for one in _view_layers(view_layer)
        for layer in _present_collections(one.layer_collection)
    }
    for collection in bpy.data.collections:
        if collection in present or collection.hide_render:
            continue
        recorder.set(collection, "hide_viewport", False)
        for item in collection.objects:
            if not item.hide_render and item not in rendered:
                recorder.set(item, "hide_viewport", False)


def show_what_ever_renders(recorder: SettingsRestorer, view_layer: bpy.types.ViewLayer) -> None:
    """Make objects visible that are rendered at some time, until Blender evaluates the animation
    again.
    """
    for layer in _rendered_collections(view_layer):
        for item in filter(is_hidden_at_times, layer.collection.objects):
            recorder.set(item, "hide_render", False)
    show_what_renders(recorder, view_layer)


def show_as_rendered(recorder: SettingsRestorer, scene: bpy.types.Scene) -> bool:
    """Give modifiers, node groups, curves... in the viewport their settings for renders; return
    whether any was another one.
    """
    render = scene.render
    changed = recorder.set(render, "simplify_subdivision", render.simplify_subdivision_render)
    of_renders = render.simplify_child_particles_render
    changed |= recorder.set(render, "simplify_child_particles", of_renders)
    for item in bpy.data.objects:
        for owner, name, value in _as_rendered(item):
            changed |= recorder.set(owner, name, value)
    for tree in bpy.data.node_groups:
        for node in [one for one in tree.nodes if one.bl_idname == "GeometryNodeIsViewport"]:
            replace_by_false(recorder, tree, node)
            changed = True
    return changed


def _as_rendered(item: bpy.types.Object) -> Iterator[tuple[Any, str, Any]]:
    """Yield the owner and the names of each viewport setting of an object, with the setting for
    renders.
    """
    yield item, "show_instancer_for_viewport", item.show_instancer_for_render
    for modifier in item.modifiers:
        yield modifier, "show_viewport", modifier.show_render
        for own, of_renders in _RENDER_SETTINGS.items() if modifier.show_render else ():
            if hasattr(modifier, own) and hasattr(modifier, of_renders):
                yield modifier, own, getattr(modifier, of_renders)
    for system in item.particle_systems:
        particles = system.settings
        yield particles, "display_percentage", 100
        if particles.child_type != "NONE":
            yield particles, "child_percent", particles.rendered_child_count
        yield particles, "display_method", "RENDER"
    data = item.data
    if isinstance(data, bpy.types.Curve):  # texts and surfaces, too
        for name in ("resolution_u", "resolution_v"):
            # 0: that of the viewport
            yield data, name, getattr(data, f"render_{name}") or getattr(data, name)
    elif isinstance(data, bpy.types.MetaBall):
        yield data, "resolution", data.render_resolution


def differs_in_viewport(item: bpy.types.Object, render: bpy.types.RenderSettings) -> bool:
    """Return whether an object's settings for the viewport differ from those for renders."""
    simplified = render.use_simplify and (
        render.simplify_subdivision != render.simplify_subdivision_render
    )
    divided = simplified and any(one.type in ("SUBSURF", "MULTIRES") for one in item.modifiers)
    return divided or any(getattr(owner, x) != value for owner, x, value in _as_rendered(item))


def _rendered_collections(view_layer: bpy.types.ViewLayer) -> Iterator[Any]:
    """Yield the layer collections that are rendered with a view layer."""

    def below(layer: Any) -> Iterator[Any]:
        if layer.exclude or layer.collection.hide_render:
            return
        yield layer
        for child in layer.children:
            yield from below(child)

    for one in _view_layers(view_layer):
        yield from below(one.layer_collection)


def _present_collections(layer: Any) -> Iterator[Any]:
    """Yield this layer collection and those below it that are not excluded."""
    if not layer.exclude:
        yield layer
        for child in layer.children:
            yield from _present_collections(child)


def _view_layers(view_layer: bpy.types.ViewLayer) -> list[Any]:
    """Return a view layer, and those of the background sets of its scene, of their own sets, and so
    on.
    """
    found, scene = {view_layer.id_data: view_layer}, view_layer.id_data.background_set
    while scene is not None and scene not in found:
        found[scene] = next((one for one in scene.view_layers if one.use), scene.view_layers[0])
        scene = scene.background_set
    return list(found.values())


def rendered_objects(view_layer: bpy.types.ViewLayer) -> set[Any]:
    """Return the objects that are rendered themselves, without those that only instances show."""
    return {
        item
        for layer in _rendered_collections(view_layer)
        for item in layer.collection.objects
        if not item.hide_render
    }


def rendered_rows(snapshot: Snapshot, rendered: set[Any] | None = None) -> Indices:
    """Return the rows of a snapshot that hold rendered surfaces.

    `rendered` are the objects that are rendered themselves, if they are known.
    """
    if rendered is None:
        rendered = rendered_objects(snapshot.view_layer)
    shapes, layout = snapshot.shapes, snapshot.layout
    surface = [s.kind in SURFACE_TYPES and not s.original.hide_render for s in shapes]
    itself = snapshot.of_shapes(
        [s.original in rendered and not _shown_by_parent(s.original) for s in shapes]
    )
    by_instancer = np.array([item in rendered for item in (*layout.instancers, None)])
    there = np.where(layout.instancer < 0, itself, by_instancer[layout.instancer])
    return np.flatnonzero(snapshot.of_shapes(surface) & layout.visible & there)


def hidden_objects(snapshot: Snapshot, rendered: set[Any]) -> list[Any]:
    """Return which of these objects are rendered, but hidden in the viewport."""
    layout = snapshot.layout
    there = {*layout.objects, *layout.row_of, *layout.instancers}
    hidden = (item for item in rendered - there if not _shown_by_parent(item))
    wanted = [one for one in hidden if one.type in SURFACE_TYPES or one.instance_type != "NONE"]
    return sorted(wanted, key=lambda item: item.name_full)


def hidden_members(snapshot: Snapshot) -> set[Any]:
    """Return the members of instanced collections that are rendered, but hidden in the viewport."""
    makers = (one for one in snapshot.layout.instancers if one.instance_type == "COLLECTION")
    return {
        item
        for collection in {one.instance_collection for one in makers}
        for item in collection.all_objects
        if item.hide_viewport and not item.hide_render and item.type in SURFACE_TYPES
    }


def ray_flags(items: Sequence[Any], view_layer: bpy.types.ViewLayer) -> Mask:
    """Return three flags for each object, (3, n).

    They say whether rays from the receiver meet it, whether rays from the transmitter meet it, and
    whether it may return something, because it is no holdout. An instance follows its object, and
    the object that makes the instance.
    """
    found = [
        (
            item.visible_camera
            and not (item.is_shadow_catcher or item.indirect_only_get(view_layer=view_layer)),
            item.visible_shadow,
            not item.holdout_get(view_layer=view_layer),
        )
        for item in items
    ]
    return np.array(found, dtype=bool).reshape(-1, 3).T


def _shown_by_parent(item: bpy.types.Object) -> bool:
    """Return whether the parent's vertices or faces have instances of an object. Then only these
    instances are rendered.
    """
    return item.parent is not None and item.parent.instance_type in {"VERTS", "FACES"}


def limited_visibility(snapshot: Snapshot) -> list[Finding]:
    """Return findings on rendered objects without a direct echo, and on objects that waves pass
    through.
    """
    return joined_parts(visibility_in_parts(snapshot, rendered_rows(snapshot)))


def joined_parts(parts: Generator[None, None, list[Finding]]) -> list[Finding]:
    """Return what is found in parts, without a pause between them."""
    while True:
        try:
            next(parts)
        except StopIteration as end:
            found: list[Finding] = end.value
            return found


def visibility_in_parts(snapshot: Snapshot, rows: Indices) -> Generator[None, None, list[Finding]]:
    """Return `limited_visibility` of `rendered_rows`; yield before parts that take a few
    milliseconds.
    """
    layer, layout = snapshot.view_layer, snapshot.layout
    items = [snapshot.shapes[n].original for n in np.unique(layout.shape[rows]).tolist()]
    # Instances also follow the settings of what makes them.
    items += [layout.instancers[n] for n in np.unique(layout.instancer[rows]).tolist() if n >= 0]
    unseen: set[str] = set()
    passed: set[str] = set()
    for start in range(0, len(items), _PART):
        yield
        part = items[start : start + _PART]
        seen, _, echoing = ray_flags(part, layer)
        unseen |= {part[n].name_full for n in np.flatnonzero(~(seen & echoing)).tolist()}
        passed |= {
            item.name_full
            for item in part
            if not (item.visible_shadow and item.visible_diffuse and item.visible_glossy)
        }
    found = [finding("hidden-from-receiver", *sorted(unseen))] if unseen else []
    return found + ([finding("rays-pass-through", *sorted(passed))] if passed else [])


def is_hidden_at_times(item: bpy.types.Object) -> bool:
    """Return whether an F-curve or a driver acts on an object's *Disable in Renders*."""
    return any(curve.data_path == "hide_render" for curve in animation_curves(item.animation_data))


def hiding_is_animated() -> bool:
    """Return whether animation hides or shows an object or collection of the open file."""
    owners = (*bpy.data.objects, *bpy.data.collections)  # older collections have no animation
    animations = (getattr(item, "animation_data", None) for item in owners)
    drivers = (curve for one in animations if one is not None for curve in one.drivers)
    curves = (curve for action in bpy.data.actions for curve in action_curves(action))
    return any("hide" in curve.data_path for curve in (*drivers, *curves))


def suggest_materials(snapshot: Snapshot) -> dict[Any, str | None]:
    """Return the optical materials of the rendered objects, each with a ready material.

    The ready material is a key of `READY`. It follows from the name of the material, or else from
    the name of an object that has it; None if neither is known.
    """
    owners: dict[Any, list[str]] = {}
    for item, materials in assigned_materials(snapshot):
        for material in materials:
            if material is not None and not is_radar_material(material):
                owners.setdefault(material, []).append(item.name)
    return {
        material: suggest_material(material.name, *names)
        for material, names in sorted(owners.items(), key=lambda pair: pair[0].name)
    }


def bare_objects(snapshot: Snapshot) -> list[Any]:
    """Return the rendered objects that can have a material and have none in any slot."""
    return [one.item for one in assigned_materials(snapshot) if not any(one.materials)]


def replace_material(
    material: bpy.types.Material, ready: str, carrier_hz: float, snapshot: Snapshot
) -> Any:
    """Assign a radar material, a key of `READY`, in place of an optical material, which stays in
    the file.

    Waves enter it if all objects with the material are closed and have no other material. Otherwise
    it is opaque, or a thin sheet for glass. `carrier_hz` is the carrier of the first evaluation.
    """
    asset = READY[ready]
    closed = all(
        set(one.materials) == {material} and _is_closed(snapshot, one.item)
        for one in assigned_materials(snapshot)
        if material in one.materials
    )
    options: dict[str, Any] = {} if closed else {"penetrable": False}
    if asset.medium == "glass" and not closed:
        options = {"sheet_thickness_m": _PANE_M}
    made = asset.material(f"{material.name} ({ready})", carrier_hz, **options)
    made.diffuse_color = material.diffuse_color
    material.user_remap(made)
    material.use_fake_user = True
    return made


def _is_closed(snapshot: Snapshot, item: bpy.types.Object) -> bool:
    """Return whether every edge of a mesh, as evaluated, joins two faces."""
    mesh = snapshot.mesh_of(item) if item.type == "MESH" else None
    return mesh is not None and mesh.sides.size > 0 and mesh.is_closed
