# SPDX-License-Identifier: GPL-3.0-or-later
"""Range-Doppler map: a Fourier transform over the pulses of every range cell.

Before it, a canceller may remove stationary echoes (moving-target indication; Skolnik, 3.2).

White noise: a cell's noise power is that of one raw sample, k T_s fs, times a gain well below 1; a
path of power P peaks at P. So SNR = P / (k T_s fs gain), which for a matched filter without tapers
is the textbook's P T / (k T_s) times the number of pulses.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass

import numpy as np

from ...arrays import Complex, Real
from ...errors import ConfigError
from ..echoes import one_channel, only_channel
from ..radar import (
    LineWaveform,
    PmcwWaveform,
    Radar,
    matched_filter,
    slow_time_window,
)
from .range_compression import RangeProfiles, line_noise_gain

#: Levels further below the strongest cell are rounding of float32 renders [dB]. The range is
#: smaller with a coarse tolerance of the synthesis.
MAP_DYNAMICS_DB = 160.0
#: Lowest level in pictures and tables [dB]: a power of 1e-30.
FLOOR_DB = -300.0


@dataclass(frozen=True)
class RangeDopplerMap:
    """Range-Doppler map.

    Attributes
    ----------
    values
        (channels, Doppler, ranges), complex. A unit path gives magnitude 1 (0 dB) at its range in
        the middle of the burst, where its Doppler falls on a cell.
    doppler_hz
        Doppler frequency of each row, ascending, 0 Hz at row pulses // 2 [Hz].
    range_m
        One-way range of each column [m].
    radar
        Waveform and burst.
    range_taper, doppler_taper
        Windows over the band and over the pulses.
    """

    values: Complex
    doppler_hz: Real
    range_m: Real
    radar: Radar
    range_taper: str
    doppler_taper: str

    @property
    def power(self) -> Real:
        """|values|^2, (channels, Doppler, ranges); W for "radar-equation"."""
        return np.asarray(np.abs(self.values) ** 2)

    @functools.cached_property
    def strongest_and_median(self) -> tuple[float, float]:
        """Largest and median power of all cells."""
        power = self.power
        return float(power.max()), float(np.median(power))

    @property
    def power_db(self) -> Real:
        """10 log10 of the power, (channels, Doppler, ranges), floored at `FLOOR_DB`."""
        return power_to_db(self.power)

    @property
    def plane(self) -> Complex:
        """Values of the only channel, (Doppler, ranges), see :func:`.echoes.only_channel`."""
        return only_channel(self.values)

    @property
    def plane_power(self) -> Real:
        """|values|^2 of the only channel, (Doppler, ranges); errors as for `plane`."""
        return np.asarray(np.abs(self.plane) ** 2)

    def channel(self, number: int) -> RangeDopplerMap:
        """Return the map of one channel, counted from 0."""
        radar = one_channel(self.radar, number)
        return dataclasses.replace(self, values=self.values[number][None], radar=radar)

    @property
    def velocity_mps(self) -> Real:
        """Range rate of each row, -lambda f_D / 2, receding positive, (pulses,) [m/s]."""
        return np.asarray(-self.doppler_hz * self.radar.waveform.wavelength_m / 2)


def range_doppler(compressed: RangeProfiles, doppler_taper: str = "hamming") -> RangeDopplerMap:
    """Return the range-Doppler map of a burst.

    Parameters
    ----------
    compressed
        Compressed pulses.
    doppler_taper
        Window over the pulses, see :func:`.radar.window_at`.

    Returns
    -------
    RangeDopplerMap
        Amplitudes (channels, pulses, ranges) against Doppler (pulses,) [Hz] and range [m].

    Notes
    -----
    f_D = -2 v / lambda: receding targets are at negative Doppler. Range rates beyond
    lambda PRF / 4 fold, as in a radar. A target that moves by more than a range cell during the
    burst smears; its peak stands where it was in the middle of the burst.
    """
    pulses = compressed.values.shape[1]
    weight = slow_time_window(doppler_taper, pulses)
    weight /= weight.sum()
    values = np.fft.fftshift(np.fft.fft(compressed.values * weight[:, None], axis=1), axes=1)
    doppler_hz = np.fft.fftshift(np.fft.fftfreq(pulses, 1 / compressed.radar.burst.prf_hz))
    return RangeDopplerMap(
        values,
        doppler_hz,
        compressed.range_m,
        compressed.radar,
        compressed.range_taper,
        doppler_taper,
    )


def coherent_samples(radar: Radar) -> int:
    """Return the number of raw samples that add up coherently in one pulse's range cell."""
    waveform = radar.waveform
    if isinstance(waveform, LineWaveform):
        repeats = waveform.code_repeats if isinstance(waveform, PmcwWaveform) else 1
        return waveform.grid_count * repeats
    return waveform.sample_count


def range_noise_gain(radar: Radar, range_taper: str = "hamming") -> float:
    """Return the noise power of a compressed range cell over that of a raw complex sample.

    Parameters
    ----------
    radar
        Waveform and burst.
    range_taper
        Range taper by name.

    Returns
    -------
    float
        Power gain.
    """
    waveform = radar.waveform
    if isinstance(waveform, LineWaveform):
        return line_noise_gain(waveform, range_taper)
    size = 4 * waveform.sample_count
    return float(np.mean(np.abs(matched_filter(waveform, size, range_taper)) ** 2))


