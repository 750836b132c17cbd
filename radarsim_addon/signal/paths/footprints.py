# SPDX-License-Identifier: GPL-3.0-or-later
"""Range, range rate and place over the surface of a pixel, from its neighbours.

A path stands for the whole surface in its pixel. A surface at grazing incidence extends over many
range bins in one pixel. A single path would put its whole echo into one bin and leave the others
empty. Between the rays of one object, lengths follow a parabola, and a pixel reaches half-way to
the neighbouring rays. The power of a pixel is spread over this interval in proportion to the
neighbours' powers; its sum stays the same. Expected powers and the echoes of rough surfaces use the
same points (`table_footprints`). Where pixels add up in phase, single paths are used.

A path is not spread in these cases:

- orders above 1, whose paths are random
- ranges to both sides that contradict each other: the nearest point of a sphere, a protruding edge
- beyond the last ray of an object that comes nearer: a strong ray would add power at shorter ranges

Beyond the last ray of an object that recedes (a limb, a horizon), it is spread over half a pixel.
Where the steps to both sides differ too much (a step in the surface), the smaller one is used.

`grid_places` finds column and row of each ray's pixel from the directions. `steps_of` computes the
differences from the neighbouring rays. `spread` makes the points, a grid of lines across and up in
each pixel. Values change along both axes independently, so changes are computed for each line, and
there are fewer lines than points.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Integers, Real, are_finite, largest
from ...contract import ReceiverRecord
from .table import PathRows
from .table_files import usable

#: Angles between rays of a sphere that are rounding, as a fraction of a pixel's side, and those of
#: tables in which directions and pose are of two float32 matrices [rad].
_SAME, _SAME_RAD = 1e-3, 3e-7
#: Most pixels of an image. Tiles are smaller; a table from elsewhere may have larger ones.
_MOST_PX = 1 << 25
#: Paths whose places are kept: 16 bytes each.
_MOST_KEPT = 1 << 20
#: Least distance of paths that are neither neighbours nor have one in common [pixels].
_GAP = 3


def placed(rows: PathRows, receiver: ReceiverRecord) -> NDArray[np.bool_]:
    """Return which rows have a known pixel, (n,).

    For parallel rays it follows from the end of the ray, for others from the direction.
    """
    if receiver.kind == "orthographic":
        return are_finite(rows["first_scatterer_m"])
    if receiver.kind == "perspective":
        backwards = np.array(receiver.matrix_world, dtype=np.float64)[:3, 2]
        return np.asarray(rows["direction"] @ backwards < 0)
    return np.asarray(largest(rows["direction"]) != 0)


def grid_places(rows: PathRows, receiver: ReceiverRecord, count: int) -> tuple[Integers, Integers]:
    """Return column and row of each path's pixel, counted from the first used pixel, (n,).

    The rows are of one tile at one of `count` replicates. There is at least one row, and all rows
    are `placed`.
    """
    pose = np.array(receiver.matrix_world, dtype=np.float64)
    # Not by BLAS: its threads wait for one another longer than three columns take.
    local = np.einsum("ni,ij->nj", np.array(rows["direction"]), pose[:3, :3])
    area = count * rows["solid_angle_sr"]
    if receiver.kind == "equirectangular":
        level = np.hypot(local[:, 0], local[:, 2])
        u, v = (
            _from_widest_gap(np.arctan2(local[:, 0], -local[:, 2])),
            np.arctan2(local[:, 1], level),
        )
        step_u, step_v = _sphere_steps(u, v, np.maximum(level, 1e-12), area)
    elif receiver.kind == "perspective":
        u, v = local[:, 0] / -local[:, 2], local[:, 1] / -local[:, 2]
        few = slice(None, None, -(-u.size // (1 << 12)))  # the pitch is the same for all
        step_u = step_v = math.sqrt(
            float(np.median(area[few] * (1 + u[few] ** 2 + v[few] ** 2) ** 1.5))
        )
    else:
        flat = (rows["first_scatterer_m"] - pose[:3, 3]) @ pose[:3, :3]
        u, v = flat[:, 0], flat[:, 1]
        step_u = step_v = math.sqrt(float(np.median(area)))
    col, row = (np.rint((x - x.min()) / s).astype(np.int64) for x, s in ((u, step_u), (v, step_v)))
    return _bounded(col, row)


def joined_places(
    rows: PathRows, receiver: ReceiverRecord, count: int
) -> tuple[Integers, Integers]:
    """Return `grid_places` for the rows of several views.

    The grids of the views lie next to each other, with a gap between them, so that paths of
    different views are not neighbours.
    """
    limits = zip(*view_limits(rows), strict=True)
    return _side_by_side([grid_places(rows[a:b], receiver, count) for a, b in limits])


def _side_by_side(each: list[tuple[Integers, Integers]]) -> tuple[Integers, Integers]:
    if len(each) == 1:
        return each[0]
    starts = np.cumsum([0] + [int(col.max()) + _GAP for col, _ in each])
    col = np.concatenate([own + start for (own, _), start in zip(each, starts, strict=False)])
    return _bounded(col, np.concatenate([row for _, row in each]))


#: Column and row of the pixels of rows, as `grid_places` finds them.
Places = Callable[[PathRows, ReceiverRecord, int], tuple[Integers, Integers]]


class GridPlaces:
    """Places of a table's views in their grids, computed once for two users."""

    def __init__(self) -> None:
        self._kept: dict[int, tuple[Integers, Integers]] = {}

    def of_views(self, number: Indices) -> Places:
        """Return a `Places` for rows of one or several views, with these numbers in the table,
        (n,).

        It keeps the places of all rows of a view until they are used a second time.
        """

        def places(
            rows: PathRows, receiver: ReceiverRecord, count: int
        ) -> tuple[Integers, Integers]:
            if rows.size < number.size:  # not the whole views
                return joined_places(rows, receiver, count)
            limits = zip(*view_limits(rows), strict=True)
            return _side_by_side(
                [self._of_view(int(number[a]), rows[a:b], receiver, count) for a, b in limits]
            )

        return places

    def _of_view(
        self, first: int, rows: PathRows, receiver: ReceiverRecord, count: int
    ) -> tuple[Integers, Integers]:
        """Return the places of all rows of a view, by the number of the first one."""
        found = self._kept.pop(first, None)
        if found is None:
            found = grid_places(rows, receiver, count)
            if sum(col.size for col, _ in self._kept.values()) <= _MOST_KEPT:
                self._kept[first] = found
        return found


