# SPDX-License-Identifier: GPL-3.0-or-later
"""Cancellers, CFAR and interpolated targets against closed forms and in noise."""

import csv
import dataclasses
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import (
    Burst,
    Cfar,
    Echoes,
    FmcwWaveform,
    PmcwWaveform,
    Radar,
    RangeDopplerMap,
    Receiver,
    Waveform,
    apply_receiver,
    cfar_threshold,
    detect_targets,
    mti_cancel,
    mti_response,
    range_doppler,
    synthesize,
)
from radarsim_addon.signal.detection.cfar import noise_correlation
from radarsim_addon.signal.echoes import synthesizer_for
from radarsim_addon.signal.maps import map_noise_gain, range_process
from radarsim_addon.signal.products.frame_products import write_detections
from tests.signal.oracle import unit_paths

pytestmark = pytest.mark.slow

RADAR = Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 64))
FMCW = FmcwWaveform(77e9, 1e9, 256, 10e6)
FMCW_RADAR = Radar(FMCW, Burst(1 / FMCW.duration_s, 128))
PMCW = PmcwWaveform(5.3e9, 20e-9, 9, samples_per_chip=2)
PMCW_RADAR = Radar(PMCW, Burst(10e3, 128))
WINDOW_M = (500.0, 1500.0)


def noise_map(
    radar: Radar, window: str, seed: int, range_limits_m: tuple[float, float] = WINDOW_M
) -> RangeDopplerMap:
    """Thermal noise through the whole chain."""
    echoes = apply_receiver(
        synthesizer_for(radar, range_limits_m).result(),
        Receiver(noise_figure_db=3.0, noise_seed=seed),
    ).echoes
    return range_doppler(range_process(echoes, window), window)


# -- MTI -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pulses", [2, 3])
@pytest.mark.parametrize("cycles", [0.0, 0.1, 0.25, 0.5])
def test_canceller_has_its_known_response(pulses: int, cycles: float) -> None:
    rate_mps = -cycles * RADAR.burst.prf_hz * RADAR.waveform.wavelength_m / 2
    range_m = 500.0 + 200 * RADAR.waveform.sample_spacing_m
    found = range_process(
        synthesize(unit_paths(RADAR, [range_m], [rate_mps]), RADAR, range_limits_m=WINDOW_M),
        "none",
        1,
    )
    power = np.abs(mti_cancel(found, pulses).plane).max(axis=1) ** 2
    before = np.abs(found.plane).max(axis=1)[: power.size] ** 2
    x = math.pi * cycles
    expected = 2 * math.sin(x) ** 2 if pulses == 2 else 8 / 3 * math.sin(x) ** 4
    np.testing.assert_allclose(power, expected * before, atol=0.03)  # it migrates a little
    assert mti_response(pulses, cycles * 1000.0, 1000.0) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("pulses", [2, 3])
def test_canceller_keeps_the_power_of_noise(pulses: int) -> None:
    noise = apply_receiver(
        synthesizer_for(RADAR, WINDOW_M).result(), Receiver(noise_figure_db=3.0)
    ).echoes
    found = range_process(noise, "none", 1)
    ratio = np.mean(np.abs(mti_cancel(found, pulses).plane) ** 2) / np.mean(
        np.abs(found.plane) ** 2
    )
    assert ratio == pytest.approx(1, abs=0.03)
    radar = mti_cancel(found, pulses).radar
    assert radar.burst.pulses == RADAR.burst.pulses - pulses + 1


def test_cancellers_that_do_not_fit() -> None:
    echoes = synthesizer_for(Radar(RADAR.waveform, Burst(1000.0, 2)), WINDOW_M).result()
    with pytest.raises(ConfigError, match="too short"):
        mti_cancel(range_process(echoes), 3)
    with pytest.raises(ConfigError, match="expected 2 or 3"):
        mti_cancel(range_process(echoes), 4)


# -- thresholds ------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["ca", "os"])
def test_training_cells_wrap_around_in_doppler_and_end_in_range(kind: str) -> None:
    """Cell by cell, the first and the last rows included, whose guard cells wrap around, too."""
    plain = noise_map(RADAR, "hamming", 3, (500.0, 700.0))
    power = plain.plane_power
    rows, cols = power.shape
    cfar = Cfar(kind, 1e-3, (2, 5), (2, 2))
    found = cfar_threshold(plain, cfar).noise
    expected = np.empty_like(power)
    for row in range(rows):
        for col in range(cols):
            cells = [
                power[(row + r) % rows, col + c]
                for r in range(-4, 5)
                for c in range(-7, 8)
                if 0 <= col + c < cols and (abs(r) > 2 or abs(c) > 5)
            ]
            ordered = sorted(cells)
            ranked = ordered[round(cfar.rank * len(cells)) - 1]
            expected[row, col] = ranked if kind == "os" else sum(cells) / len(cells)
    # the ordered statistic estimates the mean up to one factor, which the ends have, too
    factor = np.median(found / expected)
    assert kind == "os" or factor == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(found, factor * expected, rtol=1e-9)


