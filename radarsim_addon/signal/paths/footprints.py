# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pixel's surface covers of range, range rate and place, told from its neighbours.

A path stands for all that its pixel sees. Where a surface is seen at grazing incidence, that is a
stretch of many range cells, and single paths have an echo in one of them and nothing in the others.
Between the rays of one object lengths follow a parabola: from its own ray a pixel
reaches half-way to its neighbours, and its power, which it keeps, is spread over that as theirs
tell. Expected powers and the echoes of rough surfaces are formed of the same points
(:mod:`.paths.table_footprints`); where pixels add up in phase, single paths stay as they are.

Nothing is spread at orders above 1 (which chance rules), where the ranges to both sides say
opposite things (the nearest point of a sphere, an edge that juts out), and beyond the last ray of
an object where it comes nearer (a strong one would lend power to ranges before it); where it
recedes (a limb, a horizon) it continues for half a pixel. Where the steps to both sides differ too
much (a step in the surface), the smaller one counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Integers, Real
from ...contract import ReceiverRecord
from .pixel_points import PixelPoints, along_steps, shares
from .pixel_spacing import Places, grid_places, placed, view_limits
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
#: Points that are made at a time: they stay in the processor's cache.
_CHUNK = 1 << 15


@dataclass(frozen=True)
class Steps:
    """Changes from ray to ray of n rows.

    Attributes
    ----------
    length_m, range_rate_mps, power
        Of length, range rate, and power over the ray's own, (n, 2, 2) [m, m/s, 1]: by axis (across,
        up) and side (before, after), counted along the axis; 0 where unknown.
    between
        Rows that each step leads from and to, (n, 2, 2, 2), one row twice where it is unknown;
        empty: not told.
    """

    length_m: Real
    range_rate_mps: Real
    power: Real
    between: Indices = field(default_factory=lambda: np.zeros((0, 2, 2, 2), dtype=np.intp))

    def part(self, rows: slice | Indices) -> Steps:
        """Return the steps of some rows."""
        if isinstance(rows, slice):
            return Steps(self.length_m[rows], self.range_rate_mps[rows], self.power[rows])
        columns = self.length_m, self.range_rate_mps, self.power
        length_m, rate_mps, power = (column.take(rows, axis=0) for column in columns)
        return Steps(length_m, rate_mps, power)

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


def steps_of(
    rows: PathRows, receiver: ReceiverRecord, count: int, grid: Places = grid_places
) -> Steps:
    """Compute the differences between neighbouring rays of a tile replicate.

    Parameters
    ----------
    rows
        Of one tile at one replicate, with lengths, (n,); with `joined_places` of several of them.
    receiver
        Of the frame.
    count
        Number of replicates of the tile.
    grid
        Finds the pixels of rows.

    Returns
    -------
    Steps
    """
    own = np.arange(rows.size)
    between = np.broadcast_to(own[:, None, None, None], (rows.size, 2, 2, 2)).copy()
    # columns of their own: in a table they lie far apart
    length_m, rate_mps, power_w = (
        np.ascontiguousarray(rows[name]) for name in ("length_m", "range_rate_mps", "power_w")
    )
    kept = np.flatnonzero((rows["order"] == 1) & (rows["last_object"] > 0) & placed(rows, receiver))
    if kept.size > 1:
        mine = rows if kept.size == rows.size else rows[kept]
        places = grid(mine, receiver, count)
        owner = mine["last_object"].astype(np.int64) << 32 | mine["last_body"]
        depth = mine["transparent_depth"]
        for path_class in np.unique(depth):
            here = np.flatnonzero(depth == path_class)
            # columns are the second index of an image, and the first axis of steps
            for axis, chain in enumerate(_chains(places[0][here], places[1][here], owner[here])):
                rays = kept[here][chain]
                between[kept[here], axis] = _counting(length_m[rays], rays)
    return Steps(
        _differences(length_m, between),
        _differences(rate_mps, between) if rate_mps.any() else np.zeros((rows.size, 2, 2)),
        power_steps(power_w, between, power_w),
        between,
    )


def power_steps(power_w: Real, between: Indices, own_w: Real) -> Real:
    """Return the steps of power over the rays' own, (n, 2, 2), as `Steps` has them."""
    own_w = own_w[:, None, None]
    steps = _differences(power_w, between)
    with np.errstate(over="ignore"):  # next to a power of 1e-215 W, say: clipped below
        relative = np.divide(steps, own_w, out=np.zeros_like(steps), where=own_w > 0)
    return np.clip(relative, -_LARGEST_STEP, _LARGEST_STEP)