def _from_widest_gap(angle: Real) -> Real:
    """Return angles from 0 to 2 pi, counted from the end of the widest empty part of the circle."""
    ordered = np.sort(angle)
    gaps = np.diff(ordered, append=ordered[0] + 2 * math.pi)
    widest = int(np.argmax(gaps))
    return np.asarray((angle - ordered[widest] - gaps[widest] / 2) % (2 * math.pi))


def _sphere_steps(u: Real, v: Real, level: Real, area: Real) -> tuple[float, float]:
    """Return the steps of longitude and latitude of a grid; infinite along an axis with a single
    place.

    Latitudes differ by their steps. Near a pole, longitudes do not, because rounding is multiplied
    by the inverse distance from the axis. There, the solid angle of a pixel, 2 sin(dlat/2) cos(lat)
    dlon, gives the step.
    """
    side = math.sqrt(float(np.median(area)))
    same = max(_SAME * side, min(_SAME_RAD, 0.1 * side))
    step_v = _least_step(v, same)
    if math.isinf(step_v):  # one row: all of its pixels are equally far from the axis
        return _least_step(u, same / float(np.median(level))), step_v
    return float(np.median(area / level)) / (2 * math.sin(step_v / 2)), step_v


def _least_step(places: Real, same: float) -> float:
    steps = np.diff(np.sort(places))
    steps = steps[steps > same]
    return float(steps.min()) if steps.size else math.inf


def _bounded(col: Integers, row: Integers) -> tuple[Integers, Integers]:
    """Return places with the same neighbours in an image of limited size.

    If the image would be too large, empty columns and rows between paths are removed. If that is
    not enough, no path has a neighbour.
    """
    if _pixels(col, row) > _MOST_PX:
        col, row = _without_gaps(col), _without_gaps(row)
    if _pixels(col, row) > _MOST_PX:
        col, row = _GAP * np.arange(col.size), np.zeros_like(row)
    return col, row


