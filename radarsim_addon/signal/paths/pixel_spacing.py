# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the paths of a view lie on its grid of pixels, told from their directions."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Integers, Real
from ...contract import ReceiverRecord
from ...vectors import are_finite, largest
from .table import PathRows

#: Angles between rays of a sphere that are rounding, as a fraction of a pixel's side, and those of
#: tables in which directions and pose are of two float32 matrices [rad].
_SAME, _SAME_RAD = 1e-3, 3e-7
#: Pixels whose median tells the pitch, which is the same for all.
_ENOUGH = 1 << 12
#: Most pixels of an image. Tiles are smaller; a table that was put together otherwise may not be.
_MOST_PX = 1 << 25
#: Paths whose places are kept: 16 bytes each.
_MOST_KEPT = 1 << 20
#: Pixels from one path to the next that is no neighbour of it, nor of a neighbour.
_GAP = 3


def placed(rows: PathRows, receiver: ReceiverRecord) -> NDArray[np.bool_]:
    """Return which rows have a known pixel, (n,).

    Parallel rays are told by where they end, others by their direction.
    """
    if receiver.kind == "orthographic":
        return are_finite(rows["first_scatterer_m"])
    if receiver.kind == "perspective":
        backwards = np.array(receiver.matrix_world, dtype=np.float64)[:3, 2]
        return np.asarray(rows["direction"] @ backwards < 0)
    return np.asarray(largest(rows["direction"]) != 0)


def grid_places(rows: PathRows, receiver: ReceiverRecord, count: int) -> tuple[Integers, Integers]:
    """Return column and row of each path's pixel, counted from the first ones that are met, (n,).

    The rows are of one tile at one of `count` replicates, one at least, all of them `placed`.
    """
    pose = np.array(receiver.matrix_world, dtype=np.float64)
    # A column of its own: in a table they lie far apart. And no BLAS, whose threads wait for one
    # another longer than three columns take.
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
        few = slice(None, None, -(-u.size // _ENOUGH))
        step_u = step_v = math.sqrt(
            float(np.median(area[few] * (1 + u[few] ** 2 + v[few] ** 2) ** 1.5))
        )
    else:
        flat = (rows["first_scatterer_m"] - pose[:3, 3]) @ pose[:3, :3]
        u, v = flat[:, 0], flat[:, 1]
        step_u = step_v = math.sqrt(float(np.median(area)))
    col, row = (np.rint((x - x.min()) / s).astype(np.int64) for x, s in ((u, step_u), (v, step_v)))
    return _bounded(col, row)


def view_limits(table: PathRows) -> tuple[Indices, Indices]:
    """Return where the views of a table (a tile at one replicate) start and stop, (views,) each."""
    tile, replicate = np.asarray(table["tile"]), np.asarray(table["replicate"])
    cuts = np.flatnonzero((np.diff(tile) != 0) | (np.diff(replicate) != 0)) + 1
    starts = np.concatenate([[0], cuts])[: table.size].astype(np.intp)
    return starts, np.append(starts[1:], table.size)[: starts.size]


def joined_places(
    rows: PathRows, receiver: ReceiverRecord, count: int
) -> tuple[Integers, Integers]:
    """Return column and row of each path's pixel, of rows of several views, whose grids lie side by
    side.

    Parameters
    ----------
    rows
        Of tiles at some of `count` replicates, view by view, all of them `placed`, (n,).
    receiver
        Of the frame.
    count
        Number of replicates.

    Returns
    -------
    (ndarray, ndarray)
        As from `grid_places`; paths of different views are no neighbours.
    """
    limits = zip(*view_limits(rows), strict=True)
    return _side_by_side([grid_places(rows[a:b], receiver, count) for a, b in limits])


def _side_by_side(each: list[tuple[Integers, Integers]]) -> tuple[Integers, Integers]:
    """Places in one grid of those in several, none a neighbour of another's."""
    if len(each) == 1:
        return each[0]
    starts = np.cumsum([0] + [int(col.max()) + _GAP for col, _ in each])
    col = np.concatenate([own + start for (own, _), start in zip(each, starts, strict=False)])
    return _bounded(col, np.concatenate([row for _, row in each]))


#: Column and row of the pixels of rows, as `grid_places` finds them.
Places = Callable[[PathRows, ReceiverRecord, int], tuple[Integers, Integers]]


class GridPlaces:
    """Finds the places of a table's views in their grids once for two who ask for them."""

    def __init__(self) -> None:
        self._kept: dict[int, tuple[Integers, Integers]] = {}

    def of_views(self, number: Indices) -> Places:
        """Return what finds places of rows of one view or of several.

        Parameters
        ----------
        number
            Numbers of all rows of the views in the table, (n,).

        Returns
        -------
        callable
            As `joined_places`; of all rows of a view it keeps what it finds, once.
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
        """Places of all rows of a view, by the number of the first one."""
        found = self._kept.pop(first, None)
        if found is None:
            found = grid_places(rows, receiver, count)
            if sum(col.size for col, _ in self._kept.values()) <= _MOST_KEPT:
                self._kept[first] = found
        return found


def _from_widest_gap(angle: Real) -> Real:
    """Angles from 0 to 2 pi that begin where most of the circle is empty."""
    ordered = np.sort(angle)
    gaps = np.diff(ordered, append=ordered[0] + 2 * math.pi)
    widest = int(np.argmax(gaps))
    return np.asarray((angle - ordered[widest] - gaps[widest] / 2) % (2 * math.pi))


def _sphere_steps(u: Real, v: Real, level: Real, area: Real) -> tuple[float, float]:
    """Steps of longitude and latitude of a grid; infinite along an axis that has one place alone.

    Latitudes are told apart by their steps. Longitudes are not, near a pole, where rounding is
    multiplied by the inverse of the distance from the axis; but the solid angle of a pixel,
    2 sin(dlat/2) cos(lat) dlon, tells their step.
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
    """Places in an image that is not too large, with the same neighbours.

    Where it would be, empty columns and rows between paths are left out, and if that is not enough
    each path is taken to be alone.
    """
    if _pixels(col, row) > _MOST_PX:
        col, row = _without_gaps(col), _without_gaps(row)
    if _pixels(col, row) > _MOST_PX:
        col, row = _GAP * np.arange(col.size), np.zeros_like(row)
    return col, row


def _pixels(col: Integers, row: Integers) -> float:
    return (float(col.max()) + 1) * (float(row.max()) + 1)


def _without_gaps(places: Integers) -> Integers:
    """Numbers that keep neighbours adjacent, and others apart."""
    found, number = np.unique(places, return_inverse=True)
    return np.asarray(np.cumsum(np.minimum(np.diff(found, prepend=found[0]), _GAP))[number])
