# SPDX-License-Identifier: GPL-3.0-or-later
"""Power of range bins, each row spread over what its pixel covers (:mod:`.footprints`).

The sums are those of the points that `footprints.spread` makes. Those are never all in memory:
rows of as many points across and up are treated together, as many as the processor's cache holds.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from ...array_types import Indices, Mask, Real
from .footprints import Steps, points_along, widths_m
from .pixel_points import courses
from .table import PathRows

#: Points that are treated at a time: their arrays stay in the processor's cache.
_POINTS_AT_ONCE = 1 << 14


def power_of_range_bins(
    rows: PathRows, steps: Steps, bin_m: float, bins: int, view: Indices, views: int
) -> Real:
    """Compute the power of each range bin, view by view.

    Points lie at most half a bin apart. One that reaches over a border is cut in two there.

    Parameters
    ----------
    rows
        Of tiles at one replicate each, the views, with lengths, (n,).
    steps
        Of these rows, from `footprints.steps_of`.
    bin_m
        Width of a range bin [m].
    bins
        Number of bins.
    view, views
        Number of each row's view, (n,), and of all.

    Returns
    -------
    ndarray
        By view and bin [W], (views, bins + 1): the last bin holds all that is beyond.
    """
    total = np.zeros((views, bins + 1))
    along = points_along(steps, bin_m, math.inf, views=views)
    # columns of their own: in a table they lie far apart
    of_row = np.stack([rows["length_m"], rows["power_w"], widths_m(steps, along), view])
    # A sum knows no axes: one group has rows of 2 by 3 points and of 3 by 2.
    swapped = along[:, 0] < along[:, 1]
    changing = _Courses(np.stack([steps.length_m, steps.power]), swapped)
    waiting: list[tuple[Real, ...]] = []
    for count, here in _alike(np.sort(along, axis=1)[:, ::-1]):
        length_m, power_w, *others = of_row.take(here, axis=1)
        at_m, share = changing.at_places(count, here)
        at_m += length_m
        share += 1
        share *= power_w / share.sum(axis=(0, 1))
        waiting.append(np.broadcast_arrays(at_m, share, *others))
        if sum(own[0].size for own in waiting) >= _POINTS_AT_ONCE:
            _add(total, waiting, bin_m)
            waiting = []
    if waiting:
        _add(total, waiting, bin_m)
    return total


def _alike(along: Indices) -> Iterator[tuple[tuple[int, int], Indices]]:
    """Numbers of points along both axes, and rows that have them, some at a time."""
    key = along[:, 0] << 32 | along[:, 1]
    order = np.argsort(key, kind="stable")
    key = key[order]
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    for start, stop in itertools.pairwise([*starts.tolist(), key.size]):
        first, second = along[order[start]].tolist()
        step = max(_POINTS_AT_ONCE // (first * second), 1)
        for begin in range(start, stop, step):
            yield (first, second), order[begin : min(begin + step, stop)]


class _Courses:
    """How values change within pixels with these steps, (values, n, 2, 2), see
    `pixel_points.courses`. The first axis is up where a row is `swapped`, (n,), else across.
    """

    def __init__(self, steps: Real, swapped: Mask) -> None:
        values, rows = steps.shape[:2]
        steps = np.where(swapped[:, None, None], steps[:, :, ::-1], steps)
        #: Factors of x and x^2, and of |x| where that of any row is not 0, along both axes.
        self._axes: list[Real] = []
        for axis in courses(steps.reshape(values * rows, 2, 2)):
            factors = axis if axis[2].any() else axis[:2]
            self._axes.append(np.stack(factors).reshape(len(factors), values, rows))

    def at_places(self, count: tuple[int, int], rows: Indices) -> Real:
        """Changes at so many points along both axes in pixels of rows, (values, second axis, first
        axis, rows).
        """
        changes = []
        for number, factors in zip(count, self._axes, strict=True):
            place = (np.arange(number)[:, None] + 0.5) / number - 0.5
            own = factors.take(rows, axis=2)[:, :, None]
            change = place * own[0]
            change += place**2 * own[1]
            if len(own) > 2:
                change += abs(place) * own[2]
            changes.append(change)
        return np.asarray(changes[0][:, None] + changes[1][:, :, None])


def _add(total: Real, points: list[tuple[Real, ...]], bin_m: float) -> None:
    """Add powers of points at total lengths, even over widths, to the range bins of views: these
    four of each group of points.
    """
    at_m, power_w, width_m, view = (
        np.concatenate([own.ravel() for own in each]) for each in zip(*points, strict=True)
    )
    # as `footprints` cuts points at the borders of cells, which are half a bin of range
    low_m = at_m - width_m / 2
    over_m = low_m + width_m
    over_m -= np.ceil(low_m / bin_m) * bin_m
    over_m *= (over_m > 0) & (over_m < width_m)
    upper_w = over_m / np.maximum(width_m, np.finfo(np.float64).tiny)
    upper_w *= power_w
    half_m = over_m / 2
    first = view * total.shape[1]
    for place_m, each_w in (
        (at_m - half_m, power_w - upper_w),  # the lower part ends where the upper one begins
        (at_m + (width_m / 2 - half_m), upper_w),
    ):
        place_m /= 2 * bin_m
        place = np.floor(np.clip(place_m, 0, total.shape[1] - 1, out=place_m), out=place_m)
        place += first
        np.add.at(total.reshape(-1), place.astype(np.int64), each_w)