def _pixels(col: Integers, row: Integers) -> float:
    return (float(col.max()) + 1) * (float(row.max()) + 1)


def _without_gaps(places: Integers) -> Integers:
    """Return numbers without gaps: neighbours stay adjacent, others stay apart."""
    found, number = np.unique(places, return_inverse=True)
    return np.asarray(np.cumsum(np.minimum(np.diff(found, prepend=found[0]), _GAP))[number])


#: Largest step of power that is used, as a fraction of the power: half of it along two axes is
#: less than the whole power.
_LARGEST_STEP = 0.9
#: Points that rows are spread over: so many times the rows of a view, or so many at least.
_POINTS_A_ROW, _LEAST_POINTS = 16, 1 << 17
#: Points that are made, and rays whose neighbours are looked at, at a time: they stay in the
#: processor's cache.
_CHUNK, _RAYS_AT_ONCE = 1 << 15, 1 << 13


@dataclass(frozen=True)
class Steps:
    """Changes from ray to ray of n rows, (n, 2, 2); 0 where unknown.

    They are by axis (across, up) and by side (before, after), and counted along the axis.
    """

    length_m: Real
    range_rate_mps: Real
    #: Relative to the power of the ray.
    power: Real
    #: Rows that each step leads from and to, (n, 2, 2, 2), one row twice where it is unknown;
    #: empty: not given.
    between: Indices = field(default_factory=lambda: np.zeros((0, 2, 2, 2), dtype=np.intp))

    def part(self, rows: slice | Indices) -> Steps:
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
    """Points over which the rows of a tile replicate are spread."""

    #: Row that each point belongs to, (points,).
    row: Indices
    #: Total length [m] and range rate [m/s], (points,).
    length_m: Real
    range_rate_mps: Real
    #: Fraction of the row's power, (points,).
    share: Real


def steps_of(
    rows: PathRows, receiver: ReceiverRecord, count: int, grid: Places = grid_places
) -> Steps:
    """Compute the differences between neighbouring rays of a tile at one of `count` replicates.

    With `joined_places` the rows may be of several tiles.
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
            number = kept[here]
            for axis, chain in _chains(places[0][here], places[1][here], owner[here]):
                rays = number[chain]
                between[rays[2], axis] = _counting(length_m[rays], rays)
    return Steps(
        _differences(length_m, between),
        _differences(rate_mps, between) if rate_mps.any() else np.zeros((rows.size, 2, 2)),
        power_steps(power_w, between, power_w),
        between,
    )


def power_steps(power_w: Real, between: Indices, own_w: Real) -> Real:
    """Return the steps of power as fractions of the power of each ray, (n, 2, 2), as in `Steps`."""
    own_w = own_w[:, None, None]
    steps = _differences(power_w, between)
    with np.errstate(over="ignore"):  # next to a power of 1e-215 W, say: clipped below
        relative = np.divide(steps, own_w, out=np.zeros_like(steps), where=own_w > 0)
    return np.clip(relative, -_LARGEST_STEP, _LARGEST_STEP)


def _differences(values: Real, between: Indices) -> Real:
    """Return the steps of values; 0 next to a value that is not finite (refused later)."""
    with np.errstate(invalid="ignore"):
        steps = values.take(between[..., 1]) - values.take(between[..., 0])
    known = np.isfinite(steps)
    return steps if known.all() else np.where(known, steps, 0.0)


def _chains(
    col: Integers, row: Integers, owner: NDArray[np.int64]
) -> Iterator[tuple[int, Indices]]:
    """Yield five rays in a line, across (0) and up (1), (5, m), for some rays at a time.

    They are the two rays before each ray, the ray, and the two rays after it. Where another owner
    begins, the last ray of the own one replaces all rays that follow.
    """
    # two empty pixels all around: nothing wraps, and every ray has two on each side
    width = int(np.ptp(col)) + 5
    pixel = (row - row.min() + 2) * width + col - col.min() + 2
    number = np.full((int(np.ptp(row)) + 5) * width, col.size)
    number[pixel] = np.arange(col.size)
    owners = np.append(owner, -1)
    for start in range(0, col.size, _RAYS_AT_ONCE):
        own = np.arange(start, min(start + _RAYS_AT_ONCE, col.size))
        at, mine = pixel.take(own), owner.take(own)
        # columns are the second index of an image, and the first axis of steps
        for axis, stride in enumerate((1, width)):
            chain = np.tile(own, (5, 1))
            for way in (-1, 1):
                going = np.ones(own.size, dtype=bool)
                for reach in (1, 2):
                    there = number.take(at + way * reach * stride)
                    going &= owners.take(there) == mine
                    chain[2 + way * reach] = np.where(going, there, chain[2 + way * (reach - 1)])
            yield axis, chain


def _counting(length_m: Real, rays: Indices) -> Indices:
    """Return the rays from which and to which the step to each side leads, (n, 2, 2).

    The chains have five rays with their lengths, (5, n). Without a step, both rays are the same.
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
    # steps of one smooth surface differ by a smaller factor
    rough = np.maximum(near, far) > 4.0 * np.minimum(near, far)
    # The extent of a surface beyond the last ray is unknown. Where the surface comes nearer, that
    # half has the value of the ray; where it recedes (a limb, a horizon), the last step continues.
    monotonic = before * after > 0
    goes = monotonic & (to | (before < 0)), monotonic & (on | (after > 0))
    chosen = np.where(rough & ~smaller, last, first), np.where(rough & smaller, first, last)
    found = np.empty((count, 2, 2), dtype=np.intp)
    for side in (0, 1):
        for end in (0, 1):
            there = rays.take(chosen[side] + end * count)
            found[:, side, end] = np.where(goes[side], there, rays[2])
    return found


