# SPDX-License-Identifier: GPL-3.0-or-later
"""Eq. 9-14 of the paper, term by term in the time domain, at retarded times: no transform."""

import numpy as np

from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal import Paths, PmcwWaveform, Radar, Waveform, path_amplitude, replica


def emitted_s(
    received_s: np.ndarray, length_m: float, rate_mps: float, start_s: float
) -> np.ndarray:
    """When the wave left that is received at these times, all counted from `start_s`.

    It meets the scatterer half way: c (t - u) = 2 R((t + u) / 2), R = l / 2 + v t.
    """
    sent_s = received_s - length_m / SPEED_OF_LIGHT_MPS
    for _ in range(8):  # each round gains seven digits
        met_s = start_s + (received_s + sent_s) / 2
        sent_s = received_s - (length_m + 2 * rate_mps * met_s) / SPEED_OF_LIGHT_MPS
    return sent_s


def pulse_at(radar: Radar, time_s: np.ndarray) -> np.ndarray:
    """w(t): rect(t / T_p) exp(j pi K t^2) of a chirp, else the samples between which sinc is.

    PMCW repeats its code, from the first sample at t = 0, with sincs summed over all repeats.
    """
    waveform = radar.waveform
    if isinstance(waveform, Waveform):
        chirp = np.exp(1j * np.pi * waveform.fm_rate_hz_per_s * time_s**2)
        return (np.abs(time_s) <= waveform.chirp_duration_s / 2) * chirp
    samples = replica(waveform)
    if isinstance(waveform, PmcwWaveform):
        assert samples.size % 2  # of an even number the highest frequency has no sign
        apart = np.pi * (time_s[:, None] * waveform.sampling_rate_hz - np.arange(samples.size))
        below = samples.size * np.sin(apart / samples.size)
        near = np.abs(below) < 1e-9
        return np.where(near, 1.0, np.sin(apart) / np.where(near, 1.0, below)) @ samples
    place = time_s * waveform.sampling_rate_hz + (samples.size - 1) / 2
    return np.sinc(place[:, None] - np.arange(samples.size)) @ samples


def echo_at(
    paths: Paths, radar: Radar, fast_time_s: np.ndarray, slow_time_s: np.ndarray
) -> np.ndarray:
    """s = sum_i a_i w(u_i) exp(-j 2 pi f0 (t - u_i)), emitted at u_i and received at t."""
    amplitude = path_amplitude(paths, radar.waveform.wavelength_m)
    samples = np.zeros((slow_time_s.size, fast_time_s.size), dtype=complex)
    for pulse, time_s in enumerate(slow_time_s):
        for a, length_m, rate_mps in zip(
            amplitude, paths.length_m, paths.range_rate_mps, strict=True
        ):
            sent_s = emitted_s(fast_time_s, length_m, rate_mps, time_s)
            carrier = np.exp(-2j * np.pi * radar.waveform.carrier_hz * (fast_time_s - sent_s))
            samples[pulse] += a * pulse_at(radar, sent_s) * carrier
    return samples


def unit_paths(radar: Radar, range_m: list[float], rate_mps: list[float] | float = 0.0) -> Paths:
    """Paths of amplitude 1 at these ranges."""
    from radarsim_addon.signal import make_paths

    aperture = radar.waveform.wavelength_m**2 / (4 * np.pi)
    return make_paths(1 / aperture, 2 * np.asarray(range_m, float), np.asarray(rate_mps, float))
