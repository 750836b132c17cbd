# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground straight below a radar."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...array_types import Real
from ...errors import SceneError
from ..materials import SURFACE_TYPES
from ..state import EvaluatedObject, evaluated_mesh, evaluated_objects, read_numbers, read_triangles

#: Largest tilt of the ground that counts as level.
_LEVEL_RAD = math.radians(1.0)


@dataclass(frozen=True)
class GroundBelow:
    """A level surface straight below a point, Blender units.

    Attributes
    ----------
    name
        Name of the object.
    material : bpy.types.Material or None
        Of the face below the point.
    height
        World z of the surface.
    corners
        Bounding box in the world, (8, 3).
    """

    name: str
    material: Any
    height: float
    corners: Real


def ground_below(depsgraph: Any, point: Real, name: str | None = None) -> GroundBelow:
    """Find the ground: of the objects straight below a point the one with the largest area.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.
    point
        World coordinates, Blender units, (3,).
    name
        Name of the object that is the ground; None: search it.

    Returns
    -------
    GroundBelow
        The highest face of the object below the point.

    Raises
    ------
    SceneError
        Nothing, or not the named object, is below the point, or its face there is not level.
    """
    found: list[tuple[float, float, GroundBelow, float]] = []
    for item in evaluated_objects(depsgraph):
        hidden = not item.visible or item.original.hide_render
        named = name in (None, item.original.name)
        if hidden or not named or item.evaluated.type not in SURFACE_TYPES:
            continue
        corners = item.box @ item.matrix[:3, :3].T + item.matrix[:3, 3]
        low, high = corners.min(axis=0), corners.max(axis=0)
        if np.all(low[:2] <= point[:2]) and np.all(point[:2] <= high[:2]):
            face = _face_below(item, point)
            if face is not None:
                height, slot, tilt_rad = face
                area = float(np.prod(high[:2] - low[:2]))
                ground = GroundBelow(
                    item.original.name, _material(item.evaluated, slot), height, corners
                )
                found.append((area, height, ground, tilt_rad))
    if not found:
        what = "No surface" if name is None else f"No face of {name!r}"
        raise SceneError(
            f"{what} is straight below the radar at ({', '.join(f'{x:g}' for x in point)}), so "
            "there is no ground to reflect. Put a ground under the radar, or name it by --ground."
        )
    _, _, ground, tilt_rad = max(found, key=lambda one: one[:2])
    if tilt_rad > _LEVEL_RAD:
        raise SceneError(
            f"The ground {ground.name!r} is tilted by {math.degrees(tilt_rad):.3g} degrees below "
            "the radar; expected a level one. Name a level object by --ground, such as a plane "
            "at the mean height of waves."
        )
    return ground


def _face_below(item: EvaluatedObject, point: Real) -> tuple[float, int, float] | None:
    """Height, material slot and tilt [rad] of the highest face below a point; None without one."""
    with evaluated_mesh(item.evaluated) as mesh:
        if mesh is None:
            return None
        vertices, triangles = read_triangles(mesh)
        slots = read_numbers(mesh.loop_triangles, "material_index", dtype=np.int32)[:, 0]
    corners = (vertices @ item.matrix[:3, :3].T + item.matrix[:3, 3])[triangles]
    sides = corners[:, 1:] - corners[:, :1]
    normals = np.cross(sides[:, 0], sides[:, 1])
    flat = corners[:, :, :2] - point[:2]
    after = np.roll(flat, -1, axis=1)
    turns = flat[..., 0] * after[..., 1] - flat[..., 1] * after[..., 0]
    inside = (np.all(turns >= 0, axis=1) | np.all(turns <= 0, axis=1)) & (normals[:, 2] != 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.einsum("ij,ij->i", corners[:, 0] - point, normals) / normals[:, 2]
    below = np.flatnonzero(inside & (away < 0))
    if not below.size:
        return None
    top = below[np.argmax(away[below])]
    cosine = abs(normals[top, 2]) / np.linalg.norm(normals[top])
    return float(point[2] + away[top]), int(slots[top]), math.acos(min(1.0, float(cosine)))


def _material(evaluated: Any, slot: int) -> Any:
    slots = evaluated.material_slots
    if not slots:
        return None
    material = slots[min(slot, len(slots) - 1)].material
    return None if material is None else material.original
