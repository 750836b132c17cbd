# SPDX-License-Identifier: GPL-3.0-or-later
"""Registration, operators, settings, pictures; the interactive job driven by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.ui import interactive, panels, pictures, results
from radarsim_addon.blender.ui.interactive import InteractiveRender
from radarsim_addon.errors import ConfigError, FrameFileError, OutputError
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


@pytest.fixture
def scene(addon: Any) -> Any:
    """The add-on registered, and a radar before a plate."""
    made = rs.new_scene()
    rs.add_plate(10.0)
    settings = rs.radar()
    settings.sampling_mode = "rings"
    settings.ring_step_m, settings.samples = 4.0, 1
    settings.width_px = settings.height_px = 32
    return made


def registered() -> set[str]:
    """All that the add-on shows to Blender."""
    found = {name for name in dir(bpy.types) if "radarsim" in name.lower()}
    found |= {f"ops.{name}" for name in dir(bpy.ops.radarsim)}
    for owner in (bpy.types.Object, bpy.types.WindowManager):
        if hasattr(owner, "radarsim"):
            found.add(f"{owner.__name__}.radarsim")
    return found


def test_registering_twice_and_unregistering(bpy: Any) -> None:
    import radarsim_addon

    before = registered()
    radarsim_addon.register()
    once = registered()
    assert {"Object.radarsim", "WindowManager.radarsim", "ops.render_frames"} <= once
    assert "RADARSIM_PT_render" in once
    radarsim_addon.register()
    assert registered() == once
    radarsim_addon.unregister()
    assert registered() == before
    radarsim_addon.unregister()
    radarsim_addon.register()
    assert registered() == once
    radarsim_addon.unregister()
    assert registered() == before


def test_every_class_has_a_description_and_every_setting_a_tooltip(addon: Any) -> None:
    from radarsim_addon.blender.ui import link_budget_panel as system_panel
    from radarsim_addon.blender.ui import operators

    operator_classes: tuple[Any, ...] = (*operators.CLASSES, *system_panel.CLASSES[:2])
    panel_classes: tuple[Any, ...] = (*panels.RADAR_CLASSES, *panels.RUN_CLASSES)
    assert all(item.__doc__ and item.bl_label for item in operator_classes)
    assert all(item.bl_category == "Radar" for item in panel_classes)
    groups = (
        bpy.types.Object.bl_rna.properties["radarsim"].fixed_type,
        bpy.types.WindowManager.bl_rna.properties["radarsim"].fixed_type,
        bpy.types.Object.bl_rna.properties["radarsim"].fixed_type.properties["receiver"].fixed_type,
    )
    for group in groups:
        for prop in group.properties:
            if prop.identifier not in ("rna_type", "name"):
                assert prop.description, prop.identifier


def test_settings_are_what_was_typed(scene: Any) -> None:
    settings = rs.radar()
    settings.carrier_ghz, settings.bandwidth_mhz = 77.1, 153.3
    settings.chirp_duration_us, settings.sampling_rate_mhz = 12.3, 160.7
    settings.prf_hz, settings.snapshot_interval_ms = 1234.5, 7.1
    found = properties.read_measurement(scene)
    assert found.waveform.carrier_hz == 77.1e9
    assert found.waveform.bandwidth_hz == 153.3e6
    assert found.waveform.duration_s == 12.3e-6
    assert found.waveform.sampling_rate_hz == 160.7e6
    assert found.burst.prf_hz == 1234.5
    assert found.snapshot_interval_s == 7.1e-3


def test_defaults_are_the_paper(scene: Any) -> None:
    view = properties.settings(bpy.data.objects["Radar"])
    view.ring_step_m, view.rings = 250.0, 21
    found = properties.read_measurement(scene)
    assert (found.rings, found.ring_step_m, found.snapshots, found.snapshot_interval_s) == (
        21,
        250.0,
        2,
        0.01,
    )
    assert found.waveform == rs.WAVEFORM
    assert found.burst == rs.BURST
    settings = rs.radar()
    assert settings.fm_rate_mhz_per_us == pytest.approx(20.0)
    settings.chirp_duration_us, settings.fm_rate_mhz_per_us = 2.3, 20.0
    assert properties.read_measurement(scene).waveform.bandwidth_hz == 46e6


def test_frames_from_the_settings(scene: Any) -> None:
    settings = rs.radar()
    scene.frame_set(5)
    assert properties.read_measurement(scene).frames == (5,)
    settings.frame_mode = "range"
    settings.frame_start, settings.frame_end, settings.frame_step = 2, 7, 2
    assert properties.read_measurement(scene).frames == (2, 4, 6)
    settings.frame_end = 1
    with pytest.raises(ConfigError, match="Frames 2 to 1 are none"):
        properties.read_measurement(scene)
    settings.frame_mode = "scene"
    scene.frame_start, scene.frame_end, scene.frame_step = 10, 12, 1
    assert properties.read_measurement(scene).frames == (10, 11, 12)


def test_extinction_length(scene: Any) -> None:
    settings = rs.radar()
    assert properties.read_measurement(scene).extinction_length_m == 0.0
    settings.extinction_length_m = 525.0
    assert properties.read_measurement(scene).extinction_length_m == 525.0
    settings.extinction = "wavelength"
    assert properties.read_measurement(scene).extinction_length_m == 299792458 / 5.3e9


def test_command_line_overrides_the_settings_in_float64(scene: Any) -> None:
    found = properties.read_measurement(
        scene, carrier_hz=76.123456789e9, rings=3, snapshots=1, frames=(1, 2)
    )
    assert found.waveform.carrier_hz == 76.123456789e9
    assert (found.rings, found.snapshots, found.frames, found.burst.prf_hz) == (
        3,
        1,
        (1, 2),
        1000.0,
    )
    with pytest.raises(ConfigError, match="Number of rings is -1"):
        properties.read_measurement(scene, rings=-1)


def test_unsaved_file_has_no_relative_folder(scene: Any) -> None:
    with pytest.raises(OutputError, match="never saved"):
        properties.output_folder(bpy.data.objects["Radar"])
    rs.radar().output_folder = " "
    with pytest.raises(OutputError, match="No output folder"):
        properties.output_folder(bpy.data.objects["Radar"])


def test_render_and_process_operators(
    scene: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    rs.radar().output_folder = str(tmp_path)
    assert bpy.ops.radarsim.render_frames() == {"FINISHED"}
    assert "6/6 renders, 100 %" in capfd.readouterr().out
    assert len(list(tmp_path.rglob("ring_*.exr"))) == 6
    assert bpy.ops.radarsim.process_last_run() == {"FINISHED"}
    for name in (results.MAP_IMAGE, results.PROFILE_IMAGE):
        image = bpy.data.images[name]
        assert tuple(image.size) == (pictures.WIDTH, pictures.HEIGHT)
        assert image.packed_file is not None
        pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        assert pixels.min() < 0.2 < 0.9 < pixels.max()
    assert bpy.ops.radarsim.process_last_run() == {"FINISHED"}
    assert sum(image.name.startswith("Radar ") for image in bpy.data.images) == 2


def test_operators_report_named_errors(scene: Any, tmp_path: Path) -> None:
    """In the background an error report is raised as RuntimeError with its text."""
    rs.radar().output_folder = str(tmp_path / "none" / "run")
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.radarsim.render_frames()
    with pytest.raises(RuntimeError, match="contains no run"):
        bpy.ops.radarsim.process_last_run()
    with pytest.raises(RuntimeError, match="does not exist yet"):
        bpy.ops.radarsim.open_output()
    rs.radar().output_folder = str(tmp_path)
    rs.radar().snapshot_interval_ms = 0.0
    with pytest.raises(RuntimeError, match=r"Snapshot interval is 0\.0 s"):
        bpy.ops.radarsim.render_frames()


def test_set_up_and_assign_operators(addon: Any) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.cursor.location = (1, 2, 3)
    assert bpy.ops.radarsim.setup_rig() == {"FINISHED"}
    empty = bpy.data.objects["Radar"]
    assert tuple(empty.location) == (1, 2, 3)
    assert bpy.context.selected_objects == [empty]
    bpy.ops.mesh.primitive_cube_add()
    assert bpy.ops.radarsim.assign_material(preset="metal") == {"FINISHED"}
    assert panels.echoes(bpy.context.object)


# -- the interactive job ---------------------------------------------------------------------------


def handler_counts() -> dict[str, int]:
    return {
        name: len(getattr(bpy.app.handlers, name))
        for name in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, name), list)
    }


@pytest.fixture
def interactive_run(scene: Any, tmp_path: Path) -> Any:
    """A prepared run, driven tick by tick (without a window renders end within the tick)."""
    handlers = handler_counts()
    display = bpy.context.preferences.view.render_display_type
    job = rs.job_for(tmp_path)
    job.prepare()
    run = InteractiveRender(job, bpy.context.preferences)
    assert bpy.context.preferences.view.render_display_type == "NONE"
    yield run
    run.close()
    assert job.unrestored == []
    assert handler_counts() == handlers
    assert bpy.context.preferences.view.render_display_type == display
    scene = bpy.context.scene  # a test may have loaded a file
    assert attributes.ATTR_RING_MAX not in scene
    assert scene.render.resolution_x == 1920


def test_ticks_render_everything(interactive_run: Any, tmp_path: Path) -> None:
    ticks = 0
    while not interactive_run.tick():
        ticks += 1
        assert ticks < 100
    assert interactive_run.stop_reason == ""
    assert interactive_run.job.done == interactive_run.job.total == 3
    assert len(list(tmp_path.rglob("ring_*.json"))) == 3


def test_esc_stops_after_the_running_render_and_the_run_goes_on(
    interactive_run: Any, tmp_path: Path
) -> None:
    assert not interactive_run.tick()
    interactive_run.request_stop("stopped by Esc")
    assert interactive_run.tick()
    assert interactive_run.job.done == 1
    interactive_run.close()
    assert interactive_run.tick()
    assert rs.run(tmp_path).done == 3


def test_a_moment_at_which_blender_refuses_changes_is_waited_for(
    interactive_run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    touch = interactive_run.job.touch
    touch()
    refusals = iter(range(5))

    def touch_later() -> None:
        if next(refusals, None) is not None:
            raise AttributeError("Writing to ID classes in this context is not allowed")
        touch()

    monkeypatch.setattr(interactive_run.job, "touch", touch_later)
    for _ in range(5):
        assert not interactive_run.tick()
        assert interactive_run.rendering is None
    assert not interactive_run.tick()
    assert interactive_run.rendering is not None


def test_cancelled_render_stops_the_run(
    interactive_run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Esc during a render reaches Blender's own render job, which calls render_cancel."""
    assert not interactive_run.tick()
    interactive_run._ended = ""
    bpy.app.handlers.render_cancel[-1](bpy.context.scene, None)
    assert interactive_run.tick()
    assert interactive_run.stop_reason == "cancelled"
    assert not list(tmp_path.rglob("ring_*.json"))


