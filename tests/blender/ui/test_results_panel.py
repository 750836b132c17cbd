# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Results on a run of two frames: pictures, list of targets, and what they select."""

from __future__ import annotations

import io
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Vector
from matplotlib import image as matplotlib_image
from matplotlib.text import Annotation
from PIL import Image as pillow

from radarsim_addon import contract, movie_file, signal
from radarsim_addon.blender import addon as addon_module
from radarsim_addon.blender.plan import radar_preset
from radarsim_addon.blender.rig_settings import apply_preset, settings
from radarsim_addon.blender.scene import active_radar
from radarsim_addon.blender.ui import results_panel as rp
from radarsim_addon.blender.ui import shown_results as sr
from radarsim_addon.blender.ui.overlays import overlay_lines
from radarsim_addon.blender.ui.picture_images import axes_of
from radarsim_addon.blender.ui.result_pictures import HEIGHT, KINDS, WIDTH, PictureAxes, read_out
from radarsim_addon.messages import Message
from radarsim_addon.signal.pictures import FrameView, answer_request, read_view, write_view
from radarsim_addon.signal.pictures.figure import new_figure
from radarsim_addon.signal.pictures.view_pictures import write_names
from tests.blender import radar_scenes as rs
from tests.blender import recording
from tests.signal import path_runs

pytestmark = pytest.mark.blender

#: Frame 1: a wall 60 m away, a car 30 m away that recedes with 8 m/s.
WALL_M, CAR_M, CAR_MPS = 60.0, 30.0, 8.0


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A .blend with its run: 77 GHz FMCW, two frames."""
    addon_module.register()
    rs.new_scene()
    scene = bpy.context.scene
    apply_preset(scene, active_radar(scene), radar_preset("automotive_77ghz"))
    wall, car = rs.add_plate(WALL_M, 6.0), rs.add_plate(CAR_M, 2.0)
    wall.name, car.name = "Wall", "Car"
    wall.location.x = 12.0
    rs.move_steadily(car, (0.0, CAR_MPS, 0.0))
    view = settings(active_radar(scene))
    view.sampling_mode, view.pulses, view.replicates = "paths", 128, 2
    view.width_px, view.height_px = 96, 24
    view.frame_mode, view.frame_start, view.frame_end, view.frame_step = "range", 1, 7, 6
    folder = tmp_path_factory.mktemp("results")
    view.output_folder = str(folder / "run")
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    assert bpy.ops.radarsim.render_frames() == {"FINISHED"}
    yield folder / "scene.blend"
    addon_module.unregister()


@pytest.fixture
def state(measured: Path) -> Iterator[Any]:
    """The state of the tab, with the run's scene opened and nothing processed."""
    bpy.ops.wm.open_mainfile(filepath=str(measured))
    sr.follow_objects()
    bpy.context.view_layer.objects.active = None
    set_defaults()
    yield bpy.context.window_manager.radarsim_results
    set_defaults()  # of another group, where the test opened a file
    sr.forget_run()


def set_defaults() -> None:
    found = bpy.context.window_manager.radarsim_results
    for item in found.bl_rna.properties:
        if not item.is_readonly and item.identifier not in ("name", "frame", "row"):
            found.property_unset(item.identifier)


def chosen() -> str:
    target = sr.chosen_target()
    return "" if target is None else target["name"]


def process() -> Any:
    assert bpy.ops.radarsim.process_last_run() == {"FINISHED"}
    view = sr.shown_view()
    assert view is not None
    return view


def pixels(name: str) -> np.ndarray:
    image = bpy.data.images[KINDS[name].image]
    values = np.empty(WIDTH * HEIGHT * 4, dtype=np.float32)
    image.pixels.foreach_get(values)
    return values


def drawn(name: str, **changes: Any) -> np.ndarray:
    """A picture as the process that draws answers a request, (height, width, 3)."""
    fields = sr.picture_fields(bpy.context, name)
    assert fields is not None
    answer = answer_request(Message({**fields, "number": 1, **changes}, {}))
    return np.asarray(matplotlib_image.imread(io.BytesIO(answer.arrays["png"].tobytes())))[..., :3]


