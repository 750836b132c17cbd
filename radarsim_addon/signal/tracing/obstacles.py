# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of bodies, and what lies on straight ways between points of a scene."""

from __future__ import annotations

from collections.abc import MutableMapping
from functools import cached_property

import numpy as np

from ...arrays import Mask, Real, crosses, norms
from ..scene import Mesh, RayMesh, RayScene, SceneModel

#: Both ends of a way stay clear of surfaces by this part of the path's length, and by so much [m].
_CLEAR, _CLEAR_M = 4e-6, 1e-6


class BodyMesh:
    """Triangles of a mesh in its own axes [m], with the number of each one's material slot."""

    def __init__(self, mesh: Mesh, metres_per_unit: float) -> None:
        self.vertices_m, self.triangles = mesh.vertices * metres_per_unit, mesh.triangles
        self.slots, normals = mesh.slots[mesh.polygons], mesh.triangle_normals
        self.closed = mesh.is_closed
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

    @cached_property
    def rays(self) -> RayMesh:
        """The mesh for rays, in its own axes [m]."""
        return RayMesh(self.vertices_m, self.triangles)


class Obstacles:
    """All bodies of a scene, and what lies on straight ways between points.

    `known` has what was made of meshes before; more is added.
    """

    def __init__(self, model: SceneModel, known: MutableMapping[Mesh, BodyMesh]) -> None:
        self.model, self._known = model, known

    def mesh(self, body: int) -> BodyMesh | None:
        """Return the mesh of a body by its index; None without faces."""
        return self._mesh(int(self.model.shape[body]))

    def _mesh(self, number: int) -> BodyMesh | None:
        mesh = self.model.meshes[number]
        if mesh is None or not len(mesh.sides):
            return None
        if mesh not in self._known:
            self._known[mesh] = BodyMesh(mesh, self.model.metres_per_unit)
        return self._known[mesh]

    def block(self, start_m: Real, end_m: Real) -> tuple[Mask, Mask]:
        """Return whether something opaque is on each way, and whether only something open is, (n,)
        each.

        Both ends of a way do not count.
        """
        opaque = self.opaque_between(start_m, end_m)
        left, passed = np.flatnonzero(~opaque), np.zeros(len(opaque), dtype=bool)
        passed[left] = self._between(start_m[left], end_m[left], self.model.is_open)
        return opaque, passed

    def opaque_between(self, start_m: Real, end_m: Real) -> Mask:
        """Return whether something opaque is on each way, (n,). Both ends do not count."""
        return self._between(start_m, end_m, ~self.model.is_open)

    def _between(self, start_m: Real, end_m: Real, among: Mask) -> Mask:
        way_m = end_m - start_m
        clear = np.maximum(_CLEAR, _CLEAR_M / np.maximum(norms(way_m), _CLEAR_M))[:, None]
        if not len(way_m):  # of many bodies, the tree of their boxes takes a tenth of a second
            return np.zeros(0, dtype=bool)
        return self._rays.blocked(start_m + clear * way_m, end_m - clear * way_m, among)

    @cached_property
    def _rays(self) -> RayScene:
        def mesh(number: int) -> RayMesh | None:
            found = self._mesh(number)
            return None if found is None else found.rays

        return RayScene(self.model.pose, self.model.box, self.model.shape, mesh)