def test_a_render_that_vanishes_is_named(
    interactive_run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(interactive, "_PATIENCE_TICKS", 3)
    assert not interactive_run.tick()
    interactive_run._ended = ""
    with pytest.raises(interactive.RenderError, match="without a message"):
        for _ in range(10):
            interactive_run.tick()


def test_saving_in_the_middle_saves_the_users_settings(
    interactive_run: Any, tmp_path: Path
) -> None:
    interactive_run.tick()
    path = tmp_path / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert interactive_run.closed
    assert interactive_run.tick()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    assert scene.render.resolution_x == 1920
    assert attributes.ATTR_RING_MAX not in scene


def test_processing_needs_a_whole_run(scene: Any, tmp_path: Path) -> None:
    rs.run(tmp_path, limit=1)
    job = results.ProcessingJob(tmp_path)
    with pytest.raises(FrameFileError, match="lacks"):
        while not job.step():
            pass


# -- pictures --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("low", "high", "about", "expected"),
    [
        (0, 5250, 8, [0, 1000, 2000, 3000, 4000, 5000]),
        (-500, 492.2, 8, [-400, -200, 0, 200, 400]),
        (0.0, 0.003, 3, [0.0, 0.001, 0.002, 0.003]),
        (5, 5, 4, [5]),
    ],
)
def test_ticks_are_round(low: float, high: float, about: int, expected: list[float]) -> None:
    np.testing.assert_allclose(pictures.nice_ticks(low, high, about), expected, atol=1e-12)


