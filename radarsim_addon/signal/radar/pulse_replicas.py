# SPDX-License-Identifier: GPL-3.0-or-later
"""The transmitted pulse, its spectrum, and the matched filter.

For the family "pulse": linear chirp, phase code, samples from a file. The chirp is a sampled one,
as a digital generator plays it: w(t) = exp(j pi K t^2) at t_n = (n - (N-1)/2)/fs, |t_n| <= T_p/2
(Eq. 10-11, time counted from the middle of the pulse, so that the instantaneous frequency runs over
-B/2 ... B/2). Between samples every pulse is the band-limited interpolation of these, which makes
W(f) sum a_i exp(-j 2 pi (f0+f) tau_i) exact for every delay.
"""

from __future__ import annotations

import numpy as np

from ...array_types import Complex, Real
from ...errors import ConfigError
from .continuous_wave import PmcwWaveform
from .pulses import ArbitraryPulse, PhaseCodedPulse, Waveform
from .waveform import AnyWaveform
from .windows import window_at


def _replica_times_s(waveform: AnyWaveform) -> Real:
    """Sample times t_n of the pulse, from its middle, (n,) [s]."""
    count = waveform.sample_count
    return np.asarray((np.arange(count) - (count - 1) / 2) / waveform.sampling_rate_hz)


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
        As :func:`_replica_times_s`.
    """
    if isinstance(waveform, PhaseCodedPulse | ArbitraryPulse | PmcwWaveform):
        return waveform.replica_samples()
    if not isinstance(waveform, Waveform):
        raise ConfigError(
            f"A waveform of kind {waveform.kind!r} has no pulse to correlate with; its range "
            "profile is a Fourier transform of its samples."
        )
    samples: Complex = np.exp(
        1j * np.pi * waveform.fm_rate_hz_per_s * _replica_times_s(waveform) ** 2
    )
    return samples


def frequencies_hz(waveform: AnyWaveform, size: int) -> Real:
    """Return the baseband frequencies of a transform of the samples.

    Parameters
    ----------
    waveform
        Waveform whose sampling rate counts.
    size
        Samples of the transform.

    Returns
    -------
    ndarray
        (size,), in numpy's FFT order [Hz].
    """
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
        As :func:`_replica_times_s`.
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
    """conj(W(f)) times a window over the band, with unit response to a unit path.

    Parameters
    ----------
    waveform
        Of the family "pulse".
    size
        Length of the transform.
    window
        Window over |f| <= B/2, see :mod:`.radar.windows`; frequencies outside the band are cut. A
        phase code has its sidelobes from the code, and none is laid over it, see
        :func:`band_window`.

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
    # A bin that the band's edge cuts counts with its share inside; else the width of the response
    # would hang on where the bins of a transform happen to lie.
    bin_width = waveform.sampling_rate_hz / size / waveform.bandwidth_hz
    share = np.clip((0.5 - np.abs(position)) / bin_width + 0.5, 0.0, 1.0)
    weight = window_at(window, np.clip(position, -0.5, 0.5)) * share
    gain = float(np.mean(np.abs(spectrum) ** 2 * weight))
    return np.asarray(np.conj(spectrum) * (weight / gain), dtype=np.complex128)


def band_window(waveform: AnyWaveform, window: str) -> str:
    """Return the window over the band of a waveform.

    Parameters
    ----------
    waveform
        Any waveform.
    window
        Wanted window, see :mod:`.radar.windows`.

    Returns
    -------
    str
        "none" for phase codes, else `window`.
    """
    return "none" if isinstance(waveform, PhaseCodedPulse | PmcwWaveform) else window
