# SPDX-License-Identifier: GPL-3.0-or-later
"""White noise after processing: the floor of profiles and maps, for every waveform.

A cell's noise power is that of one raw sample, k T_s fs, times a gain well below 1; a path of power
P peaks at P. So SNR = P / (k T_s fs gain), which for a matched filter without tapers is the
textbook's P T / (k T_s) times the number of pulses.
"""

from __future__ import annotations

import numpy as np

from ..radar import (
    LineWaveform,
    PmcwWaveform,
    Radar,
    matched_filter,
    slow_time_window,
)
from .compress_frequencies import line_noise_gain


def coherent_samples(radar: Radar) -> int:
    """Return the number of raw samples that add up coherently in one pulse's range cell.

    Parameters
    ----------
    radar
        Waveform and burst.

    Returns
    -------
    int
        Number of samples.
    """
    waveform = radar.waveform
    if isinstance(waveform, LineWaveform):
        repeats = waveform.code_repeats if isinstance(waveform, PmcwWaveform) else 1
        return waveform.grid_count * repeats
    return waveform.sample_count


def range_noise_gain(radar: Radar, range_taper: str = "hamming") -> float:
    """Return the noise power of a compressed range cell over that of a raw complex sample.

    Parameters
    ----------
    radar
        Waveform and burst.
    range_taper
        Range taper by name.

    Returns
    -------
    float
        Power gain.
    """
    waveform = radar.waveform
    if isinstance(waveform, LineWaveform):
        return line_noise_gain(waveform, range_taper)
    size = 4 * waveform.sample_count
    return float(np.mean(np.abs(matched_filter(waveform, size, range_taper)) ** 2))


def map_noise_gain(
    radar: Radar, range_taper: str = "hamming", doppler_taper: str = "hamming"
) -> float:
    """Return the noise power of a cell of the map over that of a raw complex sample.

    Parameters
    ----------
    radar
        Waveform and burst.
    range_taper, doppler_taper
        Range taper and Doppler taper by name.

    Returns
    -------
    float
        Power gain.
    """
    weight = slow_time_window(doppler_taper, radar.burst.pulses)
    return range_noise_gain(radar, range_taper) * float(np.sum(weight**2) / weight.sum() ** 2)
