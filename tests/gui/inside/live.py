# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview in a real window: 1e5 triangles, one object moves.

blender --python live.py -- FOLDER
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path
from typing import Any, ClassVar

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from robot import Robot

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
#: Time for which the object moves [s], and the step of its motion [s].
MOVING_S, STEP_S = 8.0, 0.04


def module() -> Any:
    """The add-on's module of the preview, whatever the extension's package is called."""
    names = [name for name in sys.modules if name.endswith("blender.ui.live_preview")]
    assert len(names) == 1, names
    return sys.modules[names[0]]


def add_objects() -> Any:
    """A ground, a wall, and a ball of 1e5 triangles; returns the ball."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    ops = bpy.ops.mesh
    ops.primitive_plane_add(size=80.0, location=(0.0, 30.0, -2.0))
    ops.primitive_cube_add(size=4.0, location=(-7.0, 42.0, 0.0))
    wall = bpy.context.object
    wall.keyframe_insert("location", frame=1)
    wall.location.y -= 10.0
    wall.keyframe_insert("location", frame=25)  # 10 m/s, closing in
    for curve in wall.animation_data.action.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    bpy.context.scene.frame_set(1)
    ops.primitive_uv_sphere_add(segments=225, ring_count=224, radius=1.5, location=(4.0, 22.0, 0.0))
    bpy.ops.object.shade_smooth()
    ball = bpy.context.object
    ball.display_type = "BOUNDS"  # to draw 1e5 triangles takes software OpenGL long
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.radarsim.assign_material()
    return ball


class Drawing(bpy.types.Panel):
    """What is called while it is drawn may change nothing."""

    bl_idname, bl_label, bl_category = "RADARSIM_PT_drawing", "Drawing", "Radar"
    bl_space_type, bl_region_type = "VIEW_3D", "UI"
    draws: ClassVar[list[Any]] = []
    said: ClassVar[list[str]] = []

    def draw(self, context: Any) -> None:
        while self.draws:
            try:
                self.draws.pop(0)()
                self.said.append("")
            except Exception as error:
                self.said.append(str(error))

    @staticmethod
    def write() -> None:
        """Change data, to the value that it has."""
        bpy.context.scene.frame_start = bpy.context.scene.frame_start


def placed(robot: Robot, preview: Any) -> tuple[float, ...]:
    """Where the preview is in the window: left, bottom, right, top [px]."""
    region = next(one for one in robot.view.regions if one.type == "WINDOW")
    picture = sys.modules[module().__name__.replace("live_preview", "live_picture")]
    with bpy.context.temp_override(window=robot.window, area=robot.view, region=region):
        box, _ = picture.place_live(bpy.context, preview.draft, len(preview.lines()))
    return box.left + region.x, box.bottom + region.y, box.right + region.x, box.top + region.y


def reset(found: Any) -> None:
    """Count from now on."""
    found.__init__()


def script(robot: Robot) -> Any:
    result = robot.result
    ball = add_objects()
    yield 0.5
    yield from robot.open_tab("Radar")
    yield from robot.click("radarsim.setup_rig")
    yield from robot.settle()
    robot.press("Return")  # the first preset of the list
    yield from robot.wait(lambda: "Radar" in bpy.data.objects, "the radar", 20)
    radar = bpy.data.objects["Radar"]
    result["on"] = bpy.context.window_manager.radarsim_live  # a new radar has switched it on
    bpy.context.window_manager.radarsim_live = False
    radar.location, radar.rotation_euler = (0.0, 0.0, 0.0), (math.pi / 2, 0.0, 0.0)
    yield 1.0
    robot.start_watching()
    yield 2.0
    result["before"] = robot.stop_watching()
    live, state = module(), bpy.context.window_manager
    yield from robot.click_until("radarsim_live", lambda: state.radarsim_live, "the preview")
    preview = live.current_preview()
    found = preview.statistics
    yield from robot.wait(lambda: found.drafts >= 3, "the finest draft", 60)
    result["triangles"] = preview.draft.fields["triangles"]
    yield 1.0
    yield from robot.shot("live_preview")
    yield 1.5
    # The user moves the ball: an update may come only once it has been drawn.
    reset(found)
    robot.start_watching()
    began = time.monotonic()
    while time.monotonic() - began < MOVING_S:
        ball.location.x = 4.0 - 3.0 * math.sin(time.monotonic() - began)
        yield STEP_S
    result["moving"] = {**robot.stop_watching(), **vars(found)}
    yield from robot.shot("live_moving")
    yield 1.0
    # The user drags the picture, then its upper left corner.
    result["placed"] = [placed(robot, preview)]
    for grip, by_px in ((False, (-150, 60)), (True, (90, -40))):
        left, bottom, right, top = placed(robot, preview)
        start = (left + 5, top - 5) if grip else ((left + right) / 2, (bottom + top) / 2)
        yield from robot.drag(start, (start[0] + by_px[0], start[1] + by_px[1]))
        result["placed"].append(placed(robot, preview))
    yield from robot.shot("live_dragged")
    # A mesh that changes is read again.
    reset(found)
    for number in range(100):  # drafts take longer where other work is done
        ball.data.vertices[0].co.z = 1.5 + 0.001 * number
        ball.data.update()
        yield 0.3
        if found.first_drafts >= 2:
            break
    result["editing"] = dict(vars(found))
    # a full undo step, then the preview resumes
    drafts = found.drafts
    bpy.ops.ed.undo_push(message="test")
    ball.location.x = 0.0
    bpy.ops.ed.undo_push(message="test")
    bpy.ops.ed.undo()
    yield from robot.wait(lambda: found.drafts > drafts, "a draft after undo", 20)
    result["fault"] = preview.fault
    # Where Blender refuses timers to change data, which this state of drawing stands for.
    write, step = Drawing.write, live.LivePreview._step
    live.LivePreview._step = lambda *words: (write(), step(*words))[1]
    Drawing.draws.extend([write, live._tick])
    bpy.utils.register_class(Drawing)
    yield from robot.wait(lambda: not Drawing.draws, "a drawing", 20)
    live.LivePreview._step = step
    bpy.utils.unregister_class(Drawing)
    result["refused"], result["fault_there"] = Drawing.said, preview.fault
    yield from robot.click_until("radarsim_live", lambda: not state.radarsim_live, "the end")
    result["left"] = [name for name in dir(live) if name == "_preview" and live._preview]
    yield 0.5
    yield from robot.shot("live_off")
    yield 1.0


if __name__ == "__main__":
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.system.viewport_aa = "OFF"  # 8 drawings of the view after each change
    Robot(FOLDER).run(script)
