# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a new radar goes: to the user's view, looking at the selected objects."""

from __future__ import annotations

from typing import Any

from mathutils import Euler, Vector

from ..materials import SURFACE_TYPES

#: Distance from the centre of a scene, over its radius, at which the scene fills the new camera.
_AWAY = 3.0


def radar_pose(context: Any) -> tuple[Vector, Euler] | None:
    """Return location and rotation of a new radar that looks at the selected objects.

    It is at the eye of the 3D view, or, where that is inside an object, outside the scene. Without
    a selection it looks at all objects; None in a scene without surfaces.
    """
    surfaces = [
        item
        for item in context.scene.objects
        if item.type in SURFACE_TYPES and not item.hide_render
    ]
    if not surfaces:
        return None
    centre, radius = _sphere(surfaces)
    target, _ = _sphere([item for item in surfaces if item.select_get()] or surfaces)
    view = getattr(context.space_data, "region_3d", None)
    backwards = Vector((0.0, -1.0, 0.0))
    if view is not None:
        backwards = view.view_rotation @ Vector((0.0, 0.0, 1.0))
        eye = view.view_matrix.inverted().translation
        if view.view_perspective != "ORTHO" and not _within(eye, surfaces) and eye != target:
            return eye, _looking(target - eye)
    place = centre + backwards * max(_AWAY * radius, 1.0)
    return place, _looking(target - place)


def _sphere(items: list[Any]) -> tuple[Vector, float]:
    """Centre and radius of the box around objects."""
    corners = [item.matrix_world @ Vector(corner) for item in items for corner in item.bound_box]
    low = Vector(tuple(map(min, *corners)))
    high = Vector(tuple(map(max, *corners)))
    return (low + high) / 2, (high - low).length / 2


def _within(place: Vector, items: list[Any]) -> bool:
    """Whether a place is inside the box of an object."""
    for item in items:
        local = item.matrix_world.inverted_safe() @ place
        sides = zip(*item.bound_box, strict=True)
        if all(min(side) <= x <= max(side) for side, x in zip(sides, local, strict=True)):
            return True
    return False


def _looking(direction: Vector) -> Euler:
    """Rotation of an empty whose -Z points along a direction, +Y up."""
    return direction.to_track_quat("-Z", "Y").to_euler()
