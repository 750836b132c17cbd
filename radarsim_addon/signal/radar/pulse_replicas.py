# SPDX-License-Identifier: GPL-3.0-or-later
"""Transmitted pulses, their spectra, matched filters, and windows.

The chirp is a sampled one, as a digital generator plays it: w(t) = exp(j pi K t^2) at t_n = (n -
(N-1)/2)/fs, |t_n| <= T_p/2 (Eq. 10-11, time counted from the middle of the pulse, so that the
instantaneous frequency runs over -B/2 ... B/2). Between samples every pulse is the band-limited
interpolation of these, which makes W(f) sum a_i exp(-j 2 pi (f0+f) tau_i) exact for every delay.

Windows are closed forms of a continuous position. Their names: "none", "hann", "hamming" or
"hamming:0.75", "blackman", "kaiser:2.5" (beta), "taylor:4:-35" (nbar, sidelobe level in dB).
"""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Complex, Real
from ...errors import ConfigError
from .config import AnyWaveform
from .waveforms import ArbitraryPulse, PhaseCodedPulse, PmcwWaveform, Waveform

WINDOW_NAMES = ("none", "hann", "hamming", "blackman", "kaiser:beta", "taylor:nbar:sll_db")


def window_at(spec: str, position: Real) -> Real:
    """Return a window at positions within its extent.

    Parameters
    ----------
    spec
        Name and parameters, such as "hann" or "taylor:4:-35", see the module.
    position
        From -1/2 to 1/2, any shape. Outside, the window is 0.

    Returns
    -------
    ndarray
        Same shape; 1 at the centre for all but Taylor (whose mean is 1).

    Raises
    ------
    ConfigError
        Unknown name, or parameters that do not fit.
    """
    name, *texts = spec.lower().split(":")
    try:
        numbers = [float(text) for text in texts]
    except ValueError:
        numbers = [math.nan]
    inside = np.abs(position) <= 0.5
    angle = 2 * np.pi * position
    if name in ("none", "rectangular") and not numbers:
        value = np.ones_like(angle)
    elif name == "hann" and not numbers:
        value = 0.5 + 0.5 * np.cos(angle)
    elif name == "hamming" and (not numbers or (len(numbers) == 1 and 0.5 <= numbers[0] <= 1)):
        alpha = numbers[0] if numbers else 0.54
        value = alpha + (1 - alpha) * np.cos(angle)
    elif name == "blackman" and not numbers:
        value = 0.42 + 0.5 * np.cos(angle) + 0.08 * np.cos(2 * angle)
    elif name == "kaiser" and len(numbers) == 1 and 0 <= numbers[0] <= 100:
        bell = np.sqrt(np.maximum(1 - (2 * position) ** 2, 0.0))
        value = np.i0(numbers[0] * bell) / np.i0(numbers[0])
    elif name == "taylor" and len(numbers) == 2 and numbers[0] >= 1 and numbers[0] % 1 == 0:
        value = _taylor(angle, int(numbers[0]), abs(numbers[1]))
    else:
        raise ConfigError(
            f"Window {spec!r} is unknown; expected one of {', '.join(WINDOW_NAMES)}, "
            "for example 'hamming', 'kaiser:2.5' or 'taylor:4:-35'."
        )
    return np.where(inside, value, 0.0)


def slow_time_window(spec: str, pulses: int) -> Real:
    """Return a window over a train of pulses.

    Parameters
    ----------
    spec
        Name of the window, see :func:`window_at`.
    pulses
        Number of pulses.

    Returns
    -------
    ndarray
        (pulses,), sampled at the middle of each pulse interval.
    """
    return window_at(spec, (np.arange(pulses) - (pulses - 1) / 2) / pulses)


def _taylor(angle: Real, nbar: int, sidelobe_db: float) -> Real:
    """Taylor window (Carrara, Goodman, Majewski, Spotlight SAR, appendix D)."""
    if not 0 < sidelobe_db <= 200 or nbar > 1000:
        raise ConfigError(
            f"Taylor window with nbar {nbar} and {sidelobe_db} dB; expected nbar up to 1000 and a "
            "sidelobe level of a few tens of dB, for example 'taylor:4:-35'."
        )
    a_squared = (math.acosh(10 ** (sidelobe_db / 20)) / math.pi) ** 2
    sigma_squared = nbar**2 / (a_squared + (nbar - 0.5) ** 2)
    value = np.ones_like(angle)
    for m in range(1, nbar):
        top, bottom = 1.0, 1.0
        for n in range(1, nbar):
            top *= 1 - m**2 / sigma_squared / (a_squared + (n - 0.5) ** 2)
            if n != m:
                bottom *= 1 - m**2 / n**2
        value += (-1) ** (m + 1) * top / bottom * np.cos(m * angle)
    return value


