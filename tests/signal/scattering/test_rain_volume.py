# SPDX-License-Identifier: GPL-3.0-or-later
"""The echo of rain in a frame: power, range, blocking and Doppler, against integrals."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.physics.weather import rain_reflectivity_per_m
from radarsim_addon.signal import (
    Burst,
    Radar,
    Waveform,
    expected_power_profile,
    make_paths,
    open_run,
)
from radarsim_addon.signal.decoding import FrameInput, open_frame
from radarsim_addon.signal.pipeline import FrameResult, ProcessOptions, process_frame
from radarsim_addon.signal.radar import Weather
from radarsim_addon.signal.scattering import rain_rows
from tests.signal import path_runs as pr

EIRP_W, HALF_DEG, WALL_M = 1e6, 2.0, 800.0
WAVELENGTH_M = pr.WAVEFORM.wavelength_m
CARRIER_HZ = pr.WAVEFORM.carrier_hz
RADAR = Radar(Waveform(CARRIER_HZ, 15e6, 5e-6, 18e6), Burst(2000.0, 64))
LIMITS_M = (100.0, 1500.0)
RAIN = Weather(rain_mm_per_h=10.0, rain_echo=True)


def scene(folder: Path, *, up_deg: float = 0.0, wall: bool = True) -> Path:
    """A plate at 800 m that fills the left half of the view, or a small one beyond the limits."""
    receiver = pr.camera(pr.pose((0, 0, 0), 0.0, up_deg), HALF_DEG)
    emitter = contract.TransmitterRecord(receiver.matrix_world, EIRP_W)
    half = 1.2 * WALL_M * math.tan(math.radians(HALF_DEG))
    plate = pr.Plate("Wall", (-half, WALL_M, 0), (half, 0, 0), (0, 0, half))
    if not wall:
        plate = pr.Plate(
            "Far", (0, 2000.0, 2000 * math.tan(math.radians(up_deg))), (1, 0, 0), (0, 0, 1)
        )
    rows = pr.trace([plate], receiver, emitter, 128)
    pr.write_run(folder, rows, [plate.name], receiver, emitter, range_limits_m=1500.0)
    return folder


def opened(folder: Path) -> FrameInput:
    return open_frame(open_run(folder).frame(1), radar=RADAR, range_limits_m=LIMITS_M)


def density(start_m: float, stop_m: float) -> float:
    """Power of rain between two ranges in all of the view, without extinction."""
    tangent = math.tan(math.radians(HALF_DEG))
    solid_sr = 4 * math.asin(tangent**2 / (1 + tangent**2))  # a square pyramid
    eta = rain_reflectivity_per_m(CARRIER_HZ, 10.0)
    part = 1 / start_m - 1 / stop_m
    return EIRP_W * WAVELENGTH_M**2 / (4 * math.pi) ** 3 * eta * solid_sr * part


def test_power_of_open_and_blocked_directions(tmp_path: Path) -> None:
    """The plate ends the left half of the view at 800 m."""
    rows = rain_rows(opened(scene(tmp_path / "run")), RAIN, 0)
    range_m = rows["length_m"] / 2
    for start_m, stop_m, part in ((200.0, 300.0, 1.0), (500.0, 700.0, 1.0), (900.0, 1400.0, 0.5)):
        inside = (range_m > start_m) & (range_m < stop_m)
        found = rows["power_w"][inside].sum()
        # cells of 10 m, and points anywhere in them
        assert found == pytest.approx(part * density(start_m, stop_m), rel=0.03)
    beyond = range_m > 810
    assert np.all(rows["direction"][beyond, 0] > 0)
    assert np.all(rows["last_object"] == 0)


def test_doppler_of_fall_and_wind(tmp_path: Path) -> None:
    """Looking up by 60 degrees drops come nearer with the sine of their fall.

    Small drops return D^6; with the densities exp(-L D) and falls of 9.65 - 10.3 exp(-0.6 D) m/s,
    moments of exp(-0.6 D) are (L/(L + 0.6))^7... At 5.3 GHz, Mie's series is 1.5 % off.
    """
    frame = opened(scene(tmp_path / "run", up_deg=60.0, wall=False))
    rows = rain_rows(frame, RAIN, 3)
    slope = 4.1 * 10.0**-0.21
    first, second = (slope / (slope + 0.6)) ** 7, (slope / (slope + 1.2)) ** 7
    mean_mps, spread_mps = 9.65 - 10.3 * first, 10.3 * math.sqrt(second - first**2)
    found = np.average(rows["range_rate_mps"], weights=rows["power_w"])
    assert found == pytest.approx(-mean_mps * math.sin(math.radians(60)), rel=0.02)
    assert rows["range_rate_mps"].std() == pytest.approx(
        spread_mps * math.sin(math.radians(60)), rel=0.03
    )
    windy = Weather(rain_mm_per_h=10.0, rain_echo=True, wind_x_mps=3.0, wind_y_mps=8.0)
    drift = rain_rows(frame, windy, 3)["range_rate_mps"] - rows["range_rate_mps"]
    assert drift == pytest.approx(rows["direction"] @ (3.0, 8.0, 0.0))


def result(
    folder: Path, weather: Weather, link_budget: contract.LinkBudget | None = None
) -> FrameResult:
    run = open_run(folder)
    options = ProcessOptions(
        weather=weather, radar=RADAR, range_limits_m=LIMITS_M, speckle_seed=1,
        link_budget=link_budget,
    )  # fmt: skip
    resolved = options.for_run(run)
    return process_frame(resolved.open(run.frame(1)), resolved)


def test_echoes_and_expected_power_hold_the_rain(tmp_path: Path) -> None:
    """Wind of 12 m/s along the view: the map's power is there, and the profile's level."""
    folder = scene(tmp_path / "run", wall=False)
    wet = Weather(rain_mm_per_h=10.0, rain_echo=True, wind_y_mps=12.0)
    found, without = result(folder, wet), result(folder, Weather(rain_mm_per_h=10.0))
    assert found.expected is not None and without.expected is not None
    # extinction at 5.3 GHz is 0.01 dB/km
    profile = found.expected
    cell_m = profile.range_m[1] - profile.range_m[0]
    here = (profile.range_m > 300) & (profile.range_m < 1200)
    # a point on a cell adds this much to the sum of a profile, whose unit is the peak of a point
    point = expected_power_profile(
        make_paths(1.0, 2 * (500.0 + 100 * cell_m)), RADAR, range_limits_m=(500.0, 1500.0),
        oversample=2,
    ).power  # fmt: skip
    level = profile.profile[here].sum() / (point.sum() / point.max())
    assert level == pytest.approx(density(300.0, 1200.0), rel=0.05)
    doppler_hz = np.average(profile.doppler_hz, weights=profile.map[:, here].sum(axis=1))
    assert doppler_hz == pytest.approx(-2 * 12.0 / WAVELENGTH_M, rel=0.02)
    assert without.expected.profile[here].max() < 1e-6 * profile.profile[here].max()
    # mean power of the echoes over many cells is the expected one
    got = found.rd_map
    near = (got.range_m > 300) & (got.range_m < 1200)
    mean = got.plane_power[:, near].sum() / near.sum()
    expected = profile.map[:, here].sum() / here.sum()
    assert 10 * math.log10(mean / expected) == pytest.approx(0.0, abs=0.6)
    codes = {item.code for item in found.findings}
    assert "rain-echo" in codes and "rain-echo-left-out" not in codes


def test_rain_is_received_by_the_antennas(tmp_path: Path) -> None:
    """Both gains, the transmit power and the losses are in the echoes of rain, as in all power."""
    folder = scene(tmp_path / "run", wall=False)
    antennas = (contract.AntennaRecord("isotropic", {"gain_dbi": g}) for g in (21.0, 12.0))
    budget = contract.LinkBudget(300.0, *antennas, other_loss_db=4.0)
    gain = 300 * 10 ** ((21 + 12 - 4) / 10) / EIRP_W
    plain, found = result(folder, RAIN), result(folder, RAIN, budget)
    near = (found.rd_map.range_m > 200) & (found.rd_map.range_m < 1300)
    powers = [one.rd_map.plane_power[:, near] for one in (plain, found)]
    np.testing.assert_allclose(powers[1].sum(), gain * powers[0].sum(), rtol=1e-6)
    assert plain.expected is not None and found.expected is not None
    of_clutter = [one.clutter_profile for one in (plain.expected, found.expected)]
    assert of_clutter[0] is not None and of_clutter[1] is not None
    np.testing.assert_allclose(of_clutter[1], gain * of_clutter[0], rtol=1e-6)


def test_no_rain_no_points(tmp_path: Path) -> None:
    frame = opened(scene(tmp_path / "run"))
    assert rain_rows(frame, Weather(rain_echo=True), 0).size == 0
    assert rain_rows(frame, Weather(rain_mm_per_h=10.0), 0).size == 0


def test_what_is_said_of_the_echo_is_what_was_done(tmp_path: Path) -> None:
    """Before an orthographic receiver rain returns nothing, and the finding says so."""
    receiver = pr.camera(pr.pose((0, 0, 0)), HALF_DEG)
    receiver = dataclasses.replace(
        receiver, kind="orthographic", left=-40.0, right=40.0, bottom=-40.0, top=40.0
    )
    emitter = contract.TransmitterRecord(receiver.matrix_world, EIRP_W)
    plate = pr.plate("Wall", (0, WALL_M, 0), 50.0)
    rows = pr.trace([plate], receiver, emitter, 16)
    pr.write_run(tmp_path / "run", rows, ["Wall"], receiver, emitter, range_limits_m=1500.0)
    found = result(tmp_path / "run", RAIN)
    codes = {item.code for item in found.findings}
    assert "rain-echo-left-out" in codes and "rain-echo" not in codes
    assert found.expected is not None and found.expected.clutter_map is None
