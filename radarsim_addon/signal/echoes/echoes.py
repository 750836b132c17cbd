# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of a burst, the options of their synthesis, and their time axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Real
from ...contract import AmplitudeModel
from ...errors import ConfigError
from ..paths import Paths, path_amplitude
from ..radar import Radar
from ..scattering import path_phasors
from ..spectrum import TOLERANCE, Backend, Method, SynthesisReport

#: Largest matrix of echoes, in complex samples (4 GiB).
MAX_SAMPLES = 2**28


@dataclass(frozen=True)
class Echoes:
    """Complex samples of one burst.

    Attributes
    ----------
    samples
        s(t_m, tau_n), (pulses, samples); |s|^2 in W for weighting "radar-equation".
    first_sample_s
        Fast time of sample 0, from the middle of the transmitted pulse [s].
    range_limits_m
        One-way ranges whose echoes are recorded whole [m].
    radar
        Waveform and burst.
    amplitude_model
        See :func:`.paths.paths.path_amplitude`.
    outside
        Paths (counted once a pulse, divided by pulses) that lie wholly outside the window.
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
        count = self.samples.shape[1]
        times: Real = self.first_sample_s + np.arange(count) / self.radar.waveform.sampling_rate_hz
        return times

    @property
    def slow_time_s(self) -> Real:
        """Time of each pulse since the frame's time t, (pulses,) [s]."""
        return pulse_times_s(self.radar)


def pulse_times_s(radar: Radar) -> Real:
    """t_m = m / PRF, (pulses,) [s]."""
    times: Real = np.arange(radar.burst.pulses) / radar.burst.prf_hz
    return times


def check_window(range_limits_m: tuple[float, float]) -> tuple[float, float]:
    """The range window as two floats, 0 <= start < stop, or a ConfigError."""
    start_m, stop_m = float(range_limits_m[0]), float(range_limits_m[1])
    if not (np.isfinite(stop_m) and 0 <= start_m < stop_m):
        raise ConfigError(
            f"Range window from {start_m!r} to {stop_m!r} m; expected 0 <= start < stop."
        )
    return start_m, stop_m


@dataclass(frozen=True)
class EchoOptions:
    """How echoes are formed: each as the argument of :func:`synthesize` of the same name."""

    amplitude_model: AmplitudeModel = "radar-equation"
    receiver_gain: float = 1.0
    nufft_backend: Backend = "auto"
    tolerance: float = TOLERANCE
    slow_time_transform: Method = "auto"
    range_folding: bool = True
    chunk: int = 1 << 17
    speckle_seed: int | None = None

    def amplitudes(self, paths: Paths, wavelength_m: float) -> NDArray[np.inexact[Any]]:
        """Weight of each path in the sum, (N,), with its random phase if asked for."""
        weights: NDArray[np.inexact[Any]] = path_amplitude(
            paths, wavelength_m, self.amplitude_model, self.receiver_gain
        )
        if self.speckle_seed is not None:
            weights = weights * path_phasors(paths, self.speckle_seed)
        return weights


#: What is done unless asked otherwise.
DEFAULT_OPTIONS = EchoOptions()
