# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of docs/tutorials/first-map-window.md in a real window, with a screenshot of each.

blender --python tutorial.py -- FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from robot import Robot, pictures_fit

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
#: Letters of the screenshots: readable where the page shows them at half their size.
UI_SCALE = 1.5
OPERATOR = "RADARSIM_OT_measure_and_show"


def move_the_cube(cube: Any) -> None:
    """Insert the tutorial's two keyframes, and linear interpolation: 10 m/s along Y."""
    cube.keyframe_insert("location", frame=1)
    cube.location.y = 10.0
    cube.keyframe_insert("location", frame=25)
    for curve in cube.animation_data.action.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    bpy.context.scene.frame_set(1)


def script(robot: Any) -> Any:
    result, scene = robot.result, bpy.context.scene
    cube = bpy.data.objects["Cube"]
    move_the_cube(cube)
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "first.blend"))
    yield 1.0
    yield from robot.open_tab("Radar")
    yield from robot.shot("tutorial_1_tab")
    yield from robot.click("radarsim.setup_rig")
    yield from robot.settle()
    robot.press("Return")  # the first preset of the list
    yield from robot.wait(lambda: "Radar" in bpy.data.objects, "the radar", 20)
    yield 0.5
    yield from robot.shot("tutorial_2_radar")
    for item in bpy.context.view_layer.objects:
        item.select_set(item == cube)
    bpy.context.view_layer.objects.active = cube
    yield 0.3
    yield from robot.click("radarsim.assign_material")
    yield from robot.wait(lambda: "Radar" in cube.active_material.name, "the material", 20)
    yield 1.0
    yield from robot.shot("tutorial_3_material")
    radar = bpy.data.objects["Radar"]
    result["radar_m"] = list(radar.matrix_world.translation)
    result["output_folder"] = radar.radarsim.output_folder
    images = {image.name for image in bpy.data.images}
    yield from robot.click_until(
        "radarsim.measure_and_show", lambda: OPERATOR in robot.modal_operators(), "the run"
    )
    yield 1.0
    yield from robot.shot("tutorial_4_running")
    yield from robot.wait(
        lambda: len({image.name for image in bpy.data.images} - images) >= 2, "the images", 300
    )
    yield from robot.wait(pictures_fit, "the pictures at their size", 60)
    yield 1.0
    yield from robot.shot("tutorial_5_map")
    result["frame"] = scene.frame_current


if __name__ == "__main__":
    # Before the window is drawn for the first time: the splash screen would catch all clicks.
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.ui_scale = UI_SCALE
    Robot(FOLDER).run(script)