def centres(axis: dict[str, Any], count: int, unit: dict[str, Any]) -> np.ndarray:
    """Middles of the cells of an axis, in SI."""
    width = (axis["high"] - axis["low"]) / count
    return (axis["low"] + width * (np.arange(count) + 0.5)) * unit["size"]


def spectrogram_rates(view: FrameView) -> np.ndarray:
    axes, count = view.axes["spectrogram"], view.arrays["spectrogram_db"].shape[1]
    return -centres(axes["up"], count, axes["doppler_unit"]) * view.wavelength_m / 2


def picture_axes(name: str) -> PictureAxes:
    axes = axes_of(KINDS[name].image)
    assert axes is not None
    return axes


def texts() -> list[str]:
    return recording.drawn(rp.RADARSIM_PT_results).texts


def test_objects_have_their_range_rate_and_place_in_the_map(state: Any) -> None:
    """Frame 7 is 0.25 s later: the car 2 m further; in the map half a burst later."""
    view = process()
    assert view.frame == 7 and set(view.objects) == {"Wall", "Car"}
    car, wall = view.objects["Car"], view.objects["Wall"]
    assert car["range_m"] == pytest.approx(CAR_M + CAR_MPS * 6 / 24, abs=0.02)
    assert car["velocity_mps"] == pytest.approx(CAR_MPS, rel=1e-3)
    later_s = 127 / 2 / settings(active_radar(bpy.context.scene)).prf_hz
    assert car["map_range_m"] == pytest.approx(car["range_m"] + later_s * CAR_MPS, abs=1e-3)
    assert wall["range_m"] == pytest.approx(np.hypot(WALL_M, 12.0), abs=0.2)
    # the strongest cell of the map is within two cells of the strongest object: speckle glints
    level_db, strongest, axes = view.arrays["map_db"], view.targets[0], view.axes["map"]
    row, column = np.unravel_index(np.argmax(level_db), level_db.shape)
    range_m = centres(axes["ranges"], level_db.shape[1], axes["range_unit"])
    assert abs(range_m[column] - strongest["map_range_m"]) < 1.0
    doppler_hz = centres(axes["doppler"], level_db.shape[0], axes["doppler_unit"])
    rate = -doppler_hz[row] * view.wavelength_m / 2
    assert abs(rate - strongest["map_velocity_mps"]) < 0.4


def test_the_run_of_another_file_or_scene_is_refused_with_its_name(
    state: Any, measured: Path
) -> None:
    folder = str(measured.parent / "run")
    process()
    rs.ring_scene()
    rs.radar().output_folder = folder
    for name, text in (("", "a file that was never saved"), ("cube.blend", "'cube.blend'")):
        if name:
            bpy.ops.wm.save_as_mainfile(filepath=str(measured.with_name(name)))
        with pytest.raises(RuntimeError, match=r"another scene: 'scene\.blend', scene 'Scene'"):
            bpy.ops.radarsim.process_last_run()
        assert sr.shown_view() is None and not any("m/s" in text for text in texts())
        with pytest.raises(RuntimeError, match=f"'scene.blend', scene 'Scene'; this is {text}"):
            bpy.ops.radarsim.render_frames()
    assert (measured.parent / "run" / "frames" / "frame_0007" / "paths.npz").is_file()


def test_results_belong_to_one_scene_of_the_file(state: Any) -> None:
    process()
    first = bpy.context.scene
    assert sr.shown_run() is not None and "Older" not in "".join(texts())
    bpy.context.window.scene = bpy.data.scenes.new("Empty")
    assert [sr.shown_run(), sr.shown_view(), sr.chosen_target()] == [None] * 3
    assert not any("m/s" in text for text in texts())
    bpy.context.window.scene = first
    assert sr.shown_view() is not None


