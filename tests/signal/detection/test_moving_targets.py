# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving targets in a summary: all that move, none that another echo's response explains."""

from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.signal import (
    Burst,
    FrameResult,
    ProcessOptions,
    Radar,
    Receiver,
    find_peaks,
    process_run,
)
from radarsim_addon.signal.detection import find_moving_targets
from radarsim_addon.signal.maps import Recording, point_response
from tests.signal.pointscenes import BURST, PAIRS, WAVEFORMS, WINDOWS, clutter, scene, speeds
from tests.signal.synthetic import Setup, points, write_run

pytestmark = pytest.mark.slow

SETUP = Setup(rings=4, radar=Radar(WAVEFORMS["chirp"], BURST))
ECHOES = [(5, 6, 600.0, 5.0, 1e-6), *((2, c, 300.0, 0.0, 1e-5) for c in range(10))]
SLOWEST_MPS = 3 * SETUP.radar.velocity_resolution_mps
every_waveform = pytest.mark.parametrize("name", list(WAVEFORMS))
pairs = pytest.mark.parametrize(("name", "window"), PAIRS)


def result_of(folder: Path, options: ProcessOptions) -> FrameResult:
    return next(e for e in process_run(folder, options) if isinstance(e, FrameResult))


@every_waveform
@pytest.mark.parametrize("mti", [0, 3])
@pytest.mark.parametrize("window", ["none", "hamming"])
def test_the_response_to_one_echo_is_what_the_map_shows(name: str, mti: int, window: str) -> None:
    """It migrates by a sixth of a cell; what is left is how well its peak was placed."""
    echoes, rd_map = scene(name, [(500.3, 40.0 * 0.7, 0.0)], (400.0, 600.0), window, mti)
    peak = find_peaks(rd_map, 1)[0]
    recording = Recording(echoes, (400.0, 600.0), rd_map, mti, 1.0)
    response = point_response(recording, peak.range_m, peak.doppler_hz / 1000.0)
    row, col = np.unravel_index(np.argmax(rd_map.plane_power), rd_map.plane_power.shape)
    amplitude = complex(rd_map.plane[row, col] / response.values[row, col])
    left = np.abs(rd_map.plane - response.echo(amplitude)).max()
    assert left < 10 ** (-40 / 20) * np.abs(rd_map.plane).max()


def test_the_response_of_frequencies_is_the_dirichlet_kernel() -> None:
    echoes, rd_map = scene("stepped", [(500.0, 0.0, 0.0)], (400.0, 600.0), "none")
    response = point_response(Recording(echoes, (400.0, 600.0), rd_map, 0, 1.0), 500.0, 0.0)
    x = (rd_map.range_m - 500.0) / (WAVEFORMS["stepped"].sample_spacing_m * 500)
    expected = np.abs(np.sinc(500 * x) / np.sinc(x))
    np.testing.assert_allclose(np.abs(response.values[32]), expected, atol=1e-6)
    np.testing.assert_allclose(response.values[20], 0, atol=1e-12)


@pytest.mark.parametrize("name", ["chirp", "fmcw", "fmcw real", "pmcw"])
@pytest.mark.parametrize(
    "range_limits_m", [(0.0, 500.0), (0.0, 590.0), (610.0, 900.0), (650.0, 990.0)]
)
def test_a_mover_outside_the_window_has_no_sidelobes_in_it(
    tmp_path: Path, name: str, range_limits_m: tuple[float, float]
) -> None:
    folder = write_run(tmp_path / "run", SETUP, points(SETUP, ECHOES))
    radar = Radar(WAVEFORMS[name], Burst(1000.0, 64))
    options = ProcessOptions(
        products=False, plots=False, radar=radar, range_limits_m=range_limits_m
    )
    result = result_of(folder, options)
    assert result.moving_targets == []
    # peaks of the map alone are its sidelobes
    assert find_peaks(result.rd_map, 5, min_speed_mps=SLOWEST_MPS, min_above_db=10.0)


@pairs
@pytest.mark.parametrize("range_limits_m", [(0.0, 590.0), (606.0, 900.0), (0.0, 900.0)])
def test_sidelobes_are_no_movers_whatever_the_window(
    name: str, window: str, range_limits_m: tuple[float, float]
) -> None:
    echoes, rd_map = scene(name, [(600.0, 22.6, 0.0), *clutter(20, 1)], range_limits_m, window)
    assert len(find_moving_targets(echoes, rd_map)) == (range_limits_m == (0.0, 900.0))