def replica(waveform: AnyWaveform) -> Complex:
    """Return the samples w(t_n): exp(j pi K t_n^2) of a chirp, the chips of a code, or a file's.

    Parameters
    ----------
    waveform
        Waveform of the family "pulse", or PMCW.

    Returns
    -------
    ndarray
        Complex, (sample_count,), mean power 1.

    Raises
    ------
    ConfigError
        The waveform has no pulse.
    """
    if isinstance(waveform, PhaseCodedPulse | ArbitraryPulse | PmcwWaveform):
        return waveform.replica_samples()
    if not isinstance(waveform, Waveform):
        raise ConfigError(
            f"A waveform of kind {waveform.kind!r} has no pulse to correlate with; its range "
            "profile is a Fourier transform of its samples."
        )
    count = waveform.sample_count
    times_s = np.asarray((np.arange(count) - (count - 1) / 2) / waveform.sampling_rate_hz)
    samples: Complex = np.exp(1j * np.pi * waveform.fm_rate_hz_per_s * times_s**2)
    return samples


def frequencies_hz(waveform: AnyWaveform, size: int) -> Real:
    """Return the baseband frequencies of a transform of `size` samples, in FFT order [Hz]."""
    return np.fft.fftfreq(size, 1 / waveform.sampling_rate_hz)


def replica_spectrum(waveform: AnyWaveform, size: int) -> Complex:
    """Return the spectrum W(f) = sum_n w(t_n) exp(-j 2 pi f t_n) of the pulse.

    Parameters
    ----------
    waveform
        Waveform of the family "pulse", or PMCW.
    size
        Samples of the transform, at least those of the pulse.

    Returns
    -------
    ndarray
        Complex, (size,), at :func:`frequencies_hz`.

    Raises
    ------
    ConfigError
        The waveform has no pulse.
    ValueError
        The pulse has more samples than the transform.
    """
    samples = replica(waveform)
    if samples.size > size:
        raise ValueError(f"a chirp of {samples.size} samples needs a transform at least as long")
    middle_s = (samples.size - 1) / 2 / waveform.sampling_rate_hz
    shift = np.exp(2j * np.pi * frequencies_hz(waveform, size) * middle_s)
    spectrum: Complex = np.fft.fft(samples, size) * shift
    return spectrum


def matched_filter(waveform: AnyWaveform, size: int, window: str = "none") -> Complex:
    """Return conj(W(f)) times a window over the band, with unit response to a unit path.

    Parameters
    ----------
    waveform
        Of the family "pulse".
    size
        Length of the transform.
    window
        Window over |f| <= B/2, see :func:`window_at`; frequencies outside the band are
        cut. A phase code has its sidelobes from the code, and no window.

    Returns
    -------
    ndarray
        (size,), in FFT order: the inverse FFT of W times this peaks at exactly 1.
    """
    spectrum = replica_spectrum(waveform, size)
    if isinstance(waveform, PhaseCodedPulse):
        plain = np.conj(spectrum) / np.mean(np.abs(spectrum) ** 2)
        return np.asarray(plain, dtype=np.complex128)
    position = frequencies_hz(waveform, size) / waveform.bandwidth_hz
    # A bin at the band's edge counts with its fraction inside; otherwise the width of the response
    # would depend on where the bins lie.
    bin_width = waveform.sampling_rate_hz / size / waveform.bandwidth_hz
    share = np.clip((0.5 - np.abs(position)) / bin_width + 0.5, 0.0, 1.0)
    weight = window_at(window, np.clip(position, -0.5, 0.5)) * share
    gain = float(np.mean(np.abs(spectrum) ** 2 * weight))
    return np.asarray(np.conj(spectrum) * (weight / gain), dtype=np.complex128)


def band_window(waveform: AnyWaveform, window: str) -> str:
    """Return `window`, or "none" for phase codes: their sidelobes are those of the code."""
    return "none" if isinstance(waveform, PhaseCodedPulse | PmcwWaveform) else window
