# SPDX-License-Identifier: GPL-3.0-or-later
"""What is rendered, and making it known where Blender leaves it out of its own picture.

Poses, extents and labels come from the scene as the viewport has it, where objects that are hidden
there do not exist. They are rendered all the same, so they are shown for the time of the
measurement. What is in a collection that does not render is no part of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ..state import SettingsRestorer


def show_what_renders(recorder: SettingsRestorer, view_layer: Any) -> None:
    """Take from everything that is rendered what hides it in the viewport.

    Parameters
    ----------
    recorder
        Remembers what was hidden.
    view_layer : bpy.types.ViewLayer
    """
    rendered = set()
    for layer in rendered_collections(view_layer.layer_collection):
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
                lambda item=item: item.hide_set(True, view_layer=view_layer),  # type: ignore[misc]
            )


def rendered_collections(layer: Any) -> Iterator[Any]:
    """Layer collections below this one, itself too, that are rendered."""
    if layer.exclude or layer.collection.hide_render:
        return
    yield layer
    for child in layer.children:
        yield from rendered_collections(child)


def rendered_objects(view_layer: Any) -> set[Any]:
    """Objects that are rendered themselves (instances of others may be, too)."""
    return {
        item
        for layer in rendered_collections(view_layer.layer_collection)
        for item in layer.collection.objects
        if not item.hide_render
    }
