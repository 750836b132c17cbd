# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface for scripts, as the documentation shows it."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bpy")

import bpy

import radarsim_addon
from radarsim_addon import blender as radarsim
from radarsim_addon import signal
from radarsim_addon.blender import rig_settings
from radarsim_addon.blender.materials import read_surface
from radarsim_addon.blender.materials.physical_materials import medium_of
from radarsim_addon.blender.nodes.groups import group_input, group_node
from radarsim_addon.blender.rig_settings import read_link_budget, read_measurement
from radarsim_addon.errors import ConfigError, SceneError, SettingNameError
from radarsim_addon.signal.paths import read_paths_record
from radarsim_addon.signal.radar import make_system
from tests.blender import radar_scenes as rs

QUIET = signal.ProcessOptions(plots=False)


@pytest.fixture
def empty() -> Iterator[Any]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    yield bpy.context.scene
    rig_settings.unregister()


def wall(y: float) -> Any:
    return rs.add_plate(y, preset=None)


def test_a_radar_measures_a_wall(
    empty: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    rig = radarsim.add_radar(
        location=(0, 0, 1.5),
        look_at=(0, 50, 1.5),
        field_of_view_deg=40,
        preset="automotive_77ghz",
        pulses=8,
        width_px=24,
        height_px=24,
    )
    target = wall(20.0)
    target.location.z = 1.5
    metal = radarsim.material(name="Plate", n=1e4, kappa=1e4, rms_slope=0.2)
    assert radarsim.assign_material(target, metal) == [target]
    seen: list[float] = []

    def progress(fraction: float) -> None:
        seen.append(fraction)
        print(f"at {fraction:.3f}")

    run = radarsim.measure(rig, tmp_path / "run", frames=[1], progress=progress)
    # Blender's own words are kept off the console, those of the caller are not
    printed = capfd.readouterr().out.split("\n")
    assert [line for line in printed if line.startswith("at ")] == [f"at {f:.3f}" for f in seen]
    assert isinstance(run, signal.Run)
    assert seen and seen[-1] == pytest.approx(1.0)
    assert run.radar.waveform.carrier_hz == 77e9
    assert (run.record.width_px, run.radar.burst.pulses) == (24, 8)
    (result,) = radarsim.process(run, QUIET)
    peak = result.profile.range_m[np.argmax(result.profile.power)]
    assert peak == pytest.approx(20.0, abs=0.5)  # c / 2B
    assert not list(tmp_path.rglob("*.png"))


@pytest.mark.parametrize("value", [77e9, 5.3e9, 76.543_210_987e9, math.pi * 1e9])
def test_settings_keep_float64(empty: Any, value: float) -> None:
    rig = radarsim.add_radar()
    radarsim.settings(rig).carrier_hz = value
    assert radarsim.settings(rig).carrier_hz == value


def test_two_radars_each_have_their_settings(empty: Any) -> None:
    one, two = radarsim.add_radar(carrier_hz=5.3e9), radarsim.add_radar((5, 0, 0), carrier_hz=77e9)
    assert radarsim.settings(one).carrier_hz == 5.3e9
    assert radarsim.settings(two).carrier_hz == 77e9


def test_a_radar_is_measured_whichever_is_active(empty: Any, tmp_path: Path) -> None:
    size = {"width_px": 8, "height_px": 8, "replicates": 1, "field_of_view_deg": 40.0}
    near = radarsim.add_radar((0, 0, 0), **size)
    far = radarsim.add_radar((0, -10, 0), **size)
    radarsim.assign_material(wall(20.0), radarsim.material(n=1e4, kappa=1e4, rms_slope=0.2))
    for rig, range_m in ((near, 20.0), (far, 30.0)):
        run = radarsim.measure(rig, tmp_path / f"{range_m:g}", frames=[1])
        paths = signal.frame_paths(run.frame(1))
        assert paths.range_m.min() == pytest.approx(range_m, abs=0.05)


def test_look_at(empty: Any) -> None:
    rig = radarsim.add_radar((1.0, 2.0, 3.0), look_at=(4.0, 6.0, 3.0))
    bpy.context.view_layer.update()
    ahead = -np.array(rig.matrix_world.to_3x3())[:, 2]
    np.testing.assert_allclose(ahead, [0.6, 0.8, 0.0], atol=1e-6)
    up = np.array(rig.matrix_world.to_3x3())[:, 1]
    np.testing.assert_allclose(up, [0.0, 0.0, 1.0], atol=1e-6)


WRONG: list[tuple[Any, type[Exception], str]] = [
    (lambda: radarsim.add_radar(preset="x_band"), ConfigError, "automotive_77ghz"),
    (lambda: radarsim.add_radar(carier_hz=77e9), ConfigError, "carrier_hz"),
    (lambda: radarsim.add_radar(carrier_hz=-1.0), ConfigError, "arrier"),
    (lambda: radarsim.add_radar(field_of_view_deg=200), ConfigError, "less than 180"),
    (lambda: radarsim.add_radar((1, 1, 1), look_at=(1, 1, 1)), ConfigError, "same point"),
    (lambda: radarsim.material(), ConfigError, "needs a medium or n"),
    (lambda: radarsim.material("itu_concrete", n=2.0), ConfigError, "not both"),
    (lambda: radarsim.material("itu_concrte"), ConfigError, "concrete"),
    (lambda: radarsim.material("2"), ConfigError, "no material '2'"),
    (lambda: radarsim.material(2), ConfigError, "Medium is 2; expected a name"),
    (lambda: radarsim.material("concrete", kappa=0.1), ConfigError, "Leave out kappa"),
    (lambda: radarsim.material(n=0), ConfigError, "has the index 0"),
    (lambda: radarsim.material(n="2"), ConfigError, "'2'; expected a number"),
    (lambda: radarsim.material(n=[1, 2]), ConfigError, "expected one number"),
    (lambda: radarsim.material(n=2 + 1j), ConfigError, "expected a number"),
    (lambda: radarsim.material("metal", name=5), ConfigError, "expected text"),
    (lambda: radarsim.material("metal", rms_slope="1"), ConfigError, "rms_slope is '1'"),
    (lambda: radarsim.add_radar((math.nan, 0, 0)), ConfigError, "three finite numbers"),
    (lambda: radarsim.add_radar((0, 0)), ConfigError, "three finite numbers"),
    (lambda: radarsim.settings(None), SceneError, "add_radar"),
    (lambda: radarsim.settings("Radar"), SceneError, "add_radar"),
    (lambda: radarsim.assign_material([], "concrete"), SceneError, "no material"),
    (
        lambda: radarsim.assign_material("Cube", radarsim.material("metal")),
        SceneError,
        "no object",
    ),
    (
        lambda: radarsim.assign_material([], radarsim.material("metal")),
        SceneError,
        "can have a Radar Material",
    ),
]


def test_what_is_wrong_is_named_and_nothing_is_left(empty: Any, subtests: pytest.Subtests) -> None:
    for call, error, message in WRONG:
        with subtests.test(message):
            with pytest.raises(error, match=message):
                call()
            assert not bpy.data.objects
            assert not bpy.data.lights and not bpy.data.cameras


@pytest.mark.parametrize("frames", [[], 1, [1.5], "1:3"])
def test_frames_that_are_none_are_refused(empty: Any, tmp_path: Path, frames: Any) -> None:
    rig = radarsim.add_radar()
    with pytest.raises(ConfigError, match="whole numbers"):
        radarsim.measure(rig, tmp_path / "run", frames=frames)


def test_a_file_opened_before_the_interface_is_used(empty: Any, tmp_path: Path) -> None:
    radarsim.add_radar(carrier_hz=77e9, width_px=8, height_px=8, replicates=1, pulses=4)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "radar.blend"))
    rig_settings.unregister()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "radar.blend"))
    run = radarsim.measure(bpy.data.objects["Radar"], tmp_path / "run", frames=[1])
    assert run.radar.waveform.carrier_hz == 77e9


