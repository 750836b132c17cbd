# SPDX-License-Identifier: GPL-3.0-or-later
"""Range rates of paths from the motion of the objects they touch: no second render is needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..signal.pathtable import PathRows

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Poses:
    """Poses (4, 4) of the objects by name, and positions of the antennas, in metres."""

    objects: Mapping[str, Real]
    receiver_m: Real
    emitter_m: Real


class ObjectMotion:
    """Motion between two moments: rigid, object by object.

    Parameters
    ----------
    names
        Objects in the order of their numbers, from 1.
    now, later
        Poses at both moments.
    interval_s
        Time between them [s].
    """

    def __init__(self, names: Sequence[str], now: Poses, later: Poses, interval_s: float) -> None:
        self._interval_s = interval_s
        self._receiver_step = later.receiver_m - now.receiver_m
        self._emitter_step = later.emitter_m - now.emitter_m
        self._steps: dict[int, Real] = {}
        for number, name in enumerate(names, start=1):
            before, after = now.objects.get(name), later.objects.get(name)
            # Equal matrices are left out: their difference is exactly zero, not rounding.
            if before is None or after is None or np.array_equal(before, after):
                continue
            try:
                self._steps[number] = after @ np.linalg.inv(before) - np.eye(4)
            except np.linalg.LinAlgError:  # scaled to nothing: it has no surface either
                continue

    @staticmethod
    def poses(depsgraph: Any, rig: Any, metres_per_unit: float) -> Poses:
        """Poses at the depsgraph's time."""

        def metres(matrix: Any) -> Real:
            pose = np.array(matrix, dtype=np.float64)
            pose[:3, 3] *= metres_per_unit
            return pose

        objects = {
            item.original.name: metres(item.matrix_world)
            for item in depsgraph.objects
            if item.type not in {"CAMERA", "LIGHT"}
        }
        return Poses(
            objects,
            metres(rig.camera.evaluated_get(depsgraph).matrix_world)[:3, 3],
            metres(rig.emitter.evaluated_get(depsgraph).matrix_world)[:3, 3],
        )

    def fill_range_rates(self, rows: PathRows, receiver_m: Real, emitter_m: Real) -> None:
        """Set ``range_rate_mps`` of the rows, half the rate of the path's length.

        Exact kinematics: dL/dt = sum over vertices of v . (u_in - u_out), and the antennas' own
        motion; u_in points along the way from receiver to emitter into the vertex. Paths whose
        vertices are unknown keep 0.
        """
        first, last = rows["first_m"], rows["last_m"]
        one = rows["order"] == 1
        known = np.isfinite(last).all(axis=-1) & (np.isfinite(first).all(axis=-1) | one)
        into_first = rows["direction"]
        out_last = _unit(emitter_m - last)
        rate = np.zeros(rows.size)
        v_last = self._velocity(rows["object"], last)
        v_first = self._velocity(rows["first_object"], first)
        between = _unit(last - first)
        with np.errstate(invalid="ignore"):
            single = np.sum(v_last * (into_first - out_last), axis=-1)
            double = np.sum(v_first * (into_first - between), axis=-1) + np.sum(
                v_last * (between - out_last), axis=-1
            )
        rate = np.where(one, single, np.where(rows["order"] == 2, double, 0.0))
        rate -= into_first @ (self._receiver_step / self._interval_s)
        rate += out_last @ (self._emitter_step / self._interval_s)
        rows["range_rate_mps"] = np.where(known, np.nan_to_num(rate) / 2, 0.0)

    def _velocity(self, numbers: NDArray[np.int32], points: Real) -> Real:
        velocity = np.zeros(points.shape)
        for number, step in self._steps.items():
            mine = numbers == number
            if np.any(mine):
                moved = points[mine] @ step[:3, :3].T + step[:3, 3]
                velocity[mine] = moved / self._interval_s
        return velocity


def _unit(vectors: Real) -> Real:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(length > 0, vectors / length, 0.0)
