# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of range and Doppler that powers are sorted into."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...array_types import Integers, Real
from ..paths import Points
from ..radar import FmcwWaveform, LineWaveform, Radar
from ..spectrum import repeat_orders


class ReplicateMean:
    """Mean of replicates and its standard error (Welford 1962), without keeping them."""

    def __init__(self, shape: int | tuple[int, int]) -> None:
        self.mean, self._squares, self._count = np.zeros(shape), np.zeros(shape), 0

    def add(self, values: Real) -> None:
        self._count += 1
        change = values - self.mean
        self.mean += change / self._count
        change *= values - self.mean
        self._squares += change

    def variance(self) -> Real:
        """Of the mean; NaN where there is one: it says nothing of its error."""
        if self._count < 2:
            return np.full(self.mean.shape, np.nan)
        return np.asarray(self._squares / ((self._count - 1) * self._count))


class PowerCells:
    """Cells of range and Doppler: fractions of the sample spacing, and of the bins of the map."""

    def __init__(
        self,
        radar: Radar,
        range_limits_m: tuple[float, float],
        per_sample: int,
        per_bin: int = 1,
    ) -> None:
        self._given, self._per_bin = (radar, range_limits_m, per_sample), per_bin
        self._start_m, waveform = range_limits_m[0], radar.waveform
        self.step_m = waveform.sample_spacing_m / per_sample
        # it repeats with the pulses or the frequency steps; FMCW filters out what is beyond
        fold_m = radar.burst.unambiguous_range_m
        if isinstance(waveform, LineWaveform):
            fold_m = math.inf if isinstance(waveform, FmcwWaveform) else waveform.range_period_m
        self._period = fold_m / self.step_m
        stop_m = min(range_limits_m[1], radar.waveform.unambiguous_range_m)
        self.ranges = int((stop_m - range_limits_m[0]) / self.step_m) + 1
        self.pulses = radar.burst.pulses
        self.shape = self.pulses * per_bin, self.ranges
        #: One cell of Doppler [m/s].
        self.step_mps = radar.waveform.wavelength_m * radar.burst.prf_hz / 2 / self.shape[0]
        #: Points' distances in total length (a cell) and range rate, and where a cell begins.
        self.spacing = 2 * self.step_m, self.step_mps, 2 * self._start_m - self.step_m

    def finer(self, per_bin: int) -> PowerCells:
        """Cells of which so many are in a bin of Doppler, the first one in its middle."""
        return PowerCells(*self._given, per_bin)

    @property
    def range_m(self) -> Real:
        """Centres of the range cells, (ranges,) [m]."""
        return np.asarray(self._start_m + self.step_m * np.arange(self.ranges), dtype=np.float64)

    def add(self, grid: Real, part: Points, power: Real, grid_of: Integers | None = None) -> None:
        """Add the points that rows of these powers are spread over to the cells of a grid, or of
        several, (grids, ...), with the number of each row's.
        """
        seen, number = self.of(part.length_m, part.range_rate_mps)
        row, share = part.row.take(seen), part.share.take(seen)
        if grid_of is not None:
            number += (grid_of * math.prod(self.shape)).take(row)
        # unbuffered: of a small tile few cells are touched
        np.add.at(grid.ravel(), number, power.take(row) * share)

    def add_between(
        self, grid: Real, part: Points, power: Real, grid_of: Integers | None = None
    ) -> None:
        """As `add`, each point shared by the two cells of Doppler that it lies between."""
        place = part.range_rate_mps / self.step_mps
        below = np.floor(place)
        for cell, share in ((below, below + 1 - place), (below + 1, place - below)):
            points = Points(part.row, part.length_m, cell * self.step_mps, share * part.share)
            self.add(grid, points, power, grid_of)

    def of(
        self, length_m: Real, range_rate_mps: Real
    ) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
        """Points that are seen, again where they fold into a long window, and the cell of each."""
        ranges, period = self.ranges, self._period
        cell = (length_m / 2 - self._start_m) / self.step_m
        if math.isinf(period):
            seen = np.flatnonzero((cell >= -0.5) & (cell < ranges - 0.5))
            place = np.rint(cell.take(seen))
        else:
            low = np.ceil((cell - (ranges - 0.5)) / period)
            copies = np.maximum(np.floor((cell + 0.5) / period) - low + 1, 0).astype(np.intp)
            seen = np.repeat(np.arange(copies.size), copies)
            place = np.rint(cell[seen] - repeat_orders(low, copies) * period)
        column = np.clip(place, 0, ranges - 1).astype(np.int64)  # halves are rounded to even
        bins = np.rint(-range_rate_mps.take(seen) / self.step_mps).astype(np.int64)
        bins += self.pulses // 2 * self._per_bin
        if bins.min(initial=0) < 0 or bins.max(initial=0) >= self.shape[0]:
            bins %= self.shape[0]  # Doppler folds, too
        return seen, bins * ranges + column
