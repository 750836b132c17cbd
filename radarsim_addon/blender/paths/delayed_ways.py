# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways from points to the transmitter, and which of them pass something that delays waves.

What is seen directly may still be lit through a wall or a pane. Range encoding tells of a delay
down to its noise; of a smaller one only geometry tells that it is there.
"""

from __future__ import annotations

import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ...array_types import Mask, Real
from ...contract import ReceiverRecord, TransmitterRecord
from ...vectors import norms
from ..materials import SURFACE_TYPES, delays
from ..state import Snapshot, read_triangles

#: What lies nearer to a point than this is the surface itself, relative to the way.
_ITSELF = 1e-5
#: Triangles of which a tree is made, at most. With more, all ways count as delayed.
_MOST_TRIANGLES = 500_000
#: Distance of the antennas, relative to the scene's reach, up to which both ways are one.
_ONE_PLACE = 1e-6


class DelayedWays:
    """Surfaces that delay what passes them, at one moment, seen from the transmitter.

    Parameters
    ----------
    snapshot
        Objects and instances at that moment; Blender has evaluated nothing since.
    transmitter_m
        Its place, (3,).
    metres_per_unit
        Length of a Blender unit [m].
    """

    def __init__(self, snapshot: Snapshot, transmitter_m: Real, metres_per_unit: float) -> None:
        self._transmitter_m = transmitter_m
        vertices, triangles, count, total = [np.empty((0, 3))], [np.empty((0, 3), int)], 0, 0
        rows_of = snapshot.layout.shape
        for number, shape in enumerate(snapshot.shapes):
            if shape.original.hide_render or shape.original.type not in SURFACE_TYPES:
                continue
            if not any(map(delays, shape.materials)):
                continue
            with snapshot.mesh(shape) as mesh:
                if mesh is None:
                    continue
                own, corners = read_triangles(mesh)
            rows = np.flatnonzero((rows_of == number) & snapshot.layout.visible)
            total += len(corners) * len(rows)
            if total > _MOST_TRIANGLES or not len(corners):
                continue
            for matrix in snapshot.matrices_of(rows):
                # about the transmitter: the tree is in float32
                here_m = (own @ matrix[:3, :3].T + matrix[:3, 3]) * metres_per_unit
                vertices.append(here_m - transmitter_m)
                triangles.append(corners + count)
                count += len(own)
        self._too_many = total > _MOST_TRIANGLES
        points_m = np.concatenate(vertices)
        self._low_m = points_m.min(axis=0, initial=np.inf)
        self._high_m = points_m.max(axis=0, initial=-np.inf)
        self._tree = BVHTree.FromPolygons(points_m.tolist(), np.concatenate(triangles).tolist())

    def to(self, points_m: Real) -> Mask:
        """Whether something delays the way from the transmitter to each point (n, 3)."""
        if self._too_many:
            return np.ones(len(points_m), dtype=bool)
        found = np.zeros(len(points_m), dtype=bool)
        if not np.all(self._low_m <= self._high_m):  # nothing delays
            return found
        ways_m = points_m - self._transmitter_m
        with np.errstate(invalid="ignore"):
            meets = np.maximum(ways_m, 0) >= self._low_m
            meets &= np.minimum(ways_m, 0) <= self._high_m
        tried = np.flatnonzero(meets.all(axis=1))
        lengths_m = norms(ways_m[tried]) * (1 - _ITSELF)
        start, cast = Vector((0.0, 0.0, 0.0)), self._tree.ray_cast
        ways = zip(ways_m[tried].tolist(), lengths_m.tolist(), strict=True)
        found[tried] = [cast(start, way, length_m)[0] is not None for way, length_m in ways]
        return found


def ways_to_transmitter(
    snapshot: Snapshot,
    receiver: ReceiverRecord,
    transmitter: TransmitterRecord,
    reach_m: float,
    metres_per_unit: float,
) -> DelayedWays | None:
    """Return the ways to the transmitter; None where they are those that the receiver sees."""
    poses = np.array([one.matrix_world for one in (receiver, transmitter)], dtype=np.float64)
    receiver_m, transmitter_m = poses[:, :3, 3]
    together = float(np.linalg.norm(transmitter_m - receiver_m)) <= _ONE_PLACE * reach_m
    if together and receiver.kind != "orthographic":
        return None
    return DelayedWays(snapshot, transmitter_m, metres_per_unit)