def map_noise_gain(
    radar: Radar, range_taper: str = "hamming", doppler_taper: str = "hamming"
) -> float:
    """Return the noise power of a cell of the map over that of a raw complex sample.

    Parameters
    ----------
    radar
        Waveform and burst.
    range_taper, doppler_taper
        Range taper and Doppler taper by name.

    Returns
    -------
    float
        Power gain.
    """
    weight = slow_time_window(doppler_taper, radar.burst.pulses)
    return range_noise_gain(radar, range_taper) * float(np.sum(weight**2) / weight.sum() ** 2)


#: Weights of the cancellers by number of pulses, scaled so that white noise keeps its power.
_WEIGHTS = {2: np.array([1.0, -1.0]) / 2**0.5, 3: np.array([1.0, -2.0, 1.0]) / 6**0.5}


def mti_cancel(compressed: RangeProfiles, pulses: int) -> RangeProfiles:
    """Apply a two- or three-pulse canceller over the pulses of a burst.

    Parameters
    ----------
    compressed
        Range profiles of the pulses.
    pulses
        2 (single delay line) or 3 (double).

    Returns
    -------
    RangeProfiles
        With 1 or 2 pulses fewer. Echoes are weighted with :func:`mti_response` of their Doppler;
        white noise keeps its power on the average over Doppler.

    Raises
    ------
    ConfigError
        Another canceller, or too few pulses.
    """
    _check_pulses(pulses)
    count = compressed.values.shape[1] - pulses + 1
    if count < 1:
        raise ConfigError(
            f"A burst of {compressed.values.shape[1]} pulses is too short for a canceller of "
            f"{pulses}. Send more pulses, or process without MTI."
        )
    weights = _WEIGHTS[pulses]
    channels, _, ranges = compressed.values.shape
    values = np.zeros((channels, count, ranges), dtype=np.complex128)
    for i, weight in enumerate(weights):
        values += weight * compressed.values[:, i : i + count]
    return dataclasses.replace(compressed, values=values, radar=compressed.radar.with_pulses(count))


def mti_response(pulses: int, doppler_hz: Real | float, prf_hz: float) -> Real:
    """Return the power response of a canceller: 2 sin^2(x) and (8/3) sin^4(x), x = pi f_D / PRF.

    The textbook's 4 sin^2 and 16 sin^4, over the 2 and 6 by which the canceller raises noise.

    Parameters
    ----------
    pulses
        2 or 3.
    doppler_hz
        f_D, any shape [Hz].
    prf_hz
        PRF [Hz].

    Returns
    -------
    ndarray
        Power gain in the shape of `doppler_hz`.
    """
    _check_pulses(pulses)
    squared = np.sin(np.pi * np.asarray(doppler_hz, dtype=np.float64) / prf_hz) ** 2
    return np.asarray(2 * squared if pulses == 2 else 8 / 3 * squared**2)


def _check_pulses(pulses: int) -> None:
    if pulses not in _WEIGHTS:
        raise ConfigError(f"MTI canceller of {pulses!r} pulses; expected 2 or 3.")


def map_noise_rows(
    rd_map: RangeDopplerMap, range_taper: str, doppler_taper: str, mti: int = 0
) -> Real:
    """Return the noise power of each row of a map over that of a raw complex sample, (Doppler,).

    After a canceller of `mti` pulses (0: none) it is not white in Doppler.
    """
    taper = slow_time_window(doppler_taper, rd_map.values.shape[1])
    weights = _WEIGHTS[mti] if mti else np.ones(1)
    lags = np.arange(1 - min(weights.size, taper.size), min(weights.size, taper.size))
    noise, tapers = (
        np.correlate(part, part, "full")[part.size - 1 + lags] for part in (weights, taper)
    )
    cycles = rd_map.doppler_hz / rd_map.radar.burst.prf_hz
    rows = (np.cos(2 * np.pi * np.outer(cycles, lags)) * (noise * tapers)).sum(axis=1)
    return np.asarray(range_noise_gain(rd_map.radar, range_taper) * rows / taper.sum() ** 2)


def dynamics_db(tolerance: float) -> float:
    """Return how far below the strongest cell an echo exceeds the error of the synthesis [dB].

    `tolerance` is the relative L2 error of the echoes' spectrum.
    """
    return min(MAP_DYNAMICS_DB, 20 - 20 * math.log10(tolerance))


def power_to_db(power: Real, reference: float = 1.0, floor_db: float = FLOOR_DB) -> Real:
    """Return 10 log10(power / reference), never below a floor.

    Parameters
    ----------
    power
        Any shape; zero gives the floor.
    reference
        Power of 0 dB, in the unit of `power`.
    floor_db
        Smallest level [dB].

    Returns
    -------
    ndarray
        Levels in the shape of `power` [dB].
    """
    level = np.full(np.shape(power), float(floor_db))
    relative = np.asarray(power, dtype=np.float64) / reference
    np.log10(relative, out=level, where=relative > 0)
    return np.asarray(np.maximum(np.where(relative > 0, 10 * level, floor_db), floor_db))


def level_unit(amplitude_model: str) -> str:
    """Return the unit of a level: "dBW" with "radar-equation", whose powers are watts, else
    "dB".
    """
    return power_unit(amplitude_model) or "dB"


def power_unit(amplitude_model: str) -> str:
    """Return the unit of a picture's powers in decibels: "dBW", or "" where powers are no watts."""
    return "dBW" if amplitude_model == "radar-equation" else ""