def test_shrinking_keeps_single_dots() -> None:
    values = np.zeros((7, 5000))
    values[3, 1234] = 1.0
    small = pictures.resample_max(values, 100, 1)
    assert small.shape == (7, 100)
    assert small[3, 1234 * 100 // 5000] == 1.0
    assert small.sum() == 1.0
    assert pictures.resample_max(np.arange(3.0), 6, 0).tolist() == [0, 0, 1, 1, 2, 2]


def test_map_shows_a_dot_where_it_is() -> None:
    """A receding target at 1750 m: left of the middle, a third up, in the brightest colour."""
    range_m = np.arange(0.0, 5250.0, 1.25)
    doppler_hz = (np.arange(128) - 64) * 1000 / 128
    power_db = np.full((128, range_m.size), -150.0)
    row, column = 64 - 45, 1400
    power_db[row, column] = -80.0
    picture = pictures.draw_map(range_m, doppler_hz, power_db, 0.05657, "Map")
    assert picture.shape == (pictures.HEIGHT, pictures.WIDTH, 3)
    area = picture[pictures.TOP + 1 : -pictures.BOTTOM - 1, pictures.LEFT + 1 : -pictures.RIGHT - 1]
    yellow = np.array([0.993, 0.906, 0.144])  # the upper end of viridis
    places = np.argwhere(np.abs(area - yellow).max(axis=2) < 0.01)
    assert 0 < len(places) < 50
    y, x = places.mean(axis=0)
    assert x / area.shape[1] == pytest.approx((row + 0.5) / 128, abs=0.01)
    assert 1 - y / area.shape[0] == pytest.approx(range_m[column] / 5250, abs=0.01)
    # Axes have numbers: ink in the margins.
    assert (picture[-pictures.BOTTOM + 8 :, pictures.LEFT : -pictures.RIGHT] < 0.5).any()
    assert (picture[pictures.TOP : -pictures.BOTTOM, : pictures.LEFT - 8] < 0.5).any()


def test_empty_map_and_profile_can_be_drawn() -> None:
    axis = np.arange(10.0)
    for picture in (
        pictures.draw_map(axis, axis - 5, np.full((10, 10), -300.0), 0.05, "Empty"),
        pictures.draw_profile(axis, np.zeros(10), "Empty"),
    ):
        assert np.isfinite(picture).all()
    plain = np.ones_like(picture[300:500, 400:700])
    words = picture[pictures.TOP + 100 : -pictures.BOTTOM - 100, 500:620]
    assert words.min() < 0.3 and plain.min() == 1.0  # "no echo" in the middle


def test_one_pulse_has_no_doppler_numbers() -> None:
    power_db = np.full((1, 10), -80.0)
    one = pictures.draw_map(np.arange(10.0), np.zeros(1), power_db, 0.05, "One")
    burst = pictures.draw_map(
        np.arange(10.0), np.arange(4.0) - 2, np.repeat(power_db, 4, axis=0), 0.05, "Burst"
    )
    ticks = np.s_[-pictures.BOTTOM + 8 : -pictures.BOTTOM + 30, pictures.LEFT : -pictures.RIGHT]
    assert (burst[ticks] < 0.5).any() and not (one[ticks] < 0.5).any()
    above = np.s_[pictures.TOP - 55 : pictures.TOP - 8, pictures.LEFT : -pictures.RIGHT]
    assert (burst[above] < 0.5).any() and not (one[above] < 0.5).any()


def test_text_is_as_wide_as_its_letters() -> None:
    both = pictures.text_mask("AB").shape[1]
    assert both == pictures.text_mask("A").shape[1] + pictures.text_mask("B").shape[1]
    assert pictures.text_mask("").shape[1] == 0
    np.testing.assert_array_equal(pictures.text_mask("雷"), pictures.text_mask("?"))
