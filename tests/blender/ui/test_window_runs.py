# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the window: a copy of the scene, measured in a process of its own."""

from __future__ import annotations

import functools
import resource
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.headless import scene_copy
from radarsim_addon.blender.headless.scripting import measure
from radarsim_addon.blender.scene.scene_files import _linked_files
from radarsim_addon.blender.ui import measuring, operators
from radarsim_addon.errors import OutputError, RenderError, SceneError
from radarsim_addon.processes import remove_abandoned_folders
from radarsim_addon.signal import open_run
from radarsim_addon.signal.runs.exr import read_exr
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.state.test_settings_restore import difference, snapshot, unusual_scene
from tests.worker_processes import finished, runs

pytestmark = pytest.mark.blender

ROOT = Path(__file__).parents[3]


@pytest.fixture
def scene(addon: Any, tmp_path: Path) -> Any:
    """A saved file with a moving plate, whose run is in the folder "run" next to it."""
    made = rs.ring_scene()
    rs.move_steadily(bpy.data.objects["Plate"], (0.0, 1.0, 0.0))
    rs.radar().output_folder = "//run"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return made


@pytest.fixture(autouse=True)
def nothing_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Temporary files go into a folder of the test, in which nothing stays."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    monkeypatch.setenv("TMPDIR", str(temporary))
    yield
    measuring.end_runs()
    assert [*temporary.iterdir()] == []


def begun() -> measuring.WindowRun:
    """A run of the scene as it is now."""
    run = operators._copied(bpy.context)
    measuring.add_run(run)
    return run


def wait(until: Callable[[], bool]) -> None:
    """Step the runs, as the window's timer does."""
    end_s = time.monotonic() + 120.0
    while not until():
        measuring.advance()
        time.sleep(0.01)
        assert time.monotonic() < end_s


def measured() -> measuring.WindowRun:
    """The run of the scene as it is now, when it has ended; its error is raised."""
    run = begun()
    wait(lambda: run.ended)
    if run.error is not None:
        raise run.error
    return run


def numbers(folder: Path) -> dict[str, np.ndarray]:
    """All that a run has measured: images of rings, or columns of paths."""
    found: dict[str, np.ndarray] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.suffix == ".npz":
            with np.load(path) as arrays:
                found |= {f"{name} {key}": array.copy() for key, array in arrays.items()}
        elif path.suffix == ".exr":
            found |= {f"{name} {k}": v for k, v in read_exr(path).items()}
    assert found
    return found


def equal(one: Path, other: Path) -> bool:
    first, second = numbers(one), numbers(other)
    return first.keys() == second.keys() and all(
        np.array_equal(first[name], second[name], equal_nan=array.dtype.kind == "f")
        for name, array in first.items()
    )


def here(folder: Path) -> Path:
    """The scene as it is saved, measured by a script in this process."""
    bpy.ops.wm.save_mainfile()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # findings
        measure(bpy.data.objects["Radar"], folder / "here")
    return folder / "here"


