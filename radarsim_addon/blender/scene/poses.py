# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of the antennas: poses in metres and float64, and the edges of the receiver's frame.

Edges (left, right, bottom, top) are in the coordinates of `contract.ReceiverRecord`: tangents for a
perspective camera, metres for an orthographic one, radians of longitude and latitude for an
equirectangular one. `frame_edges` reads them from a camera, `aim` sets a camera to them.
"""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ... import contract
from ...errors import SceneError
from ..state import Snapshot
from .rig import Rig, check_scale

#: Smallest near clip distance of Blender [Blender units]. It shortens the first segment of a path.
NEAR_CLIP_UNITS = 1e-6
#: Blender's sensor width for tiles. Its value has no effect.
_SENSOR_MM = 32.0
#: Left, right, bottom, top.
Edges = tuple[float, float, float, float]


def receiver_record(
    rig: Rig, snapshot: Snapshot, metres_per_unit: float, width_px: int, height_px: int
) -> contract.ReceiverRecord:
    """Return the record of the receiver at its moment, for a render of this size.

    `SceneError` if the camera is scaled, its pose is not finite, or its frame is empty.
    """
    camera = snapshot.evaluated(rig.camera)
    check_scale(rig.camera, camera.matrix_world)
    kind = camera_kind(camera.data)
    left, right, bottom, top = frame_edges(camera.data, width_px, height_px, metres_per_unit)
    if not (0 < right - left < math.inf and 0 < top - bottom < math.inf):
        setting = {
            "perspective": f"a focal length of {camera.data.lens:g} mm",
            "orthographic": f"an orthographic scale of {camera.data.ortho_scale:g}",
        }.get(kind, "longitudes or latitudes that do not increase")
        raise SceneError(
            f"Camera {rig.camera.name!r} has {setting}, so its frame is {right - left:g} wide and "
            f"{top - bottom:g} high, and receives no echo. Set Camera > Lens so that both are "
            "finite and above 0."
        )
    return contract.ReceiverRecord(
        kind=kind,
        matrix_world=rigid_pose(camera.matrix_world, metres_per_unit).tolist(),
        left=left,
        right=right,
        bottom=bottom,
        top=top,
        near_clip_m=NEAR_CLIP_UNITS * metres_per_unit,
    )


def transmitter_record(
    rig: Rig, snapshot: Snapshot, metres_per_unit: float
) -> contract.TransmitterRecord:
    """Return the record of the transmitter at its moment.

    `SceneError` if the light is scaled, or its pose or power is not finite.
    """
    emitter = snapshot.evaluated(rig.emitter)
    check_scale(rig.emitter, emitter.matrix_world)
    exposure = float(getattr(emitter.data, "exposure", 0.0))
    eirp_w = float(emitter.data.energy) * 2.0**exposure
    if not math.isfinite(eirp_w):
        raise SceneError(
            f"The transmitter {rig.emitter.name!r} has an EIRP of {eirp_w:g} W, so received powers "
            "are unknown. Set Power of the light to a finite number of watts."
        )
    return contract.TransmitterRecord(
        matrix_world=rigid_pose(emitter.matrix_world, metres_per_unit).tolist(),
        eirp_w=eirp_w,
    )


def rigid_pose(matrix_world: Any, metres_per_unit: float) -> NDArray[np.float64]:
    """Return a matrix of Blender (4, 4) with an exact rotation and the translation in metres.

    float32 axes are orthonormal to 1e-7 only. A polar decomposition gives the nearest rotation.
    """
    matrix = np.array(matrix_world, dtype=np.float64)
    left, _, right = np.linalg.svd(matrix[:3, :3])
    pose = np.eye(4)
    pose[:3, :3] = left @ right
    pose[:3, 3] = matrix[:3, 3] * metres_per_unit
    return pose


def camera_kind(camera: bpy.types.Object) -> str:
    """Return "perspective", "orthographic" or "equirectangular"; `SceneError` for other cameras."""
    if camera.type == "PERSP":
        return "perspective"
    if camera.type == "ORTHO":
        return "orthographic"
    found = _panorama(camera).panorama_type if camera.type == "PANO" else camera.type
    if found == "EQUIRECTANGULAR":
        return "equirectangular"
    raise SceneError(
        f"Camera {camera.name!r} has the projection {found}. radarsim supports perspective, "
        "orthographic and equirectangular cameras as receivers. Set Camera > Lens > Type."
    )


def _panorama(camera: bpy.types.Object) -> Any:
    """Return the owner of the panorama's settings: the camera; up to Blender 4.4 Cycles."""
    return camera if hasattr(camera, "panorama_type") else camera.cycles


def frame_edges(
    camera: bpy.types.Object, width_px: int, height_px: int, metres_per_unit: float
) -> Edges:
    """Return the edges of a camera's frame for a render of this size, from Blender's rules.

    The fitted dimension of the sensor covers sensor / lens (perspective) or the orthographic scale.
    The pixels, which are square, give the other dimension.
    """
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
    fits_width = width_px >= height_px if fit == "AUTO" else fit == "HORIZONTAL"
    if camera.type == "ORTHO":
        size = float(camera.ortho_scale) * metres_per_unit
    else:  # AUTO uses the sensor's width for both dimensions
        sensor = camera.sensor_height if fit == "VERTICAL" else camera.sensor_width
        size = float(sensor) / float(camera.lens)
    fitted_px = width_px if fits_width else height_px
    return _shifted(camera, size, size / 2 * width_px / fitted_px, size / 2 * height_px / fitted_px)


def _shifted(camera: bpy.types.Object, size: float, half_u: float, half_v: float) -> Edges:
    """Return the edges of a frame; lens shift is in units of its fitted dimension."""
    move_u, move_v = float(camera.shift_x) * size, float(camera.shift_y) * size
    return move_u - half_u, move_u + half_u, move_v - half_v, move_v + half_v


def aim(
    camera: bpy.types.Object,
    kind: str,
    edges: Edges,
    across_px: int,
    down_px: int,
    metres_per_unit: float,
) -> Edges:
    """Set a camera that radarsim made to these edges; return those that its float32 settings give.

    Pixels are square except for "equirectangular".
    """
    left, right, bottom, top = edges
    if kind == "equirectangular":
        camera.type = "PANO"
        settings = _panorama(camera)
        settings.panorama_type = "EQUIRECTANGULAR"
        # Blender limits latitudes to the poles, but a grid can begin up to half a pixel beyond. The
        # camera's shift adds that part only: in units of the window it has fewer digits.
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
    return _shifted(camera, size, size / 2, size / 2 * down_px / across_px)
