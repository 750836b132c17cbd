# SPDX-License-Identifier: GPL-3.0-or-later
"""The transmitted chirp, its spectrum, and the matched filter.

The chirp is a sampled one, as a digital generator plays it: w(t) = exp(j pi K t^2) at
t_n = (n - (N-1)/2)/fs, |t_n| <= T_p/2 (Eq. 10-11, time counted from the middle of the pulse, so
that the instantaneous frequency runs over -B/2 ... B/2). Between samples it is the band-limited
interpolation of these, which makes W(f) sum a_i exp(-j 2 pi (f0+f) tau_i) exact for every delay.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigError
from .config import Waveform
from .windows import window_at

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


def replica_times_s(waveform: Waveform) -> Real:
    """Sample times t_n of the chirp, from its middle [s].

    Raises
    ------
    ConfigError
        The chirp is shorter than two samples.
    """
    # a tiny slack: 2.5e-6 * 60e6 is 149.99999999999997
    count = int(np.floor(waveform.chirp_length_s * waveform.sampling_rate_hz * (1 + 1e-9)))
    if count < 2:
        raise ConfigError(
            f"Chirp of {waveform.chirp_length_s:g} s has {count} sample(s) at "
            f"{waveform.sampling_rate_hz:g} Hz; at least 2 are needed. "
            "Lengthen the chirp or raise the sampling rate."
        )
    return np.asarray((np.arange(count) - (count - 1) / 2) / waveform.sampling_rate_hz)


def replica(waveform: Waveform) -> Complex:
    """Samples w(t_n) = exp(j pi K t_n^2)."""
    times = replica_times_s(waveform)
    samples: Complex = np.exp(1j * np.pi * waveform.fm_rate_hz_per_s * times**2)
    return samples


def frequencies_hz(waveform: Waveform, size: int) -> Real:
    """Baseband frequencies of a transform of `size` samples, in numpy's FFT order [Hz]."""
    return np.fft.fftfreq(size, 1 / waveform.sampling_rate_hz)


def replica_spectrum(waveform: Waveform, size: int) -> Complex:
    """W(f) = sum_n w(t_n) exp(-j 2 pi f t_n) at :func:`frequencies_hz`."""
    samples = replica(waveform)
    if samples.size > size:
        raise ValueError(f"a chirp of {samples.size} samples needs a transform at least as long")
    middle_s = (samples.size - 1) / 2 / waveform.sampling_rate_hz
    shift = np.exp(2j * np.pi * frequencies_hz(waveform, size) * middle_s)
    spectrum: Complex = np.fft.fft(samples, size) * shift
    return spectrum


def matched_filter(waveform: Waveform, size: int, window: str = "none") -> Complex:
    """conj(W(f)) times a window over the band, with unit response to a unit path.

    Parameters
    ----------
    waveform
        Chirp.
    size
        Length of the transform.
    window
        Window over |f| <= B/2, see :mod:`.windows`; frequencies outside the band are cut.

    Returns
    -------
    ndarray
        (size,), in FFT order: the inverse FFT of W times this peaks at exactly 1.
    """
    spectrum = replica_spectrum(waveform, size)
    position = frequencies_hz(waveform, size) / waveform.bandwidth_hz
    # A bin that the band's edge cuts counts with its share inside; else the width of the response
    # would hang on where the bins of a transform happen to lie.
    bin_width = waveform.sampling_rate_hz / size / waveform.bandwidth_hz
    share = np.clip((0.5 - np.abs(position)) / bin_width + 0.5, 0.0, 1.0)
    weight = window_at(window, np.clip(position, -0.5, 0.5)) * share
    gain = float(np.mean(np.abs(spectrum) ** 2 * weight))
    return np.asarray(np.conj(spectrum) * (weight / gain), dtype=np.complex128)
