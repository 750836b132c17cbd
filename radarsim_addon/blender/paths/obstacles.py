# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies between two points of a scene, for the parts of paths that Cycles does not trace.

`Obstacles` finds what is on ways to and from mirrors. `DelayedWays` finds ways from the transmitter
to points that pass something that delays waves. A point that is seen directly may still be lit
through a wall or a pane. Range encoding shows a delay down to its noise; only geometry shows that
there is a smaller one.
"""

from __future__ import annotations

from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from ...arrays import Indices, Mask, Real, crosses, norms
from ...contract import ReceiverRecord, TransmitterRecord
from ...signal.scene import Mesh, RayMesh, RayScene
from ..materials import SURFACE_TYPES, surfaces_of
from ..motion import Bodies
from ..state import Shape, Snapshot

#: Both ends of a way stay clear of surfaces by this part of the path's length, and by so much [m].
_CLEAR, _CLEAR_M = 4e-6, 1e-6
#: Vertices times triangles up to which it is found out whether a mesh is convex.
_MOST_CONVEX = 1 << 24
#: Part of a way next to the point that is the surface itself.
_ITSELF = 1e-5


class BodyMesh:
    """Triangles of a shape in its own axes [m], with the number of each one's material slot."""

    def __init__(self, mesh: Mesh, metres_per_unit: float) -> None:
        self.vertices_m, self.triangles = mesh.vertices * metres_per_unit, mesh.triangles
        self.slots, normals = mesh.slots[mesh.polygons], mesh.triangle_normals
        corners = self.vertices_m[self.triangles]
        across = crosses(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = norms(across)
        #: Unit normals by the order of corners, NaN without area, areas [m^2], and whether the
        #: surface is shaded as curved.
        with np.errstate(invalid="ignore", divide="ignore"):
            self.normals, self.areas_m2 = across / size[:, None], size / 2
            turned = np.einsum("tci,ti->tc", normals, self.normals)
            self.curved = ~(np.abs(turned).min(axis=1, initial=1.0) > 1 - 1e-6)
        #: Normals at the corners of triangles, (k, 3, 3); None where nothing is curved.
        self.corner_normals = normals if self.curved.any() else None
        self.closed = mesh.is_closed

    @cached_property
    def convex(self) -> bool:
        """Whether no straight way that leaves the mesh on its outer side meets it again."""
        if len(self.vertices_m) * len(self.triangles) > _MOST_CONVEX:
            return False
        reach_m = float(np.ptp(self.vertices_m, axis=0).max(initial=0.0))
        for corner, normal in zip(self.vertices_m[self.triangles[:, 0]], self.normals, strict=True):
            away_m = (self.vertices_m - corner) @ normal
            flat = np.abs(away_m).max() <= 1e-6 * reach_m
            if not (flat or (self.closed and away_m.max() <= 1e-6 * reach_m)):
                return False
        return True

    @cached_property
    def rays(self) -> RayMesh:
        """The mesh for rays, in its own axes [m]."""
        return RayMesh(self.vertices_m, self.triangles)


class Obstacles:
    """All bodies of a scene at one moment, and what lies on straight ways between points.

    Blender must evaluate nothing else while `bodies` are used. `meshes` were read before; more are
    added.
    """

    def __init__(
        self,
        bodies: Bodies,
        metres_per_unit: float,
        meshes: WeakKeyDictionary[Shape, BodyMesh | None],
    ) -> None:
        self.bodies, self._units, self._meshes = bodies, metres_per_unit, meshes
        shapes = bodies.snapshot.shapes
        surfaces = surfaces_of(bodies.snapshot)
        opens = [
            any(one.is_radar and not one.is_opaque for one in surfaces.of(shape.materials))
            for shape in shapes
        ]
        self._open = np.array(opens, dtype=bool)[bodies.shape]

    def mesh(self, body: int) -> BodyMesh | None:
        """Return the mesh of a body by its index; None without one."""
        return self._mesh(int(self.bodies.shape[body]))

    def _mesh(self, number: int) -> BodyMesh | None:
        snapshot = self.bodies.snapshot
        shape = snapshot.shapes[number]
        if shape not in self._meshes:
            mesh = snapshot.mesh(shape)
            found = None if mesh is None or not len(mesh.sides) else BodyMesh(mesh, self._units)
            self._meshes[shape] = found
        return self._meshes[shape]

    def block(self, start_m: Real, end_m: Real, own: Indices) -> tuple[Mask, Mask]:
        """Find what lies on ways, both ends left out.

        `own` is the number of the body that each way starts on, on its outer side, from 1; 0: none
        that is known. Returns whether something opaque lies there, and whether only something open
        does, (n,) each.
        """
        if not len(start_m):  # of many bodies, the tree of their boxes takes a tenth of a second
            return np.zeros(0, dtype=bool), np.zeros(0, dtype=bool)
        way_m = end_m - start_m
        clear = np.maximum(_CLEAR, _CLEAR_M / np.maximum(norms(way_m), _CLEAR_M))[:, None]
        start_m, end_m = start_m + clear * way_m, end_m - clear * way_m
        leaving = np.full(len(own), -1)
        for body in np.unique(own[own > 0] - 1).tolist():
            mesh = self.mesh(body)
            if mesh is not None and mesh.convex:
                leaving[own == body + 1] = body
        opaque = self._rays.blocked(start_m, end_m, ~self._open, leaving)
        passed, left = np.zeros_like(opaque), ~opaque
        passed[left] = self._rays.blocked(start_m[left], end_m[left], self._open, leaving[left])
        return opaque, passed

    @cached_property
    def _rays(self) -> RayScene:
        def mesh(number: int) -> RayMesh | None:
            found = self._mesh(number)
            return None if found is None else found.rays

        return RayScene(self.bodies.pose, self.bodies.box, self.bodies.shape, mesh)


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
        """Whether something delays the way from the transmitter to each point (n, 3)."""
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
    """Return the ways to the transmitter; None if they are those that the receiver sees."""
    poses = np.array([one.matrix_world for one in (receiver, transmitter)], dtype=np.float64)
    receiver_m, transmitter_m = poses[:, :3, 3]
    together = float(np.linalg.norm(transmitter_m - receiver_m)) <= 1e-6 * reach_m
    if together and receiver.kind != "orthographic":
        return None
    return DelayedWays(snapshot, transmitter_m, metres_per_unit)
