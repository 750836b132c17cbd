# SPDX-License-Identifier: GPL-3.0-or-later
"""What ranges and range rates a pixel's surface covers, told from the pixels beside it.

A path stands for all that its pixel sees. Where a surface is seen at grazing incidence, that is a
stretch of many range cells, and a profile of single paths has an echo in one of them and nothing
in the others. Between the rays of one object the surface is taken to be straight: from its own ray
a pixel reaches half-way to those beside it, and its power, which it keeps, is spread over that as
theirs tell. For expected powers alone: echoes with phase need points.

Nothing is spread where no neighbour tells how far: at orders above 1 (which chance rules), and
where the ranges to both sides say opposite things (the nearest point of a sphere, an edge that
juts out). Where they differ too much (a step in the surface), the smaller one counts.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..contract import CameraRecord
from .pathframes import usable
from .pathtable import PathRows
from .pixelgrid import grid_places, placed

Real = NDArray[np.float64]
Places = NDArray[np.intp]

#: Neighbours on both sides are of one smooth surface where their steps differ by less than this.
_STEEPER = 4.0
#: Largest step of power that is followed, as a share of it: half of it along two axes is less than
#: all there is.
_LARGEST_STEP = 0.9
#: Points that rows are spread over: so many times the rows of a view, or so many at least.
_POINTS_A_ROW, _LEAST_POINTS = 4, 1 << 20
#: Most points along one side of a pixel.
_MOST_ALONG = 4096
#: Points that are made at a time.
_CHUNK = 1 << 20


@dataclass(frozen=True)
class Steps:
    """Change of length, range rate and power (as a share of the ray's own) from ray to ray.

    Arrays (n, 2, 2): by axis (across, up) and side (before, after), counted along the axis; 0
    where unknown.
    """

    length_m: Real
    range_rate_mps: Real
    power: Real

    def part(self, rows: slice) -> Steps:
        """Those of some rows."""
        return Steps(self.length_m[rows], self.range_rate_mps[rows], self.power[rows])


@dataclass(frozen=True)
class Points:
    """Points that rows of a view are spread over: row, total length [m], rate [m/s], share of the
    row's power, each (points,)."""

    row: Places
    length_m: Real
    range_rate_mps: Real
    share: Real


def steps_of(rows: PathRows, camera: CameraRecord, count: int) -> Steps:
    """Differences between a view's neighbouring rays.

    Parameters
    ----------
    rows
        Of one tile at one shift, with lengths.
    camera
        The frame's.
    count
        Number of shifts of the tile.
    """
    found = Steps(*np.zeros((3, rows.size, 2, 2)))
    kept = np.flatnonzero((rows["order"] == 1) & (rows["object"] > 0) & placed(rows, camera))
    if kept.size < 2:
        return found
    col, row = grid_places(rows[kept], camera, count)
    depth = rows["transparent_depth"][kept]
    # columns of their own: those of a table lie far apart
    columns = [np.array(rows[name]) for name in ("length_m", "range_rate_mps", "power_w")]
    owner = rows["object"].astype(np.intp) << 32 | rows["body"]
    image = np.full((int(row.max()) + 5, int(col.max()) + 5), -1, dtype=np.intp)
    for gate in np.unique(depth):
        here = depth == gate
        mine = kept[here]
        image.fill(-1)
        image[row[here] + 2, col[here] + 2] = mine
        for axis, (up, across) in enumerate(((0, 1), (1, 0))):
            line = [image[row[here] + 2 + k * up, col[here] + 2 + k * across] for k in range(-2, 3)]
            steps = _limited(columns, owner, mine, line)
            found.length_m[mine, axis], found.range_rate_mps[mine, axis] = steps[:2]
            own = columns[2][mine, None]
            relative = np.divide(steps[2], own, out=np.zeros_like(steps[2]), where=own > 0)
            found.power[mine, axis] = np.clip(relative, -_LARGEST_STEP, _LARGEST_STEP)
    return found


def _limited(columns: list[Real], owner: Places, mine: Places, line: list[Places]) -> list[Real]:
    """Steps of each column before and after these rows (n, 2), from five rays in a line (-1: there
    is none); the first column rules what counts."""
    there = [(place >= 0) & (owner[place] == owner[mine]) for place in line]
    # steps from each ray of the line to the next; 0 where one of them is not of the object
    known = np.stack([a & b for a, b in itertools.pairwise(there)])
    length, *others = (
        np.where(known, np.diff([column[place] for place in line], axis=0), 0.0)
        for column in columns
    )
    # At the end of a surface the step before goes on, or the one before that if it is smaller.
    first = np.where(known[1], 1, _smaller(length, 2, 3))
    last = np.where(known[2], 2, _smaller(length, 1, 0))
    pick = np.arange(mine.size)
    before, after = length[first, pick], length[last, pick]
    small, large = np.minimum(abs(before), abs(after)), np.maximum(abs(before), abs(after))
    rough = large > _STEEPER * small
    smaller = np.where(abs(before) <= abs(after), first, last)
    first, last = np.where(rough, smaller, first), np.where(rough, smaller, last)
    monotonic = (before * after > 0)[:, None]
    return [
        np.where(monotonic, np.stack([step[first, pick], step[last, pick]], axis=-1), 0.0)
        for step in (length, *others)
    ]


def _smaller(steps: Real, one: int, other: int) -> Places:
    """Which of two steps is smaller."""
    return np.where(abs(steps[one]) <= abs(steps[other]), one, other)


def spread(rows: PathRows, steps: Steps, cell_m: float, cell_mps: float) -> Iterator[Points]:
    """Points that stand for the rows, no further apart than cells, a part at a time.

    Parameters
    ----------
    rows
        Of one tile at one shift.
    steps
        Of these rows, from `steps_of`.
    cell_m
        Distance of the points in total length [m].
    cell_mps
        In range rate [m/s].
    """
    extent = np.maximum(
        abs(steps.length_m).max(axis=2) / cell_m, abs(steps.range_rate_mps).max(axis=2) / cell_mps
    )
    most = max(_POINTS_A_ROW * len(extent), _LEAST_POINTS)
    along = _counts(extent)
    # Many rows that reach far overlap one another: coarser points do for them.
    while (total := int(along.prod(axis=1).sum())) > most:
        extent = extent * min(0.7, most / total)
        along = _counts(extent)
    points = along.prod(axis=1)
    ends = np.cumsum(points)
    start = 0
    while start < points.size:
        last = int(np.searchsorted(ends, ends[start] - points[start] + _CHUNK, side="right"))
        stop = max(last, start + 1)
        here = slice(start, stop)
        yield _points(rows[here], steps.part(here), along[here], start)
        start = stop


def _counts(extent: Real) -> Places:
    return np.clip(np.ceil(extent), 1, _MOST_ALONG).astype(np.intp)


def _points(rows: PathRows, steps: Steps, along: Places, start: int) -> Points:
    """Points of rows whose first one is number `start` of all."""
    points = along.prod(axis=1)
    row = np.repeat(np.arange(points.size), points)
    number = np.arange(row.size) - np.repeat(np.cumsum(points) - points, points)
    length, rate = rows["length_m"][row], rows["range_rate_mps"][row]
    across, share = along[row, 0], np.ones(row.size)
    for axis, index in ((0, number % across), (1, number // across)):
        place = (index + 0.5) / along[row, axis] - 0.5
        side = (place > 0).astype(np.intp)
        length = length + place * steps.length_m[row, axis, side]
        rate = rate + place * steps.range_rate_mps[row, axis, side]
        share += place * steps.power[row, axis, side]
    share /= np.bincount(row, share)[row]
    return Points(start + row, length, rate, share)


def views_by_shift(table: PathRows, shifts: int) -> Iterator[Iterator[PathRows]]:
    """For each shift of the grid the rows with a length of each tile, one after the other."""
    tile, shift = np.asarray(table["tile"]), np.asarray(table["shift"])
    cuts = np.flatnonzero((np.diff(tile) != 0) | (np.diff(shift) != 0)) + 1
    starts = np.concatenate([[0], cuts])[: table.size]
    stops = np.concatenate([cuts, [table.size]])[: starts.size]
    for number in range(shifts):
        mine = np.flatnonzero(shift[starts] == number)
        yield (_rows_with_length(table[starts[i] : stops[i]]) for i in mine)


def _rows_with_length(view: PathRows) -> PathRows:
    rows = np.array(view)
    return rows[usable(rows)]
