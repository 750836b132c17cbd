# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectrogram of a burst: Doppler against time, which shows micro-Doppler."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...arrays import Real
from ...errors import ConfigError
from ...options import check_settings, documented, setting
from ..echoes import check_window, synthesize
from ..paths import make_paths
from ..radar import Burst, Radar, slow_time_window
from .range_compression import RangeProfiles, range_process

#: A range response is cut off at this distance from its peak, in range resolutions.
_RESPONSE_CELLS = 64


@documented
@dataclass(frozen=True)
class SpectrogramOptions:
    """Windows, ranges and object of a spectrogram."""

    window_pulses: int = setting(
        "Spectrogram window",
        "Make a spectrogram with windows of this number of pulses",
        64,
        minimum=2,
        flag="--spectrogram",
    )
    overlap: float = setting(
        "Spectrogram overlap", "Set the fraction that neighbouring windows have in common", 0.75,
        minimum=0.0, maximum=0.99, flag="--spectrogram-overlap",
    )  # fmt: skip
    limits_m: tuple[float, float] | None = setting(
        "Spectrogram range limits",
        "Take the echoes between these one-way ranges. None: those of the profile",
        None, unit="m", metavar="A:B", flag="--spectrogram-range-limits",
    )  # fmt: skip
    object_name: str | None = setting(
        "Spectrogram object",
        "Take the echoes of this object or collection alone (* and ? allowed). None: all echoes",
        None, metavar="NAME", flag="--spectrogram-object",
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_settings(self)
        if self.limits_m is not None:
            check_window(self.limits_m)


@dataclass(frozen=True)
class Spectrogram:
    """Power of a burst against time and Doppler.

    Attributes
    ----------
    power
        (windows, Doppler); a path of power P within the range limits, whose Doppler is constant
        and falls on a cell, has P there. W for "radar-equation".
    time_s
        Middle of each window since the frame's time, (windows,) [s].
    doppler_hz
        Doppler frequency of each column, ascending [Hz].
    range_limits_m
        One-way ranges whose cells were added up [m].
    radar
        Waveform and burst.
    options
        Window, overlap, and what was chosen.
    """

    power: Real
    time_s: Real
    doppler_hz: Real
    range_limits_m: tuple[float, float]
    radar: Radar
    options: SpectrogramOptions

    @property
    def velocity_mps(self) -> Real:
        """Range rate of each column, -lambda f_D / 2, receding positive, (Doppler,) [m/s]."""
        return np.asarray(-self.doppler_hz * self.radar.waveform.wavelength_m / 2)


def spectrogram(
    compressed: RangeProfiles,
    options: SpectrogramOptions | None = None,
    doppler_taper: str = "hamming",
) -> Spectrogram:
    """Return the spectrogram of a burst: short Fourier transforms over the pulses.

    Parameters
    ----------
    compressed
        Range profiles of one channel.
    options
        Window, overlap and range limits; the defaults where None. The object is the caller's
        matter, who hands in its echoes.
    doppler_taper
        Window over the pulses of a transform, see :func:`.radar.window_at`.

    Returns
    -------
    Spectrogram
        Windows that lie within the burst.

    Raises
    ------
    ConfigError
        More pulses in a window than in the burst, range limits without a range cell, or several
        channels.

    Notes
    -----
    The powers of the range cells are added up and divided by the energy of the response to one
    path, so that paths in different range cells add their powers. Of a response that the range
    limits cut only the part within counts.

    References
    ----------
    V. C. Chen, The Micro-Doppler Effect in Radar, 2nd ed., Artech House 2019, chapter 2.
    """
    options = options or SpectrogramOptions()
    radar, values = compressed.radar, compressed.plane
    pulses, window = radar.burst.pulses, options.window_pulses
    if window > pulses:
        raise ConfigError(
            f"A window of {window} pulses in a burst of {pulses}; expected at most as many. Choose "
            "a shorter window for the spectrogram, or measure more pulses."
        )
    range_m = compressed.range_m
    limits_m = options.limits_m or (float(range_m[0]), float(range_m[-1]))
    inside = (range_m >= limits_m[0]) & (range_m <= limits_m[1])
    if not inside.any():
        raise ConfigError(
            f"The spectrogram's range limits of {limits_m[0]:g} to {limits_m[1]:g} m hold no range "
            f"cell; the profile has {range_m[0]:g} to {range_m[-1]:g} m."
        )
    values = values[:, inside]
    weight = slow_time_window(doppler_taper, window)[:, None]
    weight /= weight.sum()
    hop = max(1, round(window * (1 - options.overlap)))
    starts = np.arange(0, pulses - window + 1, hop)
    power = np.empty((starts.size, window))
    for row, start in enumerate(starts):
        spectrum = np.fft.fft(values[start : start + window] * weight, axis=0)
        power[row] = np.sum(np.abs(spectrum) ** 2, axis=1)
    step_m = float(range_m[1] - range_m[0]) if range_m.size > 1 else 0.0
    power /= _response_energy(radar, compressed.range_taper, step_m)
    prf_hz = radar.burst.prf_hz
    return Spectrogram(
        np.fft.fftshift(power, axes=1),
        np.asarray((starts + (window - 1) / 2) / prf_hz, dtype=np.float64),
        np.fft.fftshift(np.fft.fftfreq(window, 1 / prf_hz)),
        limits_m,
        radar,
        options,
    )


def _response_energy(radar: Radar, range_taper: str, step_m: float) -> float:
    """Return the sum of |response|^2 of a unit path over range cells that are `step_m` apart."""
    waveform = radar.waveform
    reach_m = min(
        _RESPONSE_CELLS * waveform.range_resolution_m, waveform.unambiguous_range_m / 2.01
    )
    single = Radar(waveform, Burst(radar.burst.prf_hz, 1))
    path = make_paths(4 * math.pi / waveform.wavelength_m**2, 2 * reach_m)
    limits_m = (0.0, 2 * reach_m)
    echoes = synthesize(path, single, range_limits_m=limits_m, nufft_backend="direct")
    profile = range_process(echoes, range_taper)
    cells = step_m / float(profile.range_m[1] - profile.range_m[0]) if step_m else 1.0
    return float(np.sum(np.abs(profile.plane) ** 2)) / cells
