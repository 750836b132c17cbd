# SPDX-License-Identifier: GPL-3.0-or-later
"""What ranges and range rates a pixel's surface covers, told from its neighbours.

A path stands for all that its pixel sees. Where a surface is seen at grazing incidence, that is a
stretch of many range cells, and a profile of single paths has an echo in one of them and nothing
in the others. Between the rays of one object the surface is taken to be straight: from its own ray
a pixel reaches half-way to its neighbours, and its power, which it keeps, is spread over that as
theirs tell. For expected powers alone: echoes with phase need points.

Nothing is spread at orders above 1 (which chance rules), where the ranges to both sides say
opposite things (the nearest point of a sphere, an edge that juts out), and beyond the last ray of
an object where it comes nearer (a strong one would lend power to ranges before it); where it
recedes (a limb, a horizon) it continues for half a pixel. Where the steps to both sides differ too
much (a step in the surface), the smaller one counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Real
from ...contract import ReceiverRecord
from .pixel_spacing import grid_places, placed
from .table import PathRows
from .table_files import usable

#: Neighbours on both sides are of one smooth surface where their steps differ by less than this.
_STEEPER = 4.0
#: Largest step of power that is followed, as a fraction of it: half of it along two axes is less
#: than all there is.
_LARGEST_STEP = 0.9
#: Points that rows are spread over: so many times the rows of a view, or so many at least.
_POINTS_A_ROW, _LEAST_POINTS = 16, 1 << 17
#: Most points along one side of a pixel.
_MOST_ALONG = 4096
#: Points that are made at a time.
_CHUNK = 1 << 20


@dataclass(frozen=True)
class Steps:
    """Changes from ray to ray of n rows.

    Attributes
    ----------
    length_m, range_rate_mps, power
        Of length, range rate, and power over the ray's own, (n, 2, 2) [m, m/s, 1]: by axis (across,
        up) and side (before, after), counted along the axis; 0 where unknown.
    """

    length_m: Real
    range_rate_mps: Real
    power: Real

    def part(self, rows: slice) -> Steps:
        """Return the steps of some rows."""
        return Steps(self.length_m[rows], self.range_rate_mps[rows], self.power[rows])

    def scaled(self, factor: float) -> Steps:
        """Return the steps of pixels whose side is `factor` times as long."""
        return Steps(self.length_m * factor, self.range_rate_mps * factor, self.power * factor)


@dataclass(frozen=True)
class Points:
    """Points that the rows of a tile replicate are spread over.

    Attributes
    ----------
    row
        Row that each point belongs to, (points,).
    length_m, range_rate_mps
        Total length [m] and range rate [m/s], (points,).
    share
        Fraction of the row's power, (points,).
    """

    row: Indices
    length_m: Real
    range_rate_mps: Real
    share: Real


def steps_of(rows: PathRows, receiver: ReceiverRecord, count: int) -> Steps:
    """Compute the differences between neighbouring rays of a tile replicate.

    Parameters
    ----------
    rows
        Of one tile at one replicate, with lengths, (n,).
    receiver
        Of the frame.
    count
        Number of replicates of the tile.

    Returns
    -------
    Steps
    """
    found = Steps(*np.zeros((3, rows.size, 2, 2)))
    kept = np.flatnonzero((rows["order"] == 1) & (rows["last_object"] > 0) & placed(rows, receiver))
    if kept.size < 2:
        return found
    mine = rows if kept.size == rows.size else rows[kept]
    col, row = grid_places(mine, receiver, count)
    owner = mine["last_object"].astype(np.int64) << 32 | mine["last_body"]
    depth, power = mine["transparent_depth"], mine["power_w"]
    moving = bool(np.any(mine["range_rate_mps"]))
    names = ("length_m", "power_w", "range_rate_mps")[: 3 if moving else 2]
    for path_class in np.unique(depth):
        here = depth == path_class
        # two empty pixels all around: nothing wraps, and every ray has two on each side
        place = tuple(at[here] - at[here].min() + 2 for at in (row, col))
        shape = tuple(int(at.max()) + 3 for at in place)
        owners = np.zeros(shape, dtype=np.int64)
        owners[place] = owner[here]
        images = np.zeros((len(names), *shape))
        for image, name in zip(images, names, strict=True):
            image[place] = mine[name][here]
        into, own = kept[here], power[here, None]
        for axis in (0, 1):
            # columns are the second index of an image, and the first axis of steps
            sides = _sides(images, owners, 1 - axis)
            steps = [np.stack([one[place] for one in side], axis=-1) for side in sides]
            found.length_m[into, axis] = steps[0]
            relative = np.divide(steps[1], own, out=np.zeros_like(steps[1]), where=own > 0)
            found.power[into, axis] = np.clip(relative, -_LARGEST_STEP, _LARGEST_STEP)
            if moving:
                found.range_rate_mps[into, axis] = steps[2]
    return found


def _sides(images: Real, owners: NDArray[np.int64], axis: int) -> list[tuple[Real, Real]]:
    """Step before and after each pixel of each image along an axis.

    The first image rules what counts. Pixels of no owner hold nothing.
    """
    same = (owners == np.roll(owners, 1, axis)) & (owners > 0)
    # the step that ends at each pixel; 0 where it begins on something else
    steps = [np.where(same, image - np.roll(image, 1, axis), 0.0) for image in images]

    def at(step: NDArray[Any], offset: int) -> NDArray[Any]:
        return np.roll(step, -offset, axis)

    # steps to each pixel and from it on, and the next ones to both sides
    to, on = same, at(same, 1)
    size = abs(steps[0])
    # At the end of a surface the step before counts, or the one before that if it is smaller.
    nearer_on, nearer_to = at(size, 1) <= at(size, 2), size <= at(size, -1)

    def pair(step: Real) -> tuple[Real, Real]:
        after = at(step, 1)
        first = np.where(to, step, np.where(nearer_on, after, at(step, 2)))
        last = np.where(on, after, np.where(nearer_to, step, at(step, -1)))
        return first, last

    before, after = pair(steps[0])
    smaller = abs(before) <= abs(after)
    rough = np.maximum(abs(before), abs(after)) > _STEEPER * np.minimum(abs(before), abs(after))
    take_first, take_last = rough & ~smaller, rough & smaller
    monotonic = before * after > 0
    goes_before, goes_after = to | (before < 0), on | (after > 0)
    found = []
    for step in steps:
        first, last = pair(step)
        before = np.where(monotonic, np.where(take_first, last, first), 0.0)
        after = np.where(monotonic, np.where(take_last, first, last), 0.0)
        # How far a surface extends beyond the last ray is unknown. Where it comes nearer, that half
        # stays at the ray; where it recedes (a limb, a horizon), the step before continues.
        found.append((np.where(goes_before, before, 0.0), np.where(goes_after, after, 0.0)))
    return found


def spread(rows: PathRows, steps: Steps, cell_m: float, cell_mps: float) -> Iterator[Points]:
    """Yield points that stand for the rows, no further apart than cells, a part at a time.

    Parameters
    ----------
    rows
        Of one tile at one replicate, (n,).
    steps
        Of these rows, from `steps_of`.
    cell_m
        Largest distance of the points in total length [m].
    cell_mps
        Largest distance in range rate [m/s].

    Yields
    ------
    Points
        Those of some rows; the fractions of a row add up to 1.
    """
    extent = np.maximum(
        abs(steps.length_m).max(axis=2) / cell_m, abs(steps.range_rate_mps).max(axis=2) / cell_mps
    )
    most = max(_POINTS_A_ROW * len(extent), _LEAST_POINTS)
    along = np.clip(np.ceil(extent), 1, _MOST_ALONG).astype(np.intp)
    # Many rows that reach far overlap one another: coarser points do for those that reach farthest.
    while int(along.prod(axis=1).sum()) > most:
        along = np.minimum(along, max(int(0.8 * along.max()), 1))
    points = along.prod(axis=1)
    ends = np.cumsum(points)
    start = 0
    while start < points.size:
        last = int(np.searchsorted(ends, ends[start] - points[start] + _CHUNK, side="right"))
        stop = max(last, start + 1)
        here = slice(start, stop)
        yield _points(rows[here], steps.part(here), along[here], start)
        start = stop


def _points(rows: PathRows, steps: Steps, along: Indices, start: int) -> Points:
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


def tiles_by_replicate(table: PathRows, replicates: int) -> Iterator[Iterator[PathRows]]:
    """Yield, for each replicate, an iterator over the rows of each tile that have a length.

    Parameters
    ----------
    table
        Rows of a frame, tile by tile and in each of them replicate by replicate.
    replicates
        Number of replicates.

    Yields
    ------
    iterator of ndarray
    """
    tile, replicate = np.asarray(table["tile"]), np.asarray(table["replicate"])
    cuts = np.flatnonzero((np.diff(tile) != 0) | (np.diff(replicate) != 0)) + 1
    starts = np.concatenate([[0], cuts])[: table.size]
    stops = np.concatenate([cuts, [table.size]])[: starts.size]
    for number in range(replicates):
        mine = np.flatnonzero(replicate[starts] == number)
        yield (_rows_with_length(table[starts[i] : stops[i]]) for i in mine)


def _rows_with_length(view: PathRows) -> PathRows:
    rows = np.asarray(view)
    kept = usable(rows)
    return rows if kept.all() else rows[kept]
