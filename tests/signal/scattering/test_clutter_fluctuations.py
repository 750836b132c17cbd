# SPDX-License-Identifier: GPL-3.0-or-later
"""Echoes of surfaces whose clutter has texture, or scatterers that move by themselves."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.signal import Burst, Radar, Waveform, open_run, synthesize
from radarsim_addon.signal.decoding import FrameInput, frame_paths, open_frame
from radarsim_addon.signal.maps import range_process
from radarsim_addon.signal.paths.paths import path_power_w
from radarsim_addon.signal.scattering import FrameSpeckle
from tests.signal import path_runs as pr

WAVELENGTH_M = pr.WAVEFORM.wavelength_m
WAVENUMBER = 2 * math.pi / WAVELENGTH_M
PRF_HZ, PULSES = 100.0, 128


def plate(folder: Path, **fluctuation: object) -> FrameInput:
    """A plate of 60 m at 1 km that faces the radar, 96 x 96 paths."""
    target = pr.plate("Plate", (0, 1000.0, 0), 60.0, 0.0)
    receiver = pr.camera(pr.pose((0, 0, 0)), math.degrees(0.6 * 60 / 1000))
    emitter = contract.TransmitterRecord(pr.pose((0, 0, 0)), 1e6)
    rows = pr.trace([target], receiver, emitter, 96)
    item = contract.ObjectRecord(
        "Plate", 1000.0, 1000.0, None, fluctuation=contract.FluctuationRecord(**fluctuation)
    )
    pr.write_run(
        folder, rows, ["Plate"], receiver, emitter, range_limits_m=2000.0,
        scene=contract.GroundTruthRecord(1, 0.0, [item]),
    )  # fmt: skip
    radar = Radar(Waveform(5.3e9, 2e6, 10e-6, 2.5e6), Burst(PRF_HZ, PULSES))
    return open_frame(open_run(folder).frame(1), radar=radar, range_limits_m=(500.0, 1500.0))


def pulses(frame: FrameInput, seed: int) -> np.ndarray:
    """The range cell of the plate, pulse by pulse, of the received echoes."""
    paths = FrameSpeckle(frame, seed, cell_m=1.0).apply(frame_paths(frame))
    echoes = synthesize(paths, frame.radar, range_limits_m=(500.0, 1500.0), speckle_seed=seed)
    found = range_process(echoes)
    return found.plane[:, int(np.argmin(np.abs(found.range_m - 1000.0)))]


def field(frame: FrameInput, seed: int, times_s: np.ndarray) -> np.ndarray:
    """Sum over all paths at the carrier, at times: one cell that holds the plate."""
    paths = FrameSpeckle(frame, seed, cell_m=1.0).apply(frame_paths(frame))
    start = (
        np.sqrt(path_power_w(paths, WAVELENGTH_M))
        * paths.phasors
        * np.exp(-1j * WAVENUMBER * paths.length_m)
    )
    turn = np.exp(-2j * WAVENUMBER * (times_s[1] - times_s[0]) * paths.range_rate_mps)
    found = []
    for _ in times_s:
        found.append(start.sum())
        start = start * turn
    return np.array(found)


STEP_S, LAGS = 0.01, 40
LAG_S = np.arange(LAGS) * STEP_S


@pytest.mark.parametrize(
    ("fluctuation", "expected"),
    [
        (
            {"motion": "gaussian", "motion_speed_mps": 0.03},
            np.exp(-((2 * WAVENUMBER * 0.03 * LAG_S) ** 2) / 2),
        ),
        (
            {"motion": "exponential", "motion_speed_mps": 0.04, "motion_fraction": 0.4},
            0.4 + 0.6 / (1 + (2 * WAVENUMBER * 0.04 * LAG_S) ** 2),
        ),
    ],
)
def test_pulses_have_the_correlation_of_the_spectrum(
    tmp_path: Path, fluctuation: dict, expected: np.ndarray
) -> None:
    """Bursts of 10 s hold some 50 independent echoes: of 60 the error is about 0.02."""
    frame, times_s = plate(tmp_path / "run", **fluctuation), np.arange(1000) * STEP_S
    total = np.zeros(LAGS, dtype=complex)
    for seed in range(60):
        one = field(frame, seed, times_s)
        total += [np.mean(one[lag:] * one[: one.size - lag].conj()) for lag in range(LAGS)]
    found = total / total[0]
    assert np.abs(found - expected).max() < 0.05
    assert expected[-1] < 0.5


def test_received_pulses_are_those_sums(tmp_path: Path) -> None:
    frame = plate(tmp_path / "run", motion="gaussian", motion_speed_mps=0.03)
    received = pulses(frame, 4)
    summed = field(frame, 4, np.arange(PULSES) / PRF_HZ)
    alike = np.vdot(received, summed) / np.linalg.norm(received) / np.linalg.norm(summed)
    # the cell weighs ranges by the response of the waveform
    assert abs(alike) > 0.999


def test_without_motion_all_pulses_are_the_same(tmp_path: Path) -> None:
    cell = pulses(plate(tmp_path / "run", texture="k", texture_shape=1.0, texture_length_m=3.0), 1)
    assert np.abs(cell / cell[0] - 1).max() < 1e-9


def test_texture_keeps_the_mean_power_and_gives_scatterers_its_distribution(
    tmp_path: Path,
) -> None:
    """Powers of scatterers far apart: mean 1, and the variance 1/nu of a gamma distribution."""
    plain = plate(tmp_path / "plain")
    frame = plate(tmp_path / "run", texture="k", texture_shape=0.8, texture_length_m=1.5)
    ratios = []
    for seed in range(60):
        power = [
            path_power_w(paths, WAVELENGTH_M) * np.abs(paths.phasors) ** 2
            for paths in (FrameSpeckle(one, seed, cell_m=1.0).apply(frame_paths(one))
                          for one in (plain, frame))
        ]  # fmt: skip
        ratios.append(power[1] / power[0])
    ratio = np.concatenate(ratios)
    # some 1500 patches of the length in each of 60 realisations: mean 0.004, variance 1 %
    assert ratio.mean() == pytest.approx(1.0, abs=0.015)
    assert 1 / ratio.var() == pytest.approx(0.8, rel=0.06)


def test_scatterers_keep_their_velocity_from_frame_to_frame(tmp_path: Path) -> None:
    """A frame later is the same echo as that many pulses later."""
    frame = plate(tmp_path / "run", motion="gaussian", motion_speed_mps=0.03)
    speckle = FrameSpeckle(frame, 3, cell_m=1.0)
    paths = speckle.apply(frame_paths(frame))
    now = np.sum(
        np.sqrt(path_power_w(paths, WAVELENGTH_M)) * paths.phasors
        * np.exp(-1j * WAVENUMBER * (paths.length_m + 2 * paths.range_rate_mps * 0.2))
    )  # fmt: skip
    speckle._time_s = 0.2
    later = speckle.apply(frame_paths(frame))
    then = np.sum(
        np.sqrt(path_power_w(later, WAVELENGTH_M))
        * later.phasors
        * np.exp(-1j * WAVENUMBER * later.length_m)
    )
    assert then == pytest.approx(now, rel=1e-6)