def test_other_objects_are_no_radars(empty: Any) -> None:
    radarsim.add_radar()
    with pytest.raises(SceneError, match="'Plate' is no radar"):
        radarsim.settings(wall(10.0))


def test_unknown_settings_of_a_measurement_are_refused(empty: Any, tmp_path: Path) -> None:
    rig = radarsim.add_radar()
    with pytest.raises(ConfigError, match="width_px"):
        radarsim.measure(rig, tmp_path / "run", widht_px=8)
    assert not (tmp_path / "run").exists()


def test_settings_without_a_field_in_the_window_are_taken(empty: Any, tmp_path: Path) -> None:
    rig = radarsim.add_radar(width_px=16, height_px=16, pulses=1)
    wall(3.0)
    run = radarsim.measure(rig, tmp_path / "run", frames=[1], tile_px=8, replicates=1)
    assert read_paths_record(run.frame(1).path, 1).tiles == 4  # 16 pixels a side, 8 a tile


def test_the_interface_shows_what_there_is(empty: Any) -> None:
    assert {"blender", "signal", "physics", "__version__"} <= set(dir(radarsim_addon))
    assert radarsim_addon.signal is signal and radarsim_addon.blender is radarsim
    assert dir(radarsim) == sorted(radarsim.__all__)
    for name in radarsim.__all__:
        assert callable(getattr(radarsim, name))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = radarsim_addon.nothing


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("cariier_hz", r"did you mean carrier_hz\?"),
        ("carrier_ghz", r"did you mean carrier_hz\?"),
        ("azimuth_beamwidth_deg", r"such as settings\(rig\)\.transmitter\.azimuth_beamwidth_deg"),
        ("range_taper", r"signal\.ProcessOptions\(range_taper=\.\.\.\)"),
        ("frames", r"measure\(frames=\.\.\.\)"),
        ("look_at", r"add_radar\(look_at=\.\.\.\)"),
        ("rms_slope", r"material\(rms_slope=\.\.\.\)"),
        ("nothing_like_it", "docs/settings.md lists them"),
    ],
)
def test_names_that_are_no_settings_are_told_where_they_belong(
    empty: Any, tmp_path: Path, name: str, hint: str
) -> None:
    rig = radarsim.add_radar()
    with pytest.raises(SettingNameError, match=hint):
        setattr(radarsim.settings(rig), name, 1)
    if name not in ("frames", "range_taper"):
        with pytest.raises(SettingNameError, match=hint):
            radarsim.measure(rig, tmp_path / "run", **{name: 1})
        assert not (tmp_path / "run").exists()


