# SPDX-License-Identifier: GPL-3.0-or-later
"""Stationary and moving points, seen by every waveform, for tests of maps."""

import dataclasses

import numpy as np

from radarsim_addon.signal import (
    Burst,
    Echoes,
    FmcwWaveform,
    Peak,
    PhaseCodedPulse,
    PmcwWaveform,
    Radar,
    RangeDopplerMap,
    SteppedWaveform,
    Waveform,
    mti_cancel,
    range_doppler,
    synthesize,
)
from radarsim_addon.signal.maps import range_process
from radarsim_addon.signal.radar import AnyWaveform
from tests.signal.oracle import unit_paths

BURST = Burst(1000.0, 64)
WAVEFORMS: dict[str, AnyWaveform] = {
    "chirp": Waveform(5.3e9, 50e6, 2.5e-6, 60e6),
    "barker": PhaseCodedPulse(5.3e9, 20e-9, 13),
    "fmcw": FmcwWaveform(5.3e9, 50e6, 512, 1e6),
    "fmcw real": FmcwWaveform(5.3e9, 50e6, 1024, 2e6, real_adc=True),
    "stepped": SteppedWaveform(5.3e9, 100e3, 500, 1.5e-6),
    "pmcw": PmcwWaveform(5.3e9, 20e-9, 9, code_repeats=8),
}
WINDOWS = ["none", "hann", "hamming", "taylor:4:-35", "kaiser:3", "kaiser:8"]
#: Each waveform with two windows, each window with two waveforms.
PAIRS = [(name, WINDOWS[(i + j) % 6]) for i, name in enumerate(WAVEFORMS) for j in (0, 3)]


def radar_of(name: str) -> Radar:
    """Of 64 pulses."""
    return Radar(WAVEFORMS[name], BURST)


def scene(
    name: str,
    echoes: list[tuple[float, float, float]],
    range_limits_m: tuple[float, float],
    window: str,
    mti: int = 0,
) -> tuple[Echoes, RangeDopplerMap]:
    """Echoes of points (range [m], speed [Doppler cells, receding], level [dB]), and their map."""
    radar = radar_of(name)
    range_m, cells, level_db = np.array(echoes).T
    paths = unit_paths(radar, list(range_m), list(cells * radar.velocity_resolution_mps))
    paths = dataclasses.replace(paths, radiance=paths.radiance * 10 ** (level_db / 10))
    found = synthesize(paths, radar, range_limits_m=range_limits_m)
    if name == "fmcw real":
        found = dataclasses.replace(found, samples=found.samples.real.astype(complex))
    compressed = range_process(found, window)
    return found, range_doppler(mti_cancel(compressed, mti) if mti else compressed, window)


def clutter(count: int, seed: int) -> list[tuple[float, float, float]]:
    """Stationary points, up to 30 dB above a target of 0 dB."""
    rng = np.random.default_rng(seed)
    return [(rng.uniform(100, 800), 0.0, rng.uniform(-20, 30)) for _ in range(count)]


def speeds(moving_targets: list[Peak], name: str) -> list[float]:
    """In Doppler cells."""
    radar = radar_of(name)
    return [target.velocity_mps / radar.velocity_resolution_mps for target in moving_targets]
