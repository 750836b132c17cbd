# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendered objects, and making them visible to Blender's evaluated scene as they render.

Poses, meshes, extents and ground truth come from the scene of the viewport, which does not contain
objects that are hidden there, and whose modifiers may have other settings. Cycles renders them
nevertheless, so radarsim shows during a measurement what renders. Objects in a collection that
does not render are not part of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np

from ...array_types import Indices
from ...findings import Finding, finding
from ..materials import SURFACE_TYPES
from ..state import SettingsRestorer, Snapshot, take_snapshot
from .isolation import action_curves, animation_curves

#: Settings of modifiers for the viewport, each with that for renders.
_RENDER_SETTINGS = (
    ("levels", "render_levels"),
    ("steps", "render_steps"),
    ("viewport_resolution", "resolution"),
)


def show_what_renders(recorder: SettingsRestorer, view_layer: Any) -> None:
    """Make all rendered objects visible in the viewport, and those that only instances show.

    Parameters
    ----------
    recorder
        Restores the former visibility.
    view_layer : bpy.types.ViewLayer
    """
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


def show_what_ever_renders(recorder: SettingsRestorer, view_layer: Any) -> None:
    """Make visible what renders at some time, until Blender evaluates the animation again.

    Parameters
    ----------
    recorder
        Restores the former visibility.
    view_layer : bpy.types.ViewLayer
    """
    for layer in _rendered_collections(view_layer):
        for item in filter(is_hidden_at_times, layer.collection.objects):
            recorder.set(item, "hide_render", False)
    show_what_renders(recorder, view_layer)


def rendered_rows(snapshot: Snapshot) -> Indices:
    """Return the rows of a snapshot that hold rendered surfaces."""
    rendered = rendered_objects(snapshot.depsgraph.view_layer)
    shapes, layout = snapshot.shapes, snapshot.layout
    surface = [s.kind in SURFACE_TYPES and not s.original.hide_render for s in shapes]
    itself = snapshot.of_shapes(
        [s.original in rendered and not _shown_by_parent(s.original) for s in shapes]
    )
    by_instancer = np.array([item in rendered for item in (*layout.instancers, None)])
    there = np.where(layout.instancer < 0, itself, by_instancer[layout.instancer])
    return np.flatnonzero(snapshot.of_shapes(surface) & layout.visible & there)


def _shown_by_parent(item: Any) -> bool:
    """Whether the parent's vertices or faces have instances of it: it renders only as these."""
    return item.parent is not None and item.parent.instance_type in {"VERTS", "FACES"}


def limited_visibility(depsgraph: Any) -> list[Finding]:
    """Name the rendered objects that some kinds of rays do not meet.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    list of Finding
        Objects without a direct echo, and those that waves pass through.
    """
    snapshot, layer = take_snapshot(depsgraph), depsgraph.view_layer
    rows, layout = rendered_rows(snapshot), snapshot.layout
    items = [snapshot.shapes[n].original for n in np.unique(layout.shape[rows]).tolist()]
    # Instances also follow the settings of what makes them.
    items += [layout.instancers[n] for n in np.unique(layout.instancer[rows]).tolist() if n >= 0]
    unseen, passed = set(), set()
    for item in items:
        if (
            not item.visible_camera
            or item.is_holdout
            or item.is_shadow_catcher
            or item.holdout_get(view_layer=layer)
            or item.indirect_only_get(view_layer=layer)
        ):
            unseen.add(item.name_full)
        if not (item.visible_shadow and item.visible_diffuse and item.visible_glossy):
            passed.add(item.name_full)
    found = [finding("hidden-from-receiver", *sorted(unseen))] if unseen else []
    return found + ([finding("rays-pass-through", *sorted(passed))] if passed else [])


def is_hidden_at_times(item: Any) -> bool:
    """Return whether animation decides if an object renders.

    Parameters
    ----------
    item : bpy.types.Object

    Returns
    -------
    bool
        True if an F-curve or a driver acts on its *Disable in Renders*.
    """
    return any(curve.data_path == "hide_render" for curve in animation_curves(item.animation_data))


