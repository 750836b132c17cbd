# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's walk through the Radar tab, in a real window.

blender --python walk.py -- FOLDER
"""

from __future__ import annotations

import importlib.util
import sys
import time
from pathlib import Path
from typing import Any

import bpy

HERE = Path(__file__).resolve().parent


def load(name: str) -> Any:
    """A module beside this file; Blender does not put a script's folder on the search path."""
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


robot_module = load("robot")
snapshot_module = load("snapshot")
scene_module = load("walk_scene")

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
RINGS = 12
OPERATOR = "RADARSIM_OT_render_frames"
MEASURE = "RADARSIM_OT_measure_and_show"
PROCESS = "RADARSIM_OT_process_last_run"
IMAGES = "IMAGE_EDITOR"


def script(robot: Any) -> Any:
    result = robot.result
    scene = bpy.context.scene
    objects = scene_module.add_objects()
    yield from robot.settle()

    # 1. The tab.
    yield from robot.open_tab("Radar")
    result["tab"] = robot.sidebar.active_panel_category
    yield from robot.shot("01_tab")

    # 2. The rig.
    yield from robot.click("radarsim.setup_rig")
    yield from robot.settle()
    robot.press("Return")  # the first preset of the list
    yield from robot.wait(
        lambda: any(item.type == "EMPTY" for item in scene.objects), "the rig", 20
    )
    yield from robot.settle()
    result["rig"] = {item.name: item.type for item in scene.objects if item not in objects}
    yield from robot.shot("02_rig")
    result["live"] = bpy.context.window_manager.radarsim_live
    bpy.context.window_manager.radarsim_live = False

    # What the scene's materials stand for, by their names.
    yield from robot.click("radarsim.suggest_materials")
    rows = bpy.context.window_manager.radarsim.suggestions
    yield from robot.wait(lambda: len(rows) > 0, "the list", 20)
    yield from robot.settle()
    yield from robot.shot("03_by_name")
    result["suggested"] = [row.material for row in rows]
    bpy.ops.radarsim.apply_materials(discard=True)
    yield from robot.settle()

    # 3. The material, to all that was selected.
    scene_module.select(objects)
    yield 0.3
    yield from robot.click("radarsim.assign_material")
    yield from robot.settle()
    yield from robot.shot("03_material")
    result["materials"] = {
        item.name: [slot.material.name if slot.material else "" for slot in item.material_slots]
        for item in objects
    }
    yield from robot.settle()

    # Overlays: all of them, seen from above.
    shown = bpy.context.window_manager.radarsim
    names = ("overlay_beams", "overlay_rings", "overlay_unambiguous")
    for name in names:
        setattr(shown, name, True)
    region = robot.view.spaces.active.region_3d
    before = (region.view_distance, region.view_rotation.copy(), region.view_location.copy())
    region.view_perspective = "ORTHO"
    region.view_distance, region.view_rotation = 190.0, (1.0, 0.0, 0.0, 0.0)
    region.view_location = (0.0, 45.0, 0.0)
    robot.view.tag_redraw()
    yield from robot.settle()
    yield from robot.shot("03_overlays")
    region.view_perspective = "PERSP"
    region.view_distance, region.view_rotation, region.view_location = before
    for name in names:
        setattr(shown, name, False)

    # The checklist: what it says of too low a PRF, and what its button does.
    settings = bpy.data.objects["Radar"].radarsim
    settings.prf_hz = 5000.0
    robot.view.tag_redraw()
    yield from robot.settle()
    yield from robot.shot("04_checklist")
    yield from robot.click("prf_hz", across=0.7)  # the first of three small buttons
    yield from robot.wait(lambda: settings.prf_hz > 9e3, "the button of the checklist", 20)
    result["fixed_prf_hz"] = settings.prf_hz
    settings.prf_hz = 40e3
    yield from robot.click("radarsim.check_scene")
    yield from robot.wait(lambda: bpy.context.window_manager.radarsim.checked, "the check", 60)
    yield from robot.settle()
    yield from robot.shot("04_checked")

    # 4. Numbers, and a first run.
    def start(folder: Path) -> None:
        settings.output_folder = str(folder)
        region = next(r for r in robot.view.regions if r.type == "WINDOW")
        with bpy.context.temp_override(window=robot.window, area=robot.view, region=region):
            bpy.ops.radarsim.render_frames("INVOKE_DEFAULT")

    settings.output_folder = str(FOLDER / "run one")
    settings.frame_mode = "current"
    settings.sampling_mode = "rings"
    settings.rings = RINGS
    settings.ring_step_m = 5.0
    settings.width_px = settings.height_px = 128
    settings.samples = 32  # so that a run takes longer than the walk needs to press a key
    robot.view.tag_redraw()
    yield from robot.settle()
    yield from robot.shot("04_numbers")

    before = snapshot_module.snapshot(scene)
    robot.start_watching()
    start(FOLDER / "run one")
    first = FOLDER / "run one"
    yield from robot.wait(lambda: len(list(first.rglob("*.exr"))) >= 4, "the first files", 120)
    yield from robot.shot("05_rendering")
    result["running_at_shot"] = OPERATOR in robot.modal_operators()
    # The window takes events while it renders: the user zooms the view.
    x, y = robot.view.x + robot.view.width // 3, robot.view.y + robot.view.height // 2
    distance = robot.view.spaces.active.region_3d.view_distance
    yield from robot.go(x, y)
    yield from robot.turn_wheel(3)
    yield 0.4  # the view moves smoothly
    result["zoomed"] = robot.view.spaces.active.region_3d.view_distance / distance
    result["running_after_zoom"] = OPERATOR in robot.modal_operators()
    yield from robot.wait(lambda: OPERATOR not in robot.modal_operators(), "the run's end", 300)
    yield from robot.settle()
    result["first"] = robot.stop_watching() | {
        "files": scene_module.files(first),
        "changed": snapshot_module.differences(before, snapshot_module.snapshot(scene)),
    }
    yield from robot.shot("06_done")

    # 5. A second run, stopped by Esc.
    second = FOLDER / "run zwei é"
    settings.output_folder = str(second)
    yield 0.3
    before = snapshot_module.snapshot(scene)
    start(second)
    yield from robot.wait(lambda: len(list(second.rglob("*.exr"))) >= 2, "two files", 120)
    robot.press("Escape")
    yield from robot.wait(lambda: OPERATOR not in robot.modal_operators(), "the stop", 30)
    yield from robot.settle()
    stopped = {str(p.relative_to(second)): p.stat().st_mtime_ns for p in second.rglob("*.exr")}
    result["stopped"] = {
        "files": scene_module.files(second),
        "changed": snapshot_module.differences(before, snapshot_module.snapshot(scene)),
    }
    yield from robot.shot("07_cancelled")

    # 6. Begun again: it replaces the run that was stopped, without a question.
    start(second)
    yield from robot.wait(lambda: OPERATOR not in robot.modal_operators(), "the run's end", 300)
    yield from robot.settle()
    result["continued"] = {
        "files": scene_module.files(second),
        "rendered_again": [
            name for name, when in stopped.items() if (second / name).stat().st_mtime_ns != when
        ],
        "changed": snapshot_module.differences(before, snapshot_module.snapshot(scene)),
    }

    # Esc at any moment of a render, not only at one that Blender's own render job sees.
    result["escapes"] = []
    for number, delay_s in enumerate((0.0, 0.07, 0.14, 0.21, 0.28, 0.35)):
        folder = FOLDER / f"run escape {number}"
        start(folder)
        yield from robot.wait(lambda f=folder: any(f.rglob("*.exr")), "a file", 120)
        yield delay_s
        robot.press("Escape")
        yield from robot.wait(lambda: OPERATOR not in robot.modal_operators(), "the stop", 120)
        result["escapes"].append(len(list(folder.rglob("*.exr"))))
        yield 0.3

    # 7. The other acquisition, stopped, then to its end, and back.
    stopped_paths = FOLDER / "run paths stopped"
    settings.sampling_mode = "paths"
    settings.width_px = settings.height_px = 1024
    before = snapshot_module.snapshot(scene)
    start(stopped_paths)
    yield from robot.wait(lambda: (stopped_paths / "run.json").exists(), "the run's start", 60)
    yield 0.3
    robot.press("Escape")
    yield from robot.wait(lambda: OPERATOR not in robot.modal_operators(), "the stop", 120)
    result["stopped_paths"] = {
        "files": scene_module.files(stopped_paths),
        "changed": snapshot_module.differences(before, snapshot_module.snapshot(scene)),
    }
    settings.width_px = settings.height_px = 128
    third = FOLDER / "run paths"
    settings.output_folder = str(third)
    robot.view.tag_redraw()
    yield from robot.settle()
    before = snapshot_module.snapshot(scene)
    start(third)
    yield from robot.wait(lambda: OPERATOR not in robot.modal_operators(), "the run's end", 300)
    yield from robot.settle()
    yield from robot.shot("07_paths")
    result["paths"] = {
        "files": scene_module.files(third),
        "changed": snapshot_module.differences(before, snapshot_module.snapshot(scene)),
    }
    settings.sampling_mode = "rings"
    settings.output_folder = str(second)
    yield from robot.settle()

    # Antennas and a medium: what the panels say of them.
    settings.use_link_budget = True
    settings.transmitter.kind = "gaussian"
    settings.receiver.kind = "cosine"
    # The panel is closed until a user opens it: an open one takes its place.
    panel = bpy.types.RADARSIM_PT_system
    names = {"bl_idname": "RADARSIM_PT_system_open", "bl_options": set()}
    bpy.utils.unregister_class(panel)
    opened = type("RADARSIM_PT_system_open", panel.__mro__[:1], names)
    bpy.utils.register_class(opened)
    robot.view.tag_redraw()
    yield from robot.settle()
    yield from robot.click("radarsim.draw_patterns")
    yield from robot.wait(
        lambda: sum("radarsim_pattern" in item for item in bpy.data.objects) == 2, "patterns", 20
    )
    scene_module.select(objects[:1])
    properties = next(a for a in robot.window.screen.areas if a.type == "PROPERTIES")
    # With EEVEE, software OpenGL compiles the material for its icon, which takes a minute. The
    # engine stays: to set it while Cycles draws an icon blocks Blender for good.
    scene.render.engine = "CYCLES"
    properties.spaces.active.context = "MATERIAL"
    material = objects[0].active_material.copy()
    objects[0].active_material = material
    with bpy.context.temp_override(material=material):
        bpy.ops.radarsim.make_physical()
    yield from robot.settle()
    yield from robot.shot("07_physics")
    result["physical"] = material.radarsim.medium
    yield from robot.settle()
    region = next(region for region in properties.regions if region.type == "WINDOW")
    for _ in range(3):
        with bpy.context.temp_override(window=robot.window, area=properties, region=region):
            bpy.ops.view2d.scroll_down(page=True)
        yield from robot.settle()
    yield from robot.shot("07_material")
    properties.spaces.active.context = "OBJECT"
    yield from robot.wait(lambda: not bpy.app.is_job_running("RENDER_PREVIEW"), "the icons", 60)
    settings.use_link_budget = False
    bpy.ops.radarsim.remove_patterns()
    bpy.utils.unregister_class(opened)
    bpy.utils.register_class(panel)

    # 8. Processed, and shown.
    images = {image.name for image in bpy.data.images}
    yield from robot.click_until(
        "radarsim.measure_and_show", lambda: MEASURE in robot.modal_operators(), "the run's start"
    )
    yield from robot.wait(lambda: PROCESS in robot.modal_operators(), "the processing", 300)
    robot.start_watching()
    yield from robot.shot("08_processing")
    yield from robot.wait(
        lambda: len({image.name for image in bpy.data.images} - images) > 1, "the images", 300
    )
    result["processing"] = robot.stop_watching()
    yield from robot.wait(robot_module.pictures_fit, "the pictures at their size", 60)
    result["images"] = {
        image.name: list(image.size) for image in bpy.data.images if image.name not in images
    }
    yield from robot.shot("08_processed")
    editors = [
        (window, area)
        for window in bpy.context.window_manager.windows
        for area in window.screen.areas
        if area.type == "IMAGE_EDITOR"
    ]
    result["shown"] = [
        area.spaces.active.image.name for _, area in editors if area.spaces.active.image is not None
    ]
    for number, name in enumerate(sorted(result["images"])):
        window, area = editors[0]
        area.spaces.active.image = bpy.data.images[name]
        region = next(region for region in area.regions if region.type == "WINDOW")
        with bpy.context.temp_override(window=window, area=area, region=region):
            bpy.ops.image.view_all(fit_view=True)
        yield from robot.settle()
        yield from robot.shot(f"09_image_{number}")
    result["products"] = scene_module.files(second)

    # 9. Results of paths: a target of the list, its paths; settings that process again.
    settings.sampling_mode, settings.output_folder = "paths", str(third)
    shown = bpy.context.window_manager.radarsim_results
    yield from robot.settle()
    region = next(region for region in robot.view.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=robot.window, area=robot.view, region=region):
        bpy.ops.radarsim.process_last_run("INVOKE_DEFAULT")
    yield from robot.wait(lambda: len(shown.rows) > 0, "the list of targets", 120)
    yield from robot.settle()
    for region in robot.view.regions:  # to the panel at the end of the tab
        if region.type == "UI":
            with bpy.context.temp_override(window=robot.window, area=robot.view, region=region):
                for _ in range(6):
                    bpy.ops.view2d.scroll_down(page=True)
    region_3d = robot.view.spaces.active.region_3d
    region_3d.view_distance, region_3d.view_location = 120.0, (0.0, 25.0, 0.0)
    result["pictures_s"] = []
    result["steps_s"] = [robot_module.thread_time_of(shown, "row", 0)]
    yield from robot.settle()
    target = shown.rows[0].name
    result["target"] = [target, bpy.context.view_layer.objects.active.name]
    scene_module.select(objects[2:3])  # the sphere: Blender tells of the new active object
    yield from robot.wait(lambda: shown.rows[shown.row].name == objects[2].name, "its row", 10)
    yield from robot.settle()
    yield from robot.shot("10_targets")
    editor = next(a for a in robot.window.screen.areas if a.type == IMAGES)
    for name, image in (
        ("ECHO", "Radar echo"),
        ("RANGE_TIME", "Radar range-time"),
        ("MAP", "Radar range-Doppler map"),
    ):
        result["steps_s"].append(robot_module.thread_time_of(shown, "picture", name))
        began = time.perf_counter()
        yield from robot.wait(
            lambda image=image: editor.spaces.active.image.name == image, "the picture", 20
        )
        result["pictures_s"].append(time.perf_counter() - began)
        yield from robot.settle()
        yield from robot.shot(f"10_{name.lower()}")
    # A click into the map, where the ring of another target was.
    chosen = shown.row
    place = robot_module.ring_in(editor.spaces.active.image)
    shown.row = 1 if chosen == 0 else 0
    yield from robot.settle()
    yield from robot.click_image(editor, place)
    result["clicked"] = [chosen, shown.row]
    # An image gets its size once the zoom is calm.
    space = editor.spaces.active
    yield from robot.wait(lambda: abs(space.zoom[0] - 1) < 2e-3, "the picture at its size", 20)
    result["zoom"] = list(space.zoom)
    shown.cfar = "os"
    yield from robot.wait(lambda: PROCESS in robot.modal_operators(), "processing by itself", 20)
    yield from robot.wait(lambda: PROCESS not in robot.modal_operators(), "its end", 120)
    yield from robot.settle()
    yield from robot.shot("11_detector")
    shown.picture = "SPECTROGRAM"
    name = "Radar spectrogram"
    yield from robot.wait(lambda: name in bpy.data.images, "the spectrogram", 120)
    yield from robot.settle()
    yield from robot.shot("12_spectrogram")
    result["pictures"] = [
        area.spaces.active.image.name
        for window in bpy.context.window_manager.windows
        for area in window.screen.areas
        if area.type == IMAGES and area.spaces.active.image is not None
    ]


if __name__ == "__main__":
    # Before the window is drawn for the first time: the splash screen would catch all clicks.
    bpy.context.preferences.view.show_splash = False
    walker = robot_module.Robot(FOLDER)
    walker.run(script)
