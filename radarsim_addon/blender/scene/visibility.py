# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendered objects, and making them visible to Blender's evaluated scene.

Poses, extents and ground truth come from the scene of the viewport, which does not contain objects
that are hidden there. Cycles renders them nevertheless, so radarsim makes them visible during a
measurement. Objects in a collection that does not render are not part of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ..state import SettingsRestorer


def show_what_renders(recorder: SettingsRestorer, view_layer: Any) -> None:
    """Make all rendered objects visible in the viewport.

    Parameters
    ----------
    recorder
        Restores the former visibility.
    view_layer : bpy.types.ViewLayer
    """
    rendered = set()
    for layer in _rendered_collections(view_layer.layer_collection):
        recorder.set(layer, "hide_viewport", False)
        recorder.set(layer.collection, "hide_viewport", False)
        rendered.update(layer.collection.objects)
    for item in rendered:
        if item.hide_render:
            continue
        recorder.set(item, "hide_viewport", False)
        if item.hide_get(view_layer=view_layer):
            item.hide_set(False, view_layer=view_layer)
            recorder.on_restore(
                f"{item.name}: hidden",
                lambda item=item: item.hide_set(True, view_layer=view_layer),
            )


def _rendered_collections(layer: Any) -> Iterator[Any]:
    """Yield this layer collection and those below it that are rendered."""
    if layer.exclude or layer.collection.hide_render:
        return
    yield layer
    for child in layer.children:
        yield from _rendered_collections(child)


def rendered_objects(view_layer: Any) -> set[Any]:
    """Return the objects that are rendered themselves; not those that are only instanced."""
    return {
        item
        for layer in _rendered_collections(view_layer.layer_collection)
        for item in layer.collection.objects
        if not item.hide_render
    }