def test_noise_of_a_code_is_correlated_as_its_chips_are() -> None:
    """An m-sequence of rectangular chips, two samples each: 1/2 at one sample, 0 at two."""
    rd_map = noise_map(PMCW_RADAR, "none", 0)
    doppler, along = noise_correlation(rd_map, (2, 8))
    step = round(PMCW.sample_spacing_m / (rd_map.range_m[1] - rd_map.range_m[0]))
    np.testing.assert_allclose(np.abs(doppler), [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(np.abs(along[::step][:3]), [1, 0.5, 0], atol=1.1 / 511)
    values = rd_map.plane
    measured = np.vdot(values[:, :-1], values[:, 1:]) / np.vdot(values, values)
    assert abs(measured) == pytest.approx(abs(along[1]), abs=0.01)


def test_thresholds_do_not_depend_on_the_threads_of_the_blas() -> None:
    script = """
import hashlib
from radarsim_addon.signal import Cfar, cfar_threshold
from tests.signal.detection.test_cfar import RADAR, noise_map
for kind in ("ca", "os"):
    found = cfar_threshold(noise_map(RADAR, "hamming", 0), Cfar(kind))
    print(*(hashlib.sha256(part.tobytes()).hexdigest() for part in (found.noise, found.threshold)))
"""
    names = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
    printed = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, **dict.fromkeys(names, threads)},
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for threads in ("1", "2")
    }
    assert len(printed) == 1, printed


@pytest.mark.parametrize(("kind", "window"), [("ca", "hamming"), ("os", "none")])
@pytest.mark.parametrize("radar", [RADAR, FMCW_RADAR, PMCW_RADAR], ids=["lfm", "fmcw", "pmcw"])
def test_false_alarms_are_as_rare_as_designed(kind: str, window: str, radar: Radar) -> None:
    """In noise through the whole chain: windowed, oversampled, so correlated."""
    pfa, alarms, cells = 3e-3, 0, 0
    range_limits_m = (0.0, 38.0) if radar is FMCW_RADAR else WINDOW_M
    cfar = Cfar(kind, pfa, (3, 6), (3, 10))
    for seed in range(6):
        rd_map = noise_map(radar, window, seed, range_limits_m)
        alarms += int((rd_map.plane_power > cfar_threshold(rd_map, cfar).threshold).sum())
        cells += rd_map.plane_power.size
    # alarms come in clumps of about as many cells as are correlated: at most 2 x 1.5 x 1.4
    sigma = math.sqrt(cells * pfa * 5)
    assert alarms == pytest.approx(cells * pfa, abs=4 * sigma + 0.05 * cells * pfa)
    assert cells * pfa > 500


@pytest.mark.parametrize("kind", ["ca", "os"])
@pytest.mark.parametrize("window", ["none", "blackman"])
def test_false_alarms_are_as_designed_without_guard_cells(kind: str, window: str) -> None:
    """Counted: training cells in the main lobe contain noise of the tested cell, and are unused."""
    rates, cfar = [], Cfar(kind, 1e-2, (0, 0), (2, 6))
    for seed in range(30):
        rd_map = noise_map(RADAR, window, seed)
        alarms = rd_map.plane_power > cfar_threshold(rd_map, cfar).threshold
        rates.append(alarms.mean() / cfar.pfa)
    error = np.std(rates) / math.sqrt(len(rates))
    assert np.mean(rates) == pytest.approx(1, abs=0.01 + 3 * error)
    assert error < 0.02, "enough cells to tell"


@pytest.mark.parametrize(
    ("kind", "window"), [("os", "hann"), ("os", "taylor:4:-35"), ("os", "kaiser:8"), ("ca", "hann")]
)
@pytest.mark.parametrize("wide", [False, True], ids=["lfm", "fmcw"])
def test_false_alarms_are_within_a_twentieth_of_design(kind: str, window: str, wide: bool) -> None:
    """From the thresholds themselves: noise of power P is above T with exp(-T / P)."""
    fmcw = FmcwWaveform(77e9, 1e9, 1024, 40e6)
    radar = Radar(fmcw, Burst(20e3, 64)) if wide else RADAR
    range_limits_m = (0.0, 150.0) if wide else (500.0, 3000.0)
    received = apply_receiver(
        synthesizer_for(radar, range_limits_m).result(), Receiver(noise_figure_db=3.0)
    )
    rd_map = range_doppler(range_process(received.echoes, window), window)
    noise = received.noise_power_w * map_noise_gain(radar, window, window)
    threshold = cfar_threshold(rd_map, Cfar(kind, 1e-3, (3, 6), (3, 10))).threshold
    rates = np.exp(-threshold / noise) / 1e-3
    # this noise is not of mean power P to the percent; the rate where it is, by regression
    level, rate = (
        np.array([part.mean() for part in np.array_split(values, 32, axis=1)])
        for values in (rd_map.plane_power / noise - 1, rates)
    )
    slope, found = np.polyfit(level, rate, 1)
    error = (rate - found - slope * level).std(ddof=2) / math.sqrt(32)
    assert found == pytest.approx(1, abs=0.05 + 2 * error)
    assert error < 0.045, "enough cells to tell"