@dataclass(frozen=True)
class PixelLines:
    """Lines of points in pixels, each at one place along an axis."""

    #: Row of the pixel of each line, (lines,).
    row: Indices
    #: Place along the axis in the pixel, from -1/2 to 1/2, (lines,).
    place: Real
    #: The line on which each point lies, (points,).
    of_point: Indices


@dataclass(frozen=True)
class PixelPoints:
    """Points in the pixels of rows."""

    #: Row that each point belongs to, in rising order, (points,).
    row: Indices
    #: By place across, and by place up.
    lines: tuple[PixelLines, PixelLines]

    @classmethod
    def of(cls, along: Indices) -> PixelPoints:
        """Return the points of rows with these numbers across and up, (rows, 2).

        They are in order of lines from below, and of places from left to right.
        """
        across, up = along.T
        first, second = (_lines(count) for count in (across, up))
        width = across.take(second[0])
        # points of the lines before, and lines across of the rows before
        begins, lefts = np.cumsum(width) - width, np.cumsum(across) - across
        number = np.arange(int(width.sum()))
        number += np.repeat(lefts.take(second[0]) - begins, width)
        line = np.repeat(np.arange(width.size), width)
        lines = PixelLines(*first, number), PixelLines(*second, line)
        return cls(second[0].take(line), lines)


def _lines(count: Indices) -> tuple[Indices, Real]:
    """Return row and place of each line, (lines,), with these numbers of lines in pixels."""
    row = np.repeat(np.arange(count.size), count)
    number = np.arange(row.size) - (np.cumsum(count) - count).take(row)
    return row, (number + 0.5) / count.take(row) - 0.5


def along_steps(steps: Real, points: PixelPoints) -> Real:
    """Return the change of values, (points,), at points in the pixels of rows.

    `steps` are those of the rows, (n, 2, 2).
    """
    if not steps.any():
        return np.zeros(points.row.size)
    change: list[Real] = []
    for lines, (mean, half, bent) in zip(points.lines, courses(steps), strict=True):
        row, place = lines.row, lines.place
        of_line = place * mean.take(row)
        of_line += place**2 * half.take(row)
        if bent.any():
            of_line += abs(place) * bent.take(row)
        change.append(of_line.take(lines.of_point))
    return np.add(change[0], change[1], out=change[0])


