# SPDX-License-Identifier: GPL-3.0-or-later
"""Echoes of waveforms whose receiver samples frequencies (family "line").

Sample k of a pulse that begins at t_m is taken at t = t_m + u_k, when the transmitter is at
f_k = f0 + (k - k0) df. After the mixer a path of delay tau(t) leaves

    s_k = a exp(-j 2 pi [f_k tau - K tau^2 / 2]),      K = df / (time between samples)

with the residual video phase K tau^2 / 2 for FMCW alone (Meta, Hoogeboom, Ligthart, IEEE TGRS 45,
3519, 2007): a stepped tone has settled by the time it is sampled. The path moves while the ramp
runs: with tau = tau_0 + tau' s + tau'' s^2 / 2, s = u - u_0 = n dt, n = k - k0 and f_k = f0 + n df,

    f_k tau - K tau^2 / 2 = f0 tau_0 - K tau_0^2 / 2 + n df (tau_0 + tau' (f0 - K tau_0) / K)
        + n^2 [df dt tau' + (f0 - K tau_0) dt^2 tau'' / 2 - K dt^2 tau'^2 / 2]

and terms in n^3, 1e-8 cycles for a blade's tip at 77 GHz. The third term is the range-Doppler
coupling of such radars: a mover stands at its range f0/K later. The last one bends the phase by
B T v / 2c cycles at the ends of the ramp, 0.009 rad for 1 GHz, 50 us and 17 m/s: its exponential is
a power series in n^2, one transform a term. PMCW holds all frequencies at once and has neither.

Mixer and sign: received times conjugate of transmitted, so phases fall with delay as everywhere.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigError
from ..physics.constants import SPEED_OF_LIGHT_MPS
from .config import Radar
from .echoes import MAX_SAMPLES, Echoes, check_window
from .nufft import TOLERANCE, Backend, nufft1
from .paths import Paths, Weighting, path_amplitude
from .speckle import path_phasors
from .waveform import replica
from .waveform_lines import FmcwWaveform, LineWaveform, PmcwWaveform

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Terms of a bent phase; 20 radians take 60.
_MOST_TERMS = 80
#: Lengths (rows x pulses) asked of a motion at a time: 8 MB.
_MAX_LENGTHS = 1 << 20


def line_waveform(radar: Radar) -> LineWaveform:
    """The radar's waveform, which must be of the family "line".

    Raises
    ------
    ConfigError
        It is a pulse.
    """
    waveform = radar.waveform
    if not isinstance(waveform, LineWaveform):
        raise ConfigError(f"A waveform of kind {waveform.kind!r} does not sample frequencies.")
    return waveform


def line_times_s(radar: Radar) -> Real:
    """When each row of samples begins, from the frame's time [s].

    One row a pulse; PMCW has one a code, `repeats` of them a pulse.
    """
    waveform = radar.waveform
    times_s = np.arange(radar.burst.pulses) / radar.burst.prf_hz
    if isinstance(waveform, PmcwWaveform):
        codes_s = np.arange(waveform.repeats) * waveform.code_s
        times_s = (times_s[:, None] + codes_s).ravel()
    return np.asarray(times_s)


class Oscillator(Protocol):
    """What multiplies the samples of a path of some delay."""

    @property
    def step_s(self) -> float:
        """Distance of the delays for which there are factors [s]."""

    def factor(self, order: int) -> Complex:
        """At the delay order x step_s, (rows, N)."""


class LineSynthesizer:
    """Adds up the samples of paths that come in parts; as :class:`.echoes.EchoSynthesizer`.

    Parameters
    ----------
    radar
        With a waveform of the family "line".
    window_m
        One-way ranges that the profile will show [m]. Every echo within the waveform's own range
        is in the samples, whatever the window.
    weighting, receiver_gain, method, tolerance, chunk, speckle_seed
        As for :func:`.echoes.synthesize`.
    oscillator
        Phase noise, see :class:`.phasenoise.LineOscillator`; None: none. Not for PMCW.

    Notes
    -----
    FMCW: beats beyond the ADC's band are taken out by an ideal anti-alias filter, and counted in
    ``outside``. Stepped frequency and PMCW: what is beyond the unambiguous range folds back.
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
        oscillator: Oscillator | None = None,
    ) -> None:
        if chunk < 1:
            raise ConfigError(f"Chunk of {chunk!r} paths; expected 1 or more.")
        self.radar = radar
        self.window_m = check_window(window_m)
        self._waveform = line_waveform(radar)
        self._weighting: Weighting = weighting
        self._gain = receiver_gain
        self._method: Backend = method
        self._tolerance = tolerance
        self._chunk = chunk
        self._seed = speckle_seed
        self._times_s = line_times_s(radar)
        count = self._waveform.grid_count
        if count * self._times_s.size > MAX_SAMPLES:
            raise ConfigError(
                f"{self._times_s.size} rows of {count} samples are more than {MAX_SAMPLES}. "
                "Choose fewer pulses or fewer samples."
            )
        self._still = np.zeros(count, dtype=np.complex128)
        self._moving: Complex | None = None
        self._oscillator = oscillator
        self._outside = 0

    def add(self, paths: Paths) -> None:
        """Add the echoes of these paths."""
        if self._oscillator is None:
            self._add(paths, 1.0)
            return
        # each path between the two nearest delays for which there is a factor
        whole, kept = (self._still, self._moving), self._outside
        position = paths.length_m / SPEED_OF_LIGHT_MPS / self._oscillator.step_s
        low = np.floor(position)
        total = np.zeros((self._times_s.size, self._still.size), dtype=np.complex128)
        if whole[1] is not None:
            total += whole[1]
        for order in np.unique(np.concatenate([low, low + 1])):
            share = 1 - np.abs(position - order)
            near = share > 0
            self._still, self._moving = np.zeros_like(self._still), None
            self._add(paths.select(near), share[near])
            total += self._oscillator.factor(int(order)) * self.response()
        self._still, self._moving = whole[0], total
        # every path was added for two delays, but is lost only once
        lost = 0
        if isinstance(self._waveform, FmcwWaveform):
            lost = int(np.count_nonzero(paths.range_m >= self._waveform.unambiguous_range_m))
        self._outside = kept + lost * self._times_s.size

    def _add(self, paths: Paths, share: Real | float) -> None:
        amplitude = path_amplitude(paths, self._waveform.wavelength_m, self._weighting, self._gain)
        weights = (amplitude * share).astype(np.complex128)
        if self._seed is not None:
            weights *= path_phasors(paths, self._seed)
        motion = paths.lengths
        moving = motion.moving
        still = np.flatnonzero(~moving)
        for start in range(0, still.size, self._chunk):
            rows = still[start : start + self._chunk]
            length_m = motion.lengths_m(self._times_s[:1], rows)[:, 0]
            self._still += self._transform(weights[rows], length_m, None, self._times_s.size)
        rows_moving = np.flatnonzero(moving)
        if rows_moving.size and self._moving is None:
            self._moving = np.zeros((self._times_s.size, self._still.size), dtype=np.complex128)
        for start in range(0, rows_moving.size, self._chunk):
            self._add_moving(paths, weights, rows_moving[start : start + self._chunk])

    def _add_moving(self, paths: Paths, weights: Complex, rows: NDArray[np.intp]) -> None:
        assert self._moving is not None
        waveform = self._waveform
        middle_s = waveform.grid_middle_s
        # first and last sample, so that no time lies outside the burst
        half_s = (waveform.grid_count - 1) * waveform.grid_interval_s / 2
        block = max(1, _MAX_LENGTHS // rows.size)
        for first in range(0, self._times_s.size, block):
            times_s = self._times_s[first : first + block] + middle_s
            lengths_m = paths.lengths.lengths_m(times_s, rows)
            change: tuple[Real, Real] | None = None
            if half_s > 0:
                ends = [paths.lengths.lengths_m(times_s + s * half_s, rows) for s in (-1.0, 1.0)]
                bend = (ends[1] - lengths_m) - (lengths_m - ends[0])
                change = ((ends[1] - ends[0]) / (2 * half_s), bend / half_s**2)
            for i in range(times_s.size):
                self._moving[first + i] += self._transform(
                    weights[rows],
                    lengths_m[:, i],
                    None if change is None else (change[0][:, i], change[1][:, i]),
                    1,
                )

    def _transform(
        self, weights: Complex, length_m: Real, change: tuple[Real, Real] | None, pulses: int
    ) -> Complex:
        """Samples of one pulse, from lengths in the middle of its band, rates, accelerations."""
        waveform = self._waveform
        delay_s = length_m / SPEED_OF_LIGHT_MPS
        seen_s = delay_s
        curve = np.zeros(0)
        if change is not None:
            rate, bend = (values / SPEED_OF_LIGHT_MPS for values in change)
            step_s, slope = (
                waveform.grid_interval_s,
                waveform.grid_step_hz / waveform.grid_interval_s,
            )
            video = slope if isinstance(waveform, FmcwWaveform) else 0.0
            carrier_hz = waveform.carrier_hz - video * delay_s
            seen_s = delay_s + rate * (carrier_hz / slope)
            curve = rate * (waveform.grid_step_hz * step_s - video * step_s**2 / 2 * rate)
            curve += carrier_hz * bend * (step_s**2 / 2)
        if isinstance(waveform, FmcwWaveform):
            limit_s = 2 * waveform.unambiguous_range_m / SPEED_OF_LIGHT_MPS
            heard = (seen_s >= 0) & (seen_s < limit_s)
            lost = int(np.count_nonzero(~heard))
            if lost:
                self._outside += lost * pulses
                weights, length_m = weights[heard], length_m[heard]
                delay_s, seen_s = delay_s[heard], seen_s[heard]
                curve = curve[heard] if curve.size else curve
        # cycles of the carrier from the length in float64: 1e-9 rad at 10 km and 77 GHz
        cycles = length_m * (waveform.carrier_hz / SPEED_OF_LIGHT_MPS)
        cycles = cycles - np.round(cycles)
        if isinstance(waveform, FmcwWaveform):
            cycles = cycles - waveform.slope_hz_per_s * delay_s**2 / 2
        # the transform counts k from -(N // 2)
        count = waveform.grid_count
        cycles = cycles - (waveform.grid_middle - count // 2) * waveform.grid_step_hz * seen_s
        values = weights * np.exp(-2j * np.pi * cycles)
        points = 2 * np.pi * waveform.grid_step_hz * seen_s
        return self._bent(points, values, curve)

    def _bent(self, points: Real, values: Complex, curve: Real) -> Complex:
        """Sum of c exp(-j k x) exp(-j 2 pi curve n^2), n = k - k0, as a series in n^2."""
        count = self._waveform.grid_count
        square = (np.arange(count) - self._waveform.grid_middle) ** 2
        half = float(square.max()) / 2
        largest = 2 * np.pi * half * float(np.abs(curve).max()) if curve.size else 0.0
        if largest == 0:
            return nufft1(points, values, count, self._tolerance, self._method)
        # about the middle of n^2, where the series is shortest
        place = square / half - 1
        values = values * np.exp(-2j * np.pi * half * curve)
        total, power, size = np.zeros(count, dtype=np.complex128), np.ones(count), 1.0
        for order in range(1, _MOST_TERMS):
            total += power * nufft1(points, values, count, self._tolerance, self._method)
            size *= largest / order
            if size < self._tolerance and order > largest:
                break
            values = values * (-2j * np.pi * half / order * curve)
            power = power * place
        return total

    def response(self) -> Complex:
        """The scene's response at the frequencies, (rows, N), before the code of PMCW."""
        if self._moving is None:
            return np.tile(self._still, (self._times_s.size, 1))
        return np.asarray(self._moving + self._still)

    def result(self) -> Echoes:
        """Echoes of all paths added so far; complex for a real ADC too, see `receiver`."""
        waveform = self._waveform
        samples = self.response()
        if isinstance(waveform, PmcwWaveform):
            code = np.fft.fft(replica(waveform))
            samples = np.fft.ifft(np.fft.ifftshift(samples, axes=1) * code, axis=1)
        return Echoes(
            samples,
            waveform.grid_start_s,
            self.window_m,
            self.radar,
            self._weighting,
            self._outside / self._times_s.size,
        )
