# SPDX-License-Identifier: GPL-3.0-or-later
"""Ranges at which single rays leave gaps between range cells."""

from __future__ import annotations

import math

import numpy as np

from ...array_types import Real
from ..paths import NEGLIGIBLE_FRACTION, PathRows, Steps


class RayGaps:
    """Ranges at which most rays are further apart than range cells, in all replicates together.

    Ranges with less than `NEGLIGIBLE_FRACTION` of the received power do not count.
    """

    _BINS = 200

    def __init__(self, range_limits_m: tuple[float, float], widest_m: float) -> None:
        self._window_m, self._widest_m = range_limits_m, widest_m
        self._counts = np.zeros((2, self._BINS))
        self._power_w, self._total_w = np.zeros(self._BINS), 0.0

    def add(self, rows: PathRows, steps: Steps, power_w: Real) -> None:
        """Add the rows of a view with their powers, (n,)."""
        # column by column: reductions over axes of two are slow
        reach_m = np.maximum.reduce(list(abs(steps.length_m).reshape(-1, 4).T)) / 2
        range_m = np.array(rows["length_m"]) / 2
        wide = reach_m > self._widest_m
        for count, ranges_m in enumerate((range_m, range_m[wide])):
            self._counts[count] += np.histogram(ranges_m, self._BINS, self._window_m)[0]
        self._power_w += np.histogram(range_m, self._BINS, self._window_m, weights=power_w)[0]
        self._total_w += float(power_w.sum())

    def start_m(self) -> float:
        """Return the range from which on rays leave gaps; infinite if they are few."""
        held = self._power_w > NEGLIGIBLE_FRACTION * self._total_w
        sparse = held & (self._counts[1] > self._counts[0] / 2)
        if not sparse.any() or sparse.sum() < 0.05 * held.sum():
            return math.inf
        first = int(np.argmax(sparse))
        low_m, high_m = self._window_m
        return low_m + (high_m - low_m) * first / self._BINS
