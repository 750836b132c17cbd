# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of a burst, the options of their synthesis, and their time axes."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ...array_types import Complex, Real
from ...contract import AmplitudeModel
from ...errors import ConfigError
from ...options import MAX_LENGTH_M
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..paths import Paths
from ..radar import Channel, Radar
from ..scattering import Link, amplitude_history
from ..spectrum import TOLERANCE, AmplitudeHistory, Backend, Method, SynthesisReport

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
