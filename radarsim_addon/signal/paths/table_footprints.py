# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of a table as the points over which they are spread, for echoes of rough surfaces.

The points are those of the expected power, see `footprints`, with their places in space. A pixel
reaches half-way to the neighbouring rays, so a point lies between their vertices. Its length is the
one over its place. Speckle belongs to places on the surface, so it does not move.

`power_of_range_bins` sums the same points over range bins. The points are never all in memory: rows
with equal numbers of points across and up are processed together, as many as fit into the
processor's cache.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Mask, Real, are_finite, distances, dots, norms, take_rows
from ...contract import PathsRecord
from .footprints import (
    PixelPoints,
    Steps,
    along_steps,
    courses,
    points_along,
    power_steps,
    shares,
    steps_of,
    view_limits,
    widths_m,
)
from .table import PathRows
from .table_files import usable

#: Most points, times the rows of a view: each costs as much as a path.
_POINTS_A_ROW = 4
#: Rows of a table whose points are kept until they are needed again: about 120 bytes each.
_KEPT_ROWS = 1 << 20


class _Split(NamedTuple):
    """Rows that have several points, by rising number."""

    #: Numbers in the table, (n,).
    rows: Indices
    #: Rows that their steps lead from and to, (n, 2, 2, 2).
    between: NDArray[np.signedinteger]
    #: Number of points across and up, (n, 2).
    along: NDArray[np.int16]


_NONE = _Split(np.zeros(0, np.intp), np.zeros((0, 2, 2, 2), np.int32), np.zeros((0, 2), np.int16))