def changed(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """What is different, but for Blender's own list of folders of the system."""
    return [line for line in difference(before, after) if "system_bookmarks" not in line]


@pytest.mark.parametrize("mode", ["rings", "paths"])
def test_the_window_measures_what_the_command_line_does(
    scene: Any, tmp_path: Path, mode: str
) -> None:
    """Bit by bit, of two frames, one of them another than the window shows; nothing is changed."""
    settings = rs.radar()
    settings.sampling_mode = mode
    settings.frame_mode, settings.frame_start, settings.frame_end = "range", 1, 13
    settings.frame_step = 12
    scene.frame_set(5)
    bpy.ops.wm.save_mainfile()
    before, saved = snapshot(scene), (tmp_path / "scene.blend").read_bytes()
    run = measured()
    assert changed(before, snapshot(scene)) == []
    assert (tmp_path / "scene.blend").read_bytes() == saved
    assert run.folder == tmp_path / "run" and run.frames == [1, 13] and run.fraction == 1.0
    finished("render", tmp_path / "scene.blend", "--out", tmp_path / "cli")
    assert equal(tmp_path / "run", tmp_path / "cli")
    names = [open_run(tmp_path / name).record.blend_file for name in ("run", "cli")]
    assert names == ["scene.blend", "scene.blend"]


def test_edits_that_were_not_saved_are_measured(scene: Any, tmp_path: Path) -> None:
    bpy.data.objects["Plate"].scale = (0.5, 0.5, 0.5)
    rs.radar().output_folder = "//edited"
    measured()
    assert equal(tmp_path / "edited", here(tmp_path))
    bpy.data.objects["Plate"].scale = (1.0, 1.0, 1.0)
    rs.radar().output_folder = "//other"
    measured()
    assert not equal(tmp_path / "edited", tmp_path / "other")


@pytest.mark.parametrize("ending", ["success", "error", "stop"])
def test_an_unusual_scene_is_never_changed(addon: Any, tmp_path: Path, ending: str) -> None:
    scene = unusual_scene()
    rs.radar().output_folder = str(tmp_path / ("none/run" if ending == "error" else "run"))
    bpy.context.view_layer.update()
    before, dirty = snapshot(scene), bpy.context.preferences.is_dirty
    run = begun()
    if ending == "stop":
        wait(lambda: run.began)
        run.stop()
    wait(lambda: run.ended)
    assert (run.error is not None, run.stopped) == (ending == "error", ending == "stop")
    assert changed(before, snapshot(scene)) == []
    assert bpy.context.preferences.is_dirty == dirty
    assert not bpy.data.filepath


def test_a_stop_ends_the_process_and_the_next_run_measures_all(scene: Any, tmp_path: Path) -> None:
    rs.radar().ring_step_m = 0.2
    run = begun()
    wait(lambda: run.done >= 2)
    worker = run._worker._process
    run.stop()
    wait(lambda: run.ended)
    measuring.end_runs()
    assert run.stopped and 2 <= run.done < run.total and "stopped" in run.text
    assert worker.poll() is not None
    assert not list((tmp_path / "run").rglob("*.part*"))
    assert not [path for path in (tmp_path / "run").iterdir() if "lock" in path.name]
    rs.radar().ring_step_m = 4.0
    measured()
    assert open_run(tmp_path / "run").missing() == []


def test_esc_in_the_operator_stops_its_run(scene: Any, tmp_path: Path) -> None:
    """The steps of the operator by hand. Esc that comes while the copy is saved is the next one."""
    said: list[str] = []
    operator: Any = SimpleNamespace(
        _run=None, _announced=False, _timer=None, _shows=False,
        report=lambda kind, text: said.append(text), _leave=lambda context, result: result,
    )  # fmt: skip
    for name in ("_report_end", "modal"):
        method = getattr(operators.RADARSIM_OT_render_frames, name)
        setattr(operator, name, functools.partial(method, operator))

    def step(kind: str) -> set[str]:
        event = SimpleNamespace(type=kind, value="PRESS")
        return operator.modal(bpy.context, event)  # type: ignore[no-any-return]

    assert step("TIMER") == step("G") == {"PASS_THROUGH"} and operator._run is None
    assert step("TIMER") == {"PASS_THROUGH"}
    run: Any = operator._run
    assert run.copy.folder.is_dir()
    assert step("ESC") == {"RUNNING_MODAL"}
    measuring.end_runs()
    assert run.ended and not run.copy.folder.exists()
    assert step("TIMER") == {"CANCELLED"} and "stopped" in said[-1]
    assert not (tmp_path / "run").exists()


def test_a_stop_before_the_run_has_begun_leaves_nothing(scene: Any, tmp_path: Path) -> None:
    run = begun()
    measuring.advance()
    worker = run._worker._process
    run.stop()
    measuring.end_runs()
    assert run.ended and run.stopped and worker.poll() is not None
    assert not (tmp_path / "run").exists()


def test_a_step_that_does_not_end_is_killed(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measuring, "_GRACE_S", 0.0)
    rs.radar().width_px = rs.radar().height_px = 2000
    run = begun()
    wait(lambda: run.began)
    run.stop()
    wait(lambda: run.ended)
    assert run.stopped


def test_a_killed_process_is_named(scene: Any) -> None:
    rs.radar().ring_step_m = 0.2
    run = begun()
    wait(lambda: run.began)
    run._worker._process.kill()
    wait(lambda: run.ended)
    assert isinstance(run.error, RenderError) and "signal 9" in str(run.error)


_CRASH = """
import os, sys, time
import bpy, radarsim_addon
from radarsim_addon.blender.ui import measuring, operators
radarsim_addon.register()
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
run = operators._copied(bpy.context)
measuring.add_run(run)
while not run.began:
    measuring.advance()
    assert not run.ended, run.error
    time.sleep(0.01)
print("child", run._worker._process.pid, flush=True)
{end}
"""


@pytest.mark.parametrize("end", ["os.kill(os.getpid(), 9)", "raise SystemExit"])
def test_a_crash_or_the_end_of_the_window_leaves_no_process_and_no_copy(
    scene: Any, tmp_path: Path, end: str
) -> None:
    # thousands of renders that take longer than the test waits, whatever the machine
    rs.radar().ring_step_m, rs.radar().samples = 0.01, 64
    rs.radar().width_px = rs.radar().height_px = 128
    bpy.ops.wm.save_mainfile()
    done = subprocess.run(
        [sys.executable, "-c", _CRASH.format(end=end), str(tmp_path / "scene.blend")],
        cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False,
    )  # fmt: skip
    pid = int(done.stdout.rpartition("child ")[2].split()[0])
    end_s = time.monotonic() + 20.0
    while runs(pid):
        assert time.monotonic() < end_s
        time.sleep(0.1)
    remove_abandoned_folders(now=True)  # of the window's own session, as the next one does


def test_runs_wait_for_one_another_each_with_its_copy(scene: Any, tmp_path: Path) -> None:
    plate = bpy.data.objects["Plate"]
    rs.radar().output_folder = "//first"
    first = begun()
    plate.scale = (0.5, 0.5, 0.5)
    rs.radar().output_folder = "//second"
    second = begun()
    wait(lambda: first.began)
    assert second._worker is None and measuring.current_run() is first
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)  # another file
    wait(lambda: second.ended)
    assert first.error is None and second.error is None
    assert not equal(tmp_path / "first", tmp_path / "second")


