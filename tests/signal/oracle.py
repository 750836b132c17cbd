# SPDX-License-Identifier: GPL-3.0-or-later
"""Eq. 9-14 of the paper, term by term in the time domain: no transform, no sampled chirp."""

import numpy as np

from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal import Paths, Radar, Waveform, path_amplitude


def echo_at(
    paths: Paths, radar: Radar, fast_time_s: np.ndarray, slow_time_s: np.ndarray
) -> np.ndarray:
    """s = sum_i a_i rect((tau-tau_i)/T_p) exp(j pi K (tau-tau_i)^2) exp(-j 2 pi f0 tau_i)."""
    waveform = radar.waveform
    assert isinstance(waveform, Waveform)
    amplitude = path_amplitude(paths, waveform.wavelength_m)
    samples = np.zeros((slow_time_s.size, fast_time_s.size), dtype=complex)
    for pulse, time_s in enumerate(slow_time_s):
        for a, length_m, rate_mps in zip(
            amplitude, paths.length_m, paths.range_rate_mps, strict=True
        ):
            delay_s = (length_m + 2 * rate_mps * time_s) / SPEED_OF_LIGHT_MPS
            t = fast_time_s - delay_s
            chirp = np.exp(1j * np.pi * waveform.fm_rate_hz_per_s * t**2)
            inside = np.abs(t) <= waveform.chirp_duration_s / 2
            carrier = np.exp(-2j * np.pi * waveform.carrier_hz * delay_s)
            samples[pulse] += a * inside * chirp * carrier
    return samples


def unit_paths(radar: Radar, range_m: list[float], rate_mps: list[float] | float = 0.0) -> Paths:
    """Paths of amplitude 1 at these ranges."""
    from radarsim_addon.signal import make_paths

    aperture = radar.waveform.wavelength_m**2 / (4 * np.pi)
    return make_paths(1 / aperture, 2 * np.asarray(range_m, float), np.asarray(rate_mps, float))
