# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of a burst, the options of their synthesis, and their time axes."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol, TypeVar

import numpy as np

from ...arrays import Complex, Mask, Real
from ...contract import AmplitudeModel
from ...errors import ConfigError, SchemaError
from ...options import MAX_LENGTH_M
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..decoding import FrameInput
from ..paths import Paths
from ..radar import Channel, FmcwWaveform, LineWaveform, PmcwWaveform, Radar
from ..scattering import Link, amplitude_history
from ..spectrum import (
    TOLERANCE,
    AmplitudeHistory,
    Backend,
    FrequencyGrid,
    Method,
    Ramp,
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
    """Return values of a single channel without the axis of channels.

    Parameters
    ----------
    values
        (1, ...).

    Returns
    -------
    ndarray
        (...), a view.

    Raises
    ------
    ConfigError
        There are several channels.
    """
    if values.shape[0] != 1:
        raise ConfigError(
            f"There are {values.shape[0]} channels; expected one. Choose one with channel(number)."
        )
    plane: Values = values[0]
    return plane


def one_channel(radar: Radar, number: int) -> Radar:
    """Return the radar with one of its channels.

    Parameters
    ----------
    radar
        Radar of at least one channel.
    number
        Channel, from 0.

    Returns
    -------
    Radar
        With that channel alone.

    Raises
    ------
    ConfigError
        There is no such channel.
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
    """Return the range limits as two floats.

    Parameters
    ----------
    range_limits_m
        One-way ranges (start, stop) [m].

    Returns
    -------
    start_m, stop_m
        The same [m].

    Raises
    ------
    ConfigError
        Not 0 <= start < stop, or a stop above 1e15 m.
    """
    start_m, stop_m = float(range_limits_m[0]), float(range_limits_m[1])
    if not 0 <= start_m < stop_m <= MAX_LENGTH_M:
        raise ConfigError(
            f"Range limits from {start_m!r} to {stop_m!r} m; expected 0 <= start < stop, at most "
            f"{MAX_LENGTH_M:g} m."
        )
    return start_m, stop_m


def window_samples(radar: Radar, range_limits_m: tuple[float, float]) -> int:
    """Return the samples that the receiver records of each pulse.

    Parameters
    ----------
    radar
        Pulses record their range limits; other waveforms a sample for each frequency.
    range_limits_m
        One-way ranges (start, stop) [m].

    Returns
    -------
    int
        Number of samples.
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
        "auto" (finufft where installed), "finufft", "numpy" or "direct" (term by term, for checks).
    tolerance
        Relative L2 error of the spectrum S(f) against the direct sum.
    slow_time_transform
        "auto", "type3", "per-pulse" or "direct", see
        :class:`.spectrum.accumulator.SpectrumAccumulator`.
    range_folding
        Whether echoes later than the pulse interval fall into the window of a later pulse. False:
        they stand at their true delay.
    motion_within_pulse
        Whether paths move while a pulse is under way. False: "stop and go". Of FMCW and stepped
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
    nufft_backend: Backend = "auto"
    tolerance: float = TOLERANCE
    slow_time_transform: Method = "auto"
    range_folding: bool = True
    motion_within_pulse: bool = True
    chunk: int = 1 << 17
    speckle_seed: int | None = None

    def history(
        self, paths: Paths, channel: Channel, radar: Radar, link: Link | None
    ) -> AmplitudeHistory:
        """Return the amplitudes of paths in a channel, see :func:`.scattering.amplitude`."""
        return amplitude_history(
            paths,
            channel,
            frequency_hz=radar.waveform.carrier_hz,
            pulses=radar.burst.pulses,
            amplitude_model=self.amplitude_model,
            receiver_gain=self.receiver_gain,
            link=link,
            speckle_seed=self.speckle_seed,
        )


#: What is done unless asked otherwise.
DEFAULT_OPTIONS = EchoOptions()


# -------------------------------------------------------------------------------------------------
# Frequency-sampled waveforms: pulses, grid and ramp that their synthesis needs.
# -------------------------------------------------------------------------------------------------


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


# -------------------------------------------------------------------------------------------------
# Several renders of one burst as one: each stands for the pulses around the time it shows.
#
# Where visibility changes during a burst (a target comes out from behind a wall) one render cannot
# serve it all. Each of several has its own table, whose paths have their lengths at every pulse.
# The echoes of all are added with weights that are hat functions of slow time: 1 at the pulse that
# a render shows, 0 at its neighbours', and their sum is 1 at every pulse. Phases are those of each
# render's own paths, so what is seen by two of them fades from one to the other without a jump.
# -------------------------------------------------------------------------------------------------


def interpolation_weights(slow_time_s: Real, shown_s: Sequence[float]) -> Real:
    """Weights of renders that show the scene at `shown_s`, (renders, pulses); columns sum to 1."""
    nodes = np.asarray(shown_s, dtype=np.float64)
    if nodes.size == 1:
        return np.ones((1, slow_time_s.size))
    hats = np.eye(nodes.size)
    return np.array([np.interp(slow_time_s, nodes, hat) for hat in hats])


def render_times_s(frame_input: FrameInput) -> list[float]:
    """Return when each render of a frame's burst shows the scene, after the frame's time t.

    Parameters
    ----------
    frame_input
        Frame of the sampling mode "paths".

    Returns
    -------
    list of float
        Ascending times, one for each render [s].

    Raises
    ------
    SchemaError
        The times are not in order.
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
    """Return the pulses whose interpolated echoes this render contributes to, in any channel.

    Parameters
    ----------
    radar
        Burst and channels.
    shown_s
        Scene time of each render after the start of the burst, ascending [s].
    number
        Index of the render in `shown_s`.

    Returns
    -------
    ndarray of bool
        (pulses,), True where the weight is above 0.
    """
    return np.asarray((_weights(radar, shown_s, number) > 0).any(axis=0))


def interpolate_renders(parts: Iterable[Echoes], shown_s: Sequence[float]) -> Echoes:
    """Return the echoes of a burst from those of its renders.

    Parameters
    ----------
    parts
        Echoes of each render, at least for the pulses of `pulses_of_render`; from a generator, one
        at a time is in memory.
    shown_s
        When each render shows the scene, ascending [s].

    Returns
    -------
    Echoes
        Samples (channels, rows, samples); between two renders their weights are linear in time.
    """
    weighted = (_weighted(part, shown_s, number) for number, part in enumerate(parts))
    return functools.reduce(_sum, weighted)


def _weighted(part: Echoes, shown_s: Sequence[float], number: int) -> Echoes:
    """Echoes of a render times its weight at each pulse of each channel."""
    weight = _weights(part.radar, shown_s, number)
    rows = np.repeat(weight, part.samples.shape[1] // part.radar.burst.pulses, axis=1)
    return dataclasses.replace(
        part,
        samples=rows[..., None] * part.samples,
        outside=part.outside * float(weight.mean()),
    )


def _weights(radar: Radar, shown_s: Sequence[float], number: int) -> Real:
    """Weight of a render at each pulse of each channel, (channels, pulses)."""
    offsets_s = np.array([channel.start_offset_s for channel in radar.channels])
    times_s = pulse_times_s(radar) + offsets_s[:, None]
    weights = interpolation_weights(times_s.ravel(), shown_s)
    return np.asarray(weights[number].reshape(times_s.shape))


def _sum(total: Echoes, part: Echoes) -> Echoes:
    return dataclasses.replace(
        total, samples=part.samples + total.samples, outside=total.outside + part.outside
    )
