# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies between two points of a scene, for the parts of paths that Cycles does not trace.

`Obstacles` finds what is on ways to and from mirrors, body by body: boxes first, then a tree of the
triangles. `DelayedWays` finds ways from the transmitter to points that pass something that delays
waves. A point that is seen directly may still be lit through a wall or a pane. Range encoding shows
a delay down to its noise; only geometry shows that there is a smaller one.
"""

from __future__ import annotations

from functools import cache, cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ...arrays import Indices, Mask, Real, crosses, norms
from ...contract import ReceiverRecord, TransmitterRecord
from ..materials import SURFACE_TYPES, delays
from ..motion import Bodies
from ..nodes import is_radar_material
from ..nodes.materials import lets_nothing_through
from ..state import Shape, Snapshot, read_numbers, read_triangles

#: Both ends of a way stay clear of surfaces by this part of the path's length, and by so much [m].
_CLEAR, _CLEAR_M = 4e-6, 1e-6
#: Vertices times triangles up to which it is found out whether a mesh is convex.
_MOST_CONVEX = 1 << 24
#: Part of a way next to the point that is the surface itself.
_ITSELF = 1e-5
#: Triangles of which a tree is made, at most. With more, all ways count as delayed.
_MOST_TRIANGLES = 500_000


class BodyMesh:
    """Triangles of a shape in its own axes [m], with the number of each one's material slot."""

    def __init__(self, mesh: Any, metres_per_unit: float) -> None:
        vertices, self.triangles = read_triangles(mesh)
        self.vertices_m = vertices.astype(np.float64) * metres_per_unit
        faces = mesh.loop_triangles
        self.slots = read_numbers(faces, "material_index", dtype=np.int32)[:, 0]
        normals = read_numbers(faces, "split_normals", 9).reshape(-1, 3, 3)
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
        edges = read_numbers(mesh.loops, "edge_index", dtype=np.int32).ravel()
        self.closed = bool(np.all(np.bincount(edges, minlength=len(mesh.edges)) == 2))

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
    def _tree(self) -> Any:
        return BVHTree.FromPolygons(self.vertices_m.tolist(), self.triangles.tolist())

    def meets(self, start_m: Real, end_m: Real) -> Mask:
        """Whether ways (n, 3) in the shape's own axes meet the mesh, (n,)."""
        cast = self._tree.ray_cast
        ways_m = end_m - start_m
        return np.array(
            [
                cast(start, way, length)[0] is not None
                for start, way, length in zip(
                    start_m.tolist(), ways_m.tolist(), norms(ways_m).tolist(), strict=True
                )
            ],
            dtype=bool,
        )


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
        lets_through = cache(lambda m: is_radar_material(m) and not lets_nothing_through(m))
        opens = [any(map(lets_through, shape.materials)) for shape in shapes]
        self._open = np.array(opens, dtype=bool)[bodies.shape]

    @cached_property
    def _around_m(self) -> tuple[Real, Real]:
        """Lowest and highest corners of boxes along the world's axes around the bodies, (n, 3)."""
        bodies = self.bodies
        low, high = bodies.box[:, 0], bodies.box[:, 1]
        reach = np.abs(bodies.pose[:, :3, :3]) @ ((high - low) / 2)[:, :, None]
        middle = np.einsum("nij,nj->ni", bodies.pose[:, :3, :3], (high + low) / 2)
        middle += bodies.pose[:, :3, 3]
        return middle - reach[:, :, 0], middle + reach[:, :, 0]

    def mesh(self, body: int) -> BodyMesh | None:
        """Return the mesh of a body by its index; None without one."""
        snapshot = self.bodies.snapshot
        shape = snapshot.shapes[int(self.bodies.shape[body])]
        if shape not in self._meshes:
            with snapshot.mesh(shape) as mesh:
                usable = mesh is not None and len(mesh.polygons) > 0
                self._meshes[shape] = BodyMesh(mesh, self._units) if usable else None
        return self._meshes[shape]

    def block(self, start_m: Real, end_m: Real, own: Indices) -> tuple[Mask, Mask]:
        """Find what lies on ways, both ends left out.

        `own` is the number of the body that each way starts on, on its outer side, from 1; 0: none
        that is known. Returns whether something opaque lies there, and whether only something open
        does, (n,) each.
        """
        way_m = end_m - start_m
        clear = np.maximum(_CLEAR, _CLEAR_M / np.maximum(norms(way_m), _CLEAR_M))[:, None]
        start_m, end_m = start_m + clear * way_m, end_m - clear * way_m
        opaque = np.zeros(len(start_m), dtype=bool)
        passed = opaque.copy()
        low_m, high_m = np.minimum(start_m, end_m), np.maximum(start_m, end_m)
        if not len(start_m):
            return opaque, passed
        lowest_m, highest_m = self._around_m
        near = np.all(lowest_m <= high_m.max(axis=0), axis=1)
        near &= np.all(highest_m >= low_m.min(axis=0), axis=1)
        for body in np.flatnonzero(near).tolist():
            left = ~opaque & np.all(low_m <= highest_m[body], axis=1)
            left &= np.all(high_m >= lowest_m[body], axis=1)
            mesh = self.mesh(body) if left.any() else None
            if mesh is None:
                continue
            if mesh.convex:
                left &= own != body + 1
            ways = np.flatnonzero(left)
            if not ways.size:
                continue
            hit = self._meets(body, mesh, start_m[ways], end_m[ways])
            (passed if self._open[body] else opaque)[ways[hit]] = True
        return opaque, passed & ~opaque

    def _meets(self, body: int, mesh: BodyMesh, start_m: Real, end_m: Real) -> Mask:
        pose = self.bodies.pose[body]
        if np.linalg.det(pose) == 0:
            return np.zeros(len(start_m), dtype=bool)
        turn = np.linalg.inv(pose[:3, :3])
        own = [(point - pose[:3, 3]) @ turn.T for point in (start_m, end_m)]
        inside = _crosses_box(*own, *self.bodies.box[body])
        hit = np.zeros(len(start_m), dtype=bool)
        hit[inside] = mesh.meets(own[0][inside], own[1][inside])
        return hit


def _crosses_box(start: Real, end: Real, low: Real, high: Real) -> Indices:
    """Numbers of the ways (n, 3) that cross a box, with some room for rounding."""
    room = 1e-6 * (np.abs(low).max() + np.abs(high).max()) + 1e-12
    way = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        into, out = (low - room - start) / way, (high + room - start) / way
    first, last = np.fmin(into, out), np.fmax(into, out)
    outside = (way == 0) & ((start < low - room) | (start > high + room))
    first, last = np.nan_to_num(first, nan=-np.inf), np.nan_to_num(last, nan=np.inf)
    enters, leaves = np.maximum(first.max(axis=1), 0.0), np.minimum(last.min(axis=1), 1.0)
    return np.flatnonzero((enters <= leaves) & ~outside.any(axis=1))


class DelayedWays:
    """Surfaces that delay waves, at one moment, seen from the transmitter.

    `snapshot` has the objects and instances of that moment; Blender has evaluated nothing since.
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
    """Return the ways to the transmitter; None if they are those that the receiver sees."""
    poses = np.array([one.matrix_world for one in (receiver, transmitter)], dtype=np.float64)
    receiver_m, transmitter_m = poses[:, :3, 3]
    together = float(np.linalg.norm(transmitter_m - receiver_m)) <= 1e-6 * reach_m
    if together and receiver.kind != "orthographic":
        return None
    return DelayedWays(snapshot, transmitter_m, metres_per_unit)
