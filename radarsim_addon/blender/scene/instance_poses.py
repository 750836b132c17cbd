# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses and boxes of the objects and instances of a scene at one moment."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...array_types import Indices, Real
from ..state import Key, Snapshot, take_snapshot

#: Blender fills unused numbers of instances with this.
_UNUSED = 2**31 - 1


@dataclass(frozen=True)
class InstancePose:
    """Pose of an object or instance, with its box.

    Attributes
    ----------
    pose : ndarray, shape (4, 4)
        From its own axes to the world, in metres.
    box : ndarray, shape (2, 3)
        Lowest and highest corner in its own axes [m].
    """

    pose: Real
    box: Real

    @property
    def reach_m(self) -> float:
        """Distance of the farthest corner of the box from the origin of its axes [m]."""
        corners = np.array(list(itertools.product(*self.box.T)))
        return float(np.linalg.norm(corners @ self.pose[:3, :3].T, axis=-1).max())


@dataclass(frozen=True)
class Poses:
    """Poses and boxes of n objects and instances at one moment.

    Attributes
    ----------
    names
        Names of objects.
    owner : ndarray, shape (n,)
        Index of each one's name.
    pose : ndarray, shape (n, 4, 4)
        From its own axes to the world, in metres.
    box : ndarray, shape (n, 2, 3)
        Lowest and highest corner in its own axes [m].
    rendered
        Original objects that are not hidden from renders, by name.
    snapshot, rows
        The snapshot that they are from, and their rows in it, (n,).
    """

    names: Sequence[str]
    owner: Indices
    pose: Real
    box: Real
    rendered: Mapping[str, Any] = field(default_factory=dict)
    snapshot: Snapshot | None = None
    rows: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def numbered(self, names: Sequence[str]) -> Indices:
        """Return the place of each one's name among other names, from 1, (n,); 0: not there."""
        numbers = {name: number for number, name in enumerate(names, start=1)}
        return np.array([numbers.get(name, 0) for name in self.names], dtype=np.intp)[self.owner]

    def key(self, index: int) -> Key:
        """Return the key of one of them."""
        return () if self.snapshot is None else self.snapshot.layout.key(int(self.rows[index]))


def pose_in_metres(matrix: Any, metres_per_unit: float) -> Real:
    """Return a matrix of Blender with its translation in metres.

    Parameters
    ----------
    matrix : mathutils.Matrix
        4x4, Blender units.
    metres_per_unit
        Metres per Blender unit.

    Returns
    -------
    ndarray
        Shape (4, 4), float64.
    """
    pose = np.array(matrix, dtype=np.float64)
    pose[:3, 3] *= metres_per_unit
    return pose


def instance_name(key: Key) -> str:
    """Return a key as text.

    Parameters
    ----------
    key
        Key of an instance.

    Returns
    -------
    str
        The instancer and Blender's numbers, joined by slashes; empty for the object itself.
    """
    return "/".join([str(part) for part in key if part != _UNUSED])


def evaluated_poses(depsgraph: Any, metres_per_unit: float) -> Poses:
    """Return the poses and boxes of all surfaces at the time of a depsgraph.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.
    metres_per_unit
        Metres per Blender unit.

    Returns
    -------
    Poses
        In metres.
    """
    snapshot = take_snapshot(depsgraph)
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


def distance_from_box(instance: InstancePose, points: Real) -> tuple[Real, Real]:
    """Return where points lie relative to the box of an instance.

    Parameters
    ----------
    instance
        Pose and box.
    points
        Shape (n, 3), world axes [m].

    Returns
    -------
    local, outside : numpy.ndarray
        Points in the object's own axes, and vectors from the box to the points in world lengths,
        0 inside the box, shapes (n, 3) [m].
    """
    try:
        inverse = np.linalg.inv(instance.pose)
    except np.linalg.LinAlgError:  # the scale is 0, so no point lies on the object
        return np.zeros_like(points), np.full_like(points, np.inf)
    local = points @ inverse[:3, :3].T + inverse[:3, 3]
    outside = np.maximum(np.maximum(instance.box[0] - local, local - instance.box[1]), 0.0)
    return local, outside @ instance.pose[:3, :3].T
