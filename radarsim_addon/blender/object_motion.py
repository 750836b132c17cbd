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


#: Numbers of an instance that tell it from others of the same object; empty for the object itself.
Key = tuple[Any, ...]

#: A turn larger than this between the two moments has no sure direction [rad].
_LARGEST_TURN = 3.0
#: How far the axes of a rotation may be from orthonormal; float32 poses are within 1e-6.
_RIGID_WITHIN = 1e-4


@dataclass(frozen=True)
class Shown:
    """One object or instance: its pose (4, 4) in metres, and its box (2, 3) in its own axes [m]."""

    pose: Real
    box: Real


@dataclass(frozen=True)
class Poses:
    """What is shown, by name and instance, and positions of the antennas, in metres."""

    objects: Mapping[str, Mapping[Key, Shown]]
    receiver_m: Real
    emitter_m: Real


@dataclass(frozen=True)
class _Motion:
    """Motion of one object or instance: velocity of its origin, and either a turn or a stretch."""

    shown: Shown
    origin_rate: Real
    turn_rate: Real | None  # rad/s, about the origin
    stretch_rate: Real | None  # (3, 3) 1/s

    def velocity(self, points: Real) -> Real:
        arm = points - self.shown.pose[:3, 3]
        if self.turn_rate is not None:
            return self.origin_rate + np.cross(self.turn_rate, arm)
        if self.stretch_rate is not None:
            return self.origin_rate + arm @ self.stretch_rate.T
        return np.broadcast_to(self.origin_rate, points.shape)


class ObjectMotion:
    """Motion between two moments: rigid, object by object and instance by instance.

    Turns are taken at the first moment (a rotor's blade moves along its circle, not along the
    chord of the interval), shifts of the origin as their mean over the interval.

    Parameters
    ----------
    names
        Objects in the order of their numbers, from 1.
    now, later
        Poses at both moments.
    interval_s
        Time between them [s].
    """

    def __init__(
        self,
        names: Sequence[str],
        now: Poses,
        later: Poses,
        interval_s: float,
    ) -> None:
        self._interval_s = interval_s
        self._receiver_step = later.receiver_m - now.receiver_m
        self._emitter_step = later.emitter_m - now.emitter_m
        self._moving: dict[int, list[_Motion | Shown]] = {}
        for number, name in enumerate(names, start=1):
            after = later.objects.get(name, {})
            parts = [
                _motion(shown, after.get(key), interval_s)
                for key, shown in now.objects.get(name, {}).items()
            ]
            if any(isinstance(part, _Motion) for part in parts):
                self._moving[number] = parts

    @staticmethod
    def poses(depsgraph: Any, rig: Any, metres_per_unit: float) -> Poses:
        """Poses at the depsgraph's time."""

        def metres(matrix: Any) -> Real:
            pose = np.array(matrix, dtype=np.float64)
            pose[:3, 3] *= metres_per_unit
            return pose

        objects: dict[str, dict[Key, Shown]] = {}
        for item in depsgraph.object_instances:
            evaluated = item.object
            if evaluated.type in {"CAMERA", "LIGHT", "EMPTY"}:
                continue
            key: Key = ()
            if item.is_instance:
                key = (item.parent.original.name, *item.persistent_id)
            corners = np.array([tuple(corner) for corner in evaluated.bound_box])
            box = np.stack([corners.min(axis=0), corners.max(axis=0)]) * metres_per_unit
            shown = Shown(metres(item.matrix_world), box)
            objects.setdefault(evaluated.original.name, {})[key] = shown
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
        for number, parts in self._moving.items():
            mine = np.flatnonzero(numbers == number)
            if not mine.size:
                continue
            which = _nearest_box(parts, points[mine])
            for index, part in enumerate(parts):
                if isinstance(part, _Motion):
                    rows = mine[which == index]
                    velocity[rows] = part.velocity(points[rows])
        return velocity


def _motion(now: Shown, later: Shown | None, interval_s: float) -> _Motion | Shown:
    """How an object moves; the object itself where it stands still."""
    # Equal matrices are left out: their difference is exactly zero, not rounding.
    if later is None or np.array_equal(now.pose, later.pose):
        return now
    origin_rate = (later.pose[:3, 3] - now.pose[:3, 3]) / interval_s
    if np.array_equal(now.pose[:3, :3], later.pose[:3, :3]):
        return _Motion(now, origin_rate, None, None)
    try:
        step = later.pose[:3, :3] @ np.linalg.inv(now.pose[:3, :3])
    except np.linalg.LinAlgError:  # scaled to nothing: it has no surface either
        return now
    if np.abs(step @ step.T - np.eye(3)).max() < _RIGID_WITHIN:
        turn = np.array([step[2, 1] - step[1, 2], step[0, 2] - step[2, 0], step[1, 0] - step[0, 1]])
        sine = float(np.linalg.norm(turn)) / 2
        angle = float(np.arctan2(sine, (np.trace(step) - 1) / 2))
        if angle < _LARGEST_TURN:
            factor = angle / (2 * sine) if sine > 0 else 0.5
            return _Motion(now, origin_rate, turn * factor / interval_s, None)
    return _Motion(now, origin_rate, None, (step - np.eye(3)) / interval_s)


def _nearest_box(parts: Sequence[_Motion | Shown], points: Real) -> NDArray[np.intp]:
    """Index of the instance in (or nearest to) whose box each point lies."""
    best = np.zeros(len(points), dtype=np.intp)
    if len(parts) == 1:
        return best
    least = np.full(len(points), np.inf)
    for index, part in enumerate(parts):
        shown = part.shown if isinstance(part, _Motion) else part
        local, outside = beside_box(shown, points)
        # Boxes that overlap are told apart by their centres, a little.
        centre = (local - shown.box.mean(axis=0)) @ shown.pose[:3, :3].T
        distance = np.linalg.norm(outside, axis=-1) + 1e-6 * np.linalg.norm(centre, axis=-1)
        nearer = distance < least
        best[nearer], least[nearer] = index, distance[nearer]
    return best


def beside_box(shown: Shown, points: Real) -> tuple[Real, Real]:
    """Points in the object's own axes, and in world lengths how far outside its box they lie."""
    try:
        inverse = np.linalg.inv(shown.pose)
    except np.linalg.LinAlgError:  # scaled to nothing: nothing lies on it
        return np.zeros_like(points), np.full_like(points, np.inf)
    local = points @ inverse[:3, :3].T + inverse[:3, 3]
    outside = np.maximum(np.maximum(shown.box[0] - local, local - shown.box[1]), 0.0)
    return local, outside @ shown.pose[:3, :3].T


def _unit(vectors: Real) -> Real:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(length > 0, vectors / length, 0.0)