def test_a_misspelt_argument_of_a_material_is_named(empty: Any) -> None:
    with pytest.raises(ConfigError, match=r"no argument 'rms_slop'; did you mean rms_slope\?"):
        radarsim.material("concrete", rms_slop=0.2)


def test_simple_and_impenetrable_materials(empty: Any) -> None:
    """Waves enter where the Volume is linked; a preset is the file's one."""

    metal = radarsim.simple_material("metal")
    assert radarsim.simple_material("metal") is metal and not read_surface(metal).has_interior
    own = radarsim.simple_material(name="Own", n=2.0, kappa=0.1, specularity=0.3, roughness=0.6)
    values = [socket.default_value for socket in group_node(own).inputs][:4]
    assert own.name == "Own" and values == pytest.approx([2.0, 0.1, 0.3, 0.6], rel=1e-6)
    assert (
        read_surface(own).has_interior
        and not read_surface(radarsim.simple_material(n=2.0, penetrable=False)).has_interior
    )
    assert read_surface(radarsim.material("concrete")).has_interior
    assert not read_surface(radarsim.material("concrete", penetrable=False)).has_interior
    for wrong in ({}, {"preset": "metal", "n": 2.0}, {"preset": "metal", "roughness": 0.1}):
        with pytest.raises(ConfigError, match="preset"):
            radarsim.simple_material(**wrong)


def test_a_medium_is_evaluated_at_the_carrier_of_the_radar_and_of_each_measurement(
    empty: Any, tmp_path: Path
) -> None:
    """Ground, ITU-R P.2040: n falls with the carrier."""
    rig = radarsim.add_radar(preset="paper", width_px=8, height_px=8)
    ground = radarsim.material("itu_medium_dry_ground", rms_slope=0.3)

    def index() -> float:
        return float(group_input(ground, "Index of Refraction").default_value)

    at_5_ghz = medium_of(ground).index(5.3e9).real
    at_9_ghz = medium_of(ground).index(9.4e9).real
    assert at_5_ghz - at_9_ghz > 0.05
    assert index() == pytest.approx(at_5_ghz, rel=1e-6)
    radarsim.settings(rig).carrier_hz = 9.4e9
    assert index() == pytest.approx(at_9_ghz, rel=1e-6)


