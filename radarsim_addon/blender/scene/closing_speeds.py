# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of all surfaces at one moment, and largest range rates of objects before a render.

`evaluated_poses` reads poses and boxes of objects and instances. `ClosingSpeeds` takes two moments
of a scene, and `keyed_speeds` one moment and the F-curves of objects, which need no evaluation.
Both end at `largest_rate`: the outermost points of a mesh (`outermost_points`) go on as a rigid
body with the motion and rotation between two poses, and the largest of their |range rates| over the
burst counts. A mesh that deforms has the rate of the faces of its bounding box.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from weakref import WeakKeyDictionary

import bpy
import numpy as np
from mathutils import Euler, Matrix, Quaternion, Vector

from ...arrays import Indices, Real
from ..state import Key, Shape, Snapshot
from .ground_truth import Boxes
from .visibility import action_curves

#: Frames between two moments that tell the velocity at the first one: wheels turn little in it,
#: and it is long against the 1e-4 frames around a key in which Blender gives the key's value.
VELOCITY_FRAMES = 0.04
#: Corners of a bounding box, in Blender's order, whose mean is the centre of a face.
_FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 4, 5), (2, 3, 6, 7), (0, 3, 4, 7), (1, 2, 5, 6))
#: Directions in which the outermost vertex of a mesh is taken, and moments of a burst.
_DIRECTIONS, _MOMENTS = 64, 33


@dataclass(frozen=True)
class InstancePose:
    """Pose of an object or instance, with its box."""

    #: From its own axes to the world, in metres, (4, 4).
    pose: Real
    #: Lowest and highest corner in its own axes, (2, 3) [m].
    box: Real

    @property
    def reach_m(self) -> float:
        """Distance of the farthest corner of the box from the origin of its axes [m]."""
        corners = np.array(list(itertools.product(*self.box.T)))
        return float(np.linalg.norm(corners @ self.pose[:3, :3].T, axis=-1).max())


@dataclass(frozen=True)
class Poses:
    """Poses and boxes of n objects and instances at one moment."""

    #: Names of objects.
    names: Sequence[str]
    #: Index of each one's name, (n,).
    owner: Indices
    #: From its own axes to the world, in metres, (n, 4, 4).
    pose: Real
    #: Lowest and highest corner in its own axes, (n, 2, 3) [m].
    box: Real
    #: Original objects that are not hidden from renders, by name.
    rendered: Mapping[str, Any] = field(default_factory=dict)
    #: The snapshot that they are from, and their rows in it, (n,).
    snapshot: Snapshot | None = None
    rows: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def numbered(self, names: Sequence[str]) -> Indices:
        """Return the place of each object's name in a list of names, from 1, (n,); 0 if it is not
        there.
        """
        numbers = {name: number for number, name in enumerate(names, start=1)}
        return np.array([numbers.get(name, 0) for name in self.names], dtype=np.intp)[self.owner]

    def key(self, index: int) -> Key:
        """Return the key of one pose."""
        return () if self.snapshot is None else self.snapshot.layout.key(int(self.rows[index]))


def evaluated_poses(snapshot: Snapshot, metres_per_unit: float) -> Poses:
    """Return the poses and boxes of all surfaces at the time of a snapshot."""
    shapes = snapshot.shapes
    has_surface = [shape.kind not in {"CAMERA", "LIGHT", "EMPTY"} for shape in shapes]
    rows = np.flatnonzero(snapshot.of_shapes(has_surface))
    names = [shape.original.name_full for shape in shapes]
    corners = np.array([shape.box for shape in shapes]).reshape(-1, 8, 3)
    boxes = np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)
    pose = snapshot.matrices_of(rows)
    pose[:, :3, 3] *= metres_per_unit
    owner = snapshot.layout.shape[rows]
    rendered = {s.original.name_full: s.original for s in shapes if not s.original.hide_render}
    return Poses(names, owner, pose, boxes[owner] * metres_per_unit, rendered, snapshot, rows)


def pose_in_metres(matrix: Any, metres_per_unit: float) -> Real:
    """Return a matrix of Blender, (4, 4), with its translation in metres."""
    pose = np.array(matrix, dtype=np.float64)
    pose[:3, 3] *= metres_per_unit
    return pose


