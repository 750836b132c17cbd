# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of a burst, the options of their synthesis, their time axes, and several renders as one.

Where visibility changes during a burst (a target comes out from behind a wall) one render cannot
serve all of it. Each of several renders has its own table, whose paths have their lengths at every
pulse. `interpolate_renders` adds the echoes of all with weights that are hat functions of slow
time: 1 at the pulse that a render shows, 0 at its neighbours', and their sum is 1 at every pulse.
Phases are those of each render's own paths, so a surface seen by two of them fades from one to the
other without a jump.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ...arrays import Complex, Mask, Real
from ...contract import AmplitudeModel
from ...errors import ConfigError, SchemaError
from ...options import MAX_LENGTH_M
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..decoding import FrameInput
from ..radar import LineWaveform, PmcwWaveform, Radar
from ..spectrum import (
    TOLERANCE,
    Backend,
    Method,
    SynthesisReport,
)

Values = TypeVar("Values", Real, Complex)


@dataclass(frozen=True)
class Echoes:
    """Complex samples of one burst.

    Attributes
    ----------
    samples
        s(t_m, tau_n), (channels, rows, samples); |s|^2 in W for "radar-equation". One row
        per pulse; PMCW has one per code.
    first_sample_s
        Fast time of sample 0, from the middle of the transmitted pulse [s].
    range_limits_m
        One-way ranges whose echoes are recorded whole [m].
    radar
        Waveform and burst.
    amplitude_model
        See :func:`.scattering.path_amplitude`.
    outside
        Paths outside the window, counted once a pulse and divided by pulses.
    report
        How they were formed; None where they come from elsewhere.
    """

    samples: Complex
    first_sample_s: float
    range_limits_m: tuple[float, float]
    radar: Radar
    amplitude_model: AmplitudeModel
    outside: float
    report: SynthesisReport | None = None

    @property
    def fast_time_s(self) -> Real:
        """Time since the middle of the transmitted pulse, (samples,) [s]."""
        count = self.samples.shape[-1]
        times: Real = self.first_sample_s + np.arange(count) / self.radar.waveform.sampling_rate_hz
        return times

    @property
    def slow_time_s(self) -> Real:
        """Time of each pulse since the frame's time t, (pulses,) [s]; a channel's are
        ``channel.start_offset_s`` later.
        """
        return pulse_times_s(self.radar)

    @property
    def plane(self) -> Complex:
        """Samples of the only channel, (rows, samples), see `only_channel`."""
        return only_channel(self.samples)

    def channel(self, number: int) -> Echoes:
        """Return the echoes of one channel, counted from 0."""
        radar = one_channel(self.radar, number)
        return dataclasses.replace(self, samples=self.samples[number][None], radar=radar)


def only_channel(values: Values) -> Values:
    """Return values (1, ...) of a single channel without the axis of channels, as a view.
    `ConfigError`: there are several channels.
    """
    if values.shape[0] != 1:
        raise ConfigError(
            f"There are {values.shape[0]} channels; expected one. Choose one with channel(number)."
        )
    plane: Values = values[0]
    return plane


def one_channel(radar: Radar, number: int) -> Radar:
    """Return the radar with one of its channels alone, counted from 0. `ConfigError`: there is no
    such channel.
    """
    if not 0 <= number < len(radar.channels):
        raise ConfigError(
            f"Channel {number} of a radar with {len(radar.channels)}; expected 0 to "
            f"{len(radar.channels) - 1}."
        )
    return dataclasses.replace(radar, channels=(radar.channels[number],))


def pulse_times_s(radar: Radar) -> Real:
    """Return the times of the pulses, t_m = m / PRF.

    Parameters
    ----------
    radar
        Radar whose burst counts.

    Returns
    -------
    ndarray
        (pulses,) [s].
    """
    times: Real = np.arange(radar.burst.pulses) / radar.burst.prf_hz
    return times


def check_window(range_limits_m: tuple[float, float]) -> tuple[float, float]:
    """Return the range limits as two floats [m]. `ConfigError`: not 0 <= start < stop <= 1e15 m."""
    start_m, stop_m = float(range_limits_m[0]), float(range_limits_m[1])
    if not 0 <= start_m < stop_m <= MAX_LENGTH_M:
        raise ConfigError(
            f"Range limits from {start_m!r} to {stop_m!r} m; expected 0 <= start < stop, at most "
            f"{MAX_LENGTH_M:g} m."
        )
    return start_m, stop_m


def window_samples(radar: Radar, range_limits_m: tuple[float, float]) -> int:
    """Return the number of samples that the receiver records of each pulse. Pulses record their
    range limits; other waveforms record one sample per frequency.
    """
    waveform = radar.waveform
    if waveform.family == "line":
        return waveform.sample_count
    start_s, stop_s = (2 * r / SPEED_OF_LIGHT_MPS for r in range_limits_m)
    return math.ceil((stop_s - start_s) * waveform.sampling_rate_hz) + waveform.sample_count + 1


