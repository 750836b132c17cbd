# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of a table as the points that they are spread over: what echoes of rough surfaces are of.

The points are those of expected power, see :mod:`.paths.footprints`, with their places in space: as
a pixel reaches half-way to the rays around it, a point lies between their vertices. Its length is
that over its place, so that speckle, which belongs to places on the surface, stays where it is.
"""

from __future__ import annotations

import numpy as np

from ...array_types import Indices, Real
from ...contract import PathsRecord
from .footprints import (
    along_steps,
    places_in_pixels,
    points_along,
    power_steps,
    shares,
    steps_of,
    view_limits,
)
from .table import PathRows
from .table_files import usable

#: Most points, times the rows of a view: each costs as much as a path.
_POINTS_A_ROW = 4


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
        self._table = table
        self._receiver_m = np.array(record.receiver.matrix_world)[:3, 3]
        self._emitter_m = np.array(record.transmitter.matrix_world)[:3, 3]
        self._orthographic = record.receiver.kind == "orthographic"
        none = np.zeros(0, dtype=np.intp)
        rows, between, along = [none], [none.reshape(0, 2, 2, 2)], [none.reshape(0, 2)]
        for start, stop in zip(*view_limits(table), strict=True):
            view = np.asarray(table[start:stop])
            kept = usable(view)
            for axis in range(3):
                kept &= np.isfinite(view["last_scatterer_m"][:, axis])
            number = np.flatnonzero(kept)
            mine = view if number.size == view.size else view[number]
            steps = steps_of(mine, record.receiver, record.replicates)
            points = points_along(steps, cell_m, cell_mps, _POINTS_A_ROW)
            several = np.flatnonzero(points.max(axis=1, initial=1) > 1)
            rows.append(start + number[several])
            between.append(start + number[steps.between[several]])
            along.append(points[several])
        #: Rows of several points in rising order, what their steps lie between, and how many.
        self._rows, self._between = np.concatenate(rows), np.concatenate(between)
        self._along = np.concatenate(along)

    def points(self, numbers: Indices) -> tuple[Indices, PathRows]:
        """Return the points of some rows, themselves as rows of a table.

        Parameters
        ----------
        numbers
            Rows of the table, (n,).

        Returns
        -------
        ndarray, ndarray
            Index in `numbers` that each point belongs to, and the points with their parts of power
            and solid angle, (points,) each.
        """
        rows = self._table[_as_slice(numbers)]
        place = np.searchsorted(self._rows, numbers)
        split = np.append(self._rows, -1)[place] == numbers
        chosen = place[split]
        if not chosen.size:
            return np.arange(rows.size), rows
        along, between = self._along[chosen], self._between[chosen]
        counts = np.ones(rows.size, dtype=np.intp)
        counts[split] = along.prod(axis=1)
        index = np.repeat(np.arange(rows.size), counts)
        points = rows[index]
        mine = np.flatnonzero(split[index])
        row, at = places_in_pixels(along)
        share = shares(
            power_steps(self._table["power_w"], between, rows["power_w"][split]), row, at
        )

        def moved(name: str) -> Real:
            ends = self._table[name][between]
            return along_steps(ends[:, :, :, 1] - ends[:, :, :, 0], row, at)

        old_m = points["last_scatterer_m"][mine]
        new_m = old_m + moved("last_scatterer_m")
        old_leg_m, new_leg_m = (
            np.linalg.norm(place_m - self._emitter_m, axis=1) for place_m in (old_m, new_m)
        )
        points["length_m"][mine] += new_leg_m - old_leg_m
        if self._orthographic:
            points["length_m"][mine] += np.sum(points["direction"][mine] * (new_m - old_m), axis=1)
        else:
            old_arm_m, new_arm_m = old_m - self._receiver_m, new_m - self._receiver_m
            reach_m = np.linalg.norm(new_arm_m, axis=1)
            points["length_m"][mine] += reach_m - np.linalg.norm(old_arm_m, axis=1)
            points["direction"][mine] = new_arm_m / reach_m[:, None]
        points["first_scatterer_m"][mine] = points["last_scatterer_m"][mine] = new_m
        points["range_rate_mps"][mine] += moved("range_rate_mps")
        for name in ("power_w", "solid_angle_sr"):
            points[name][mine] *= share
        return index, points


def _as_slice(rows: Indices) -> Indices | slice:
    """Row numbers, as a slice where they are without a gap: of a table that copies nothing."""
    if not rows.size or rows[-1] - rows[0] + 1 != rows.size or (np.diff(rows) != 1).any():
        return rows
    return slice(int(rows[0]), int(rows[-1]) + 1)