def _differences(values: Real, between: Indices) -> Real:
    """Steps of values; none to or from what is not finite, which is refused where it is used."""
    with np.errstate(invalid="ignore"):
        steps = values.take(between[..., 1]) - values.take(between[..., 0])
    known = np.isfinite(steps)
    return steps if known.all() else np.where(known, steps, 0.0)


def _chains(col: Integers, row: Integers, owner: NDArray[np.int64]) -> Iterator[Indices]:
    """Five rays in a line across, and up: two before each, itself, two after it, (5, n).

    Where another owner begins, the last ray of the own one stands for all that follow.
    """
    # two empty pixels all around: nothing wraps, and every ray has two on each side
    width = int(np.ptp(col)) + 5
    pixel = (row - row.min() + 2) * width + col - col.min() + 2
    number = np.full((int(np.ptp(row)) + 5) * width, col.size)
    own = np.arange(col.size)
    number[pixel] = own
    owners = np.append(owner, -1)
    for stride in (1, width):
        chain = np.tile(own, (5, 1))
        for way in (-1, 1):
            going = np.ones(col.size, dtype=bool)
            for reach in (1, 2):
                there = number[pixel + way * reach * stride]
                going &= owners[there] == owner
                chain[2 + way * reach] = np.where(going, there, chain[2 + way * (reach - 1)])
        yield chain


def _counting(length_m: Real, rays: Indices) -> Indices:
    """Rays that the step to each side leads from and to, (n, 2, 2), the ray twice for none, of
    chains of five rays and their lengths, (5, n).
    """
    step = np.diff(length_m, axis=0)
    size = abs(step)
    to, on = rays[1] != rays[2], rays[3] != rays[2]
    # At the end of a surface the step before counts, or the one before that if it is smaller.
    first = np.where(to, 1, np.where(size[2] <= size[3], 2, 3))
    last = np.where(on, 2, np.where(size[1] <= size[0], 1, 0))
    # places in arrays of one axis: numpy takes from these much faster
    count = rays.shape[1]
    ray = np.arange(count)
    first, last = first * count + ray, last * count + ray
    before, after = step.take(first), step.take(last)
    near, far = abs(before), abs(after)
    smaller = near <= far
    rough = np.maximum(near, far) > _STEEPER * np.minimum(near, far)
    # How far a surface extends beyond the last ray is unknown. Where it comes nearer, that half
    # stays at the ray; where it recedes (a limb, a horizon), the step before continues.
    monotonic = before * after > 0
    goes = monotonic & (to | (before < 0)), monotonic & (on | (after > 0))
    chosen = np.where(rough & ~smaller, last, first), np.where(rough & smaller, first, last)
    found = np.empty((count, 2, 2), dtype=np.intp)
    for side in (0, 1):
        for end in (0, 1):
            there = rays.take(chosen[side] + end * count)
            found[:, side, end] = np.where(goes[side], there, rays[2])
    return found


def points_along(
    steps: Steps, cell_m: float, cell_mps: float, most_a_row: int = _POINTS_A_ROW, views: int = 1
) -> Indices:
    """Return how many points stand for each row across and up, (n, 2), see `spread`; there are at
    most so many times the rows, or a number for each view that costs nothing.
    """
    # by columns: reductions over two are slow
    length_m, rate_mps = abs(steps.length_m), abs(steps.range_rate_mps)
    extent = np.maximum(length_m[..., 0], length_m[..., 1]) / cell_m
    if rate_mps.any():
        extent = np.maximum(extent, np.maximum(rate_mps[..., 0], rate_mps[..., 1]) / cell_mps)
    most = max(most_a_row * len(extent), _LEAST_POINTS * views)
    along = np.clip(np.ceil(extent), 1, _MOST_ALONG).astype(np.intp)
    # Many rows that reach far overlap one another: coarser points do for those that reach farthest.
    while int(along[:, 0] @ along[:, 1]) > most:
        along = np.minimum(along, max(int(0.8 * along.max()), 1))
    return along