def hiding_is_animated() -> bool:
    """Return whether animation hides or shows something in the open file.

    Returns
    -------
    bool
        True if an F-curve or driver acts on what objects or collections are visible.
    """
    owners = (*bpy.data.objects, *bpy.data.collections)  # older collections have no animation
    animations = (getattr(item, "animation_data", None) for item in owners)
    drivers = (curve for one in animations if one is not None for curve in one.drivers)
    curves = (curve for action in bpy.data.actions for curve in action_curves(action))
    return any("hide" in curve.data_path for curve in (*drivers, *curves))


def show_as_rendered(recorder: SettingsRestorer, scene: Any) -> None:
    """Give what the viewport evaluates its settings for renders: modifiers, node groups, curves...

    Parameters
    ----------
    recorder
        Restores the former settings.
    scene : bpy.types.Scene
    """
    render = scene.render
    recorder.set(render, "simplify_subdivision", render.simplify_subdivision_render)
    recorder.set(render, "simplify_child_particles", render.simplify_child_particles_render)
    for item in bpy.data.objects:
        recorder.set(item, "show_instancer_for_viewport", item.show_instancer_for_render)
        for modifier in item.modifiers:
            recorder.set(modifier, "show_viewport", modifier.show_render)
            for own, of_renders in _RENDER_SETTINGS:
                if hasattr(modifier, own) and hasattr(modifier, of_renders):
                    recorder.set(modifier, own, getattr(modifier, of_renders))
    for tree in bpy.data.node_groups:
        for node in [one for one in tree.nodes if one.bl_idname == "GeometryNodeIsViewport"]:
            _replace_by_false(recorder, tree, node)
    for particles in bpy.data.particles:
        recorder.set(particles, "display_percentage", 100)
        recorder.set(particles, "child_percent", particles.rendered_child_count)
        recorder.set(particles, "display_method", "RENDER")
    for curve in bpy.data.curves:
        for name in ("resolution_u", "resolution_v"):
            # 0: that of the viewport
            recorder.set(curve, name, getattr(curve, f"render_{name}") or getattr(curve, name))
    for ball in bpy.data.metaballs:
        recorder.set(ball, "resolution", ball.render_resolution)


def _replace_by_false(recorder: SettingsRestorer, tree: Any, node: Any) -> None:
    """Connect the constant False in the place of a Boolean node."""
    targets = [link.to_socket for link in node.outputs[0].links]
    constant = tree.nodes.new("FunctionNodeInputBool")
    for target in targets:
        tree.links.new(constant.outputs[0], target)

    def undo() -> None:
        for target in targets:
            tree.links.new(node.outputs[0], target)
        tree.nodes.remove(constant)

    recorder.on_restore(tree.name, undo)


def _present_collections(layer: Any) -> Iterator[Any]:
    """Yield this layer collection and those below it that are not excluded."""
    if not layer.exclude:
        yield layer
        for child in layer.children:
            yield from _present_collections(child)


def _view_layers(view_layer: Any) -> list[Any]:
    """A view layer, and those of its scene's background set, of the set's own set, and so on."""
    found, scene = {view_layer.id_data: view_layer}, view_layer.id_data.background_set
    while scene is not None and scene not in found:
        found[scene] = next((one for one in scene.view_layers if one.use), scene.view_layers[0])
        scene = scene.background_set
    return list(found.values())


def _rendered_collections(view_layer: Any) -> Iterator[Any]:
    """Yield the layer collections that are rendered with a view layer."""

    def below(layer: Any) -> Iterator[Any]:
        if layer.exclude or layer.collection.hide_render:
            return
        yield layer
        for child in layer.children:
            yield from below(child)

    for one in _view_layers(view_layer):
        yield from below(one.layer_collection)


def rendered_objects(view_layer: Any) -> set[Any]:
    """Return the objects that are rendered themselves; not those that are only instanced."""
    return {
        item
        for layer in _rendered_collections(view_layer)
        for item in layer.collection.objects
        if not item.hide_render
    }
