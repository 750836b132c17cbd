# SPDX-License-Identifier: GPL-3.0-or-later
"""What processing makes of white noise: the floor of profiles and maps, for every waveform.

A cell's noise power is that of one raw sample, k T_s fs, times a gain well below 1; a path of power
P peaks at P. So SNR = P / (k T_s fs gain), which for a matched filter without windows is the
textbook's P T / (k T_s) times the number of pulses.
"""

from __future__ import annotations

import numpy as np

from ..radar import (
    LineWaveform,
    PmcwWaveform,
    Radar,
    matched_filter,
    replica_count,
    slow_time_window,
)
from .compress_frequencies import line_noise_gain


def coherent_samples(radar: Radar) -> int:
    """Raw samples that carry one pulse's echo, and add up coherently in its range cell."""
    waveform = radar.waveform
    if isinstance(waveform, LineWaveform):
        repeats = waveform.code_repeats if isinstance(waveform, PmcwWaveform) else 1
        return waveform.grid_count * repeats
    return replica_count(waveform)


def range_noise_gain(radar: Radar, range_taper: str = "hamming") -> float:
    """Noise power of a compressed range cell over that of a raw complex sample."""
    waveform = radar.waveform
    if isinstance(waveform, LineWaveform):
        return line_noise_gain(waveform, range_taper)
    size = 4 * replica_count(waveform)
    return float(np.mean(np.abs(matched_filter(waveform, size, range_taper)) ** 2))


def map_noise_gain(
    radar: Radar, range_taper: str = "hamming", doppler_taper: str = "hamming"
) -> float:
    """Noise power of a cell of the range-Doppler map over that of a raw complex sample."""
    weight = slow_time_window(doppler_taper, radar.burst.pulses)
    return range_noise_gain(radar, range_taper) * float(np.sum(weight**2) / weight.sum() ** 2)
