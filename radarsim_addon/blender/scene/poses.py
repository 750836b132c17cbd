# SPDX-License-Identifier: GPL-3.0-or-later
"""Antennas as the sidecars record them: poses in metres and float64, the frustum in closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import contract
from ...errors import SceneError
from .projections import NEAR_CLIP_UNITS, camera_kind, frame_edges
from .rig import Rig, check_scale


def rigid_pose(matrix_world: Any, metres_per_unit: float) -> NDArray[np.float64]:
    """Pose, shape (4, 4): Blender's matrix with exact rotation and the translation in metres.

    float32 leaves the axes orthonormal to 1e-7 only; the polar decomposition takes the nearest
    rotation.
    """
    matrix = np.array(matrix_world, dtype=np.float64)
    left, _, right = np.linalg.svd(matrix[:3, :3])
    pose = np.eye(4)
    pose[:3, :3] = left @ right
    pose[:3, 3] = matrix[:3, 3] * metres_per_unit
    return pose


def frustum(camera: Any, width_px: int, height_px: int) -> tuple[float, float, float, float]:
    """Tangents of the frame's left, right, bottom and top edge.

    Blender's rule: the sensor's fitted dimension sees sensor / lens, the other one follows from the
    pixels (which are square), and lens shift is in units of the fitted dimension.

    Parameters
    ----------
    camera : bpy.types.Camera
        A perspective camera.
    width_px, height_px
        Size of the render.
    """
    fit = camera.sensor_fit
    if fit == "AUTO":
        fit = "HORIZONTAL" if width_px >= height_px else "VERTICAL"
        sensor = camera.sensor_width  # AUTO takes the width for either side
    else:
        sensor = camera.sensor_width if fit == "HORIZONTAL" else camera.sensor_height
    fitted_px = width_px if fit == "HORIZONTAL" else height_px
    size = float(sensor) / float(camera.lens)
    half_u = 0.5 * size * width_px / fitted_px
    half_v = 0.5 * size * height_px / fitted_px
    shift_u = float(camera.shift_x) * size
    shift_v = float(camera.shift_y) * size
    return shift_u - half_u, shift_u + half_u, shift_v - half_v, shift_v + half_v


def receiver_record(
    rig: Rig, depsgraph: Any, metres_per_unit: float, width_px: int, height_px: int
) -> contract.ReceiverRecord:
    """Receiver as it is at the depsgraph's time.

    Raises
    ------
    SceneError
        The camera is scaled, its place is not finite, or it sees nothing.
    """
    camera = rig.camera.evaluated_get(depsgraph)
    check_scale(rig.camera, camera.matrix_world)
    kind = camera_kind(camera.data)
    if kind == "perspective":
        left, right, bottom, top = frustum(camera.data, width_px, height_px)
    else:
        left, right, bottom, top = frame_edges(camera.data, width_px, height_px, metres_per_unit)
    if not (0 < right - left < math.inf and 0 < top - bottom < math.inf):
        setting = {
            "perspective": f"a focal length of {camera.data.lens:g} mm",
            "orthographic": f"an orthographic scale of {camera.data.ortho_scale:g}",
        }.get(kind, "longitudes or latitudes that end where they begin, or before")
        raise SceneError(
            f"Camera {rig.camera.name!r} has {setting}, so that its frame is {right - left:g} wide "
            f"and {top - bottom:g} high; expected more than 0, and an end. Set Camera > Lens."
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
    rig: Rig, depsgraph: Any, metres_per_unit: float
) -> contract.TransmitterRecord:
    """Transmitter as it is at the depsgraph's time.

    Raises
    ------
    SceneError
        The lamp is scaled, its place is not finite, or its power is not.
    """
    emitter = rig.emitter.evaluated_get(depsgraph)
    check_scale(rig.emitter, emitter.matrix_world)
    exposure = float(getattr(emitter.data, "exposure", 0.0))
    eirp_w = float(emitter.data.energy) * 2.0**exposure
    if not math.isfinite(eirp_w):
        raise SceneError(
            f"The emitter {rig.emitter.name!r} has a power of {eirp_w:g} W; expected a number. Set "
            "EIRP in Radar > Rig."
        )
    return contract.TransmitterRecord(
        matrix_world=rigid_pose(emitter.matrix_world, metres_per_unit).tolist(),
        eirp_w=eirp_w,
    )
