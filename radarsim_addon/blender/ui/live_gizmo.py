# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview is moved with the mouse, and resized by its upper left corner."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import bpy

from .live_picture import GRIP_PX, Box, Placement, drag_live, place_live, placement
from .live_preview import current_preview

#: What lies under the mouse: numbers that Blender gives back when the user presses it.
_NOTHING, _PICTURE, _GRIP = -1, 0, 1


def _shown(context: bpy.types.Context) -> tuple[Box, float] | None:
    """Return where the preview is in the view, and its scale; None where it is not drawn."""
    preview = current_preview()
    if preview is None or preview.draft is None or not context.space_data.overlay.show_overlays:
        return None
    panel, scale = place_live(context, preview.draft, len(preview.lines()))
    return (panel, scale) if scale else None


class RADARSIM_GT_live(bpy.types.Gizmo):
    """The area of the live preview. The preview draws itself."""

    bl_idname = "RADARSIM_GT_live"

    _start: tuple[Placement, Box, int, int, bool]

    def draw(self, context: bpy.types.Context) -> None:
        pass

    def test_select(self, context: bpy.types.Context, location: Sequence[float]) -> int:
        """Return what lies under the mouse."""
        shown, (x, y) = _shown(context), location
        if shown is None:
            return _NOTHING
        panel, scale = shown
        if not (panel.left <= x <= panel.right and panel.bottom <= y <= panel.top):
            return _NOTHING
        grip = GRIP_PX * scale
        return _GRIP if x < panel.left + grip and y > panel.top - grip else _PICTURE

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        shown = _shown(context)
        if shown is None:
            return {"CANCELLED"}
        place = event.mouse_region_x, event.mouse_region_y
        grip = self.test_select(context, place) == _GRIP
        self._start = dataclasses.replace(placement), shown[0], *place, grip
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event, tweak: object) -> set[str]:
        start, panel, x, y, grip = self._start
        by_px = event.mouse_region_x - x, event.mouse_region_y - y
        drag_live(context, start, panel, by_px, grip)
        context.region.tag_redraw()
        return {"RUNNING_MODAL"}

    def exit(self, context: bpy.types.Context, cancel: bool) -> None:
        if cancel:
            vars(placement).update(vars(self._start[0]))
            context.region.tag_redraw()


class RADARSIM_GGT_live(bpy.types.GizmoGroup):
    """The live preview in the 3D view."""

    bl_idname = "RADARSIM_GGT_live"
    bl_label = "Live Preview"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return current_preview() is not None

    def setup(self, context: bpy.types.Context) -> None:
        self.gizmos.new(RADARSIM_GT_live.bl_idname)


CLASSES: tuple[type, ...] = (RADARSIM_GT_live, RADARSIM_GGT_live)