def test_results_older_than_the_last_edit_are_marked(state: Any, tmp_path: Path) -> None:
    """A selection, another frame and a change of the tab's own state are no edits."""
    scene, car = bpy.context.scene, bpy.data.objects["Car"]
    process()
    earlier = "Of an earlier session: the scene may have changed"
    assert sr.age_of_results() == earlier and earlier in texts()
    for image in list(bpy.data.images):  # new pictures are no edits either
        bpy.data.images.remove(image)
    settings(active_radar(scene)).output_folder = str(tmp_path / "run")
    for _ in range(2):  # the second time in place of the first run
        assert bpy.ops.radarsim.render_frames() == {"FINISHED"}
    process()
    assert sr.age_of_results() == ""

    def after(change: Any) -> str:
        change()
        bpy.context.view_layer.update()
        return sr.age_of_results()

    assert after(lambda: car.select_set(True)) == ""
    assert after(lambda: bpy.ops.object.select_all(action="DESELECT")) == ""
    assert after(lambda: setattr(bpy.context.view_layer.objects, "active", car)) == ""
    assert after(lambda: scene.frame_set(3)) == ""
    assert after(lambda: setattr(state, "span_db", 60.0)) == ""
    assert after(lambda: setattr(car, "visible_camera", False)) == sr.age_of_results() != ""
    assert "The scene was edited after this run" in texts()
    assert bpy.ops.radarsim.render_frames() == {"FINISHED"}
    assert sr.age_of_results() == "Older than the last run: process it"
    process()
    assert sr.age_of_results() == ""
    for name, change in {
        "unit": lambda: setattr(scene.unit_settings, "scale_length", 2.0),
        "node": lambda: setattr(car.data.materials[0].node_tree.nodes[-1], "mute", True),
        "removal": lambda: bpy.data.objects.remove(bpy.data.objects["Wall"]),
    }.items():
        sr.note_measured(sr.note_copied(bpy.context), sr._state.scenes[0].fingerprint)
        assert sr.age_of_results() == "", name
        assert after(change) == "The scene was edited after this run", name


def test_results_older_than_the_last_edit_of_the_radar_are_marked(
    state: Any, tmp_path: Path
) -> None:
    radar = active_radar(bpy.context.scene)
    view = settings(radar)
    view.output_folder = str(tmp_path / "run")
    assert bpy.ops.radarsim.render_frames() == {"FINISHED"}
    process()
    sr.note_measured(sr.note_copied(bpy.context), sr._state.scenes[0].fingerprint)
    assert sr.age_of_results() == ""
    carrier_ghz = radar.radarsim.carrier_ghz
    for shown, name, value in (
        (radar.radarsim, "carrier_ghz", carrier_ghz / 2),
        (radar.radarsim, "seed", 5),
        (radar.radarsim.transmitter, "kind", "cosine"),
        (radar.radarsim, "use_link_budget", not view.use_link_budget),
    ):
        before = getattr(shown, name)
        setattr(shown, name, value)
        assert sr.age_of_results() == "The scene was edited after this run", name
        assert "The scene was edited after this run" in texts()
        setattr(shown, name, before)
        assert sr.age_of_results() == "", name
    view.output_folder, view.frame_end = str(tmp_path / "other"), 99
    assert sr.age_of_results() == ""


def test_a_row_selects_its_object_and_an_object_its_row(state: Any) -> None:
    view = process()
    names = [item["name"] for item in view.targets]
    assert [row.name for row in state.rows] == names
    before = pixels("MAP")
    for row, name in enumerate(names):
        assert bpy.ops.radarsim.select_target(row=row) == {"FINISHED"}
        assert bpy.context.selected_objects == [bpy.data.objects[name]]
        assert bpy.context.view_layer.objects.active.name == name
        assert state.row == row and chosen() == name
        shown = texts()
        assert name in shown and any(text.endswith("dBsm") for text in shown)
    assert not np.array_equal(pixels("MAP"), before)  # its ring
    bpy.data.objects[names[1]].select_set(False)
    bpy.data.objects[names[0]].select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects[names[0]]
    sr.follow_selection()
    assert chosen() == names[0] and state.row == 0
    state.row = 1  # a click on the list
    assert bpy.context.view_layer.objects.active.name == names[1]
    with pytest.raises(RuntimeError, match="no row 99"):
        bpy.ops.radarsim.select_target(row=99)


