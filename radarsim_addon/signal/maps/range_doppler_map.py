# SPDX-License-Identifier: GPL-3.0-or-later
"""Range-Doppler map: a Fourier transform over the pulses of every range cell."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass

import numpy as np

from ...array_types import Complex, Real
from ..echoes import one_channel, only_channel
from ..radar import Radar, slow_time_window
from .range_compression import RangeProfiles

#: Lowest level in decibels that a picture or a table gets: 1e-30 in power.
FLOOR_DB = -300.0


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
    """Return the unit of a level.

    Parameters
    ----------
    amplitude_model
        See :func:`.scattering.path_amplitude`.

    Returns
    -------
    str
        "dBW" with "radar-equation", whose powers are watts, else "dB".
    """
    return power_unit(amplitude_model) or "dB"


def power_unit(amplitude_model: str) -> str:
    """Return the unit of a picture's powers in decibels.

    Parameters
    ----------
    amplitude_model
        See :func:`.scattering.path_amplitude`.

    Returns
    -------
    str
        "dBW", or "" where powers are no watts.
    """
    return "dBW" if amplitude_model == "radar-equation" else ""


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
        Window over the pulses, see :mod:`.radar.windows`.

    Returns
    -------
    RangeDopplerMap
        Amplitudes (channels, pulses, ranges) against Doppler (pulses,) [Hz] and range [m].

    Notes
    -----
    f_D = -2 v / lambda: receding targets are at negative Doppler, on the left. Range rates beyond
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