@pytest.mark.parametrize("window", ["none", "kaiser:8"])
@pytest.mark.parametrize(
    ("name", "beyond_m"), [("barker", 27.0), ("barker", 32.0), ("chirp", 303.0)]
)
def test_a_mover_most_of_whose_pulse_is_not_recorded_has_no_sidelobes_in_the_window(
    name: str, beyond_m: float, window: str
) -> None:
    """Its peak is where a part of the code, or of the band, fits: not where it stands."""
    for range_m in (400.0 - beyond_m, 600.0 + beyond_m):
        assert (
            find_moving_targets(*scene(name, [(range_m, 11.36, 0.0)], (400.0, 600.0), window)) == []
        )


@every_waveform
@pytest.mark.parametrize("window", WINDOWS)
def test_what_stands_still_does_not_move(name: str, window: str) -> None:
    for mti in (0, 2):
        assert (
            find_moving_targets(*scene(name, clutter(40, 2), (0.0, 900.0), window, mti), mti) == []
        )


@pairs
def test_what_nearly_stands_still_has_no_sidelobes_among_the_movers(name: str, window: str) -> None:
    """Range rates of a tenth of a cell, as of lengths in float32."""
    rng = np.random.default_rng(3)
    swaying = [(r, float(rng.normal(0, 0.1)), level) for r, _, level in clutter(40, 3)]
    assert find_moving_targets(*scene(name, swaying, (0.0, 900.0), window)) == []


@pairs
@pytest.mark.parametrize(("cells", "mti"), [(1.6, 0), (-1.8, 2), (2.5, 0)])
def test_slow_movers_are_listed_beside_stronger_clutter(
    name: str, window: str, cells: float, mti: int
) -> None:
    echoes = [(500.3, cells, 0.0), *clutter(40, 4)]
    moving_targets = find_moving_targets(*scene(name, echoes, (0.0, 900.0), window, mti), mti)
    # main lobes of kaiser:8 are 2.7 cells wide to each side: static and target overlap
    within = 0.05 if window == "kaiser:8" else 0.02
    assert speeds(moving_targets, name) == [pytest.approx(cells, abs=within)]
    waveform = WAVEFORMS[name]
    coupling_m = 0.2 if waveform.family == "line" else 0.05
    assert moving_targets[0].range_m == pytest.approx(500.3, abs=coupling_m)


@pairs
def test_a_weak_mover_is_found_under_the_sidelobes_of_a_strong_one(name: str, window: str) -> None:
    """At the same range 12 cells faster, and at the same speed 12 cells behind."""
    waveform = WAVEFORMS[name]
    behind_m = 12 * waveform.sample_spacing_m
    echoes = [(400.0, 8.3, 0.0), (400.0, 20.6, -30.0), (400.0 + behind_m, 8.3, -30.0)]
    moving_targets = find_moving_targets(*scene(name, echoes, (0.0, 900.0), window))
    assert speeds(moving_targets, name)[0] == pytest.approx(8.3, abs=0.01)
    assert sorted(speeds(moving_targets, name)[1:]) == pytest.approx([8.3, 20.6], abs=0.1)
    assert [target.level_db for target in moving_targets] == pytest.approx([0, -30, -30], abs=0.5)


def test_a_mover_in_the_window_stays_beside_one_outside(tmp_path: Path) -> None:
    echoes = [*ECHOES, (8, 3, 450.0, -3.0, 1e-7)]
    folder = write_run(tmp_path / "run", SETUP, points(SETUP, echoes))
    options = ProcessOptions(products=False, plots=False, range_limits_m=(0.0, 550.0))
    (target,) = result_of(folder, options).moving_targets
    assert target.velocity_mps == pytest.approx(-3.0, abs=0.02)


@pytest.mark.parametrize("name", ["chirp", "pmcw"])
@pytest.mark.parametrize("adc_bits", [8, 12])
def test_the_rounding_of_an_adc_is_no_mover(tmp_path: Path, name: str, adc_bits: int) -> None:
    """Rounding follows the strong echo: it is not white."""
    folder = write_run(tmp_path / "run", SETUP, points(SETUP, ECHOES))
    radar = Radar(WAVEFORMS[name], Burst(1000.0, 64))
    options = ProcessOptions(
        products=False, plots=False, radar=radar, receiver=Receiver(adc_bits=adc_bits)
    )
    (target,) = result_of(folder, options).moving_targets
    assert target.velocity_mps == pytest.approx(5.0, abs=0.02)