def courses(steps: Real) -> Iterator[tuple[Real, Real, Real]]:
    """Yield the factors of x, x^2 and |x| in the change of values at x in a pixel, across and up,
    (n,) each.

    With steps on both sides, the change is the parabola through the three rays; it meets the
    neighbour's parabola half-way. With a step on one side, that half is a straight line, and the
    other half has the value of the ray.
    """
    for before, after in ((steps[:, axis, 0], steps[:, axis, 1]) for axis in (0, 1)):
        known = (before != 0) & (after != 0)
        half = (after - before) / 2
        yield (before + after) / 2, np.where(known, half, 0.0), np.where(known, 0.0, half)


def shares(power_steps: Real, points: PixelPoints) -> Real:
    """Return the fraction of its row's power that each point has, (points,). They add up to 1."""
    row, share = points.row, along_steps(power_steps, points)
    share += 1
    share /= np.bincount(row, share).take(row)
    return share


def points_along(
    steps: Steps, cell_m: float, cell_mps: float, most_a_row: int = _POINTS_A_ROW, views: int = 1
) -> Indices:
    """Return the number of points across and up for each row, (n, 2), see `spread`.

    In all there are at most `most_a_row` points per row, or a minimum for each view that takes no
    time.
    """
    # by columns: reductions over two are slow
    length_m, rate_mps = abs(steps.length_m), abs(steps.range_rate_mps)
    extent = np.maximum(length_m[..., 0], length_m[..., 1]) / cell_m
    if rate_mps.any():
        extent = np.maximum(extent, np.maximum(rate_mps[..., 0], rate_mps[..., 1]) / cell_mps)
    most = max(most_a_row * len(extent), _LEAST_POINTS * views)
    along = np.clip(np.ceil(extent), 1, 4096).astype(np.intp)
    # Many wide rows overlap one another, so coarser points suffice for the widest ones.
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
    """Yield points that stand for the rows of some views, at most one cell apart, in parts.

    Cells are `cell_m` of total length and `cell_mps` of range rate. One cell ends at the total
    length `border_m`. A point that extends over this border, or over one whole cells away from it,
    is cut in two there. The fractions of a row add up to 1.
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
    """Return the total length that each point covers along the wider axis, (n,) [m]."""
    size_m = abs(steps.length_m)
    covered_m = (size_m[..., 0] + size_m[..., 1]) / 2 / along
    return np.maximum(covered_m[:, 0], covered_m[:, 1])


def _cut_at_borders(points: Points, width_m: Real, cell_m: float, border_m: float) -> Points:
    """Return the points, cut in two at borders of cells. The power of a point is even over its
    width.
    """
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


def view_limits(table: PathRows) -> tuple[Indices, Indices]:
    """Return where each view of a table (a tile at one replicate) begins and ends, (views,)."""
    tile, replicate = np.asarray(table["tile"]), np.asarray(table["replicate"])
    cuts = np.flatnonzero((np.diff(tile) != 0) | (np.diff(replicate) != 0)) + 1
    starts = np.concatenate([[0], cuts])[: table.size].astype(np.intp)
    return starts, np.append(starts[1:], table.size)[: starts.size]


def tiles_by_replicate(table: PathRows, replicates: int) -> Iterator[Iterator[PathRows]]:
    """Yield, for each replicate, an iterator over the rows of each tile that have a length."""
    for views in views_by_replicate(table, replicates):
        yield (rows for _, rows in views)


def views_by_replicate(
    table: PathRows, replicates: int
) -> Iterator[Iterator[tuple[Indices, PathRows]]]:
    """Yield, for each replicate, an iterator over the numbers and rows of each tile with a length.

    In the table, tiles follow one another, and in each tile its replicates.
    """
    starts, stops = view_limits(table)
    replicate = np.asarray(table["replicate"])[starts]
    for number in range(replicates):
        mine = np.flatnonzero(replicate == number)
        yield (_rows_with_length(table, starts[i], stops[i]) for i in mine)


def _rows_with_length(table: PathRows, start: int, stop: int) -> tuple[Indices, PathRows]:
    rows = table[start:stop]
    kept = np.flatnonzero(usable(rows))
    return start + kept, rows if kept.size == rows.size else rows[kept]
