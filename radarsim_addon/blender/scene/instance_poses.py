# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene shows at one moment: objects and instances, with their poses and boxes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...array_types import Real

#: Numbers of an instance that tell it from others of the same object; empty for the object itself.
Key = tuple[Any, ...]


@dataclass(frozen=True)
class InstancePose:
    """One object or instance: its pose (4, 4) in metres, and its box (2, 3) in its own axes [m]."""

    pose: Real
    box: Real


@dataclass(frozen=True)
class Poses:
    """What is shown, by name and instance, in metres."""

    objects: Mapping[str, Mapping[Key, InstancePose]]


def pose_in_metres(matrix: Any, metres_per_unit: float) -> Real:
    """Blender's matrix with the translation in metres, (4, 4)."""
    pose = np.array(matrix, dtype=np.float64)
    pose[:3, 3] *= metres_per_unit
    return pose


def instance_key(item: Any) -> Key:
    """What tells an instance from others of its object.

    Parameters
    ----------
    item : bpy.types.DepsgraphObjectInstance
    """
    if not item.is_instance:
        return ()
    return (item.parent.original.name, *item.persistent_id)


def instance_name(key: Key) -> str:
    """A key as text: the instancer, and the numbers that Blender uses."""
    # 2^31 - 1 fills what is not used
    return "/".join(str(part) for part in key if part != 2**31 - 1)


def evaluated_poses(depsgraph: Any, metres_per_unit: float) -> Poses:
    """Poses at the depsgraph's time."""
    objects: dict[str, dict[Key, InstancePose]] = {}
    for item in depsgraph.object_instances:
        evaluated = item.object
        if evaluated.type in {"CAMERA", "LIGHT", "EMPTY"}:
            continue
        corners = np.array([tuple(corner) for corner in evaluated.bound_box])
        box = np.stack([corners.min(axis=0), corners.max(axis=0)]) * metres_per_unit
        shown = InstancePose(pose_in_metres(item.matrix_world, metres_per_unit), box)
        objects.setdefault(evaluated.original.name, {})[instance_key(item)] = shown
    return Poses(objects)


def beside_box(shown: InstancePose, points: Real) -> tuple[Real, Real]:
    """Points in the object's own axes, and in world lengths how far outside its box they lie."""
    try:
        inverse = np.linalg.inv(shown.pose)
    except np.linalg.LinAlgError:  # scaled to nothing: nothing lies on it
        return np.zeros_like(points), np.full_like(points, np.inf)
    local = points @ inverse[:3, :3].T + inverse[:3, 3]
    outside = np.maximum(np.maximum(shown.box[0] - local, local - shown.box[1]), 0.0)
    return local, outside @ shown.pose[:3, :3].T
