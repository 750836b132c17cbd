# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving-target indication: cancellers that remove stationary echoes (Skolnik, 3.2)."""

from __future__ import annotations

import dataclasses

import numpy as np

from ...array_types import Real
from ...errors import ConfigError
from ..radar import slow_time_window
from .noise_floor import range_noise_gain
from .range_compression import RangeProfiles
from .range_doppler_map import RangeDopplerMap

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


def map_noise_rows(
    rd_map: RangeDopplerMap, range_taper: str, doppler_taper: str, mti: int = 0
) -> Real:
    """Return the noise power of each row of a map over that of a raw complex sample.

    Parameters
    ----------
    rd_map
        Map whose rows are asked for.
    range_taper, doppler_taper
        Range taper and Doppler taper by name.
    mti
        Pulses of the canceller of the map, 0 for none: its noise is not white in Doppler.

    Returns
    -------
    ndarray
        Power gain, (Doppler,); without a canceller `map_noise_gain`.
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


def _check_pulses(pulses: int) -> None:
    if pulses not in _WEIGHTS:
        raise ConfigError(f"MTI canceller of {pulses!r} pulses; expected 2 or 3.")