def instance_name(key: Key) -> str:
    """Return the parts of a key, joined by slashes; empty for an object itself."""
    unused = 2**31 - 1  # Blender fills unused numbers of instances with this
    return "/".join([str(part) for part in key if part != unused])


def distance_from_box(instance: InstancePose, points: Real) -> tuple[Real, Real]:
    """Return world points (n, 3) in the axes of an instance, and the vectors to them from its box,
    (n, 3) [m].

    The vectors have their lengths in the world, and are 0 inside the box.
    """
    try:
        inverse = np.linalg.inv(instance.pose)
    except np.linalg.LinAlgError:  # the scale is 0, so no point lies on the object
        return np.zeros_like(points), np.full_like(points, np.inf)
    local = points @ inverse[:3, :3].T + inverse[:3, 3]
    outside = np.maximum(np.maximum(instance.box[0] - local, local - instance.box[1]), 0.0)
    return local, outside @ instance.pose[:3, :3].T


class ClosingSpeeds:
    """Largest |range rate| of every object over the bursts of a run, of `span_s` seconds each."""

    def __init__(self, metres_per_unit: float, span_s: float = 0.0) -> None:
        self._units, self._span_s = metres_per_unit, span_s
        #: Largest |range rate| by the label of the object [m/s].
        self.by_object: dict[str, float] = {}

    def add(
        self,
        before: tuple[Boxes, tuple[Real, Real]],
        after: tuple[Boxes, tuple[Real, Real]],
        interval_s: float,
    ) -> None:
        """Add the rates between two moments. Each moment has boxes, and the places of
        the antennas.
        """
        first, last = before[0].snapshot, after[0].snapshot
        here, there = before[0].pairs(after[0])
        antennas = np.stack([before[1], after[1]])
        if not here.size or not interval_s > 0:
            return
        if np.array_equal(antennas[0], antennas[1]):  # then only what moves has a rate
            here, there = _moving(first, here, last, there)
        ranges_m = [
            _ranges_m(snapshot.corners_of(rows), tuple(places), self._units)
            for snapshot, rows, places in ((first, here, antennas[0]), (last, there, antennas[1]))
        ]
        means_mps = np.abs(ranges_m[1] - ranges_m[0]).max(axis=1) / interval_s
        for row, later, mean_mps in zip(here.tolist(), there.tolist(), means_mps, strict=True):
            shape = first.shapes[first.layout.shape[row]]
            rate_mps = float(mean_mps)
            if shape is last.shapes[last.layout.shape[later]]:
                poses = np.stack([first.matrix(row), last.matrix(later)])
                points = outermost_points(first, shape)
                rate_mps = self._units * largest_rate(
                    points, poses, antennas, interval_s, self._span_s
                )
            label = first.label(row)
            self.by_object[label] = max(rate_mps, self.by_object.get(label, 0.0))


def _moving(
    first: Snapshot, here: Indices, last: Snapshot, there: Indices
) -> tuple[Indices, Indices]:
    """Return the rows in both snapshots of the boxes that move from one snapshot to the other."""
    if first.walked is last.walked:  # the others are as that walk found them
        again = np.isin(here, np.union1d(first.moved, last.moved))
        here, there = here[again], there[again]
    moving = (first.corners_of(here) != last.corners_of(there)).any(axis=(1, 2))
    return here[moving], there[moving]


def _ranges_m(corners: Real, antennas: tuple[Real, Real], metres_per_unit: float) -> Real:
    """Return half the path lengths via the centres of the faces and of the boxes, (n, 7) [m]."""
    faces = corners[:, _FACES].mean(axis=2)
    points = np.concatenate([faces, corners.mean(axis=1, keepdims=True)], axis=1)
    lengths = sum(np.linalg.norm(points - antenna, axis=2) for antenna in antennas)
    return np.asarray(lengths * metres_per_unit / 2)


