# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectrogram: levels, axes, and the sinusoid of a point that turns."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import (
    Burst,
    FmcwWaveform,
    Radar,
    Spectrogram,
    SpectrogramOptions,
    range_process,
    spectrogram,
    synthesize,
)
from radarsim_addon.signal.maps import RangeProfiles
from tests.signal.oracle import unit_paths
from tests.signal.waveform_kinds import ALL, burst_of

RADAR = Radar(FmcwWaveform(24e9, 180e6, 64, 5e6, 20e-6), Burst(10e3, 512))
LIMITS_M = (0.0, 40.0)


def profiles(radar: Radar, range_m: list[float], rate_mps: float = 0.0) -> RangeProfiles:
    paths = unit_paths(radar, range_m, rate_mps)
    far_m = min(2 * max(range_m), 0.9 * radar.waveform.unambiguous_range_m)
    return range_process(synthesize(paths, radar, range_limits_m=(0.0, far_m)))


@pytest.mark.parametrize("waveform", ALL, ids=lambda one: one.kind)
def test_a_unit_path_has_0_db_at_its_doppler_and_windows_are_evenly_spaced(waveform) -> None:
    """One path that recedes by three Doppler cells of the window, wherever it is in its cell."""
    radar = burst_of(waveform, 64)
    prf_hz, wavelength_m = radar.burst.prf_hz, waveform.wavelength_m
    rate_mps = 3 * prf_hz / 32 * wavelength_m / 2
    unambiguous_m = waveform.unambiguous_range_m
    middle_m = min(100 * waveform.range_resolution_m, unambiguous_m / 2)
    for shift in (0.0, 0.3):
        range_m = middle_m + shift * waveform.sample_spacing_m
        found = spectrogram(
            profiles(radar, [range_m], rate_mps), SpectrogramOptions(32, overlap=0.5)
        )
        assert found.power.shape == (3, 32)
        np.testing.assert_allclose(found.time_s * prf_hz, [15.5, 31.5, 47.5])
        assert found.velocity_mps[13] == pytest.approx(rate_mps)
        assert found.doppler_hz[13] == pytest.approx(-3 * prf_hz / 32)
        # A code of PMCW loses 1 - sinc^2(3/32) = 3 % to a Doppler within it; range migration and
        # the sidelobes beyond the limits take less than 0.1 dB of the others.
        tolerance = 0.03 if waveform.kind == "pmcw" else 0.02
        np.testing.assert_allclose(found.power[:, 13], 1.0, rtol=tolerance)


def test_paths_in_different_cells_add_their_powers_and_range_limits_choose() -> None:
    both = profiles(RADAR, [10.0, 25.0])
    middle = 32
    assert spectrogram(both).power[:, middle] == pytest.approx(2.0, rel=0.02)
    near = spectrogram(both, SpectrogramOptions(limits_m=(4.0, 16.0)))
    assert near.power[:, middle] == pytest.approx(1.0, rel=0.02)
    assert near.range_limits_m == (4.0, 16.0)


@pytest.fixture(scope="module")
def rotating() -> tuple[Spectrogram, float, float]:
    """A point 0.1 m from an axis 20 m away, 10 turns a second: half a turn in the burst."""
    rho_m, turns_hz = 0.1, 10.0
    times_s = np.arange(RADAR.burst.pulses) / RADAR.burst.prf_hz
    single = dataclasses.replace(RADAR, burst=Burst(RADAR.burst.prf_hz, 1))
    lines = [
        range_process(
            synthesize(
                unit_paths(single, [20.0 + rho_m * np.sin(2 * np.pi * turns_hz * time_s)]),
                single,
                range_limits_m=LIMITS_M,
                nufft_backend="direct",
            )
        )
        for time_s in times_s
    ]
    values = np.concatenate([line.values for line in lines], axis=1)
    whole = RangeProfiles(values, lines[0].range_m, RADAR, lines[0].range_taper)
    return spectrogram(whole, SpectrogramOptions(32, 0.9)), rho_m, 2 * np.pi * turns_hz


def test_a_rotating_point_draws_its_sinusoid(rotating: tuple[Spectrogram, float, float]) -> None:
    """f_D = -(2 / lambda) rho Omega cos(Omega t), within half a Doppler cell, at its power.

    Within a window the Doppler changes by less than a cell: the ridge stays above -1 dB.
    """
    found, rho_m, omega = rotating
    expected_hz = -2 / RADAR.waveform.wavelength_m * rho_m * omega * np.cos(omega * found.time_s)
    cell_hz = RADAR.burst.prf_hz / 32
    assert np.ptp(expected_hz) > 5 * cell_hz  # otherwise the test sees no sinusoid
    rows = np.arange(found.time_s.size)
    best = found.power.argmax(axis=1)
    assert np.abs(found.doppler_hz[best] - expected_hz).max() <= 0.55 * cell_hz
    # Centre of gravity of the main lobe: a finer look at the same sinusoid.
    near = best[:, None] + np.arange(-2, 3)
    weight = found.power[rows[:, None], near]
    centre_hz = (weight * found.doppler_hz[near]).sum(axis=1) / weight.sum(axis=1)
    assert np.abs(centre_hz - expected_hz).max() < 0.1 * cell_hz
    assert 10 * np.log10(found.power.max()) == pytest.approx(0.0, abs=0.1)


def test_what_does_not_fit_is_refused() -> None:
    short = profiles(RADAR, [10.0])
    with pytest.raises(ConfigError, match="window of 1024 pulses in a burst of 512"):
        spectrogram(short, SpectrogramOptions(1024))
    with pytest.raises(ConfigError, match="hold no range cell"):
        spectrogram(short, SpectrogramOptions(limits_m=(900.0, 901.0)))
    with pytest.raises(ConfigError, match="Range limits"):
        SpectrogramOptions(limits_m=(5.0, 1.0))
    with pytest.raises(ConfigError):
        SpectrogramOptions(1)