def test_a_run_that_waits_can_be_stopped(scene: Any, tmp_path: Path) -> None:
    first = begun()
    rs.radar().output_folder = "//second"
    second = begun()
    second.stop()
    wait(lambda: first.ended)
    wait(lambda: measuring.current_run() is None)
    assert first.error is None and not first.stopped and second.stopped
    assert not (tmp_path / "second").exists()


# -- what a copy does not hold ---------------------------------------------------------------------


def textured(image: Any) -> None:
    """Have the plate scatter as an image says, and another light of it pass the rings."""
    material = ph.principled("Painted", (1.0, 1.0, 1.0))
    nodes = material.node_tree.nodes
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    texture = nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    coordinates = nodes.new("ShaderNodeTexCoord")
    links = material.node_tree.links
    links.new(coordinates.outputs["Generated"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    plate = bpy.data.objects["Plate"].data
    plate.materials.clear()
    plate.materials.append(material)
    rs.radar().sampling_mode = "paths"


def painted(image: Any) -> None:
    pixels = np.ones((image.size[1], image.size[0], 4), np.float32)
    values = np.random.default_rng(3).integers(50, 240, pixels.shape[:2]) / 256  # exact as halves
    pixels[..., :3] = values[..., None]
    image.pixels.foreach_set(pixels.ravel())


def saved_image(suffix: str) -> Any:
    """A black image of the file picture.png or picture.exr."""
    image = bpy.data.images.new("Saved", 8, 8, float_buffer=suffix == "exr")
    image.file_format = {"exr": "OPEN_EXR", "png": "PNG"}[suffix]
    image.filepath_raw = f"//picture.{suffix}"
    image.save()
    image.source = "FILE"
    return image


@pytest.mark.parametrize("source", ["GENERATED", "FILE"])
def test_painted_images_are_measured_as_if_they_were_saved(
    scene: Any, tmp_path: Path, source: str
) -> None:
    """The user's images are neither packed nor saved."""
    image = saved_image("png") if source == "FILE" else bpy.data.images.new("Painted", 8, 8)
    textured(image)
    painted(image)
    measured()
    assert image.is_dirty and image.packed_file is None and image.source == source
    image.file_format, image.filepath_raw = "PNG", "//saved.png"
    image.save()
    image.source = "FILE"
    assert equal(tmp_path / "run", here(tmp_path))
    textured(bpy.data.images.new("Black", 8, 8))
    rs.radar().output_folder = "//black"
    measured()
    assert not equal(tmp_path / "run", tmp_path / "black")


def test_painted_floats_are_measured_as_in_this_process(scene: Any, tmp_path: Path) -> None:
    generated = bpy.data.images.new("Painted", 8, 8, float_buffer=True)
    for name, image in (("run", generated), ("file", saved_image("exr"))):
        image.colorspace_settings.name = generated.colorspace_settings.name
        textured(image)
        painted(image)
        rs.radar().output_folder = f"//{name}"
        measured()
    textured(generated)
    assert equal(tmp_path / "run", here(tmp_path))
    assert equal(tmp_path / "file", tmp_path / "here")


def test_relative_paths_are_those_of_the_original(scene: Any, tmp_path: Path) -> None:
    """A library and an image next to the file."""
    folder = tmp_path / "parts"
    folder.mkdir()
    image = bpy.data.images.new("Picture", 8, 8)
    painted(image)
    image.filepath_raw, image.file_format = "//parts/picture.png", "PNG"
    image.save()
    image.source = "FILE"
    textured(image)
    library = rs.add_plate(11.0, size=5.0)
    library.name = "Linked"
    bpy.data.libraries.write(str(folder / "library.blend"), {library}, path_remap="RELATIVE_ALL")
    bpy.data.objects.remove(library)
    with bpy.data.libraries.load("//parts/library.blend", link=True, relative=True) as (_, into):
        into.objects = ["Linked"]
    scene.collection.objects.link(into.objects[0])
    bpy.context.view_layer.update()
    run = measured()
    assert not [one for one in run.findings if one.code == "linked-file-missing"]
    assert equal(tmp_path / "run", here(tmp_path))


def test_no_script_of_the_file_runs(scene: Any, tmp_path: Path) -> None:
    mark = tmp_path / "ran"
    text = bpy.data.texts.new("startup.py")
    text.write(f"open({str(mark)!r}, 'w')")
    text.use_module = True
    measured()
    assert not mark.exists()


# -- what the process does not have ----------------------------------------------------------------


def test_objects_that_a_driver_of_the_session_moves_are_refused_by_name(scene: Any) -> None:
    bpy.app.driver_namespace["far"] = lambda: 12.0
    curve = bpy.data.objects["Plate"].driver_add("location", 0)
    curve.driver.expression = "far()"
    try:
        bpy.context.view_layer.update()
        with pytest.raises(SceneError, match=r"1 objects are different.*'Plate'"):
            measured()
    finally:
        del bpy.app.driver_namespace["far"]


def test_meshes_that_differ_are_refused_by_name(scene: Any) -> None:
    other = rs.add_plate(12.0)
    other.modifiers.new("Array", "ARRAY")
    bpy.app.driver_namespace["far"] = lambda: 3.0
    other.driver_add('modifiers["Array"].count').driver.expression = "far()"
    try:
        bpy.context.view_layer.update()
        with pytest.raises(SceneError, match=rf"1 objects are different.*'{other.name}'"):
            measured()
    finally:
        del bpy.app.driver_namespace["far"]


def test_functions_that_blender_calls_at_each_frame_are_named(scene: Any) -> None:
    def carrier(*_: Any) -> None:
        bpy.data.objects["Plate"].scale.x = 1.0 + bpy.context.scene.frame_current

    bpy.app.handlers.frame_change_post.append(carrier)
    try:
        run = measured()
    finally:
        bpy.app.handlers.frame_change_post.remove(carrier)
    (found,) = [one for one in run.findings if one.code == "handlers-not-run"]
    assert "carrier" in found.message and "frame 1" in found.message


def test_a_device_that_is_not_there_is_named(scene: Any) -> None:
    run = begun()
    run.copy.order.fields["device"] = ["CUDA", []]
    wait(lambda: run.ended)
    assert "CUDA" in str(run.error)


def test_scene_layer_and_radar_are_those_of_the_window(scene: Any, tmp_path: Path) -> None:
    """Not those that are active when the copy is opened by itself."""
    layer = scene.view_layers.new("Second")
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    assert bpy.context.scene == other
    with bpy.context.temp_override(scene=scene, view_layer=layer):
        run = begun()
    fields = run.copy.order.fields
    assert (fields["scene"], fields["view_layer"], fields["radar"]) == ("Scene", "Second", "Radar")
    wait(lambda: run.ended)
    assert run.error is None
    assert open_run(tmp_path / "run").record.scene == "Scene"


def test_numbers_of_a_scene_are_equal_and_small_changes_are_seen(scene: Any) -> None:
    layer = bpy.context.view_layer
    plate = bpy.data.objects["Plate"]

    def now() -> Any:
        return scene_copy.evaluated_numbers(scene_copy.evaluated_snapshot(layer))

    before = now()
    assert scene_copy.differences(before, now()) == []
    plate.delta_location.y = 1e-3
    assert scene_copy.differences(before, now()) == ["Plate"]
    plate.delta_location.y = 0.0
    assert scene_copy.differences(before, now()) == []
    plate.data.vertices[2].co.x += 1e-4
    plate.data.update()
    assert scene_copy.differences(before, now()) == ["Plate"]


def test_the_copy_is_no_save_for_add_ons_and_packs_nothing(scene: Any) -> None:
    called: list[Any] = []
    hooks = bpy.app.handlers.save_pre, bpy.app.handlers.save_post
    for hook in hooks:
        hook.append(called.append)
    bpy.data.use_autopack = True
    image = saved_image("png")
    image.use_fake_user = True
    try:
        operators._copied(bpy.context).close()
        assert called == [] and image.packed_file is None and bpy.data.use_autopack
        assert all(hook[-1] == called.append for hook in hooks)
    finally:
        bpy.data.use_autopack = False
        for hook in hooks:
            hook.remove(called.append)


# -- the disk --------------------------------------------------------------------------------------


def test_a_full_disk_is_named_before_the_copy(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = scene_copy.shutil._ntuple_diskusage(100, 99, 1)
    monkeypatch.setattr(scene_copy.shutil, "disk_usage", lambda _: usage)
    with pytest.raises(OutputError, match=r"needs about .* MB in the temporary folder"):
        operators._copied(bpy.context)


def test_a_copy_that_cannot_be_written_is_named(scene: Any) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, limits[1]))
    try:
        with pytest.raises(OutputError, match="could not be saved"):
            operators._copied(bpy.context)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_the_expected_size_is_about_that_of_the_copy(scene: Any) -> None:
    count = 400
    mesh = bpy.data.meshes.new("Grid")
    x, y = np.meshgrid(np.arange(count), np.arange(count))
    places = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    corner = (x + count * y)[:-1, :-1].ravel()
    faces = np.stack([corner, corner + 1, corner + count + 1, corner + count], axis=-1)
    mesh.from_pydata(places.tolist(), [], faces.tolist())
    bpy.data.objects["Plate"].data = mesh
    copy = operators._copied(bpy.context).copy
    assert 0.8 < scene_copy.expected_size() / copy.size_bytes < 1.5
    copy.close()


# -- simulations -----------------------------------------------------------------------------------


def cloth(scene: Any, on_disk: bool) -> Any:
    """A plate of cloth that falls; the run measures frame 12, the window shows frame 3."""
    item = rs.add_plate(8.0, size=3.0)
    bpy.context.view_layer.objects.active = item
    with bpy.context.temp_override(object=item, active_object=item, selected_objects=[item]):
        bpy.ops.object.modifier_add(type="CLOTH")
    cache = item.modifiers[-1].point_cache
    cache.frame_start, cache.frame_end = 1, 14
    cache.use_disk_cache = on_disk
    settings = rs.radar()
    settings.frame_mode, settings.frame_start, settings.frame_end = "range", 12, 12
    scene.frame_set(3)
    bpy.ops.wm.save_mainfile()
    return item


def test_a_simulation_that_is_not_baked_is_played_from_its_start(
    scene: Any, tmp_path: Path
) -> None:
    cloth(scene, on_disk=False)
    measured()
    finished("render", tmp_path / "scene.blend", "--out", tmp_path / "cli")
    assert equal(tmp_path / "run", tmp_path / "cli")
    rs.radar().frame_start = rs.radar().frame_end = 1
    rs.radar().output_folder = "//first"
    measured()
    fallen = numbers(tmp_path / "run").values()
    assert not all(map(np.array_equal, fallen, numbers(tmp_path / "first").values()))


def test_baked_caches_on_the_disk_are_those_of_the_original(scene: Any, tmp_path: Path) -> None:
    item = cloth(scene, on_disk=True)
    with pytest.raises(SceneError, match=f"{item.name!r} would write their caches"):
        measured()
    with bpy.context.temp_override(point_cache=item.modifiers[-1].point_cache):
        bpy.ops.ptcache.bake(bake=True)
    files = sorted((tmp_path / "blendcache_scene").iterdir())
    assert len(files) > 10
    before = [(path.name, path.read_bytes(), path.stat().st_mtime_ns) for path in files]
    bpy.ops.wm.save_mainfile()
    measured()
    assert equal(tmp_path / "run", here(tmp_path))
    linked = _linked_files()
    assert tmp_path / "blendcache_scene" in linked and Path.cwd() not in linked
    files = sorted((tmp_path / "blendcache_scene").iterdir())
    assert [(path.name, path.read_bytes(), path.stat().st_mtime_ns) for path in files] == before
    for path in files:  # the window keeps the pose that it has read from them
        path.unlink()
    with pytest.raises(SceneError, match=f"different in the process that measures: {item.name!r}"):
        measured()
