# SPDX-License-Identifier: GPL-3.0-or-later
"""Range profiles of waveforms that sample frequencies: a Fourier transform over the frequencies.

    h(r) = sum_k g_k s_k exp(j 2 pi (k - k0) df 2r/c) / sum_k g_k

A path of power P peaks at P, as after the matched filter of a pulse. g is the window; for PMCW the
correlator, g s = sum over repeats of FFT(samples) conj(FFT(code)), no window laid over.
"""

from __future__ import annotations

import numpy as np

from ...array_types import Complex, Real
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..radar import FmcwWaveform, LineWaveform, PmcwWaveform, replica, slow_time_window
from ..spectrum import Backend, nufft1

#: Samples of padded rows that are transformed at a time: 4 MB.
_PADDED = 1 << 18


def line_weights(waveform: LineWaveform, range_taper: str) -> Real:
    """Return the weights g_k of the frequencies.

    Parameters
    ----------
    waveform
        FMCW, stepped frequency or PMCW.
    range_taper
        Range taper by name; PMCW takes the spectrum of its code.

    Returns
    -------
    ndarray
        (frequencies,), in their order.
    """
    if isinstance(waveform, PmcwWaveform):
        return np.fft.fftshift(np.abs(np.fft.fft(replica(waveform))) ** 2)
    return slow_time_window(range_taper, waveform.grid_count)


def line_range_axis(
    waveform: LineWaveform, range_limits_m: tuple[float, float], oversample: int
) -> Real:
    """One-way ranges from the window's start to the unambiguous range at most [m]; a window that
    begins beyond it is a `ConfigError`.
    """
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


def compress_lines(
    waveform: LineWaveform, samples: Complex, range_m: Real, range_taper: str, oversample: int
) -> Complex:
    """Range profiles (pulses, ranges) at `range_m`, from `line_range_axis`, of raw samples (rows,
    N); PMCW has `repeats` rows a pulse.
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
    """Noise power in a range cell over that of a complex sample.

    A real ADC keeps half the noise and a quarter of an echo's power: the gain is 3 dB worse.
    """
    if isinstance(waveform, PmcwWaveform):
        # a correlation with N samples of power |w|^2, averaged over the repeats
        energy = float(np.sum(np.abs(replica(waveform)) ** 2))
        return 1 / (energy * waveform.code_repeats)
    weight = line_weights(waveform, range_taper)
    gain = float(np.sum(weight**2) / weight.sum() ** 2)
    return 2 * gain if isinstance(waveform, FmcwWaveform) and waveform.real_adc else gain


class LinePower:
    """Adds up expected powers sum_i P_i |h(r - r_i)|^2; see `compress.expected_power_profile`."""

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
        """Paths at these one-way ranges [m] with these powers."""
        if isinstance(self._waveform, FmcwWaveform):
            heard = range_m < self._waveform.unambiguous_range_m
            range_m, power = range_m[heard], power[heard]
        points = 4 * np.pi * self._waveform.grid_step_hz / SPEED_OF_LIGHT_MPS * range_m
        cell_m, (start_m, stop_m) = self._waveform.range_resolution_m, self._limits_m
        after_m, period_m = range_m - start_m + cell_m, self._waveform.range_period_m
        if not (after_m.min(initial=0.0) >= 0 and after_m.max(initial=0.0) < period_m):
            after_m = np.mod(after_m, period_m)
        beyond = after_m > stop_m - start_m + 2 * cell_m
        for total, rows in zip(self._sums, (~beyond, beyond), strict=True):
            own = slice(None) if rows.all() else rows
            if rows.any():
                # 1e-13: far echoes stand many tens of dB below near ones
                total += nufft1(points[own], power[own], total.size, 1e-13, self._nufft_backend)

    def result(self, within: bool = False) -> Real:
        """Power at `range_m`, of its shape, in the unit of the powers that were added; `within`: of
        echoes within the range limits alone.
        """
        total = self._sums[0] if within else self._sums.sum(axis=0)
        count = self._waveform.grid_count
        q = np.arange(-count, count)
        start = 2 * self.range_m[0] / SPEED_OF_LIGHT_MPS * self._waveform.grid_step_hz
        size = count * self._oversample
        padded = np.zeros(max(size, 2 * count), dtype=np.complex128)
        padded[q % padded.size] = total * self._lags * np.exp(2j * np.pi * q * start)
        power = np.fft.ifft(padded).real * padded.size
        return np.asarray(np.maximum(power[: self.range_m.size], 0.0))
