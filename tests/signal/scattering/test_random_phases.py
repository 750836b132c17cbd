# SPDX-License-Identifier: GPL-3.0-or-later
"""Random phases: the mean coherent power is the sum of the powers, whatever the sampling."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from radarsim_addon import signal

RADAR = signal.Radar(signal.Waveform(5.3e9, 50e6, 2.5e-6, 60e6), signal.Burst(1000.0, 4))
WINDOW_M = (900.0, 1100.0)


def face(pixels: int) -> signal.Paths:
    """A face at 1000 m that receives 1 W in all, seen by this many pixels."""
    paths = signal.make_paths(np.full(pixels, 1.0), 2000.0)
    power = signal.path_power_w(paths, RADAR.waveform.wavelength_m)
    return dataclasses.replace(
        paths,
        solid_angle_sr=paths.solid_angle_sr / power.sum(),
        row=np.arange(pixels, dtype=np.int32),
    )


def peak_power(paths: signal.Paths, seed: int | None) -> float:
    echoes = signal.synthesize(paths, RADAR, range_limits_m=WINDOW_M, speckle_seed=seed)
    return float((np.abs(signal.range_process(echoes).plane) ** 2).max())


@pytest.mark.parametrize("pixels", [100, 400])
def test_mean_power_is_the_sum_of_the_powers(pixels: int) -> None:
    """Without random phases the level would be N W for N pixels of 1/N W; its spread is that of
    exponential intensity, so the mean of 300 is within 6 % (one standard error)."""
    paths = face(pixels)
    assert peak_power(paths, None) == pytest.approx(pixels, rel=2e-3)  # between samples
    found = np.array([peak_power(paths, seed) for seed in range(300)])
    assert found.mean() == pytest.approx(1.0, abs=0.25)
    assert found.std() == pytest.approx(found.mean(), rel=0.3)


def test_phases_are_uniform_and_differ_from_path_to_path_and_seed_to_seed() -> None:
    paths = face(20_000)
    phasors = signal.path_phasors(paths, 3)
    np.testing.assert_allclose(np.abs(phasors), 1, atol=1e-15)
    counts, _ = np.histogram(np.angle(phasors), 20, (-np.pi, np.pi))
    # chi-squared of 19 degrees of freedom: 43.8 at a probability of 0.1 %
    assert np.sum((counts - 1000) ** 2 / 1000) < 43.8
    for other in (phasors[1:] * np.conj(phasors[:-1]), signal.path_phasors(paths, 4)[1:]):
        assert abs(np.mean(other * np.conj(phasors[1:]))) < 5 / np.sqrt(20_000)


def test_phases_do_not_depend_on_how_paths_are_split() -> None:
    paths = face(1000)
    parts = [paths.select(slice(0, 300)), paths.select(slice(300, 1000))]
    joined = np.concatenate([signal.path_phasors(part, 7) for part in parts])
    assert (joined == signal.path_phasors(paths, 7)).all()
    whole, split = (
        signal.synthesize(p, RADAR, range_limits_m=WINDOW_M, speckle_seed=7).plane
        for p in (paths, parts)
    )
    np.testing.assert_allclose(split, whole, atol=1e-9 * np.abs(whole).max())


def test_phases_are_the_same_at_every_pulse() -> None:
    echoes = signal.synthesize(face(100), RADAR, range_limits_m=WINDOW_M, speckle_seed=1)
    assert (echoes.plane == echoes.plane[0]).all()
