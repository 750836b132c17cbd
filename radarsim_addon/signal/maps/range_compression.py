# SPDX-License-Identifier: GPL-3.0-or-later
"""Pulse compression: matched filter with window, and the speckle-free profile it should show.

A path of power P peaks at P in the profile of every waveform. Pulses pass the matched filter,
conj(W(f)) and a window over the band. Waveforms that sample frequencies are transformed over them,

    h(r) = sum_k g_k s_k exp(j 2 pi (k - k0) df 2r/c) / sum_k g_k,

g the window; for PMCW the correlator, g s = sum over repeats of FFT(samples) conj(FFT(code)), no
window laid over. The expected profile is the sum of powers sum_i P_i |h(r - r_i)|^2, by a
non-uniform FFT of the powers and a product with the transform of |h|^2.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...arrays import Complex, Mask, Real
from ...contract import AmplitudeModel
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..echoes import Echoes, check_window, one_channel, only_channel
from ..paths import Paths, path_power_w
from ..radar import (
    MAX_SAMPLES,
    FmcwWaveform,
    LineWaveform,
    PmcwWaveform,
    Radar,
    band_window,
    frequencies_hz,
    matched_filter,
    replica,
    replica_spectrum,
    slow_time_window,
)
from ..scattering import path_amplitude
from ..spectrum import Backend, nufft1, repeat_orders, smooth_size

#: Samples of padded rows that are transformed at a time: 4 MB.
_PADDED = 1 << 18
#: Ranges of profiles for each sample of the echo.
OVERSAMPLE = 2
#: Paths of one transform, at least.
_TOGETHER = 1 << 17


@dataclass(frozen=True)
class RangeProfiles:
    """Range-compressed pulses.

    Attributes
    ----------
    values
        (channels, pulses, ranges), complex. A unit path at range r peaks at r with magnitude 1 and
        phase -4 pi r / lambda, whatever the window.
    range_m
        One-way range of each column, evenly spaced, (ranges,) [m].
    radar
        Waveform and burst.
    range_taper
        Window over the band.
    """

    values: Complex
    range_m: Real
    radar: Radar
    range_taper: str

    @property
    def plane(self) -> Complex:
        """Values of the only channel, (pulses, ranges), see :func:`.echoes.only_channel`."""
        return only_channel(self.values)

    @property
    def mean_power(self) -> Real:
        """Mean of |values|^2 over the pulses, (channels, ranges); W for "radar-equation"."""
        return np.asarray(np.mean(np.abs(self.values) ** 2, axis=1))

    def channel(self, number: int) -> RangeProfiles:
        """Return the profiles of one channel, counted from 0."""
        radar = one_channel(self.radar, number)
        return dataclasses.replace(self, values=self.values[number][None], radar=radar)


@dataclass(frozen=True)
class PowerProfile:
    """Power against range, as expected on average over the speckle.

    Attributes
    ----------
    power
        sum_i P_i |h(r - r_i)|^2, (ranges,): a single path of power P peaks at P.
    range_m
        One-way range, evenly spaced, (ranges,) [m].
    radar
        Waveform and burst.
    range_taper
        Window over the band.
    """

    power: Real
    range_m: Real
    radar: Radar
    range_taper: str


def range_process(
    echoes: Echoes, range_taper: str = "hamming", oversample: int = OVERSAMPLE
) -> RangeProfiles:
    """Range profiles of a burst that peak at the power of a path, whatever the waveform.

    Pulses go through the matched filter: conj(W(f)) and a window over the band. What an FMCW or
    stepped radar samples is transformed over its frequencies, PMCW correlated with its code.

    Parameters
    ----------
    echoes
        Echoes.
    range_taper
        Window over the band, see :func:`.radar.window_at`. Hamming widens the response 1.47 times
        and lowers its sidelobes from -13.3 to -42.7 dB.
    oversample
        Range samples per sample of the echo.

    Returns
    -------
    RangeProfiles
        Over ``echoes.range_limits_m``.

    Raises
    ------
    ConfigError
        Unknown window, oversampling beyond 1 to 64, more ranges than `MAX_SAMPLES`, or a range
        window beyond the waveform's own range.
    """
    waveform = echoes.radar.waveform
    range_m = range_axis(echoes.radar, echoes.range_limits_m, oversample)
    range_taper = band_window(waveform, range_taper)
    if isinstance(waveform, LineWaveform):
        values = np.stack(
            [compress_lines(waveform, s, range_m, range_taper, oversample) for s in echoes.samples]
        )
        return RangeProfiles(values, range_m, echoes.radar, range_taper)
    chirp = waveform.sample_count
    channels, pulses, count = echoes.samples.shape
    size = smooth_size(count + chirp)
    if size * oversample * channels * pulses > MAX_SAMPLES:
        raise ConfigError(
            f"{channels * pulses} pulses of {size * oversample} ranges are more than "
            f"{MAX_SAMPLES}. Choose shorter range limits (--range-limits) or less oversampling."
        )
    offset_s = 2 * echoes.range_limits_m[0] / SPEED_OF_LIGHT_MPS - echoes.first_sample_s
    shift = np.exp(2j * np.pi * frequencies_hz(waveform, size) * offset_s)
    response = matched_filter(waveform, size, range_taper) * shift
    values = np.empty((channels, pulses, range_m.size), dtype=np.complex128)
    for place in np.ndindex(channels, pulses):  # one at a time: no padded copy of them all
        line = _interpolate(np.fft.fft(echoes.samples[place], size) * response, oversample)
        values[place] = line[: range_m.size]
    return RangeProfiles(values, range_m, echoes.radar, range_taper)


def range_axis(radar: Radar, range_limits_m: tuple[float, float], oversample: int) -> Real:
    """Return one-way ranges of profiles, `oversample` for each sample of the echo."""
    if not (isinstance(oversample, int) and 1 <= oversample <= 64):
        raise ConfigError(f"Oversampling is {oversample!r}; expected a whole number from 1 to 64.")
    if isinstance(radar.waveform, LineWaveform):
        return line_range_axis(radar.waveform, range_limits_m, oversample)
    step_m = radar.waveform.sample_spacing_m / oversample
    count = int(np.floor((range_limits_m[1] - range_limits_m[0]) / step_m + 1e-9)) + 1
    return np.asarray(range_limits_m[0] + step_m * np.arange(count))


def _interpolate(spectrum: Complex, oversample: int) -> Complex:
    """Return samples of a band-limited spectrum (FFT order, last axis) on a finer grid."""
    size = spectrum.shape[-1]
    half = (size + 1) // 2
    padded = np.zeros((*spectrum.shape[:-1], size * oversample), dtype=np.complex128)
    padded[..., :half] = spectrum[..., :half]
    padded[..., half - size :] = spectrum[..., half:]
    return np.asarray(np.fft.ifft(padded) * oversample)


def line_range_axis(
    waveform: LineWaveform, range_limits_m: tuple[float, float], oversample: int
) -> Real:
    """Return one-way ranges from the window's start to the unambiguous range at most."""
    limit_m = waveform.unambiguous_range_m
    if range_limits_m[0] >= limit_m:
        raise ConfigError(
            f"Range limits from {range_limits_m[0]:g} m; the waveform's range ends at "
            f"{limit_m:g} m. "
            "Choose nearer limits, or a waveform with a smaller slope or frequency step."
        )
    step_m = waveform.sample_spacing_m / oversample
    stop_m = min(range_limits_m[1], limit_m - step_m)
    count = max(1, int(np.floor((stop_m - range_limits_m[0]) / step_m + 1e-9)) + 1)
    return np.asarray(range_limits_m[0] + step_m * np.arange(count))


