# SPDX-License-Identifier: GPL-3.0-or-later
"""Point echoes of known range, speed and level, received by every kind of waveform; no renders."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from radarsim_addon.signal import (
    Burst,
    Echoes,
    FmcwWaveform,
    PhaseCodedPulse,
    PmcwWaveform,
    Radar,
    RangeDopplerMap,
    SteppedWaveform,
    Waveform,
    make_paths,
    mti_cancel,
    range_doppler,
    synthesize,
)
from radarsim_addon.signal.maps import range_process
from radarsim_addon.signal.radar import AnyWaveform, LineWaveform

#: Of 50 MHz each: cells of 2.5 to 3 m, whatever the kind.
WAVEFORMS: dict[str, AnyWaveform] = {
    "LFM": Waveform(5.3e9, 50e6, 2.5e-6, 60e6),
    "Barker": PhaseCodedPulse(5.3e9, 20e-9, 13),
    "FMCW": FmcwWaveform(5.3e9, 50e6, 512, 1e6),
    "FMCW, real ADC": FmcwWaveform(5.3e9, 50e6, 1024, 2e6, real_adc=True),
    "stepped": SteppedWaveform(5.3e9, 100e3, 500, 1.5e-6),
    "PMCW": PmcwWaveform(5.3e9, 20e-9, 9, code_repeats=8),
}
WINDOWS = {
    "none": "none",
    "Hann": "hann",
    "Hamming": "hamming",
    "Taylor 4, -35 dB": "taylor:4:-35",
    "Kaiser 8": "kaiser:8",
}
#: Range [m], range rate [Doppler cells, receding], level [dB].
Point = tuple[float, float, float]


def radar_of(name: str) -> Radar:
    """Of 64 pulses."""
    return Radar(WAVEFORMS[name], Burst(1000.0, 64))


def received(
    name: str,
    points: Sequence[Point],
    range_limits_m: tuple[float, float],
    window: str,
    mti: int = 0,
) -> tuple[Echoes, RangeDopplerMap]:
    """Echoes of points, and their map."""
    radar = radar_of(name)
    range_m, cells, level_db = np.array(points, dtype=np.float64).T
    aperture_m2 = radar.waveform.wavelength_m**2 / (4 * math.pi)
    paths = make_paths(
        10 ** (level_db / 10) / aperture_m2, 2 * range_m, cells * radar.velocity_resolution_mps
    )
    echoes = synthesize(paths, radar, range_limits_m=range_limits_m)
    if isinstance(radar.waveform, FmcwWaveform) and radar.waveform.real_adc:
        echoes = dataclasses.replace(echoes, samples=echoes.samples.real.astype(complex))
    return echoes, map_of(echoes, window, mti)


def map_of(echoes: Echoes, window: str, mti: int = 0) -> RangeDopplerMap:
    """The same window over frequencies and over pulses."""
    compressed = range_process(echoes, window)
    return range_doppler(mti_cancel(compressed, mti) if mti else compressed, window)


def apparent_range_m(radar: Radar, range_m: float, rate_mps: float) -> float:
    """Where a map shows an echo: in the middle of the burst, with the range-Doppler coupling.

    A waveform that sweeps is received at its carrier f_c over its slope earlier (Richards,
    Fundamentals of Radar Signal Processing, 4.6).
    """
    waveform = radar.waveform
    time_s = (radar.burst.pulses - 1) / 2 / radar.burst.prf_hz
    if isinstance(waveform, Waveform):
        time_s += waveform.carrier_hz / waveform.fm_rate_hz_per_s
    elif isinstance(waveform, PmcwWaveform):
        time_s += waveform.duration_s / 2
    elif isinstance(waveform, LineWaveform):
        slope_hz_per_s = waveform.grid_step_hz / waveform.grid_interval_s
        time_s += waveform.grid_middle_s + waveform.carrier_hz / slope_hz_per_s
    return range_m + rate_mps * time_s
