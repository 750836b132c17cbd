# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways from the transmitter to points that pass something that delays waves.

A point that is seen directly may still be lit through a wall or a pane. Range encoding shows a
delay down to its noise; only geometry shows that there is a smaller one.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Mask, Real
from ...contract import ReceiverRecord, TransmitterRecord
from ...signal.scene import RayMesh, RayScene
from ..materials import SURFACE_TYPES, surfaces_of
from ..state import Snapshot

#: Part of a way next to the point that is the surface itself.
_ITSELF = 1e-5


class DelayedWays:
    """Surfaces that delay waves, at one moment, seen from the transmitter.

    `snapshot` has the objects and instances of that moment; Blender has evaluated nothing since.
    """

    def __init__(self, snapshot: Snapshot, transmitter_m: Real, metres_per_unit: float) -> None:
        self._transmitter_m = transmitter_m
        meshes: dict[int, RayMesh] = {}
        surfaces = surfaces_of(snapshot)
        for number, shape in enumerate(snapshot.shapes):
            if shape.original.hide_render or shape.original.type not in SURFACE_TYPES:
                continue
            if not any(one.delays for one in surfaces.of(shape.materials)):
                continue
            mesh = snapshot.mesh(shape)
            if mesh is not None:
                meshes[number] = mesh.rays
        shapes = snapshot.layout.shape
        rows = np.flatnonzero(np.isin(shapes, list(meshes)) & snapshot.layout.visible)
        poses_m = snapshot.matrices_of(rows) * np.array([[metres_per_unit]] * 3 + [[1.0]])
        boxes = np.array([meshes[number].box for number in shapes[rows].tolist()])
        self._rays = RayScene(poses_m, boxes.reshape(-1, 2, 3), shapes[rows], meshes.get)

    def to(self, points_m: Real) -> Mask:
        """Return whether an object delays the wave from the transmitter to each point (n, 3)."""
        ways_m = points_m - self._transmitter_m
        # the end of each way is the surface itself
        return self._rays.blocked(self._transmitter_m, self._transmitter_m + (1 - _ITSELF) * ways_m)


def ways_to_transmitter(
    snapshot: Snapshot,
    receiver: ReceiverRecord,
    transmitter: TransmitterRecord,
    reach_m: float,
    metres_per_unit: float,
) -> DelayedWays | None:
    """Return the object that finds delays between the transmitter and points.

    None if both antennas are in one place: then the receiver already sees the same delays.
    """
    poses = np.array([one.matrix_world for one in (receiver, transmitter)], dtype=np.float64)
    receiver_m, transmitter_m = poses[:, :3, 3]
    together = float(np.linalg.norm(transmitter_m - receiver_m)) <= 1e-6 * reach_m
    if together and receiver.kind != "orthographic":
        return None
    return DelayedWays(snapshot, transmitter_m, metres_per_unit)
