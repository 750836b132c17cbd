# SPDX-License-Identifier: GPL-3.0-or-later
"""Complex baseband echoes of a burst (Eq. 9-14 of the paper, with the carrier phase).

    s(t_m, tau) = sum_i a_i w(tau - tau_i) exp(-j 2 pi f0 tau_i),   tau_i = l_i(t_m)/c

is formed in the frequency domain, S(f) = W(f) sum_i a_i exp(-j 2 pi (f0+f) tau_i): a non-uniform
FFT per pulse. Paths that stand still are transformed once for all pulses; the others at every
pulse at their true length, so range migration is exact. l_i(t_m) = l_i + 2 v_i t_m, t_m = m/PRF
from the frame's time t. Stop and go: nothing moves while a pulse travels.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigError
from ..physics.constants import SPEED_OF_LIGHT_MPS
from .config import Radar
from .nufft import TOLERANCE, Backend, nufft1, smooth_size
from .paths import Paths, Weighting, path_amplitude
from .speckle import path_phasors
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
    """

    samples: Complex
    first_sample_s: float
    window_m: tuple[float, float]
    radar: Radar
    weighting: Weighting
    outside: float

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


class EchoSynthesizer:
    """Adds up the echoes of paths that come in parts (ring by ring); see :func:`synthesize`.

    Memory: one complex matrix (pulses, frequencies), whatever the number of paths.
    """

    def __init__(
        self,
        radar: Radar,
        window_m: tuple[float, float],
        *,
        weighting: Weighting = "radar-equation",
        receiver_gain: float = 1.0,
        method: Backend = "auto",
        tolerance: float = TOLERANCE,
        chunk: int = 1 << 18,
        speckle_seed: int | None = None,
    ) -> None:
        if chunk < 1:
            raise ConfigError(f"Chunk of {chunk!r} paths; expected 1 or more.")
        self.window_m = check_window(window_m)
        self.radar = radar
        self._weighting: Weighting = weighting
        self._gain = receiver_gain
        self._method: Backend = method
        self._tolerance = tolerance
        self._chunk = chunk
        self._speckle_seed = speckle_seed
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
        self._size = smooth_size(needed)
        self._half_s = (chirp - 1) / 2 / rate_hz
        self._first_s = start_s - self._half_s
        self._limits_s = (start_s - 2 * self._half_s, stop_s + 2 * self._half_s)
        self._static = np.zeros(self._size, dtype=np.complex128)
        self._moving: Complex | None = None
        self._outside = 0

    def add(self, paths: Paths) -> None:
        """Add the echoes of these paths."""
        amplitude = path_amplitude(
            paths, self.radar.waveform.wavelength_m, self._weighting, self._gain
        )
        weights = amplitude.astype(np.complex128)
        if self._speckle_seed is not None:
            weights *= path_phasors(paths, self._speckle_seed)
        times_s = pulse_times_s(self.radar)
        for start in range(0, len(paths), self._chunk):
            part = slice(start, start + self._chunk)
            a, length_m = weights[part], paths.length_m[part]
            rate_mps = paths.range_rate_mps[part]
            still = rate_mps == 0
            self._static += self._transform(a[still], length_m[still], times_s.size)
            if still.all():
                continue
            if self._moving is None:
                self._moving = np.zeros((times_s.size, self._size), dtype=np.complex128)
            a, length_m, rate_mps = a[~still], length_m[~still], rate_mps[~still]
            for pulse, time_s in enumerate(times_s):
                self._moving[pulse] += self._transform(a, length_m + 2 * rate_mps * time_s, 1)

    def _transform(self, amplitude: Complex, length_m: Real, pulses: int) -> Complex:
        """sum_i a_i exp(-j 2 pi (f0+f) tau_i), f ascending, delays from sample 0."""
        delay_s = length_m / SPEED_OF_LIGHT_MPS
        received = (delay_s > self._limits_s[0]) & (delay_s < self._limits_s[1])
        kept = int(np.count_nonzero(received))
        if kept < received.size:
            self._outside += (received.size - kept) * pulses
            amplitude = amplitude[received]
            length_m, delay_s = length_m[received], delay_s[received]
        # cycles of the carrier from the length in float64: 1e-9 rad at 10 km and 77 GHz
        cycles = length_m * (self.radar.waveform.carrier_hz / SPEED_OF_LIGHT_MPS)
        values = amplitude * np.exp(-2j * np.pi * (cycles - np.round(cycles)))
        step_rad = 2 * np.pi * self.radar.waveform.sampling_rate_hz / self._size
        points = (delay_s - self._first_s) * step_rad
        return nufft1(points, values, self._size, self._tolerance, self._method)

    def result(self) -> Echoes:
        """Echoes of all paths added so far."""
        pulses = self.radar.burst.pulses
        spectrum = replica_spectrum(self.radar.waveform, self._size)
        samples = np.empty((pulses, self._count), dtype=np.complex128)
        still = np.fft.ifft(np.fft.ifftshift(self._static) * spectrum)[: self._count]
        for pulse in range(pulses):
            samples[pulse] = still
            if self._moving is not None:
                moving = np.fft.ifftshift(self._moving[pulse]) * spectrum
                samples[pulse] += np.fft.ifft(moving)[: self._count]
        return Echoes(
            samples,
            self._first_s,
            self.window_m,
            self.radar,
            self._weighting,
            self._outside / pulses,
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
    chunk: int = 1 << 18,
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
        Of the non-uniform FFT, relative to the sum of all amplitudes.
    chunk
        Paths transformed at a time; the result does not depend on it beyond rounding.
    speckle_seed
        Give each path a random phase, see :func:`.speckle.path_phasors`: then the mean coherent
        power is the sum of the powers. None: the plain sum, in which pixels of a smooth face add
        up in phase, so that levels grow with the number of pixels.

    Notes
    -----
    Echoes beyond the unambiguous range c/2PRF stand at their true delay, not folded back: every
    echo is taken to be listened to after its own pulse.
    """
    from .families import synthesizer_for  # it knows of all kinds, this module among them

    synthesizer = synthesizer_for(
        radar,
        window_m,
        weighting=weighting,
        receiver_gain=receiver_gain,
        method=method,
        tolerance=tolerance,
        chunk=chunk,
        speckle_seed=speckle_seed,
    )
    for part in [paths] if isinstance(paths, Paths) else paths:
        synthesizer.add(part)
    return synthesizer.result()