@dataclass(frozen=True)
class EchoOptions:
    """How echoes are formed.

    Attributes
    ----------
    amplitude_model
        "radar-equation" or "paper", see :func:`.scattering.path_amplitude`.
    receiver_gain
        G_r, linear.
    nufft_backend
        "finufft", or "direct" for the sum term by term, as a check.
    tolerance
        Relative L2 error of the spectrum S(f) against the direct sum.
    slow_time_transform
        "auto", "type3", "per-pulse" or "direct", see :class:`.spectrum.SpectrumAccumulator`.
    range_folding
        Whether echoes later than the pulse interval fall into the window of a later pulse. False:
        they stay at their true delay.
    motion_within_pulse
        Whether paths move while a pulse is under way. False: "stop and go". In FMCW and stepped
        frequency they always do.
    chunk
        Paths transformed at a time; the result does not depend on it beyond rounding.
    speckle_seed
        Seed of a random phase for each path, see :func:`.scattering.path_phasors`: the mean
        coherent power is then the sum of the powers. None: the plain sum, in which pixels of a
        smooth face add up in phase, so that levels grow with their number.
    """

    amplitude_model: AmplitudeModel = "radar-equation"
    receiver_gain: float = 1.0
    nufft_backend: Backend = "finufft"
    tolerance: float = TOLERANCE
    slow_time_transform: Method = "auto"
    range_folding: bool = True
    motion_within_pulse: bool = True
    chunk: int = 1 << 17
    speckle_seed: int | None = None


#: What is done unless asked otherwise.
DEFAULT_OPTIONS = EchoOptions()


def line_waveform(radar: Radar) -> LineWaveform:
    """Return the waveform of the radar. `ConfigError`: it is not of the family "line"."""
    waveform = radar.waveform
    if not isinstance(waveform, LineWaveform):
        raise ConfigError(f"A waveform of kind {waveform.kind!r} does not sample frequencies.")
    return waveform


def line_times_s(radar: Radar) -> Real:
    """Return the start of each row of samples, from the frame's time, (rows,) [s]: one row per
    pulse, for PMCW one per code.
    """
    waveform, times_s = radar.waveform, pulse_times_s(radar)
    if isinstance(waveform, PmcwWaveform):
        codes_s = np.arange(waveform.code_repeats) * waveform.code_s
        times_s = (times_s[:, None] + codes_s).ravel()
    return np.asarray(times_s)


def render_times_s(frame_input: FrameInput) -> list[float]:
    """Return the scene time that each render of a frame's burst shows, after the frame's time t
    [s].
    """
    motions = [table.motion for table in frame_input.tables]
    times = [0.0 if motion is None else motion.epoch_offset_s for motion in motions]
    if any(later <= earlier for earlier, later in itertools.pairwise(times)):
        raise SchemaError(
            f"{frame_input.frame.path}: the renders of its burst show {times} s; expected "
            "ascending times. Render the frame again."
        )
    return times


def pulses_of_render(radar: Radar, shown_s: Sequence[float], number: int) -> Mask:
    """Return a mask of the pulses to which this render contributes, in any channel, (pulses,).
    `shown_s` are the scene times of all renders after the start of the burst, ascending.
    """
    return np.asarray((_weights(radar, shown_s, number) > 0).any(axis=0))


def interpolate_renders(parts: Iterable[Echoes], shown_s: Sequence[float]) -> Echoes:
    """Interpolate the echoes of a burst between its renders, which show the scene at the ascending
    times `shown_s`. Each part needs the pulses of `pulses_of_render` only. A generator keeps one
    part in memory at a time.
    """
    total: Echoes | None = None
    for number, part in enumerate(parts):
        weight = _weights(part.radar, shown_s, number)
        rows = np.repeat(weight, part.samples.shape[1] // part.radar.burst.pulses, axis=1)
        samples, outside = rows[..., None] * part.samples, part.outside * float(weight.mean())
        if total is not None:
            samples, outside = samples + total.samples, total.outside + outside
        total = dataclasses.replace(total or part, samples=samples, outside=outside)
    assert total is not None  # a burst has at least one render
    return total


def _weights(radar: Radar, shown_s: Sequence[float], number: int) -> Real:
    """Return the weight of a render at each pulse of each channel, (channels, pulses). The weights
    of all renders add up to 1.
    """
    offsets_s = np.array([channel.start_offset_s for channel in radar.channels])
    times_s = pulse_times_s(radar) + offsets_s[:, None]
    nodes = np.asarray(shown_s, dtype=np.float64)
    if nodes.size == 1:
        return np.ones(times_s.shape)
    weights = np.interp(times_s.ravel(), nodes, np.eye(nodes.size)[number])
    return np.asarray(weights.reshape(times_s.shape))
