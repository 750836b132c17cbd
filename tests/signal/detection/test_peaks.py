# SPDX-License-Identifier: GPL-3.0-or-later
"""Interpolated peaks against closed forms, for every waveform and window; SNR against truth."""

import dataclasses

import numpy as np
import pytest

from radarsim_addon.signal import Cfar, Radar, detect_targets, find_peaks, range_doppler
from radarsim_addon.signal.detection import received_recording
from radarsim_addon.signal.maps import map_noise_gain, range_process
from radarsim_addon.signal.radar import LineWaveform, PmcwWaveform
from tests.signal.pointscenes import PAIRS, clutter, radar_of, scene

pytestmark = pytest.mark.slow


def apparent_m(radar: Radar, range_m: float, rate_mps: float) -> float:
    """Where a map has an echo: in the middle of the burst, with the range-Doppler coupling."""
    waveform = radar.waveform
    time_s = (radar.burst.pulses - 1) / 2 / radar.burst.prf_hz
    if isinstance(waveform, PmcwWaveform):
        time_s += waveform.duration_s / 2
    elif isinstance(waveform, LineWaveform):
        slope_hz_per_s = waveform.grid_step_hz / waveform.grid_interval_s
        time_s += waveform.grid_middle_s + waveform.carrier_hz / slope_hz_per_s
    return range_m + rate_mps * time_s


@pytest.mark.parametrize(("name", "window"), PAIRS)
def test_peaks_are_off_by_less_than_a_two_hundredth_of_a_cell(name: str, window: str) -> None:
    """At random places between the cells; moving by less than half a cell during the burst."""
    rng = np.random.default_rng(0)
    radar = radar_of(name)
    cell_m, cell_mps = radar.waveform.sample_spacing_m, radar.velocity_resolution_mps
    for cells in (rng.uniform(4, 20), -rng.uniform(4, 20)):
        range_m = 450 + rng.uniform(0, 1) * cell_m
        _, rd_map = scene(name, [(range_m, cells, 0.0)], (200.0, 700.0), window)
        for peak in (find_peaks(rd_map, 1)[0], detect_targets(rd_map).targets[0]):
            expected_m = apparent_m(radar, range_m, cells * cell_mps)
            assert peak.range_m == pytest.approx(expected_m, abs=0.005 * cell_m)
            assert peak.velocity_mps == pytest.approx(cells * cell_mps, abs=0.005 * cell_mps)
            assert peak.level_db == pytest.approx(0, abs=0.1)


@pytest.mark.parametrize("name", ["chirp", "fmcw", "pmcw"])
@pytest.mark.parametrize(
    ("window", "cells"), [("none", 2.2), ("none", -3.3), ("hamming", 3.3), ("kaiser:8", 4.4)]
)
def test_clutter_at_the_same_range_does_not_pull_at_a_slow_peak(
    name: str, window: str, cells: float
) -> None:
    """30 dB stronger; left in, it pulls by up to 0.24 cells and 14 dB."""
    radar = radar_of(name)
    cell_m, cell_mps = radar.waveform.sample_spacing_m, radar.velocity_resolution_mps
    echoes = [(500.3, cells, 0.0), (500.3, 0.0, 30.0)]
    _, rd_map = scene(name, echoes, (200.0, 900.0), window)
    peak = find_peaks(rd_map, 1, min_speed_mps=1.6 * cell_mps)[0]
    assert peak.velocity_mps == pytest.approx(cells * cell_mps, abs=0.005 * cell_mps)
    expected_m = apparent_m(radar, 500.3, cells * cell_mps)
    assert peak.range_m == pytest.approx(expected_m, abs=0.005 * cell_m)
    assert peak.level_db == pytest.approx(0, abs=0.05)


@pytest.mark.parametrize(
    ("name", "window"), [("chirp", "none"), ("chirp", "hann"), ("barker", "hann"), ("fmcw", "none")]
)
def test_targets_at_the_end_of_the_window_are_not_pulled_inwards(name: str, window: str) -> None:
    radar = radar_of(name)
    cell_m = radar.waveform.sample_spacing_m
    rate_mps = 8.3 * radar.velocity_resolution_mps
    for place in (0.3, 0.7):
        range_m = 400 + place * cell_m
        echoes, rd_map = scene(name, [(range_m, 8.3, 0.0)], (400.0, 700.0), window)
        wide = received_recording(echoes, rd_map, 0).rd_map
        target = detect_targets(rd_map, wide=wide).targets[0]
        expected_m = apparent_m(radar, range_m, rate_mps)
        assert target.range_m == pytest.approx(expected_m, abs=0.01 * cell_m)
        assert target.level_db == pytest.approx(0, abs=0.1)


@pytest.mark.parametrize("name", ["chirp", "fmcw", "pmcw"])
def test_a_target_at_one_end_of_the_window_is_none_at_the_other(name: str) -> None:
    """The interpolation over range is periodic: from the last cell it would climb to the first."""
    range_m = 400 + 0.3 * radar_of(name).waveform.sample_spacing_m
    _, rd_map = scene(name, [(range_m, 8.3, 0.0)], (400.0, 700.0), "none")
    far = [target.level_db for target in detect_targets(rd_map).targets if target.range_m > 600]
    assert max(far, default=-100.0) < -10


@pytest.mark.parametrize("kind", ["ca", "os"])
@pytest.mark.parametrize("name", ["chirp", "fmcw"])
@pytest.mark.parametrize("snr_db", [25.0, 60.0])
def test_snr_is_that_of_the_noise_not_of_the_own_sidelobes(
    kind: str, name: str, snr_db: float
) -> None:
    """Without a window, whose sidelobes fill the training cells 25 to 45 dB below the peak."""
    rng, radar, found = np.random.default_rng(5), radar_of(name), []
    sigma = np.sqrt(10 ** (-snr_db / 10) / map_noise_gain(radar, "none", "none") / 2)
    for cells in (8.4, 11.7, -14.2):
        echoes, _ = scene(name, [(450.0 + cells, cells, 0.0)], (200.0, 700.0), "none")
        shape = echoes.plane.shape
        noise = sigma * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
        noisy = dataclasses.replace(echoes, samples=echoes.samples + noise)
        rd_map = range_doppler(range_process(noisy, "none"), "none")
        found.append(detect_targets(rd_map, Cfar(kind, 1e-4)).targets[0].snr_db)
    assert np.mean(found) == pytest.approx(snr_db, abs=1.0)


def test_clutter_is_found_where_it_stands() -> None:
    """A peak on 0 Hz is fitted alone."""
    echoes = clutter(1, 7)
    _, rd_map = scene("chirp", echoes, (0.0, 900.0), "hamming")
    peak = find_peaks(rd_map, 1)[0]
    assert (peak.range_m, peak.level_db) == pytest.approx((echoes[0][0], echoes[0][2]), abs=0.01)
    assert peak.velocity_mps == pytest.approx(0, abs=1e-6)
