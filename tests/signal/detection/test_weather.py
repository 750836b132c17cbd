# SPDX-License-Identifier: GPL-3.0-or-later
"""Weather takes 10^(-gamma L / 10) of each path's power, with and without a link budget."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.errors import ConfigError
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.detection import FrameBudget
from radarsim_addon.signal.paths import path_power_w
from radarsim_addon.signal.pipeline import ProcessOptions, main, process_frame
from radarsim_addon.signal.radar import Radar, Weather
from radarsim_addon.signal.runs import open_run
from tests.signal import path_runs as pr

RANGE_M = 1000.0
CARRIER_HZ = 77e9
#: Attenuation of 10 mm/h at 77 GHz, horizontal polarisation [dB/km]: ITU-R P.838-3 by another code.
RAIN_DB_PER_KM = 5.90902
RADAR = Radar(dataclasses.replace(pr.WAVEFORM, carrier_hz=CARRIER_HZ), pr.BURST)
RAIN = Weather(rain_mm_per_h=10.0, rain_polarisation="horizontal")


def _run(folder: Path, link_budget: contract.LinkBudget | None) -> Path:
    receiver = pr.camera(pr.pose((0, 0, 0)), 0.5)
    emitter = contract.TransmitterRecord(pr.pose((0, 0, 0)), 250.0)
    rows = pr.trace([pr.plate("Plate", (0, RANGE_M, 0), 10.0)], receiver, emitter, 16)
    return pr.write_run(
        folder, rows, ["Plate"], receiver, emitter, range_limits_m=2 * RANGE_M, system=link_budget
    )


@pytest.mark.parametrize("link_budget", [None, contract.LinkBudget(transmit_power_w=3.0)])
def test_rain_takes_its_decibels_of_every_path_and_product(
    tmp_path: Path, link_budget: contract.LinkBudget | None
) -> None:
    folder = _run(tmp_path / "run", link_budget)
    run = open_run(folder)
    clear, wet = (
        process_frame(options.open(run.frame(1)), options)
        for weather in (Weather(), RAIN)
        for options in [ProcessOptions(weather=weather, radar=RADAR).for_run(run)]
    )
    lost = 10 ** (-RAIN_DB_PER_KM * 2 * RANGE_M / 1e4)
    assert wet.budget.received_w / clear.budget.received_w == pytest.approx(lost, rel=2e-4)
    assert wet.rd_map.plane_power.max() / clear.rd_map.plane_power.max() == pytest.approx(
        lost, rel=2e-4
    )
    assert wet.profile.power.sum() / clear.profile.power.sum() == pytest.approx(lost, rel=2e-4)
    (seen,), (before,) = wet.budget.objects, clear.budget.objects
    assert seen.power_w / before.power_w == pytest.approx(lost, rel=2e-4)
    assert seen.rcs_m2 == before.rcs_m2
    codes = {item.code for item in wet.findings} - {item.code for item in clear.findings}
    assert codes == {"weather-attenuates", "rain-echo-left-out"}
    assert (wet.budget.noise_w is None) == (link_budget is None)


def test_clear_air_leaves_every_bit(tmp_path: Path) -> None:
    frame = open_frame(open_run(_run(tmp_path / "run", contract.LinkBudget(3.0))).frame(1))
    wavelength_m = pr.WAVEFORM.wavelength_m
    powers = [
        path_power_w(FrameBudget(frame, weather).apply(frame_paths(frame)), wavelength_m)
        for weather in (None, Weather(air_temperature_c=30.0, vapour_g_per_m3=20.0))
    ]
    np.testing.assert_array_equal(*powers)


def test_longer_paths_lose_more(tmp_path: Path) -> None:
    frame = open_frame(open_run(_run(tmp_path / "run", None)).frame(1), radar=RADAR)
    paths = frame_paths(frame)
    gain = FrameBudget(frame, RAIN).apply(paths).gain
    assert gain is not None
    expected = 10 ** (-RAIN_DB_PER_KM * paths.length_m / 1e4)
    np.testing.assert_allclose(gain, expected, rtol=2e-4)


def test_fog_and_gases_add_up() -> None:
    fog, gases = Weather(fog_g_per_m3=0.5), Weather(gases=True)
    both = Weather(rain_mm_per_h=10.0, rain_polarisation="horizontal", fog_g_per_m3=0.5, gases=True)
    parts = [one.attenuation_db_per_km(CARRIER_HZ) for one in (fog, gases, RAIN)]
    assert both.attenuation_db_per_km(CARRIER_HZ) == pytest.approx(math.fsum(parts), rel=1e-12)
    assert parts[1] == pytest.approx(0.348044, rel=1e-5)  # P.676-12 by another code
    assert not Weather().findings(CARRIER_HZ)


def test_weather_that_cannot_be_is_refused() -> None:
    with pytest.raises(ConfigError, match="Rain"):
        Weather(rain_mm_per_h=-1.0)
    with pytest.raises(ConfigError, match="Rain"):
        Weather(rain_mm_per_h=1.0).attenuation_db_per_km(0.5e9)


def test_command_line_takes_weather(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = _run(tmp_path / "run", None)
    assert main(["process", str(folder), "--no-plots", "--rain-mm-per-h", "10"]) == 0
    assert "its own echo is left out" in capsys.readouterr().out