def line_weights(waveform: LineWaveform, range_taper: str) -> Real:
    """Return the weights g_k of the frequencies in their order; PMCW takes the spectrum of its
    code.
    """
    if isinstance(waveform, PmcwWaveform):
        return np.fft.fftshift(np.abs(np.fft.fft(replica(waveform))) ** 2)
    return slow_time_window(range_taper, waveform.grid_count)


def compress_lines(
    waveform: LineWaveform, samples: Complex, range_m: Real, range_taper: str, oversample: int
) -> Complex:
    """Compute range profiles (pulses, ranges) from raw samples (rows, N).

    `range_m` is the axis from `line_range_axis`. A pulse is one row; PMCW has `code_repeats` rows
    per pulse.
    """
    count = waveform.grid_count
    if isinstance(waveform, PmcwWaveform):
        code = np.fft.fft(replica(waveform))
        codes = samples.reshape(-1, waveform.code_repeats, count).mean(axis=1)
        spectra = np.fft.fftshift(np.fft.fft(codes, axis=1) * np.conj(code), axes=1)
        spectra /= np.sum(np.abs(code) ** 2)
    else:
        weight = line_weights(waveform, range_taper)
        # a real ADC holds half the amplitude of the beat
        real = isinstance(waveform, FmcwWaveform) and waveform.real_adc
        samples = samples.real.astype(np.complex128) if real else samples
        spectra = samples * (weight * ((2.0 if real else 1.0) / weight.sum()))
    k = np.arange(count)
    start = 2 * range_m[0] / SPEED_OF_LIGHT_MPS * waveform.grid_step_hz
    size = count * oversample
    shift = np.exp(2j * np.pi * start * k)
    turn = np.exp(-2j * np.pi * waveform.grid_middle * (start + np.arange(range_m.size) / size))
    values = np.empty((spectra.shape[0], range_m.size), dtype=np.complex128)
    step = max(_PADDED // size, 1)  # a few at a time: no padded copy of them all
    for first in range(0, len(spectra), step):
        lines = np.fft.ifft(spectra[first : first + step] * shift, size)[:, : range_m.size]
        values[first : first + step] = lines * size * turn
    return values


def line_noise_gain(waveform: LineWaveform, range_taper: str) -> float:
    """Return the noise power in a range cell over that of a complex sample.

    A real ADC keeps half the noise and a quarter of an echo's power: the gain is 3 dB worse.
    """
    if isinstance(waveform, PmcwWaveform):
        # a correlation with N samples of power |w|^2, averaged over the repeats
        energy = float(np.sum(np.abs(replica(waveform)) ** 2))
        return 1 / (energy * waveform.code_repeats)
    weight = line_weights(waveform, range_taper)
    gain = float(np.sum(weight**2) / weight.sum() ** 2)
    return 2 * gain if isinstance(waveform, FmcwWaveform) and waveform.real_adc else gain


def expected_power_profile(
    paths: Paths | Iterable[Paths],
    radar: Radar,
    *,
    range_limits_m: tuple[float, float],
    range_taper: str = "hamming",
    oversample: int = 4,
) -> PowerProfile:
    """Return the profile of the matched filter, averaged over the speckle.

    The sum of powers sum_i P_i |h(r - r_i)|^2, h the compressed response to one path, about which
    the coherent profile fluctuates when phases are random. Taken at t, before anything moves.

    Parameters
    ----------
    paths
        Paths, or several tables of them.
    radar
        Waveform and burst.
    range_limits_m
        One-way ranges (start, stop) [m].
    range_taper
        Window over the band, see :func:`.radar.window_at`.
    oversample
        Ranges per sample of the echo, at least 2.

    Returns
    -------
    PowerProfile
        Expected power against one-way range, (ranges,) [W], [m].

    Notes
    -----
    Echoes beyond the unambiguous range c / 2 PRF fold, as in :func:`.echoes.synthesize`.
    """
    accumulator = ProfileAccumulator(
        radar, range_limits_m, range_taper=range_taper, oversample=oversample
    )
    for part in [paths] if isinstance(paths, Paths) else paths:
        accumulator.add(part)
    return accumulator.result()


class ProfileAccumulator:
    """Adds up the expected power of paths that come in parts; see `expected_power_profile`.

    P_i is the square of the amplitude, for `amplitude_model` and `receiver_gain` see
    :func:`.scattering.path_amplitude`.
    """

    def __init__(
        self,
        radar: Radar,
        range_limits_m: tuple[float, float],
        *,
        range_taper: str = "hamming",
        amplitude_model: AmplitudeModel = "radar-equation",
        receiver_gain: float = 1.0,
        oversample: int = 4,
        nufft_backend: Backend = "finufft",
    ) -> None:
        if oversample < 2:
            raise ConfigError(
                f"Oversampling is {oversample!r}; power has twice the band of the echo, so at "
                "least 2 is needed."
            )
        self._radar, self._range_taper = radar, band_window(radar.waveform, range_taper)
        self._weighting: AmplitudeModel = amplitude_model
        self._gain = receiver_gain
        self._nufft_backend: Backend = nufft_backend
        self._range_m = range_axis(radar, check_window(range_limits_m), oversample)
        self._waiting: list[tuple[Real, Real]] = []
        self._lines: LinePower | None = None
        if isinstance(radar.waveform, LineWaveform):
            self._lines = LinePower(
                radar.waveform, check_window(range_limits_m), range_taper, oversample, nufft_backend
            )
            return
        chirp = radar.waveform.sample_count
        self._base = smooth_size(-(-self._range_m.size // oversample) + 4 * chirp)
        self._oversample = oversample
        self._size = self._base * oversample
        if self._size > MAX_SAMPLES:
            raise ConfigError(
                f"A profile of {self._size} ranges; at most {MAX_SAMPLES}. Choose a shorter range "
                "window or less oversampling."
            )
        # the compressed pulse is two chirps long: what lies further out does not reach in
        self._margin_m = (2 * chirp - 1) * radar.waveform.sample_spacing_m
        #: Of echoes within the range limits, and of those that reach in from beyond.
        self._sums = np.zeros((2, self._size), dtype=np.complex128)

    def add(self, paths: Paths) -> None:
        """Add the power of these paths. Each path has its length at the time of the frame."""
        wavelength_m = self._radar.waveform.wavelength_m
        if self._weighting == "radar-equation":
            # Not the square of an amplitude: with interference a path's own power can be negative.
            power = path_power_w(paths, wavelength_m, self._gain)
        else:
            power = path_amplitude(paths, wavelength_m, self._weighting, self._gain) ** 2
        self._waiting.append((paths.range_m, power))
        if sum(each.size for each, _ in self._waiting) >= _TOGETHER:
            self._flush()

    def _flush(self) -> None:
        """Add up all waiting paths together, because the transform of few paths has a high
        overhead.
        """
        if not self._waiting:
            return
        range_m, power = map(np.concatenate, zip(*self._waiting, strict=True))
        self._waiting = []
        if self._lines is not None:
            self._lines.add(range_m, power)
        else:
            self._add_pulses(range_m, power)

    def _add_pulses(self, range_m: Real, power: Real) -> None:
        offset_m = range_m - self._range_m[0]
        span_m = self._range_m[-1] - self._range_m[0]
        # echoes beyond the unambiguous range are folded; once, or more often in a long window
        fold_m = self._radar.burst.unambiguous_range_m
        low = np.floor((offset_m - span_m - self._margin_m) / fold_m) + 1
        copies = np.ceil((offset_m + self._margin_m) / fold_m) - low
        copies = np.maximum(copies, 0).astype(np.intp)
        near = np.repeat(np.arange(copies.size), copies)
        offset_m = offset_m[near] - repeat_orders(low, copies) * fold_m
        step_m = self._radar.waveform.sample_spacing_m / self._oversample
        points = offset_m * (2 * np.pi / (step_m * self._size))
        cell_m = self._radar.waveform.range_resolution_m
        beyond = (offset_m < -cell_m) | (offset_m > span_m + cell_m)
        _add_sums(self._sums, points, power[near], beyond, self._nufft_backend)

    def result(self, within: bool = False) -> PowerProfile:
        """Return the profile of all paths added so far.

        With `within`, it does not contain the sidelobes of echoes beyond the range limits.
        """
        self._flush()
        if self._lines is not None:
            power = self._lines.result(within)
            return PowerProfile(power, self._range_m, self._radar, self._range_taper)
        waveform = self._radar.waveform
        response = replica_spectrum(waveform, self._base) * matched_filter(
            waveform, self._base, self._range_taper
        )
        point_power = np.abs(_interpolate(response, self._oversample)) ** 2
        total = self._sums[0] if within else self._sums.sum(axis=0)
        spectrum = np.fft.ifftshift(total) * np.fft.fft(point_power)
        power = np.maximum(np.fft.ifft(spectrum).real[: self._range_m.size], 0.0)
        return PowerProfile(power, self._range_m, self._radar, self._range_taper)


def _add_sums(sums: Complex, points: Real, power: Real, beyond: Mask, backend: Backend) -> None:
    """Add the powers of echoes within the range limits to the first sum, and those of other echoes
    to the second.
    """
    for total, rows in zip(sums, (~beyond, beyond), strict=True):
        own = slice(None) if rows.all() else rows
        if rows.any():
            # 1e-13: far echoes stand many tens of dB below near ones
            total += nufft1(points[own], power[own], total.size, 1e-13, backend)


class LinePower:
    """Adds up expected powers sum_i P_i |h(r - r_i)|^2 of a waveform that samples frequencies."""

    def __init__(
        self,
        waveform: LineWaveform,
        range_limits_m: tuple[float, float],
        range_taper: str,
        oversample: int,
        nufft_backend: Backend,
    ) -> None:
        self._waveform, self._oversample, self._nufft_backend = waveform, oversample, nufft_backend
        self.range_m = line_range_axis(waveform, range_limits_m, oversample)
        weight = line_weights(waveform, range_taper)
        count = weight.size
        # |h|^2 has the autocorrelation of the weights as its coefficients, q = -N ... N-1
        spectrum = np.abs(np.fft.fft(weight, 2 * count)) ** 2
        self._lags = np.fft.fftshift(np.fft.ifft(spectrum).real) / weight.sum() ** 2
        self._limits_m = range_limits_m
        #: Of echoes within the range limits, and of those that reach in from beyond.
        self._sums = np.zeros((2, 2 * count), dtype=np.complex128)

    def add(self, range_m: Real, power: Real) -> None:
        if isinstance(self._waveform, FmcwWaveform):
            heard = range_m < self._waveform.unambiguous_range_m
            range_m, power = range_m[heard], power[heard]
        points = 4 * np.pi * self._waveform.grid_step_hz / SPEED_OF_LIGHT_MPS * range_m
        cell_m, (start_m, stop_m) = self._waveform.range_resolution_m, self._limits_m
        after_m, period_m = range_m - start_m + cell_m, self._waveform.range_period_m
        if not (after_m.min(initial=0.0) >= 0 and after_m.max(initial=0.0) < period_m):
            after_m = np.mod(after_m, period_m)
        beyond = after_m > stop_m - start_m + 2 * cell_m
        _add_sums(self._sums, points, power, beyond, self._nufft_backend)

    def result(self, within: bool = False) -> Real:
        """Return the power at `range_m`; `within`: of echoes within the range limits alone."""
        total = self._sums[0] if within else self._sums.sum(axis=0)
        count = self._waveform.grid_count
        q = np.arange(-count, count)
        start = 2 * self.range_m[0] / SPEED_OF_LIGHT_MPS * self._waveform.grid_step_hz
        size = count * self._oversample
        padded = np.zeros(max(size, 2 * count), dtype=np.complex128)
        padded[q % padded.size] = total * self._lags * np.exp(2j * np.pi * q * start)
        power = np.fft.ifft(padded).real * padded.size
        return np.asarray(np.maximum(power[: self.range_m.size], 0.0))
