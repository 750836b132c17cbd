# SPDX-License-Identifier: GPL-3.0-or-later
"""A polygon mesh in its own axes, read once; what follows from it is computed once.

Polygons have any number of sides. Their corners are numbered one polygon after another: a corner
has a vertex, and the edge from there to the next corner. Polygons are cut into triangles by the
program that made the mesh, in order; a polygon of n sides has n - 2 of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Indices, Int32, Real, crosses, dots, norms
from .rays import RayMesh


@dataclass(eq=False)
class Mesh:
    """v vertices, p polygons with c corners, and the m triangles into which these are cut.

    Lengths are in any one unit. Objects and instances of the same shape share a mesh.
    """

    #: (v, 3).
    vertices: Real
    #: First corner of each polygon, (p,).
    first_corners: Int32
    #: Vertex of each corner, and edge to the next one, (c,).
    corner_vertices: Int32
    corner_edges: Int32
    #: Material slots of the polygons, (p,).
    slots: Int32
    #: Normals of shading at the corners, (c, 3); None where they are those of the polygons.
    corner_normals: Real | None = None
    #: Corners of the triangles, (m, 3); None where no polygon has more than four sides.
    cut: Int32 | None = None

    @cached_property
    def sides(self) -> Indices:
        """Number of sides of each polygon, (p,)."""
        return np.diff(self.first_corners, append=len(self.corner_vertices)).astype(np.intp)

    @cached_property
    def triangle_corners(self) -> Int32:
        """Corners of the triangles, (m, 3)."""
        if self.cut is not None:
            return self.cut
        return _cut_quads(self.vertices, self.first_corners, self.corner_vertices)

    @cached_property
    def triangles(self) -> Int32:
        """Vertices of the triangles, (m, 3)."""
        return np.asarray(self.corner_vertices[self.triangle_corners])

    @cached_property
    def polygons(self) -> Indices:
        """Polygon of each triangle, (m,)."""
        return np.repeat(np.arange(len(self.sides)), self.sides - 2)

    @property
    def triangle_normals(self) -> Real:
        """Normals of shading at the corners of the triangles, (m, 3, 3)."""
        if self.corner_normals is None:
            return np.repeat(self.normals[self.polygons, None], 3, axis=1)
        return np.asarray(self.corner_normals[self.triangle_corners])

    @cached_property
    def _newell(self) -> Real:
        """Area vectors of the polygons, (p, 3): half the sum of the cross products of corners.

        Newell's formula, about the first corner of each.
        """
        corners = self.vertices[self.corner_vertices]
        following = np.arange(1, len(corners) + 1)
        following[self.first_corners + self.sides - 1] = self.first_corners
        start = np.repeat(corners[self.first_corners], self.sides, axis=0)
        cross = np.cross(corners - start, corners[following] - start)
        return np.add.reduceat(cross, self.first_corners) / 2 if len(cross) else cross

    @cached_property
    def areas(self) -> Real:
        """Areas of the polygons, (p,)."""
        return norms(self._newell)

    @cached_property
    def normals(self) -> Real:
        """Unit normals of the polygons, (p, 3); (0, 0, 1) without an area, as Blender has it."""
        with np.errstate(invalid="ignore", divide="ignore"):
            found = self._newell / self.areas[:, None]
        found[~(self.areas > 0)] = 0.0, 0.0, 1.0
        return np.asarray(found)

    @cached_property
    def centers(self) -> Real:
        """Means of the vertices of the polygons, (p, 3)."""
        corners = self.vertices[self.corner_vertices]
        sums = np.add.reduceat(corners, self.first_corners) if len(corners) else corners
        return np.asarray(sums / self.sides[:, None])

    @cached_property
    def neighbours(self) -> Indices:
        """Pairs of polygons that share an edge, (2, n)."""
        face = np.repeat(np.arange(len(self.sides)), self.sides)
        order = np.argsort(self.corner_edges, kind="stable")
        same = np.diff(self.corner_edges[order]) == 0
        return np.stack([face[order][:-1][same], face[order][1:][same]])

    @cached_property
    def is_closed(self) -> bool:
        """Whether each edge of a polygon joins two."""
        uses = np.bincount(self.corner_edges)
        return bool(np.all((uses == 2) | (uses == 0)))

    @cached_property
    def rays(self) -> RayMesh:
        """The mesh for rays, in its own axes."""
        return RayMesh(self.vertices, self.triangles)


def _cut_quads(vertices: Real, first_corners: Int32, corner_vertices: Int32) -> Int32:
    """Return the corners of the triangles into which Blender cuts triangles and quads, (m, 3).

    A quad is cut from its first corner to its third, or, where both others lie on one side of this
    line, from its second to its fourth.
    """
    sides = np.diff(first_corners, append=len(corner_vertices))
    found = np.repeat(first_corners, sides - 2)[:, None] + np.arange(3, dtype=np.int32)
    quads = np.flatnonzero(sides == 4)
    if quads.size:
        start = first_corners[quads]
        first, second, third, fourth = (vertices[corner_vertices[start + n]] for n in range(4))
        along = third - first
        inwards = dots(crosses(second - first, along), crosses(fourth - first, along)) > 0
        cut = np.where(inwards[:, None], [[0, 1, 3, 1, 2, 3]], [[0, 1, 2, 0, 2, 3]])
        row = (np.cumsum(sides - 2) - 2)[quads]
        found[row[:, None] + [0, 1]] = (start[:, None] + cut).reshape(-1, 2, 3)
    return np.asarray(found, dtype=np.int32)