def keyed_speeds(
    found: Boxes, antennas: tuple[Any, Any], frame: float, fps: float, span_s: float
) -> dict[str, float]:
    """Return the largest |range rate| of objects that follows from their F-curves, by label [units
    per second].

    Blender evaluates nothing for this, so other kinds of animation are not included. `found` are
    the surfaces at `frame`, where the burst of `span_s` seconds begins. `antennas` are receiver and
    transmitter.
    """
    snapshot, layout = found.snapshot, found.snapshot.layout

    def poses_of(item: bpy.types.Object, now: Real) -> Real | None:
        worlds = keyed_worlds(item, (frame, frame + VELOCITY_FRAMES))
        if worlds is None:
            return None
        # In float32 both are rounded alike by Blender; what F-curves add is the difference.
        return np.stack([now, worlds[1] @ np.linalg.pinv(worlds[0]) @ now])

    places = []
    for item in antennas:
        now = np.array(snapshot.evaluated(item).matrix_world, dtype=np.float64)
        poses = poses_of(item, now) if _is_keyed(item) else None
        places.append([now[:3, 3]] * 2 if poses is None else poses[:, :3, 3])
    both = np.array(places).transpose(1, 0, 2)
    still = np.array_equal(both[0], both[1])
    speeds: dict[str, float] = {}
    for row in found.rows[layout.instancer[found.rows] < 0].tolist():
        shape = snapshot.shapes[layout.shape[row]]
        if still and not _is_keyed(shape.original):
            continue
        now = snapshot.matrix(row)
        poses = poses_of(shape.original, now) if _is_keyed(shape.original) else np.stack([now, now])
        if poses is not None:
            points = outermost_points(snapshot, shape)
            interval_s = VELOCITY_FRAMES / fps
            speeds[snapshot.label(row)] = largest_rate(points, poses, both, interval_s, span_s)
    return speeds


def keyed_step(item: bpy.types.Object, frame: float) -> Real | None:
    """Return how far F-curves move the origin of an object in one frame, (3,) [Blender units].

    None if no F-curve moves it, or if something else may move it too.
    """
    poses = keyed_worlds(item, (frame, frame + VELOCITY_FRAMES))
    if poses is None:
        return None
    return np.asarray((poses[1] - poses[0])[:3, 3] / VELOCITY_FRAMES, dtype=np.float64)


def keyed_worlds(item: bpy.types.Object, frames: Sequence[float]) -> Real | None:
    """Return the world matrices of an object at frames by its F-curves, (frames, 4, 4).

    None where constraints, drivers, simulations or strips may move it or its parents.
    """
    animation, body = item.animation_data, item.rigid_body
    if any(not one.mute for one in item.constraints) or body is not None:
        return None
    if item.rotation_mode == "AXIS_ANGLE":
        return None
    if item.parent is not None and item.parent_type != "OBJECT":
        return None
    channels = ("location", "rotation_euler", "rotation_quaternion", "scale")
    curves: list[bpy.types.FCurve] = []
    if animation is not None:
        if animation.drivers or animation.nla_tracks:
            return None
        action = animation.action
        slot = getattr(animation, "action_slot", None)
        moving = () if action is None else action_curves(action, slot)
        curves = [one for one in moving if not one.mute]
    if any(one.data_path.startswith("delta_") for one in curves):
        return None
    values = {name: list(getattr(item, name)) for name in channels}
    own = []
    for frame in frames if curves else frames[:1]:
        for curve in curves:
            if curve.data_path in values:
                values[curve.data_path][curve.array_index] = curve.evaluate(frame)
        place = Vector(values["location"]) + item.delta_location
        if item.rotation_mode == "QUATERNION":
            turn = Quaternion(values["rotation_quaternion"]).normalized()
            turn = item.delta_rotation_quaternion @ turn
        else:
            turn = Euler(values["rotation_euler"], item.rotation_mode).to_quaternion()
            turn = item.delta_rotation_euler.to_quaternion() @ turn
        size = Vector(a * b for a, b in zip(values["scale"], item.delta_scale, strict=True))
        own.append(Matrix.LocRotScale(place, turn, size))
    matrices = np.array(own, dtype=np.float64).repeat(1 if curves else len(frames), axis=0)
    if item.parent is None:
        return matrices
    above = keyed_worlds(item.parent, frames)
    inverse = np.array(item.matrix_parent_inverse, dtype=np.float64)
    return None if above is None else np.asarray(above @ inverse @ matrices)