class TableFootprints:
    """Points over which rows of a table are spread; any other row is its own point.

    Points are at most `cell_m` of total length and `cell_mps` of range rate apart.
    """

    def __init__(
        self, record: PathsRecord, table: PathRows, cell_m: float, cell_mps: float
    ) -> None:
        self._record, self._table = record, table
        self._cell = cell_m, cell_mps
        self._receiver_m = np.array(record.receiver.matrix_world)[:3, 3]
        self._emitter_m = np.array(record.transmitter.matrix_world)[:3, 3]
        self._orthographic = record.receiver.kind == "orthographic"
        self._views: dict[int, _Split] = {}
        self._starts, self._stops = view_limits(table)
        self._kept: dict[int, tuple[Indices, tuple[Indices, PathRows]]] = {}

    def take(self, number: Indices, rows: PathRows, steps: Steps) -> None:
        """Use steps of whole views, one after another, that other code has computed, too.

        The rows (n,) are those with a length; `number` are their numbers in the table.
        """
        if number.size and _placed(rows).all():
            first, last = (np.searchsorted(self._starts, number[[0, -1]], "right") - 1).tolist()
            self._views.update(dict.fromkeys(range(first + 1, last + 1), _NONE))
            self._add(first, number, steps, last + 1 - first)

    def _add(self, view: int, number: Indices, steps: Steps, views: int = 1) -> None:
        """Add the rows of several views as if they were of the first one."""
        along = points_along(steps, *self._cell, _POINTS_A_ROW, views)
        several = np.flatnonzero(along.max(axis=1, initial=1) > 1)
        # 44 bytes per row, for half of the rows of a scene: numbers as short as they can be
        kind: type[np.signedinteger] = np.int32 if self._table.size < 1 << 31 else np.int64
        between: NDArray[np.signedinteger] = number[steps.between[several]].astype(kind)
        self._views[view] = _Split(number[several], between, along[several].astype(np.int16))

    @functools.cached_property
    def _split(self) -> _Split:
        """Return the rows of all views by rising number. Missing steps are computed here."""
        record = self._record
        for view, (start, stop) in enumerate(zip(self._starts, self._stops, strict=True)):
            if view not in self._views:
                rows = self._table[start:stop]
                kept = np.flatnonzero(usable(rows) & _placed(rows))
                rows = rows if kept.size == rows.size else rows[kept]
                self._add(view, start + kept, steps_of(rows, record.receiver, record.replicates))
        parts = [self._views.pop(view) for view in range(self._starts.size)]
        return _Split(*map(np.concatenate, zip(_NONE, *parts, strict=True)))

    def points(self, numbers: Indices) -> tuple[Indices, PathRows]:
        """Return the points of some rows, as rows of a table with their parts of power and solid
        angle.

        Also return the index in `numbers` of each point's row, (points,).
        """
        first = int(numbers[0]) if numbers.size else -1
        kept = self._kept.pop(first, None)
        if kept is not None and np.array_equal(kept[0], numbers):
            return kept[1]
        found = self._points(numbers)
        # a table comes twice: for its cells, then for its echoes
        if self._table.size <= _KEPT_ROWS:
            self._kept[first] = numbers, found
        return found

    def _points(self, numbers: Indices) -> tuple[Indices, PathRows]:
        found = self._split
        place = np.searchsorted(found.rows, numbers)
        split = np.append(found.rows, -1)[place] == numbers
        chosen = place[split]
        if not chosen.size:
            return np.arange(numbers.size), self._table[numbers]
        along, between = (a[chosen].astype(np.intp) for a in (found.along, found.between))
        counts = np.ones(numbers.size, dtype=np.intp)
        counts[split] = along[:, 0] * along[:, 1]
        index = np.repeat(np.arange(numbers.size), counts)
        points = self._table[numbers[index]]
        mine = np.flatnonzero(split[index])
        in_pixels = PixelPoints.of(along)
        table, own = self._table, numbers[split]
        power_w = table["power_w"]
        share = shares(power_steps(power_w, between, power_w[own]), in_pixels)

        begin, end = (np.ascontiguousarray(between[..., i]) for i in (0, 1))

        def moved(column: Real) -> Real:
            values = np.ascontiguousarray(column)  # in a table they lie far apart
            return along_steps(values[end] - values[begin], in_pixels)

        # what belongs to rows is computed once for all of their points
        row, old_m = in_pixels.row, take_rows(table["last_scatterer_m"], own)
        new_m = take_rows(old_m, row)
        new_m += np.stack([moved(column) for column in table["last_scatterer_m"].T]).T
        longer_m = distances(new_m, self._emitter_m) - distances(old_m, self._emitter_m)[row]
        points["length_m"][mine] += longer_m
        if self._orthographic:
            across_m = new_m - take_rows(old_m, row)
            points["length_m"][mine] += dots(points["direction"][mine], across_m)
        else:
            arm_m = new_m - self._receiver_m
            reach_m = norms(arm_m)
            points["length_m"][mine] += reach_m - norms(old_m - self._receiver_m)[row]
            points["direction"].T[:, mine] = arm_m.T / reach_m
        for name in ("first_scatterer_m", "last_scatterer_m"):
            points[name].T[:, mine] = new_m.T
        points["range_rate_mps"][mine] += moved(table["range_rate_mps"])
        for name in ("power_w", "solid_angle_sr"):
            points[name][mine] *= share
        return index, points


def _placed(rows: PathRows) -> Mask:
    """Return which rows have a known last vertex, (n,)."""
    return are_finite(rows["last_scatterer_m"])


#: Points that are treated at a time: their arrays stay in the processor's cache.
_POINTS_AT_ONCE = 1 << 14


def power_of_range_bins(
    rows: PathRows, steps: Steps, bin_m: float, bins: int, view: Indices, views: int
) -> Real:
    """Compute the power of each range bin [W], (views, bins + 1). The last bin has all power
    beyond.

    The rows are of the views, which are tiles at one replicate each; `view` has the number of each
    row's view, (n,). Points lie at most half a bin apart. A point that extends over a border is cut
    in two there.
    """
    total = np.zeros((views, bins + 1))
    along = points_along(steps, bin_m, math.inf, views=views)
    # columns of their own: in a table they lie far apart
    of_row = np.stack([rows["length_m"], rows["power_w"], widths_m(steps, along), view])
    # A sum is the same for both axes: one group has rows of 2 by 3 points and of 3 by 2.
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
    """Yield numbers of points along both axes, and some rows that have these numbers."""
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
    """Changes of values within pixels with these steps, (values, n, 2, 2), see
    `footprints.courses`.

    The first axis is up where a row is `swapped`, (n,), otherwise across.
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
        """Return the changes at `count` points along both axes in the pixels of rows.

        The result is (values, second axis, first axis, rows).
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
    """Add groups of points (total length, power, width, view) to the range bins of views.

    The power of a point is even over its width.
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