def test_a_part_that_is_selected_chooses_the_row_of_its_object(state: Any) -> None:
    process()
    hub, wheel = (bpy.data.objects.new(name, None) for name in ("Hub", "Wheel"))
    for item, parent in ((hub, bpy.data.objects["Car"]), (wheel, hub)):
        bpy.context.scene.collection.objects.link(item)
        item.parent = parent
    wheel.select_set(True)
    bpy.context.view_layer.objects.active = wheel
    sr.follow_selection()
    assert chosen() == "Car"


def test_parts_are_listed_by_themselves_where_asked(state: Any) -> None:
    assert "--parts" not in rp.chosen_processing(bpy.context)
    state.parts = True
    assert "--parts" in rp.chosen_processing(bpy.context)
    assert "parts" in recording.drawn(rp.RADARSIM_PT_results).fields
    process()


@pytest.mark.parametrize("picture", ["MAP", "PROFILE", "SPECTROGRAM", "RANGE_TIME"])
def test_a_click_on_a_peak_selects_its_object(state: Any, picture: str) -> None:
    """The place is read from the picture: what the mark of the chosen target changes there."""
    state.picture = picture
    view = process()
    plain = drawn(picture)
    for row, item in enumerate(view.targets):
        change = np.abs(drawn(picture, chosen=item) - plain).max(axis=2)
        y, x = np.argwhere(change > 0.1).mean(axis=0)
        x, y = (x + 0.5) / WIDTH, 1 - (y + 0.5) / HEIGHT
        bpy.context.view_layer.objects.active = None
        done = bpy.ops.radarsim.pick_target(kind=picture, x=x, y=y)
        assert done == {"FINISHED"} and state.row == row
        assert chosen() == item["name"] == bpy.context.view_layer.objects.active.name
        assert bpy.context.selected_objects == [bpy.data.objects[item["name"]]]
    chosen_before = chosen()
    assert bpy.ops.radarsim.pick_target(kind=picture, x=0.8, y=0.75) == {"CANCELLED"}
    assert chosen() == chosen_before


def place_of(picture: str, across: float, up: float) -> dict[str, Any]:
    """Arguments of a click, from fractions of the plotting area."""
    left, low, right, high = picture_axes(picture).box
    return {"kind": picture, "x": left + across * (right - left), "y": low + up * (high - low)}


def test_values_under_the_mouse_are_those_of_the_cell(state: Any) -> None:
    """The strongest cell of the wall at rest and of the car, which recedes to the right of it."""
    view = process()
    axes, level_db = view.axes["map"], view.arrays["map_db"]
    doppler_hz = centres(axes["doppler"], level_db.shape[0], axes["doppler_unit"])
    range_m = centres(axes["ranges"], level_db.shape[1], axes["range_unit"])
    rates = -view.wavelength_m / 2 * doppler_hz
    across = {}
    for name, near in {"Wall": abs(rates) < 2, "Car": abs(rates - CAR_MPS) < 2}.items():
        levels = np.where(near[:, None], level_db, -np.inf)
        row, column = np.unravel_index(levels.argmax(), levels.shape)
        place = picture_axes("MAP").place(doppler_hz[row], range_m[column])
        text = read_out("MAP", picture_axes("MAP"), view, *place).split("   ")
        assert [text[0], *text[2:]] == [
            f"{range_m[column]:.4g} m", f"{level_db[row, column]:.1f} {view.unit}", name
        ]  # fmt: skip
        assert float(text[1].removesuffix(" m/s")) == pytest.approx(
            rates[row], abs=0.06 * abs(rates[1] - rates[0])
        )
        assert place[0] is not None
        across[name] = place[0]
    assert across["Car"] > across["Wall"]
    assert read_out("MAP", picture_axes("MAP"), view, 0.01, 0.5) == ""
    state.picture = "PROFILE"
    range_m, power = view.arrays["profile_range_m"], view.arrays["profile"]
    peak = range_m[np.where(abs(range_m - WALL_M) < 5, power, 0.0).argmax()]
    x, _ = picture_axes("PROFILE").place(peak, -10.0)
    text = read_out("PROFILE", picture_axes("PROFILE"), view, x, 0.5).split("   ")
    assert float(text[0].removesuffix(" m")) == pytest.approx(peak, rel=1e-3)
    assert text[-1] == "Wall"