def test_a_strong_echo_does_not_spoil_thresholds_beside_it() -> None:
    """200 dB over the rest: nothing is lost in differences of sums."""
    rd_map = noise_map(RADAR, "hamming", 1)
    values = rd_map.plane.copy()
    values[20, 400] = 1e10 * np.abs(values).mean()
    spiked = RangeDopplerMap(
        values[None], rd_map.doppler_hz, rd_map.range_m, rd_map.radar, "hamming", "hamming"
    )
    cfar = Cfar("ca", 1e-3, (2, 5), (2, 7))
    plain, found = (cfar_threshold(m, cfar).noise for m in (rd_map, spiked))
    near = found > 2 * plain
    rows, cols = np.nonzero(near)
    assert np.abs(rows - 20).max() <= 4 and np.abs(cols - 400).max() <= 12
    assert not near[18:23, 395:406].any(), "guard cells keep the echo out"
    np.testing.assert_allclose(found[~near], plain[~near], rtol=1e-9)


def test_detectors_that_do_not_fit() -> None:
    for numbers, message in (
        ({"kind": "xy"}, "'xy'"),
        ({"pfa": 2.0}, "False-alarm rate"),
        ({"rank": 1.0}, "rank"),
        ({"train": (0, 0)}, "without training"),
        ({"guard": (-1, 2)}, "guard cells"),
    ):
        with pytest.raises(ConfigError, match=message):
            Cfar(**numbers)
    rd_map = noise_map(Radar(RADAR.waveform, Burst(1000.0, 1)), "none", 0, (500.0, 520.0))
    with pytest.raises(ConfigError, match="no training cells"):
        cfar_threshold(rd_map, Cfar("ca", 1e-3, (2, 30), (2, 8)))


# -- targets ---------------------------------------------------------------------------------------


def scene(noise: float, seed: int) -> Echoes:
    """A unit path at 800 m with 5 m/s, and noise."""
    echoes = synthesize(unit_paths(RADAR, [800.0], [5.0]), RADAR, range_limits_m=WINDOW_M)
    rng = np.random.default_rng(seed)
    shape = echoes.plane.shape
    more = noise * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
    return dataclasses.replace(echoes, samples=echoes.samples + more)


def test_targets_in_noise_are_found_with_their_snr() -> None:
    sigma = 0.5
    found = [
        detect_targets(
            range_doppler(range_process(scene(sigma, seed))),
            Cfar("ca", 1e-7),
        ).targets
        for seed in range(8)
    ]
    assert all(len(targets) == 1 for targets in found)
    # two windows of 1.35 dB each, and what the pulse's own ripple costs
    snr_db = 10 * math.log10(150 * 64 / (2 * sigma**2)) - 2 * 1.346
    measured = np.mean([targets[0].snr_db for targets in found])
    assert measured == pytest.approx(snr_db, abs=0.5)
    speeds = np.array([targets[0].velocity_mps for targets in found])
    assert np.abs(speeds.mean() - 5.0) < 0.02 * RADAR.velocity_resolution_mps


def test_an_empty_map_has_no_targets() -> None:
    rd_map = range_doppler(range_process(synthesizer_for(RADAR, WINDOW_M).result()))
    assert detect_targets(rd_map).targets == []


def test_files_of_detections(tmp_path: Path) -> None:
    found = detect_targets(range_doppler(range_process(scene(0.5, 1))), Cfar("os", 1e-7))
    table, record = write_detections(tmp_path / "frame_0001", found)
    with open(table, encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert float(rows[0]["velocity_mps"]) == found.targets[0].velocity_mps
    data = json.loads(record.read_text("utf-8"))
    assert data["targets"][0]["range_m"] == found.targets[0].range_m
    assert data["cfar"]["kind"] == "os"


@pytest.mark.parametrize("kind", ["ca", "os"])
@pytest.mark.parametrize("cells", [0.0, 31.6, 32.0, -31.7])
def test_guard_cells_of_a_target_wrap_around_in_doppler(kind: str, cells: float) -> None:
    """Its main lobe in noise is 5 rows by 12 cells; at +-PRF / 2 half of it is in the last rows."""
    rng = np.random.default_rng(6)
    rate_mps = cells * RADAR.velocity_resolution_mps
    echoes = synthesize(unit_paths(RADAR, [600.0], [rate_mps]), RADAR, range_limits_m=WINDOW_M)
    shape = echoes.samples.shape
    noise = 0.3 * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
    noisy = dataclasses.replace(echoes, samples=echoes.samples + noise)
    rd_map = range_doppler(range_process(noisy, "hamming"), "hamming")
    near = [
        target
        for target in detect_targets(rd_map, Cfar(kind, 1e-6)).targets
        if abs(target.range_m - 600.0) < 25.0
    ]
    assert len(near) == 1
    # -PRF / 2 and PRF / 2 are one place
    apart = (near[0].velocity_mps - rate_mps) / RADAR.velocity_resolution_mps
    assert min(abs(apart), 64 - abs(apart)) < 0.2
