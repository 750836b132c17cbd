# SPDX-License-Identifier: GPL-3.0-or-later
"""A click on a target in a picture of the results selects its object and draws its paths."""

from __future__ import annotations

from typing import Any

import bpy

from .pictures import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH
from .result_pictures import KINDS, Shown, nearest_frame, nearest_target
from .results_panel import select_chosen
from .shown_results import choose_row, shown_run, shown_view, target_text

#: Pictures in which targets have places.
_KINDS = ("MAP", "PROFILE", "SPECTROGRAM", "RANGE_TIME")
_ITEMS = tuple((name, KINDS[name].label, KINDS[name].tooltip) for name in _KINDS)
#: Farthest target that a click means, in a picture of 1200 x 800 [px].
_REACH_PX = 30.0
_keys: list[tuple[Any, Any]] = []


def _kind_of(context: Any) -> str:
    """The kind of picture that the editor under the mouse shows; empty if a click means nothing."""
    space = context.space_data
    image = space.image if space is not None and space.type == "IMAGE_EDITOR" else None
    name = "" if image is None else image.name
    return next((kind for kind in _KINDS if KINDS[kind].image == name), "")


class RADARSIM_OT_pick_target(bpy.types.Operator):
    """Choose the target next to the mouse: select its object, draw its paths, show its numbers"""

    bl_idname = "radarsim.pick_target"
    bl_label = "Pick Radar Target"
    bl_options = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(
        name="Picture",
        items=_ITEMS,
        description="Choose the picture that the place is in",
    )
    x: bpy.props.FloatProperty(
        name="X", min=0.0, max=1.0, description="Set the place from the left edge to the right one"
    )
    y: bpy.props.FloatProperty(
        name="Y", min=0.0, max=1.0, description="Set the place from the lower edge to the upper one"
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        return shown_view() is not None

    def invoke(self, context: Any, event: Any) -> set[str]:
        kind = _kind_of(context)
        if not kind:
            return {"PASS_THROUGH"}
        mouse = event.mouse_region_x, event.mouse_region_y
        self.kind = kind
        self.x, self.y = x, y = context.region.view2d.region_to_view(*mouse)
        if not (LEFT <= x * WIDTH < WIDTH - RIGHT and BOTTOM <= y * HEIGHT < HEIGHT - TOP):
            return {"PASS_THROUGH"}
        done = self.execute(context)
        return done if done == {"FINISHED"} else {*done, "PASS_THROUGH"}  # for Blender's own tools

    def execute(self, context: Any) -> set[str]:
        run, view = shown_run(), shown_view()
        assert run is not None and view is not None
        # half a pixel: places of the axes are the centres of pixels
        place = self.x * WIDTH - 0.5, (1 - self.y) * HEIGHT - 0.5
        if self.kind == "RANGE_TIME":  # each frame has its own targets
            view = run.view(run.frames[nearest_frame(run.profiles, place[0])])
        row, away_px = nearest_target(self.kind, Shown(view, run.profiles), *place)
        if away_px > _REACH_PX:
            self.report({"INFO"}, "No target of the list is near the mouse. Click on a target.")
            return {"CANCELLED"}
        target = choose_row(context, row, view.frame)
        assert target is not None
        select_chosen(self, context)
        self.report({"INFO"}, f"{target['name'] or 'Target'}: {target_text(target)}")
        return {"FINISHED"}


CLASSES: tuple[type, ...] = (RADARSIM_OT_pick_target,)


def follow_clicks() -> None:
    """Choose targets by clicks in Image Editors; a second call changes nothing."""
    keys = bpy.context.window_manager.keyconfigs.addon
    if _keys or keys is None:
        return
    keymap = keys.keymaps.new(name="Image", space_type="IMAGE_EDITOR")
    _keys.append((keymap, keymap.keymap_items.new("radarsim.pick_target", "LEFTMOUSE", "PRESS")))


def ignore_clicks() -> None:
    """Take it back; a second call changes nothing."""
    while _keys:
        keymap, item = _keys.pop()
        keymap.keymap_items.remove(item)
