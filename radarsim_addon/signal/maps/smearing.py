# SPDX-License-Identifier: GPL-3.0-or-later
"""The point response over powers in cells of range and Doppler."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...array_types import Indices, Real
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..paths import make_paths
from ..radar import Radar, slow_time_window
from ..spectrum import smooth_size
from .range_compression import expected_power_profile

#: Cells in a bin of Doppler of the planes of clutter.
FINER = 4
#: Up to so many rows of Doppler are convolved one by one, faster than by a transform of all.
_FEW_ROWS = 16


class Smearing:
    """Profiles and maps of planes of powers in cells.

    Parameters
    ----------
    radar
        Waveform and burst.
    range_taper, doppler_taper
        Tapers by name.
    step_m, cells_per_sample
        Of the cells of range.
    correlations
        Of each plane, at lags of the pulses, (pulses,) each: how its echoes keep from pulse to
        pulse apart from their Doppler. 1 for scatterers that do not move by themselves, as in the
        first plane.
    """

    def __init__(
        self,
        radar: Radar,
        range_taper: str,
        doppler_taper: str,
        step_m: float,
        cells_per_sample: int,
        correlations: Sequence[Real],
    ) -> None:
        self._range = _range_response(radar, range_taper, step_m, cells_per_sample)
        weight = slow_time_window(doppler_taper, radar.burst.pulses)
        weight = weight / weight.sum()
        self._doppler = [
            _doppler_response(weight, one, FINER if plane else 1)
            for plane, one in enumerate(correlations)
        ]

    def __call__(self, planes: Sequence[Real], first: int = 0) -> tuple[Real, Real]:
        """Return profile (ranges,) and map (pulses, ranges) of all planes from one on, together.

        `planes` are powers, (pulses, ranges) the first, with `FINER` times as many rows the others.
        """
        profile: Real | float = 0.0
        image: Real | float = 0.0
        for plane in range(first, len(planes)):
            profile = profile + planes[plane].sum(axis=0)
            step = FINER if plane else 1
            # most rows of Doppler are empty
            held = np.flatnonzero(planes[plane].any(axis=1))
            in_range = _smear(planes[plane][held], self._range)
            image = image + _smear_doppler(in_range, held, self._doppler[plane], step)
        return _smear(np.atleast_2d(profile), self._range)[0], np.asarray(image)


def _doppler_response(weight: Real, correlation: Real, finer: int) -> Real:
    """Power of a burst in cells of Doppler from its own, (finer x pulses,)."""
    cells = finer * weight.size
    if np.all(correlation == 1):
        return np.asarray(np.abs(np.fft.fft(weight, cells)) ** 2)
    # the spectrum of the taper's own correlation times the echoes', at lags of both signs
    squared = np.abs(np.fft.fft(weight, cells)) ** 2
    ahead = np.fft.ifft(squared).real[: weight.size] * correlation
    lags = np.zeros(cells)
    lags[: weight.size] = ahead
    lags[cells - weight.size + 1 :] += ahead[:0:-1]
    return np.asarray(np.maximum(np.fft.fft(lags).real, 0.0))


def _range_response(radar: Radar, range_taper: str, step_m: float, cells_per_sample: int) -> Real:
    """|h|^2 on the cells, its peak in the middle."""
    if radar.waveform.family == "line":
        # it repeats with the range: half a period to each side
        cells = int(radar.waveform.unambiguous_range_m / step_m) // 2 - 3
        if cells < 1:
            raise ConfigError("The waveform has too few range cells for an expected profile.")
    else:
        # the compressed pulse reaches its length to each side; twice that leaves nothing out
        cells = int(radar.waveform.duration_s * SPEED_OF_LIGHT_MPS / step_m)
    middle = cells + 2
    point = expected_power_profile(
        make_paths(1.0, 2 * middle * step_m),
        radar,
        range_limits_m=(0.0, 2 * middle * step_m),
        range_taper=range_taper,
        oversample=cells_per_sample,
    )
    response = point.power[middle - cells : middle + cells + 1]
    return np.asarray(response / response[cells])


def _smear(grid: Real, response: Real) -> Real:
    """Convolve each row with a response whose peak is in its middle."""
    # What is further from the peak than the grid is long reaches nothing.
    middle, reach = response.size // 2, grid.shape[1] - 1
    response = response[max(middle - reach, 0) : middle + reach + 1]
    size = smooth_size(grid.shape[1] + response.size - 1)
    spectrum = np.fft.rfft(grid, size, axis=1) * np.fft.rfft(response, size)
    start = response.size // 2
    result = np.fft.irfft(spectrum, size, axis=1)[:, start : start + grid.shape[1]]
    return np.maximum(result, 0.0)


def _smear_doppler(rows: Real, held: Indices, response: Real, step: int) -> Real:
    """Every `step`-th row of a circular convolution over Doppler, of the rows that are `held`."""
    count = response.size
    if held.size <= _FEW_ROWS:
        # sidelobes keep their digits where they are far below the strongest row, too
        shifts = (np.arange(0, count, step)[:, None] - held) % count
        return np.asarray(np.einsum("dh,hr->dr", response[shifts], rows))
    grid = np.zeros((count, rows.shape[1]))
    grid[held] = rows
    spectrum = np.fft.rfft(grid, axis=0) * np.fft.rfft(response)[:, None]
    return np.maximum(np.fft.irfft(spectrum, count, axis=0), 0.0)[::step]
