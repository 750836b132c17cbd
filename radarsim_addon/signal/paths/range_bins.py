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

from ...array_types import Indices, Real
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
    length_m, power_w = (np.ascontiguousarray(rows[name]) for name in ("length_m", "power_w"))
    width_m = widths_m(steps, along)
    lengths, powers = _Courses(steps.length_m), _Courses(steps.power)
    for count, here in _alike(along):
        at_m = lengths.at_places(count, here) + length_m.take(here)
        share = powers.at_places(count, here) + 1
        share *= power_w.take(here) / share.sum(axis=(0, 1))
        _add(total, view.take(here), at_m, share, width_m.take(here), bin_m)
    return total


def _alike(along: Indices) -> Iterator[tuple[tuple[int, int], Indices]]:
    """Numbers of points across and up, and rows that have them, some at a time."""
    key = along[:, 0] << 32 | along[:, 1]
    order = np.argsort(key, kind="stable")
    key = key[order]
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    for start, stop in itertools.pairwise([*starts.tolist(), key.size]):
        across, up = along[order[start]].tolist()
        step = max(_POINTS_AT_ONCE // (across * up), 1)
        for begin in range(start, stop, step):
            yield (across, up), order[begin : min(begin + step, stop)]


class _Courses:
    """How a value changes within pixels with these steps, (n, 2, 2), see `pixel_points.courses`."""

    def __init__(self, steps: Real) -> None:
        self._axes = [(*axis, bool(axis[2].any())) for axis in courses(steps)]

    def at_places(self, count: tuple[int, int], rows: Indices) -> Real:
        """Changes at so many points across and up in pixels of rows, (up, across, rows)."""
        changes = []
        for number, (mean, half, bent, is_bent) in zip(count, self._axes, strict=True):
            place = (np.arange(number)[:, None] + 0.5) / number - 0.5
            change = place * mean.take(rows)
            change += place**2 * half.take(rows)
            if is_bent:
                change += abs(place) * bent.take(rows)
            changes.append(change)
        return changes[0] + changes[1][:, None]


def _add(
    total: Real, view: Indices, at_m: Real, power_w: Real, width_m: Real, bin_m: float
) -> None:
    """Add powers of points at total lengths, (..., n), even over widths, (n,), to the range bins of
    views, (n,).
    """
    # as `footprints` cuts points at the borders of cells, which are half a bin of range
    low_m = at_m - width_m / 2
    over_m = low_m + width_m
    over_m -= np.ceil(low_m / bin_m) * bin_m
    over_m *= (over_m > 0) & (over_m < width_m)
    upper_w = over_m / np.maximum(width_m, np.finfo(np.float64).tiny)
    upper_w *= power_w
    half_m = over_m / 2
    for place_m, each_w in (
        (at_m - half_m, power_w - upper_w),  # the lower part ends where the upper one begins
        (at_m + (width_m / 2 - half_m), upper_w),
    ):
        place_m /= 2 * bin_m
        place = np.clip(place_m, 0, total.shape[1] - 1, out=place_m).astype(np.int64)
        place += view * total.shape[1]
        np.add.at(total.reshape(-1), place.ravel(), each_w.ravel())
