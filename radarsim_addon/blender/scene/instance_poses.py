# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses and boxes of the objects and instances of a scene at one moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...array_types import Real
from ..state import Key, evaluated_objects


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


@dataclass(frozen=True)
class Poses:
    """Poses of objects and instances at one moment, by name of the object.

    Attributes
    ----------
    objects
        Poses by instance.
    rendered
        Original objects that are not hidden from renders.
    """

    objects: Mapping[str, Mapping[Key, InstancePose]]
    rendered: Mapping[str, Any] = field(default_factory=dict)


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
    # Blender fills unused numbers with 2^31 - 1.
    return "/".join(str(part) for part in key if part != 2**31 - 1)


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
    objects: dict[str, dict[Key, InstancePose]] = {}
    rendered: dict[str, Any] = {}
    for one in evaluated_objects(depsgraph):
        name = one.original.name
        if not one.original.hide_render:
            rendered[name] = one.original
        if one.evaluated.type not in {"CAMERA", "LIGHT", "EMPTY"}:
            box = np.stack([one.box.min(axis=0), one.box.max(axis=0)]) * metres_per_unit
            pose = pose_in_metres(one.matrix_world, metres_per_unit)
            objects.setdefault(name, {})[one.key] = InstancePose(pose, box)
    return Poses(objects, rendered)


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