def test_targets_have_their_names_in_pictures() -> None:
    """The strongest first; none over another one, none outside."""
    figure = new_figure(9.6, 6.4)
    axis = figure.subplots()
    axis.set_xlim(100.0, -100.0)
    axis.set_ylim(0.0, 50.0)
    named = [("Car", (0.0, 20.0)), ("Wheel", (1.0, 20.5)), ("", (50.0, 9.0)), ("Far", (0.0, 70.0))]
    write_names(axis, [*named, ("Wall", (-99.0, 40.0))], "white", "black")
    written = [one for one in axis.texts if isinstance(one, Annotation)]
    assert [(one.get_text(), one.xy) for one in written] == [
        ("Car", (0.0, 20.0)), ("Wall", (-99.0, 40.0))
    ]  # fmt: skip
    for one in axis.texts:
        box = one.get_window_extent().transformed(axis.transAxes.inverted())
        assert box.x0 > 0 and box.x1 < 1


def test_a_click_in_the_spectrogram_means_a_target_of_its_echoes(state: Any) -> None:
    """At any time: the strongest cells are the wall's, the car's those of 8 m/s, further up.

    The cells have rising Doppler, which is drawn downwards.
    """
    state.picture = "SPECTROGRAM"
    view = process()
    rates, level_db = spectrogram_rates(view), view.arrays["spectrogram_db"]
    for across in (0.1, 0.9):
        column = level_db[int(across * len(level_db))]
        strongest = {"Wall": abs(rates) < 2, "Car": abs(rates - CAR_MPS) < 2}
        for name, near in strongest.items():
            cell = np.where(near, column, -np.inf).argmax()
            click = place_of("SPECTROGRAM", across, 1 - (cell + 0.5) / rates.size)
            assert bpy.ops.radarsim.pick_target(**click) == {"FINISHED"}
            assert chosen() == name
    state.source, state.object_name = "OBJECT", "Car"
    process()
    still = place_of("SPECTROGRAM", 0.5, 1 - (np.abs(rates).argmin() + 0.5) / rates.size)
    bpy.ops.radarsim.pick_target(**still)
    assert chosen() != "Wall"
    state.source, state.range_start, state.range_stop = "RANGES", 50.0, 70.0
    process()
    assert bpy.ops.radarsim.pick_target(**still) == {"FINISHED"} and chosen() == "Wall"


def test_a_click_in_the_range_time_picture_shows_the_frame_of_that_time(state: Any) -> None:
    """Frame 1 is the left half, frame 7 the right one, where the car is 2 m further away."""
    process()
    state.picture = "RANGE_TIME"
    low_m, high_m = picture_axes("RANGE_TIME").y
    for frame, across in ((1, 0.2), (7, 0.8)):
        car_m = CAR_M + CAR_MPS * (frame - 1) / 24
        up = (car_m - low_m) / (high_m - low_m)
        assert bpy.ops.radarsim.pick_target(**place_of("RANGE_TIME", across, up)) == {"FINISHED"}
        assert state.frame == frame and chosen() == "Car"
        target = sr.chosen_target()
        assert target is not None and target["range_m"] == pytest.approx(car_m, abs=0.02)
        assert bpy.context.view_layer.objects.active.name == "Car"
        assert state.rows[state.row].name == "Car"


