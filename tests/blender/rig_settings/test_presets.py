# SPDX-License-Identifier: GPL-3.0-or-later
"""Radars to begin with: complete, within what such radars have, and the default of a new one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import blender as radarsim
from radarsim_addon import contract, signal
from radarsim_addon.blender.plan import PRESETS, radar_preset
from radarsim_addon.blender.rig_settings import (
    RADAR_SETTINGS,
    apply_preset,
    load_preset,
    read_link_budget,
    read_measurement,
    read_preset,
    save_preset,
    settings,
)
from radarsim_addon.blender.scene import active_radar, antennas_of, find_rig, setup_rig
from radarsim_addon.errors import ConfigError
from radarsim_addon.signal.radar import Weather, make_system
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender
C0_MPS = 299_792_458.0
#: Least and largest EIRP of such radars [dBm]. Vehicles: at most 55 (EN 301 091-1), 24 GHz: at most
#: 20 (EN 300 440). The others: power of the transmitter, 4 pi over the solid angle of the beam.
EIRP_DBM = {
    "automotive_77ghz": (25, 55), "short_range_77ghz": (20, 55), "long_range_77ghz": (30, 55),
    "doppler_24ghz": (10, 20), "marine_x_band": (80, 105), "surveillance_x_band": (80, 105),
    "sar_c_band": (60, 85), "paper": (89, 91),
}  # fmt: skip


@pytest.fixture
def scene(addon: Any) -> Iterator[Any]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    yield bpy.context.scene


def light_w(rig: Any) -> float:
    return float(next(item for item in rig.children if item.type == "LIGHT").data.energy)


def state(scene: Any, rig: Any) -> dict[str, Any]:
    """All settings, antennas, field of view and light."""
    view = settings(rig)
    found = {name: getattr(view, name) for name in RADAR_SETTINGS}
    preset = read_preset(scene, rig, "")
    light_and_lens = [f"{value:.5g}" for value in (preset.field_of_view_deg, preset.eirp_w or 0.0)]
    return {**found, **preset.settings, "light and lens": light_and_lens}


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_fits_together(scene: Any, name: str) -> None:
    rig = radarsim.add_radar(preset=name)
    measurement = read_measurement(scene, rig)
    radar = measurement.radar
    eirp_dbm = 10 * math.log10(light_w(rig)) + 30
    assert EIRP_DBM[name][0] <= eirp_dbm <= EIRP_DBM[name][1]
    assert measurement.range_stop_m <= radar.unambiguous_range_m
    camera = find_rig(scene, **antennas_of(scene, rig)).camera.data
    longer = max(measurement.width_px, measurement.height_px)
    assert longer <= 1024 and measurement.width_px * measurement.height_px < 600_000
    record = read_link_budget(rig, radar.waveform.wavelength_m)
    assert (record is None) == (name == "paper")
    if record is None:
        return
    assert f"EIRP {eirp_dbm:.0f} dBm" in PRESETS[name].description
    gain = make_system(record, radar.waveform.wavelength_m).transmitter.peak_gain
    assert light_w(rig) == pytest.approx(record.transmit_power_w * gain, rel=1e-6)
    # The camera sees all of the main beam.
    widths_deg = [
        2 * math.degrees(math.atan(math.tan(camera.angle / 2) * side / longer))
        for side in (measurement.width_px, measurement.height_px)
    ]
    beam = record.transmitter.parameters
    for width_deg, axis in zip(widths_deg, ("azimuth", "elevation"), strict=True):
        assert width_deg >= 1.25 * beam[f"{axis}_beamwidth_deg"]


def test_nobody_gets_a_megawatt(scene: Any) -> None:
    """A car of 10 m^2 at 50 m: 12 dBm, 17.06 dBi, by the radar equation."""
    by_script = radarsim.add_radar()
    assert bpy.ops.radarsim.setup_rig() == {"FINISHED"}
    by_button = active_radar(scene)
    assert by_button != by_script
    assert light_w(setup_rig(scene)) == 1.0
    wavelength_m, gain = C0_MPS / 77e9, 10**1.706
    for rig in (by_script, by_button):
        assert light_w(rig) == pytest.approx(0.016 * gain, rel=2e-3)
        record = read_link_budget(rig, wavelength_m)
        assert record is not None
        assert record.transmit_power_w == 0.016
        view = settings(rig)
        assert (view.waveform_kind, view.carrier_hz, view.use_link_budget) == ("fmcw", 77e9, True)


def test_a_preset_leaves_nothing_of_the_one_before(scene: Any) -> None:
    for before in PRESETS:
        for after in ("paper", "marine_x_band"):
            fresh = radarsim.add_radar(preset=after)
            expected = state(scene, fresh)
            rig = radarsim.add_radar(
                preset=before, idle_s=1e-6, transmit_loss_db=3.0,
                transmitter={"kind": "array", "row_taper": "hamming", "peak_gain_dbi": 3.0},
            )  # fmt: skip
            apply_preset(scene, rig, radar_preset(after))
            assert state(scene, rig) == expected


def test_how_a_run_is_made_stays(scene: Any) -> None:
    rig = radarsim.add_radar(frame_mode="scene", seed=7, max_reflections=3, rain_mm_per_h=5.0)
    apply_preset(scene, rig, radar_preset("sar_c_band"))
    view = settings(rig)
    assert (view.frame_mode, view.seed, view.max_reflections) == ("scene", 7, 3)
    assert view.rain_mm_per_h == 5.0


def test_a_saved_radar_comes_back(scene: Any, tmp_path: Path) -> None:
    rig = radarsim.add_radar(
        preset="long_range_77ghz", carrier_hz=76.512345678901e9, field_of_view_deg=33.0,
        receiver={"kind": "cosine", "exponent": 2.5, "beamwidth_deg": None},
    )  # fmt: skip
    expected = state(scene, rig)
    path = tmp_path / "mine.py"
    save_preset(path, read_preset(scene, rig, "Mine"))
    other = radarsim.add_radar(preset="paper")
    apply_preset(scene, other, load_preset(path))
    assert state(scene, other) == expected
    assert settings(other).carrier_hz == 76.512345678901e9


@pytest.mark.parametrize(
    "text",
    [
        "", "preset = ", "preset = [1]", "preset = {'label': 1}", "import os\nos.remove('x')",
        "preset = __import__('os').getcwd()", "preset = " + "(" * 5000,
        "preset = {'label': '', 'description': '', 'field_of_view_deg': 400.0}",
        "preset = {'label': '', 'description': '', 'field_of_view_deg': 40.0, 'settings': 3}",
    ],
)  # fmt: skip
def test_a_strange_file_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "strange.py"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match="holds no radar"):
        load_preset(path)


def test_files_from_before_keep_their_numbers(scene: Any, tmp_path: Path) -> None:
    """A radar whose settings nobody touched: what was the panel's default stays its value."""
    setup_rig(scene, eirp_w=1e6)
    path = str(tmp_path / "old.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    measurement = read_measurement(bpy.context.scene)
    waveform = measurement.waveform
    assert (waveform.kind, waveform.carrier_hz, waveform.bandwidth_hz) == ("lfm", 5.3e9, 50e6)
    assert (measurement.burst.prf_hz, measurement.burst.pulses) == (1000.0, 128)
    rig = active_radar(bpy.context.scene)
    assert not settings(rig).use_link_budget
    assert light_w(rig) == 1e6
    assert measurement.weather == Weather()


def test_range_limits_and_weather_go_along_with_the_run(scene: Any, tmp_path: Path) -> None:
    """10 mm/h take 5.50 and 5.95 dB/km at 70 and 80 GHz (table of P.838-3): 5.82 at 77 GHz."""
    rig = radarsim.add_radar(width_px=16, height_px=16, replicates=1, field_of_view_deg=20.0)
    radarsim.assign_material(rs.add_plate(20.0), radarsim.material(n=1e4, kappa=1e4, rms_slope=0.2))
    powers = []
    for name, rain in (("dry", 0.0), ("rain", 10.0)):
        run = radarsim.measure(
            rig, tmp_path / name, frames=[1], range_stop_m=60.0, rain_mm_per_h=rain
        )
        assert run.range_limits_m == (0.0, 60.0)
        (result,) = radarsim.process(run, signal.ProcessOptions(plots=False, products=False))
        assert result.profile.range_m[-1] == pytest.approx(60.0, abs=0.5)
        powers.append(result.budget.received_w)
    taken_db = 10 * math.log10(powers[0] / powers[1])
    assert taken_db == pytest.approx(5.82 * 2 * 20.0 / 1000, rel=0.01)


@pytest.mark.parametrize(("start_m", "stop_m"), [(10.0, 0.0), (10.0, 10.0), (20.0, 5.0)])
def test_range_limits_must_have_an_order(scene: Any, start_m: float, stop_m: float) -> None:
    radarsim.add_radar(range_start_m=start_m, range_stop_m=stop_m)
    with pytest.raises(ConfigError, match="stop beyond the start"):
        read_measurement(scene)


def test_the_level_of_the_light_changes_no_power(scene: Any, tmp_path: Path) -> None:
    """0.8 W in place of 1 MW: with a link budget both give the same watts, in two reflections."""
    rig = radarsim.add_radar(
        width_px=24, height_px=24, replicates=1, max_reflections=2, motion="off",
        field_of_view_deg=40.0,
    )  # fmt: skip
    rough = radarsim.material(n=1e4, kappa=1e4, rms_slope=0.3)
    radarsim.assign_material([rs.add_plate(10.0, tilt_deg=tilt) for tilt in (40, -40)], rough)
    light = next(item for item in rig.children if item.type == "LIGHT").data
    found = []
    for watts in (light.energy, 1e6):
        light.energy = watts
        run = radarsim.measure(rig, tmp_path / f"{watts:.0f}", frames=[1])
        table = np.load(run.frame(1).path / contract.PATHS_TABLE)
        found.append(table["power_w"] / watts)
    assert found[0].size == found[1].size > 100
    np.testing.assert_allclose(found[0], found[1], rtol=2e-6)