def nothing_moves(item: bpy.types.Object) -> bool:
    """Return whether an object and its parents have nothing that could move them. This test is
    quick.
    """
    while item is not None:
        if item.animation_data is not None or item.rigid_body is not None:
            return False
        if any(not one.mute for one in item.constraints):
            return False
        if item.parent is not None and item.parent_type != "OBJECT":
            return False
        item = item.parent
    return True


def _is_keyed(item: bpy.types.Object) -> bool:
    """Return whether an object or one of its parents has an action."""
    while item is not None:
        if item.animation_data is not None and item.animation_data.action is not None:
            return True
        item = item.parent
    return False


def largest_rate(
    points: Real, poses: Real, antennas: Real, interval_s: float, span_s: float
) -> float:
    """Return the largest |range rate| of points of a rigid body during a burst [units/s].

    `points` (n, 3) are in the body's own axes. Its `poses` (2, 4, 4) and the places of both
    `antennas` (2, 2, 3) are given at two moments. Body and antennas keep their velocities between
    these moments.
    """
    place = points @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]
    centre = place.mean(axis=1)
    velocity = (centre[1] - centre[0]) / interval_s
    spin = _turn(poses) / interval_s
    arms = place[0] - centre[0]
    times_s = np.linspace(0.0, span_s, _MOMENTS if spin.any() and span_s > 0 else 1)
    turned = np.stack([_rotation(spin * at_s) for at_s in times_s])
    arms = np.einsum("tij,nj->tni", turned, arms)
    moving = (turned @ velocity)[:, None] + np.cross(spin, arms)
    now = centre[0] + velocity * times_s[:, None, None] + arms
    rates = np.zeros(arms.shape[:2])
    for start, end in antennas.transpose(1, 0, 2):
        own = (end - start) / interval_s
        away = now - (start + own * times_s[:, None, None])
        distance = np.maximum(np.linalg.norm(away, axis=2), np.finfo(np.float64).tiny)
        rates += np.einsum("tni,tni->tn", moving - own, away) / distance / 2
    return float(np.abs(rates).max())


def _turn(poses: Real) -> Real:
    """Return the rotation vector between two poses, without their scales."""
    axes = poses[:, :3, :3]
    left, _, right = np.linalg.svd(axes[1] @ np.linalg.pinv(axes[0]))
    turn = left @ right
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine = float(np.linalg.norm(vector)) / 2
    angle = float(np.arctan2(sine, (np.trace(turn) - 1) / 2))
    # float32 axes turn by as much without any motion
    return vector * (angle / (2 * sine)) if sine > 1e-6 else np.zeros(3)


def _rotation(vector: Real) -> Real:
    """Return the matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


#: Outermost vertices of meshes that Blender has not evaluated since.
_outermost: WeakKeyDictionary[Shape, Real] = WeakKeyDictionary()


def outermost_points(snapshot: Snapshot, shape: Shape) -> Real:
    """Return the outermost vertices of a mesh and the centres of the faces of its box, in own axes,
    (n, 3).

    Without a mesh, these are the corners of its box.
    """
    if shape not in _outermost:
        points = shape.box
        mesh = snapshot.mesh(shape)
        if mesh is not None and len(mesh.vertices):
            index = np.arange(_DIRECTIONS) + 0.5  # Fibonacci's sphere, and along the axes
            z, angle = 1 - 2 * index / _DIRECTIONS, index * np.pi * (3 - np.sqrt(5))
            around = np.sqrt(1 - z**2)[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
            directions = np.concatenate([np.column_stack([around, z]), np.eye(3), -np.eye(3)])
            size = np.ptp(mesh.vertices, axis=0)
            size[size == 0] = 1.0  # a flat mesh: that axis tells its vertices not apart
            farthest = np.unique((mesh.vertices / size @ directions.T).argmax(axis=0))
            # What is ahead of the radar closes in faster than edges do.
            points = np.concatenate(
                [mesh.vertices[farthest], shape.box[np.array(_FACES)].mean(axis=1)]
            )
        _outermost[shape] = points
    return _outermost[shape]