def test_paths_of_a_target_go_from_the_radar_to_its_object_and_back(state: Any) -> None:
    view = process()
    for item in view.targets:
        assert 1 <= len(item["lines_m"]) <= 12
        for line in np.array(item["lines_m"]):
            np.testing.assert_allclose(line[[0, -1]], 0.0, atol=1e-3)
            assert abs(np.linalg.norm(line[1]) - item["range_m"]) < 1.0
    bpy.context.scene.unit_settings.scale_length = 10.0  # the overlay stands in the scene's units
    shown = bpy.context.window_manager.radarsim
    for row, item in enumerate(view.targets):
        sr.choose_row(bpy.context, row)
        (lines,) = (one for one in overlay_lines(recording.context())[0] if one.kind == "paths")
        assert len(lines.ends) == sum(2 * (len(line) - 1) for line in item["lines_m"])
        far = max((lines.matrix @ Vector(end)).length for end in lines.ends)
        assert far == pytest.approx(item["range_m"] / 10, abs=0.1)
    shown.overlay_paths = False
    assert "paths" not in {one.kind for one in overlay_lines(recording.context())[0]}
    shown.overlay_paths = True


def test_detections_come_with_their_objects(state: Any) -> None:
    state.cfar, state.pfa = "ca", "1e-4"
    assert state.thermal_noise  # switched on with the detector
    view = process()
    assert view.detections is not None
    found = {item["name"]: item for item in reversed(view.targets) if item["name"]}
    assert set(found) == {"Wall", "Car"}
    assert found["Car"]["velocity_mps"] == pytest.approx(CAR_MPS, abs=0.2)
    assert found["Car"]["snr_db"] > 10
    assert len(state.rows) == len(view.targets)
    names = [item["name"] for item in view.targets]
    bpy.ops.radarsim.select_target(row=names.index("Car"))
    assert bpy.context.view_layer.objects.active.name == "Car"
    sr.follow_selection()  # keeps the detection, which is not the object's mean
    assert sr.chosen_row() == names.index("Car")


def test_every_picture_of_every_frame_is_drawn(state: Any) -> None:
    state.picture = "SPECTROGRAM"
    state.source, state.object_name, state.window_pulses = "OBJECT", "Car", 32
    view = process()
    assert view.arrays["spectrogram_db"].shape == (13, 32)
    rates = spectrogram_rates(view)
    at = rates[view.arrays["spectrogram_db"].max(axis=0).argmax()]
    assert abs(at - CAR_MPS) < rates[0] - rates[1]
    for name, kind in KINDS.items():
        state.picture = name
        seen = []
        for frame in (1, 7, 1):
            state.frame = frame
            assert state.frame == frame
            seen.append(pixels(name))
        assert np.array_equal(seen[0], seen[2])
        assert seen[0].min() < 0.2 and seen[0].max() > 0.9
        if name not in ("RANGE_TIME", "PPI"):  # which show all frames
            assert not np.array_equal(seen[0], seen[1]), name
        assert kind.image in bpy.data.images


def test_the_dynamic_range_changes_the_picture_without_processing(state: Any) -> None:
    process()
    wide = pixels("MAP")
    state.span_db = 30.0
    assert not np.array_equal(pixels("MAP"), wide)
    state.span_db = 80.0
    np.testing.assert_array_equal(pixels("MAP"), wide)


def test_frames_are_stepped_and_snapped_and_the_panel_says_where_it_is(state: Any) -> None:
    assert bpy.ops.radarsim.step_frame.poll() is False
    process()
    layout = recording.drawn(rp.RADARSIM_PT_results)
    assert "frame 7, 2 targets" in layout.texts
    assert {"picture", "frame", "span_db", "thermal_noise", "cfar"} <= set(layout.fields)
    bpy.ops.radarsim.step_frame(step=-1)
    assert state.frame == 1
    bpy.ops.radarsim.step_frame(step=-1)
    assert state.frame == 1
    state.frame = 5
    assert state.frame == 7
    state.cfar, state.picture = "os", "SPECTROGRAM"
    assert {"pfa", "window_pulses", "overlap", "source"} <= set(
        recording.drawn(rp.RADARSIM_PT_results).fields
    )


