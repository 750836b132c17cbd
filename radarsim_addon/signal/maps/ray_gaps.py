# SPDX-License-Identifier: GPL-3.0-or-later
"""Where single rays leave gaps between range cells."""

from __future__ import annotations

import math

import numpy as np

from ..paths import PathRows, Steps


class RayGaps:
    """Where most rays are further apart than range cells, in all replicates together."""

    _BINS = 200

    def __init__(self, range_limits_m: tuple[float, float], widest_m: float) -> None:
        self._window_m, self._widest_m = range_limits_m, widest_m
        self._counts = np.zeros((2, self._BINS))

    def add(self, rows: PathRows, steps: Steps) -> None:
        """Rows of a view."""
        # column by column: reductions over axes of two are slow
        reach_m = np.maximum.reduce(list(abs(steps.length_m).reshape(-1, 4).T)) / 2
        range_m = np.array(rows["length_m"]) / 2
        wide = reach_m > self._widest_m
        for count, ranges_m in enumerate((range_m, range_m[wide])):
            self._counts[count] += np.histogram(ranges_m, self._BINS, self._window_m)[0]

    def start_m(self) -> float:
        """Infinite where they are few."""
        held, sparse = self._counts[0] > 0, self._counts[1] > self._counts[0] / 2
        if not sparse.any() or sparse.sum() < 0.05 * held.sum():
            return math.inf
        first = int(np.argmax(sparse))
        low_m, high_m = self._window_m
        return low_m + (high_m - low_m) * first / self._BINS
