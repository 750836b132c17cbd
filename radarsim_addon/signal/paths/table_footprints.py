# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of a table as the points that they are spread over: what echoes of rough surfaces are of.

The points are those of expected power, see :mod:`.paths.footprints`, with their places in space: as
a pixel reaches half-way to the rays around it, a point lies between their vertices. Its length is
that over its place, so that speckle, which belongs to places on the surface, stays where it is.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Mask, Real
from ...contract import PathsRecord
from ...vectors import are_finite, distances, dots, norms, take_rows
from .footprints import (
    Steps,
    points_along,
    power_steps,
    steps_of,
)
from .pixel_points import PixelPoints, along_steps, shares
from .pixel_spacing import view_limits
from .rows import PathColumns
from .table import PathRows
from .table_files import usable

#: Most points, times the rows of a view: each costs as much as a path.
_POINTS_A_ROW = 4
#: Rows of a table whose points are kept until they are wanted again: some 120 bytes each.
_KEPT_ROWS = 1 << 20


class _Split(NamedTuple):
    """Rows of several points (n,) in rising order, what their steps lie between, (n, 2, 2, 2), and
    how many points they have across and up, (n, 2).
    """

    rows: Indices
    between: NDArray[np.signedinteger]
    along: NDArray[np.int16]


_NONE = _Split(np.zeros(0, np.intp), np.zeros((0, 2, 2, 2), np.int32), np.zeros((0, 2), np.int16))


class TableFootprints:
    """Finds what rows of a table are spread over; all other rows are points of their own.

    Parameters
    ----------
    record, table
        From :func:`.paths.open_frame_table`.
    cell_m
        Largest distance of the points in total length [m].
    cell_mps
        Largest distance in range rate [m/s].
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
        self._kept: dict[int, tuple[Indices, tuple[Indices, PathColumns]]] = {}

    def take(self, number: Indices, rows: PathRows, steps: Steps) -> None:
        """Take the steps of whole views, one after another, from who needs them too.

        Parameters
        ----------
        number, rows
            Usable rows of these views, and their numbers in the table, (n,) each.
        steps
            From `steps_of`.
        """
        if number.size and _placed(rows).all():
            first, last = (np.searchsorted(self._starts, number[[0, -1]], "right") - 1).tolist()
            self._views.update(dict.fromkeys(range(first + 1, last + 1), _NONE))
            self._add(first, number, steps, last + 1 - first)

    def _add(self, view: int, number: Indices, steps: Steps, views: int = 1) -> None:
        """Rows of several views are kept as those of the first one."""
        along = points_along(steps, *self._cell, _POINTS_A_ROW, views)
        several = np.flatnonzero(along.max(axis=1, initial=1) > 1)
        # 44 bytes a row, for half of the rows of a scene: numbers no longer than they have to be
        kind: type[np.signedinteger] = np.int32 if self._table.size < 1 << 31 else np.int64
        between: NDArray[np.signedinteger] = number[steps.between[several]].astype(kind)
        self._views[view] = _Split(number[several], between, along[several].astype(np.int16))

    @functools.cached_property
    def _split(self) -> _Split:
        """The rows of all views in rising order; views that nobody gave are looked at here."""
        record = self._record
        for view, (start, stop) in enumerate(zip(self._starts, self._stops, strict=True)):
            if view not in self._views:
                rows = np.asarray(self._table[start:stop])
                kept = np.flatnonzero(usable(rows) & _placed(rows))
                rows = rows if kept.size == rows.size else rows[kept]
                self._add(view, start + kept, steps_of(rows, record.receiver, record.replicates))
        parts = [self._views.pop(view) for view in range(self._starts.size)]
        return _Split(*map(np.concatenate, zip(_NONE, *parts, strict=True)))

    def points(self, numbers: Indices) -> tuple[Indices, PathColumns]:
        """Return the points of some rows, themselves as rows of a table.

        Parameters
        ----------
        numbers
            Rows of the table, (n,).

        Returns
        -------
        ndarray, PathColumns
            Index in `numbers` that each point belongs to, and the points with their parts of power
            and solid angle, (points,) each.
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

    def _points(self, numbers: Indices) -> tuple[Indices, PathColumns]:
        found = self._split
        place = np.searchsorted(found.rows, numbers)
        split = np.append(found.rows, -1)[place] == numbers
        chosen = place[split]
        if not chosen.size:
            return np.arange(numbers.size), PathColumns(self._table, numbers)
        along, between = (a[chosen].astype(np.intp) for a in (found.along, found.between))
        counts = np.ones(numbers.size, dtype=np.intp)
        counts[split] = along[:, 0] * along[:, 1]
        index = np.repeat(np.arange(numbers.size), counts)
        points = PathColumns(self._table, numbers[index])
        mine = np.flatnonzero(split[index])
        in_pixels = PixelPoints.of(along)
        table, own = np.asarray(self._table), numbers[split]
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
    """Which rows have a known last vertex, (n,)."""
    return are_finite(rows["last_scatterer_m"])
