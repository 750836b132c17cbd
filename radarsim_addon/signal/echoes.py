# SPDX-License-Identifier: GPL-3.0-or-later
"""Complex baseband echoes of a burst (Eq. 9-14 of the paper, with the carrier phase).

    s(t_m, tau) = sum_i a_i w(tau - tau_i) exp(-j 2 pi f0 tau_i),   tau_i = l_i(t_m)/c

is formed in the frequency domain, W(f) sum_i a_i exp(-j 2 pi (f0+f) tau_i), by :mod:`.synthesis`.
t_m = m/PRF from the frame's time t. Stop and go: nothing moves while a pulse travels.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigError
from ..physics.constants import SPEED_OF_LIGHT_MPS
from .config import Radar
from .nufft import Backend, smooth_size
from .paths import Paths, Weighting, path_amplitude
from .speckle import path_phasors
from .synthesis import (
    TOLERANCE,
    FrequencyGrid,
    Listening,
    Method,
    SpectrumAccumulator,
    SynthesisReport,
)
from .waveform import replica_count, replica_spectrum

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Largest matrix of echoes, in complex samples (4 GiB).
MAX_SAMPLES = 2**28
#: Empty samples behind the window, which keep the tails of the band-limited chirp from wrapping.
_GUARD_SAMPLES = 64


@dataclass(frozen=True)
class Echoes:
    """Complex samples of one burst.

    Attributes
    ----------
    samples
        s(t_m, tau_n), (pulses, samples); |s|^2 in W for weighting "radar-equation".
    first_sample_s
        Fast time of sample 0, from the middle of the transmitted pulse [s].
    window_m
        One-way ranges whose echoes are recorded whole [m].
    radar
        Waveform and burst.
    weighting
        See :func:`.paths.path_amplitude`.
    outside
        Paths (counted once a pulse, divided by pulses) that lie wholly outside the window.
    report
        How they were formed; None where they come from elsewhere.
    """

    samples: Complex
    first_sample_s: float
    window_m: tuple[float, float]
    radar: Radar
    weighting: Weighting
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


def check_window(window_m: tuple[float, float]) -> tuple[float, float]:
    """The range window as two floats, 0 <= start < stop, or a ConfigError."""
    start_m, stop_m = float(window_m[0]), float(window_m[1])
    if not (np.isfinite(stop_m) and 0 <= start_m < stop_m):
        raise ConfigError(
            f"Range window from {start_m!r} to {stop_m!r} m; expected 0 <= start < stop."
        )
    return start_m, stop_m


@dataclass(frozen=True)
class EchoOptions:
    """How echoes are formed: each as the argument of :func:`synthesize` of the same name."""

    weighting: Weighting = "radar-equation"
    receiver_gain: float = 1.0
    method: Backend = "auto"
    tolerance: float = TOLERANCE
    synthesis: Method = "auto"
    range_folding: bool = True
    chunk: int = 1 << 17
    speckle_seed: int | None = None

    def amplitudes(self, paths: Paths, wavelength_m: float) -> NDArray[np.inexact[Any]]:
        """Weight of each path in the sum, (N,), with its random phase if asked for."""
        weights: NDArray[np.inexact[Any]] = path_amplitude(
            paths, wavelength_m, self.weighting, self.receiver_gain
        )
        if self.speckle_seed is not None:
            weights = weights * path_phasors(paths, self.speckle_seed)
        return weights


#: What is done unless asked otherwise.
AS_USUAL = EchoOptions()


class EchoSynthesizer:
    """Adds up the echoes of paths that come in parts (ring by ring); see :func:`synthesize`.

    Memory: one complex matrix (pulses, frequencies) and buffers of some 100 MB at most, whatever
    the number of paths.

    Parameters
    ----------
    radar
        With a waveform of the family "pulse".
    window_m
        One-way ranges (start, stop) whose echoes are recorded whole [m].
    options
        See :class:`EchoOptions`.

    Raises
    ------
    ConfigError
        The window is empty or reversed, or the matrix of echoes too large.
    """

    def __init__(
        self, radar: Radar, window_m: tuple[float, float], options: EchoOptions = AS_USUAL
    ) -> None:
        self.window_m = check_window(window_m)
        self.radar = radar
        self._options = options
        rate_hz = radar.waveform.sampling_rate_hz
        chirp = replica_count(radar.waveform)
        start_s, stop_s = (2 * r / SPEED_OF_LIGHT_MPS for r in self.window_m)
        self._count = int(np.ceil((stop_s - start_s) * rate_hz)) + chirp + 1
        # An echo that only just reaches into the window needs a chirp's length of room before and
        # behind it; with that, the circular transform wraps nothing into the window.
        needed = self._count + 2 * chirp + _GUARD_SAMPLES
        if needed * radar.burst.pulses > MAX_SAMPLES:
            raise ConfigError(
                f"{radar.burst.pulses} pulses of {needed} samples are more than {MAX_SAMPLES}. "
                "Choose a shorter range window, fewer pulses or a lower sampling rate."
            )
        size = smooth_size(needed)
        self._half_s = (chirp - 1) / 2 / rate_hz
        self._first_s = start_s - self._half_s
        self._sum = SpectrumAccumulator(
            FrequencyGrid.centred(radar.waveform.carrier_hz, rate_hz / size, size),
            pulse_times_s(radar),
            tolerance=options.tolerance,
            method=options.synthesis,
            backend=options.method,
            listening=Listening(
                start_s - 2 * self._half_s,
                stop_s + 2 * self._half_s,
                1 / radar.burst.prf_hz if options.range_folding else None,
                radar.waveform.carrier_hz,
            ),
            chunk=options.chunk,
        )

    def add(self, paths: Paths) -> None:
        """Add the echoes of these paths.

        Raises
        ------
        PathDataError
            A row has a length or an amplitude that is NaN or infinite.
        """
        weights = self._options.amplitudes(paths, self.radar.waveform.wavelength_m)
        self._sum.add(paths.lengths, weights)

    def result(self) -> Echoes:
        """Echoes of all paths added so far."""
        spectrum = self._sum.result()
        size, pulses = spectrum.grid.count, self.radar.burst.pulses
        # S has delays from the middle of the pulse; sample 0 is at first_s
        k = np.fft.fftfreq(size, 1 / size)
        turns = spectrum.grid.step_hz * self._first_s
        shift = np.exp(2j * np.pi * (k * (turns - round(turns)) % 1.0))
        filter_ = replica_spectrum(self.radar.waveform, size) * shift
        samples = np.empty((pulses, self._count), dtype=np.complex128)
        if spectrum.moving is None:
            line = np.fft.ifft(np.fft.ifftshift(spectrum.still) * filter_)
            samples[:] = line[: self._count]
        else:
            for pulse, moving in enumerate(spectrum.moving):
                line = np.fft.ifftshift(moving + spectrum.still) * filter_
                samples[pulse] = np.fft.ifft(line)[: self._count]
        return Echoes(
            samples,
            self._first_s,
            self.window_m,
            self.radar,
            self._options.weighting,
            spectrum.report.outside,
            spectrum.report,
        )


def synthesize(
    paths: Paths | Iterable[Paths],
    radar: Radar,
    *,
    window_m: tuple[float, float],
    weighting: Weighting = "radar-equation",
    receiver_gain: float = 1.0,
    method: Backend = "auto",
    tolerance: float = TOLERANCE,
    synthesis: Method = "auto",
    range_folding: bool = True,
    chunk: int = 1 << 17,
    speckle_seed: int | None = None,
) -> Echoes:
    """Echoes of a burst from paths (Eq. 9-14).

    Parameters
    ----------
    paths
        Paths, or several tables of them (a generator will do: :func:`.paths.iter_paths`).
    radar
        Waveform and burst.
    window_m
        One-way ranges (start, stop) whose echoes are recorded whole [m]; ``run.window_m`` is what
        the rings cover. Echoes that reach in from outside are cut at the edge, not folded.
    weighting
        "radar-equation" or "paper", see :func:`.paths.path_amplitude`.
    receiver_gain
        G_r, linear.
    method
        "auto" (finufft where installed), "finufft", "numpy" or "direct" (sum over all frequencies
        term by term: slow, for checks).
    tolerance
        Relative L2 error of the spectrum S(f) against the direct sum, see :mod:`.synthesis`.
    synthesis
        "auto", "type3", "per-pulse" or "direct", see :class:`.synthesis.SpectrumAccumulator`.
    range_folding
        Whether echoes later than the pulse interval fall into the window of a later pulse, as in
        a radar that sends equal pulses all the time. False: they stand at their true delay.
    chunk
        Paths transformed at a time; the result does not depend on it beyond rounding.
    speckle_seed
        Give each path a random phase, see :func:`.speckle.path_phasors`: then the mean coherent
        power is the sum of the powers. None: the plain sum, in which pixels of a smooth face add
        up in phase, so that levels grow with the number of pixels.

    Notes
    -----
    Stop and go: a path's delay is that of the time of the pulse in whose window it is heard.
    A folded echo has the carrier phase of its true delay, for the oscillator runs on.
    """
    from .families import synthesizer_for  # it knows of all kinds, this module among them

    options = EchoOptions(
        weighting=weighting,
        receiver_gain=receiver_gain,
        method=method,
        tolerance=tolerance,
        synthesis=synthesis,
        range_folding=range_folding,
        chunk=chunk,
        speckle_seed=speckle_seed,
    )
    synthesizer = synthesizer_for(radar, window_m, options)
    for part in [paths] if isinstance(paths, Paths) else paths:
        synthesizer.add(part)
    return synthesizer.result()
