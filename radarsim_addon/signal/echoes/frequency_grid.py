# SPDX-License-Identifier: GPL-3.0-or-later
"""Frequency-sampled waveforms: pulses, grid and ramp that their synthesis needs."""

from __future__ import annotations

from fractions import Fraction
from typing import Protocol

import numpy as np

from ...array_types import Complex, Real
from ...errors import ConfigError
from ..radar import FmcwWaveform, LineWaveform, PmcwWaveform, Radar
from ..spectrum import FrequencyGrid, Ramp


def line_waveform(radar: Radar) -> LineWaveform:
    """The radar's waveform, which must be of the family "line" (`ConfigError`)."""
    waveform = radar.waveform
    if not isinstance(waveform, LineWaveform):
        raise ConfigError(f"A waveform of kind {waveform.kind!r} does not sample frequencies.")
    return waveform


def line_times_s(radar: Radar) -> Real:
    """Return when each row of samples begins, from the frame's time.

    Parameters
    ----------
    radar
        Waveform and burst.

    Returns
    -------
    ndarray
        (rows,) [s]; one row per pulse, for PMCW one per code.
    """
    waveform = radar.waveform
    times_s = np.arange(radar.burst.pulses) / radar.burst.prf_hz
    if isinstance(waveform, PmcwWaveform):
        codes_s = np.arange(waveform.code_repeats) * waveform.code_s
        times_s = (times_s[:, None] + codes_s).ravel()
    return np.asarray(times_s)


class Oscillator(Protocol):
    """What multiplies the samples of a path of some delay."""

    @property
    def step_s(self) -> float:
        """Distance of the delays for which there are factors [s]."""

    def factor(self, order: int) -> Complex:
        """At the delay order x step_s, (rows, N)."""


def line_grid(waveform: LineWaveform) -> FrequencyGrid:
    """Frequencies of the samples, exact where the engine has its zero."""
    ahead = waveform.grid_count // 2 - Fraction(waveform.grid_middle)
    centre_hz = Fraction(waveform.carrier_hz) + ahead * Fraction(waveform.grid_step_hz)
    return FrequencyGrid.centred(centre_hz, waveform.grid_step_hz, waveform.grid_count)


def line_ramp(waveform: LineWaveform) -> Ramp | None:
    """When they are taken; None: all at once."""
    if waveform.grid_interval_s == 0:
        return None
    video = waveform.slope_hz_per_s if isinstance(waveform, FmcwWaveform) else 0.0
    return Ramp(waveform.grid_interval_s, video)