def spread(
    rows: PathRows,
    steps: Steps,
    cell_m: float,
    cell_mps: float,
    border_m: float = 0.0,
    views: int = 1,
) -> Iterator[Points]:
    """Yield points that stand for the rows, no further apart than cells, a part at a time.

    Parameters
    ----------
    rows
        Of one tile at one replicate, or of several such views, (n,).
    steps
        Of these rows, from `steps_of`.
    cell_m
        Largest distance of the points in total length [m].
    cell_mps
        Largest distance in range rate [m/s].
    border_m
        Total length at which a cell ends. A point that reaches over such a place, or others whole
        cells away from it, is cut in two there.
    views
        Number of tile replicates that the rows are of.

    Yields
    ------
    Points
        Those of some rows; the fractions of a row add up to 1.
    """
    along = points_along(steps, cell_m, cell_mps, views=views)
    points, covered_m = along[:, 0] * along[:, 1], widths_m(steps, along)
    lengths, rates = np.array(rows["length_m"]), np.array(rows["range_rate_mps"])
    whole, several = np.flatnonzero(points == 1), np.flatnonzero(points > 1)
    if whole.size:
        found = Points(whole, lengths.take(whole), rates.take(whole), np.ones(whole.size))
        yield _cut_at_borders(found, covered_m.take(whole), cell_m, border_m)
    ends = np.cumsum(points[several])
    start = 0
    while start < several.size:
        begin = ends[start - 1] if start else 0
        stop = max(int(np.searchsorted(ends, begin + _CHUNK, side="right")), start + 1)
        here = several[start:stop]
        points_of, own = PixelPoints.of(along.take(here, axis=0)), steps.part(here)
        row = here.take(points_of.row)
        length_m, rate_mps = lengths.take(row), rates.take(row)
        length_m += along_steps(own.length_m, points_of)
        rate_mps += along_steps(own.range_rate_mps, points_of)
        found = Points(row, length_m, rate_mps, shares(own.power, points_of))
        yield _cut_at_borders(found, covered_m.take(row), cell_m, border_m)
        start = stop


def widths_m(steps: Steps, along: Indices) -> Real:
    """Return the total length that each of so many points covers along the wider axis, (n,) [m]."""
    size_m = abs(steps.length_m)
    covered_m = (size_m[..., 0] + size_m[..., 1]) / 2 / along
    return np.maximum(covered_m[:, 0], covered_m[:, 1])


def _cut_at_borders(points: Points, width_m: Real, cell_m: float, border_m: float) -> Points:
    """The points, those cut in two that reach over a border; each is even over its width."""
    low_m = points.length_m - width_m / 2
    over_m = low_m + width_m
    low_m -= border_m
    low_m /= cell_m
    before_m = np.ceil(low_m, out=low_m)
    before_m *= cell_m
    before_m += border_m
    over_m -= before_m
    cut = np.flatnonzero((over_m > 0) & (over_m < width_m))
    over_m, width_m = over_m.take(cut), width_m.take(cut)
    part = over_m / width_m
    count = points.row.size
    row = np.concatenate([points.row, points.row.take(cut)])
    length_m, rate_mps, share = (
        np.concatenate([column, column.take(cut)])
        for column in (points.length_m, points.range_rate_mps, points.share)
    )
    # the lower part ends where the upper one begins
    length_m[cut] -= over_m / 2
    length_m[count:] += (width_m - over_m) / 2
    share[cut] *= 1 - part
    share[count:] *= part
    return Points(row, length_m, rate_mps, share)


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
    for views in views_by_replicate(table, replicates):
        yield (rows for _, rows in views)


def views_by_replicate(
    table: PathRows, replicates: int
) -> Iterator[Iterator[tuple[Indices, PathRows]]]:
    """Yield, for each replicate, an iterator as `tiles_by_replicate`, with numbers of the rows.

    Parameters
    ----------
    table
        Rows of a frame, tile by tile and in each of them replicate by replicate.
    replicates
        Number of replicates.

    Yields
    ------
    iterator of (ndarray, ndarray)
        Numbers of the rows in the table, and the rows, (n,) each.
    """
    starts, stops = view_limits(table)
    replicate = np.asarray(table["replicate"])[starts]
    for number in range(replicates):
        mine = np.flatnonzero(replicate == number)
        yield (_rows_with_length(table, starts[i], stops[i]) for i in mine)


def _rows_with_length(table: PathRows, start: int, stop: int) -> tuple[Indices, PathRows]:
    rows = np.asarray(table[start:stop])
    kept = np.flatnonzero(usable(rows))
    return start + kept, rows if kept.size == rows.size else rows[kept]