def test_pictures_and_animations_are_saved(state: Any, tmp_path: Path) -> None:
    """Both pictures of the GIF are those of the window, to the colours of its palette."""
    process()
    path = tmp_path / "map.png"
    assert bpy.ops.radarsim.save_picture(filepath=str(path)) == {"FINISHED"}
    saved = matplotlib_image.imread(path)
    window = pixels("MAP").reshape(HEIGHT, WIDTH, 4)[::-1, :, :3]
    np.testing.assert_allclose(saved[..., :3], window, atol=1 / 255)
    path = tmp_path / "map.gif"
    assert bpy.ops.radarsim.save_animation(filepath=str(path), seconds=0.5) == {"FINISHED"}
    with pillow.open(path) as animation:
        assert getattr(animation, "n_frames", 1) == 2 and animation.info["duration"] == 500
        pictures = []
        for number in range(2):
            animation.seek(number)
            pictures.append(np.asarray(animation.convert("RGB")) / 255)
    assert np.abs(pictures[1] - window).max() < 0.06  # frame 7, which the window shows
    assert np.abs(pictures[0] - window).max() > 0.2
    path = tmp_path / "map.mp4"
    assert bpy.ops.radarsim.save_animation(filepath=str(path), seconds=0.5) == {"FINISHED"}
    clip, first = bpy.data.movieclips.load(str(path)), bpy.data.images.load(str(path))
    assert clip.fps == 2.0 and clip.frame_duration == 2 and tuple(clip.size) == (WIDTH, HEIGHT)
    state.frame = 1  # whose picture is the first of the movie
    window = pixels("MAP").reshape(HEIGHT, WIDTH, 4)[::-1, :, :3]
    assert np.abs(pictures[0] - window).max() < 0.06
    values = np.empty(WIDTH * HEIGHT * 4, dtype=np.float32)
    first.pixels.foreach_get(values)
    assert np.abs(values - pixels("MAP")).mean() < 0.01
    state.frame = 7
    path.unlink()
    for name in ("save_picture", "save_animation"):
        with pytest.raises(RuntimeError, match="does not exist"):
            getattr(bpy.ops.radarsim, name)(filepath=str(tmp_path / "none" / "x"))
    state.picture = "SPECTROGRAM"
    with pytest.raises(RuntimeError, match="no spectrogram of this frame"):
        bpy.ops.radarsim.save_picture(filepath=str(path))
    assert sorted(item.name for item in tmp_path.iterdir()) == ["map.gif", "map.png"]


