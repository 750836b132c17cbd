# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of the antennas: poses in metres and float64, and the edges of the receiver's frame."""

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
    """Return a matrix of Blender with an exact rotation and the translation in metres.

    float32 axes are orthonormal to 1e-7 only. A polar decomposition gives the nearest rotation.

    Parameters
    ----------
    matrix_world
        Shape (4, 4), Blender units.
    metres_per_unit
        Metres per Blender unit.

    Returns
    -------
    ndarray
        Shape (4, 4).
    """
    matrix = np.array(matrix_world, dtype=np.float64)
    left, _, right = np.linalg.svd(matrix[:3, :3])
    pose = np.eye(4)
    pose[:3, :3] = left @ right
    pose[:3, 3] = matrix[:3, 3] * metres_per_unit
    return pose


def receiver_record(
    rig: Rig, depsgraph: Any, metres_per_unit: float, width_px: int, height_px: int
) -> contract.ReceiverRecord:
    """Return the record of the receiver at the depsgraph's time.

    Parameters
    ----------
    rig
        Antennas.
    depsgraph : bpy.types.Depsgraph
        Up to date.
    metres_per_unit
        Metres per Blender unit.
    width_px, height_px
        Size of the render.

    Returns
    -------
    contract.ReceiverRecord
        Pose and near clip distance in metres.

    Raises
    ------
    SceneError
        The camera is scaled, its pose is not finite, or its frame is empty.
    """
    camera = rig.camera.evaluated_get(depsgraph)
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
    rig: Rig, depsgraph: Any, metres_per_unit: float
) -> contract.TransmitterRecord:
    """Return the record of the transmitter at the depsgraph's time.

    Parameters
    ----------
    rig
        Antennas.
    depsgraph : bpy.types.Depsgraph
        Up to date.
    metres_per_unit
        Metres per Blender unit.

    Returns
    -------
    contract.TransmitterRecord
        Pose in metres, EIRP in watts.

    Raises
    ------
    SceneError
        The light is scaled, or its pose or power is not finite.
    """
    emitter = rig.emitter.evaluated_get(depsgraph)
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