def test_separate_antennas_and_their_lengths_at_every_pulse(empty: Any, tmp_path: Path) -> None:
    """A plate that moves along y: both legs, from its points at every pulse."""
    rig = radarsim.add_radar(
        (0, 0, 0),
        (0, 40, 0),
        field_of_view_deg=4,
        preset="paper",
        width_px=16,
        height_px=16,
        sampling_mode="paths",
        prf_hz=500,
        pulses=5,
    )
    bpy.context.view_layer.update()
    receiver, transmitter = radarsim.antennas(rig)
    assert (receiver.type, transmitter.type) == ("CAMERA", "LIGHT")
    transmitter.matrix_parent_inverse = rig.matrix_world.inverted()
    transmitter.location = (30, 0, 0)
    plate = rs.add_plate(40.0, 0.5, preset=None)
    radarsim.assign_material(plate, radarsim.material("metal", rms_slope=0.3))
    plate.driver_add("location", 1).driver.expression = "39 + frame"
    run = radarsim.measure(rig, tmp_path / "run", frames=[1])
    paths = signal.frame_paths(run.frame(1))
    times_s = signal.pulse_times_s(run.radar)
    assert times_s == pytest.approx(np.arange(5) / 500)
    lengths_m = paths.lengths_at_m(times_s)
    assert lengths_m.shape == (len(paths), 5) and len(paths)
    assert lengths_m.mean() == pytest.approx(40 + 50, abs=0.2)
    speed_mps = float(bpy.context.scene.render.fps)  # 1 m per frame
    points = paths.geometry.last_scatterer_m[:, None] + np.multiply.outer(
        times_s, [0.0, speed_mps, 0.0]
    )
    legs = np.linalg.norm(points, axis=-1) + np.linalg.norm(points - [30, 0, 0], axis=-1)
    assert lengths_m == pytest.approx(legs, abs=2e-5)


def test_link_budgets_are_made_by_public_names(empty: Any, tmp_path: Path) -> None:
    """Twice the watts are 3 dB."""
    rig = radarsim.add_radar(preset="automotive_77ghz", width_px=8, height_px=8, pulses=2)
    wall(10.0)
    run = radarsim.measure(rig, tmp_path / "run", frames=[1])
    powers = []
    for watts in (1.0, 2.0):
        horn = signal.AntennaRecord("cosine", {"exponent": 2.0})
        budget = signal.LinkBudget(transmit_power_w=watts, transmitter=horn)
        options = signal.ProcessOptions(link_budget=budget, plots=False, products=False)
        (result,) = radarsim.process(run, options, out=tmp_path / f"{watts}")
        powers.append(result.budget.objects[0].power_dbm)
    assert powers[1] - powers[0] == pytest.approx(10 * math.log10(2), abs=1e-6)


def test_library_media_follow_the_carrier(empty: Any) -> None:
    radarsim.add_radar(preset="automotive_77ghz")
    assert radarsim.material("itu_concrete").name == "Radar concrete"


def test_the_automotive_preset_has_the_power_of_such_radars(empty: Any) -> None:
    """EIRP of 12 dBm and 17 dB, far below the 55 dBm of EN 301 091-1; a car of 10 m^2 at 100 m
    has an SNR of 30 dB over a burst, by the radar equation."""
    rig = radarsim.add_radar(preset="automotive_77ghz")
    measurement = read_measurement(bpy.context.scene, rig)
    wavelength_m = measurement.waveform.wavelength_m
    record = read_link_budget(rig, wavelength_m)
    assert record is not None
    gain = make_system(record, wavelength_m).transmitter.peak_gain
    eirp_dbm = 10 * math.log10(record.transmit_power_w * gain) + 30
    assert eirp_dbm == pytest.approx(29.1, abs=0.2)
    received_w = record.transmit_power_w * gain**2 * wavelength_m**2 * 10
    received_w /= (4 * math.pi) ** 3 * 100**4
    burst_s = 256 * 256 / 20e6  # chirps times samples over their rate
    noise_w = 1.380649e-23 * 290 * 10**1.5 / burst_s
    assert 10 * math.log10(received_w / noise_w) == pytest.approx(30, abs=1)


def test_importing_the_interface_imports_no_bpy(root: Path) -> None:
    code = (
        "import sys\nfrom radarsim_addon import blender as radarsim\n"
        "assert 'bpy' not in sys.modules\n"
        "assert set(radarsim.__all__) <= {*dir(radarsim), *radarsim.__all__}\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