def test_movies_need_blenders_ffmpeg(
    state: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without FFmpeg, and where the encoder fails, an error says so and no file is left."""
    process()
    path = tmp_path / "map.mp4"
    bad = tmp_path / "bad.py"
    bad.write_text("raise SystemExit('no such codec')")
    with monkeypatch.context() as patch:
        patch.setattr(movie_file, "_ENCODER", bad)
        with pytest.raises(RuntimeError, match="no such codec"):
            bpy.ops.radarsim.save_animation(filepath=str(path))
    options = SimpleNamespace(build_options=SimpleNamespace(codec_ffmpeg=False))
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "bpy", SimpleNamespace(app=options))
        with pytest.raises(RuntimeError, match="built without FFmpeg"):
            bpy.ops.radarsim.save_animation(filepath=str(path))
    assert list(tmp_path.iterdir()) == [bad]


def test_a_run_is_forgotten_with_its_files(state: Any) -> None:
    process()
    folder = Path(sr.shown_run().folder.name)
    process()  # another one in its place
    assert not folder.exists()
    folder = Path(sr.shown_run().folder.name)
    assert folder.is_dir()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert sr.shown_run() is None and not folder.exists()


@pytest.mark.parametrize("azimuth_deg", [0.0, 35.0, -120.0])
def test_a_view_has_the_direction_that_the_receiver_looks_in(
    tmp_path: Path, azimuth_deg: float
) -> None:
    """From +Y clockwise as seen from above, over a width of 40 degrees, looking up by 10."""
    pose = path_runs.pose((3.0, -2.0, 1.0), azimuth_deg, 10.0)
    receiver, emitter = path_runs.camera(pose, 20.0), contract.TransmitterRecord(pose, 1e3)
    right, up, back, place = np.array(pose)[:3].T
    wall = path_runs.Plate("Wall", tuple(place - 30 * back), tuple(2 * right), tuple(2 * up))
    rows = path_runs.trace([wall], receiver, emitter, 32)
    assert rows.size
    path_runs.write_run(tmp_path / "run", rows, ["Wall"], receiver, emitter, range_limits_m=60.0)
    options = signal.ProcessOptions(plots=False, products=False)
    (result,) = (e for e in signal.process_run(tmp_path / "run", options) if hasattr(e, "rd_map"))
    write_view(result, tmp_path)
    view = read_view(tmp_path, 1)
    assert view.azimuth_deg == pytest.approx(azimuth_deg, abs=1e-9)
    assert view.width_deg == pytest.approx(40.0)


@pytest.fixture
def saved(state: Any, tmp_path: Path) -> Path:
    """A file that was measured and then saved."""
    settings(active_radar(bpy.context.scene)).output_folder = "//run"
    path = tmp_path / "mine.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert bpy.ops.radarsim.measure_and_show() == {"FINISHED"}
    assert sr.age_of_results() == ""
    bpy.ops.wm.save_mainfile()
    return path


def reopened(path: Path) -> str:
    """Open a file, process its run as the panel offers it, and return the age of the results."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert sr.has_unseen_run() and "This file has a run: process it to see it" in texts()
    assert sr.shown_view() is None
    process()
    assert not sr.has_unseen_run()
    return sr.age_of_results()


def test_a_reopened_file_shows_its_last_run_with_one_click(saved: Path, tmp_path: Path) -> None:
    before = [tuple(row.values()) for row in bpy.context.window_manager.radarsim_results.rows]
    picture = pixels("MAP")
    assert reopened(saved) == ""
    rows = bpy.context.window_manager.radarsim_results.rows
    assert [tuple(row.values()) for row in rows] == before and before
    np.testing.assert_array_equal(pixels("MAP"), picture)
    # under another name it is still the run of this file
    other = tmp_path / "other name.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(other))
    assert reopened(other) == ""
    bpy.data.objects["Wall"].location.x += 1.0
    bpy.context.view_layer.update()
    assert sr.age_of_results() == "The scene was edited after this run"


def test_a_file_that_was_edited_after_its_run_says_so(saved: Path) -> None:
    bpy.data.objects["Wall"].location.x += 1.0
    bpy.context.view_layer.update()
    bpy.ops.wm.save_mainfile()
    assert reopened(saved) == "The scene was edited after this run"


def test_a_file_that_was_edited_without_radarsim_says_so(saved: Path) -> None:
    sr.ignore_objects()
    try:
        bpy.ops.wm.open_mainfile(filepath=str(saved))
        bpy.data.objects["Wall"].location.x += 1.0
        bpy.ops.wm.save_mainfile()
    finally:
        sr.follow_objects()
    assert reopened(saved) == "The scene was edited after this run"


def test_a_run_that_is_gone_is_not_offered(saved: Path) -> None:
    shutil.rmtree(saved.parent / "run")
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    assert not sr.has_unseen_run()
    sr.ignore_objects()
    try:
        bpy.context.scene[sr._LAST_RUN] = "no JSON"
        bpy.ops.wm.save_mainfile()
    finally:
        sr.follow_objects()
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    assert not sr.has_unseen_run() and not sr._state.own


def test_a_file_that_was_measured_before_it_was_saved_shows_its_run(
    state: Any, tmp_path: Path
) -> None:
    """The run knows no file name; what the file keeps of it does."""
    rs.new_scene()
    apply_preset(bpy.context.scene, active_radar(bpy.context.scene), radar_preset("paper"))
    rs.add_plate(CAR_M, 2.0).name = "Car"
    view = settings(active_radar(bpy.context.scene))
    view.sampling_mode, view.replicates, view.pulses = "paths", 1, 16
    view.width_px = view.height_px = 16
    view.output_folder = str(tmp_path / "run")
    assert bpy.ops.radarsim.measure_and_show() == {"FINISHED"}
    path = tmp_path / "first.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert reopened(path) == ""
