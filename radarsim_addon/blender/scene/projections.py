# SPDX-License-Identifier: GPL-3.0-or-later
"""Aiming a camera of any kind at a part of the field of view, and reading back what it sees.

Edges are in the coordinates of `contract.ReceiverRecord`: tangents for a perspective camera, metres
for an orthographic one, radians of longitude and latitude for an equirectangular one.
"""

from __future__ import annotations

import math
from typing import Any

from ...errors import SceneError

#: Blender's sensor width that is used for the views; any would do.
_SENSOR_MM = 32.0

Edges = tuple[float, float, float, float]


def camera_kind(camera: Any) -> str:
    """Kind of a camera as the records name it.

    Parameters
    ----------
    camera : bpy.types.Camera

    Raises
    ------
    SceneError
        A panorama of another projection than the equirectangular one, or a kind of its own.
    """
    if camera.type == "PERSP":
        return "perspective"
    if camera.type == "ORTHO":
        return "orthographic"
    if camera.type == "PANO" and _panorama(camera).panorama_type == "EQUIRECTANGULAR":
        return "equirectangular"
    found = _panorama(camera).panorama_type if camera.type == "PANO" else camera.type
    raise SceneError(
        f"Camera {camera.name!r} projects as {found}; the receiver is perspective, orthographic or "
        "an equirectangular panorama. Set Camera > Lens > Type."
    )


def _panorama(camera: Any) -> Any:
    """Where the panorama's settings are: on the camera from Blender 4.5 on, before in Cycles'."""
    return camera if hasattr(camera, "panorama_type") else camera.cycles


def frame_edges(camera: Any, width_px: int, height_px: int, metres_per_unit: float) -> Edges:
    """Left, right, bottom and top edge of an orthographic or equirectangular camera's frame."""
    if camera.type == "PANO":
        settings = _panorama(camera)
        across = float(settings.longitude_max) - float(settings.longitude_min)
        down = float(settings.latitude_max) - float(settings.latitude_min)
        move_u, move_v = float(camera.shift_x) * across, float(camera.shift_y) * down
        return (
            float(settings.longitude_min) + move_u,
            float(settings.longitude_max) + move_u,
            float(settings.latitude_min) + move_v,
            float(settings.latitude_max) + move_v,
        )
    fit = camera.sensor_fit
    if fit == "AUTO":
        fit = "HORIZONTAL" if width_px >= height_px else "VERTICAL"
    size = float(camera.ortho_scale) * metres_per_unit
    fitted_px = width_px if fit == "HORIZONTAL" else height_px
    half_u, half_v = size / 2 * width_px / fitted_px, size / 2 * height_px / fitted_px
    move_u, move_v = float(camera.shift_x) * size, float(camera.shift_y) * size
    return move_u - half_u, move_u + half_u, move_v - half_v, move_v + half_v


def aim(
    camera: Any, kind: str, edges: Edges, across_px: int, down_px: int, metres_per_unit: float
) -> Edges:
    """Make a camera see these edges; returns the edges that its float32 settings really give.

    Parameters
    ----------
    camera : bpy.types.Camera
        Camera of our own; its pixels are square but for the equirectangular kind.
    kind
        As `camera_kind` names it.
    edges
        Left, right, bottom, top.
    across_px, down_px
        Size of the render.
    metres_per_unit
        Scale, for the orthographic kind.
    """
    left, right, bottom, top = edges
    if kind == "equirectangular":
        camera.type = "PANO"
        settings = _panorama(camera)
        settings.panorama_type = "EQUIRECTANGULAR"
        # Latitudes end at the poles, and a grid may begin up to half a pixel beyond. The camera's
        # shift does that; all of it would cost digits, as it is in units of the window.
        beyond = max(top - math.pi / 2, 0.0) or min(bottom + math.pi / 2, 0.0)
        camera.shift_x, camera.shift_y = 0.0, beyond / (top - bottom)
        settings.longitude_min, settings.longitude_max = left, right
        settings.latitude_min, settings.latitude_max = bottom - beyond, top - beyond
        return frame_edges(camera, across_px, down_px, metres_per_unit)
    width = right - left
    camera.sensor_fit = "HORIZONTAL"
    camera.shift_x = (left + right) / 2 / width
    camera.shift_y = (bottom + top) / 2 / width
    if kind == "orthographic":
        camera.type = "ORTHO"
        camera.ortho_scale = width / metres_per_unit
        return frame_edges(camera, across_px, down_px, metres_per_unit)
    camera.type = "PERSP"
    camera.sensor_width = _SENSOR_MM
    camera.lens = _SENSOR_MM / width
    size = float(camera.sensor_width) / float(camera.lens)
    half_u, half_v = size / 2, size / 2 * down_px / across_px
    move_u, move_v = float(camera.shift_x) * size, float(camera.shift_y) * size
    return move_u - half_u, move_u + half_u, move_v - half_v, move_v + half_v


#: Least near clip plane that Blender takes, in Blender units; it shortens each first segment.
NEAR_CLIP_UNITS = 1e-6
