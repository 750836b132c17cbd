# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of a mesh that are walls: what is behind each of them, across it, and how thick.

A building in one mesh has walls of several thicknesses in several directions. A face belongs to a
wall where the face behind it is parallel, and near compared to the width of its surface.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from mathutils.bvhtree import BVHTree

from ...array_types import Indices, Mask, Real
from ...vectors import crosses
from ..state import evaluated_mesh, read_numbers

#: Maximum difference of the unit normals of parallel faces.
PARALLEL = 0.02
#: Least width of a surface over the thickness of a wall behind it.
WIDE = 6.0
#: Least cosine between neighbouring faces of one surface.
_SMOOTH = 0.9
#: Triangles behind which the depth is measured: all, or the largest ones of more.
_ALL_TRIANGLES, _LARGEST_TRIANGLES = 20_000, 500
#: Relative difference of one thickness.
ONE_THICKNESS = 0.01
#: Distance from a face at which its ray begins, relative to the size of the object.
_OFF_FACE = 1e-6
#: Points of a triangle, barycentric: their mean of squares is that of the triangle.
TRIANGLE_POINTS = np.full((3, 3), 1 / 6) + np.eye(3) / 2


class Depths(NamedTuple):
    """What is behind faces of an object, across them, at points of their triangles.

    Attributes
    ----------
    face
        Number of the polygon of each point, (n,).
    area
        Part of the surface that each point stands for [square Blender units], (n,).
    place
        The points about the object's origin, along the world's axes [Blender units], (n, 3).
    depth
        [Blender units], (n,); NaN where the mesh is open behind.
    parallel
        Whether the face behind is parallel, (n,).
    """

    face: Indices
    area: Real
    place: Real
    depth: Real
    parallel: Mask


class WallFaces(NamedTuple):
    """Walls of an object, by its polygons.

    Attributes
    ----------
    wall
        Whether each is a face of a wall, (n,).
    normal
        Unit normals in world axes, (n, 3).
    area
        [Square Blender units], (n,).
    thickness
        Of the wall behind each, or next to it, in the object's own units, (n,); 0: unknown.
    share
        Fraction of the surface that is walls of the thickness given.
    """

    wall: Mask
    normal: Real
    area: Real
    thickness: Real
    share: float

    @property
    def one_thickness(self) -> float | None:
        """The thickness in the object's own units that all walls have; None if they differ."""
        found = self.thickness[self.wall]
        most = float(found.max(initial=0.0))
        alike = found.size and np.ptp(found) <= 2 * ONE_THICKNESS * most
        return float(np.average(found, weights=self.area[self.wall])) if alike else None

    def across(self, normal: Real) -> float:
        """Fraction of the walls' area with faces across another direction than this one."""
        other = self.wall & (np.abs(self.normal @ normal) < 1 - PARALLEL**2 / 2)
        return float(self.area[other].sum() / max(self.area[self.wall].sum(), 1e-300))


def depths_behind(mesh: Any, linear: Real, most: int = _LARGEST_TRIANGLES) -> Depths:
    """Look across the largest triangles of a mesh into it.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    linear
        From its axes to the world's, (3, 3).
    most
        Number of triangles.

    Returns
    -------
    Depths
    """
    mesh.calc_loop_triangles()
    corners = read_numbers(mesh.loop_triangles, "vertices", 3, np.int32)
    face = read_numbers(mesh.loop_triangles, "polygon_index", 1, np.int32).ravel()
    points = read_numbers(mesh.vertices, "co", 3).astype(np.float64) @ linear.T
    triangles = points[corners]
    outward = crosses(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    outward *= np.copysign(1.0, np.linalg.det(linear))
    double = np.linalg.norm(outward, axis=1)
    chosen = np.argsort(-double, kind="stable")[:most]
    chosen = chosen[double[chosen] > 0]
    inward = -outward[chosen] / double[chosen, None]
    place = np.einsum("pk,nkx->npx", TRIANGLE_POINTS, triangles[chosen])
    tree = BVHTree.FromPolygons(points.tolist(), corners.tolist())
    off = _OFF_FACE * float(np.ptp(points, axis=0).max(initial=0.0))
    start = place + off * inward[:, None]
    depth, parallel = np.full(place.shape[:2], np.nan), np.zeros(place.shape[:2], dtype=bool)
    for row, (starts, ray) in enumerate(zip(start.tolist(), inward.tolist(), strict=True)):
        for column, begin in enumerate(starts):
            _, normal, _, way = tree.ray_cast(begin, ray)
            if way is not None:
                depth[row, column] = way + off
                parallel[row, column] = abs(normal.dot(ray)) > 1 - PARALLEL**2 / 2
    area = np.repeat(double[chosen] / 6, 3)
    return Depths(
        np.repeat(face[chosen], 3), area, place.reshape(-1, 3), depth.ravel(), parallel.ravel()
    )


def find_walls(item: Any, depsgraph: Any) -> WallFaces | None:
    """Find the walls of an evaluated object.

    Parameters
    ----------
    item : bpy.types.Object
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    WallFaces or None
        None for an object without faces or of no volume. Of a large mesh only some faces are known.
    """
    evaluated = item.evaluated_get(depsgraph)
    linear = np.array(evaluated.matrix_world.to_3x3(), dtype=np.float64)
    if abs(np.linalg.det(linear)) < 1e-30:
        return None
    with evaluated_mesh(evaluated) as mesh:
        if mesh is None or not len(mesh.polygons):
            return None
        own = read_numbers(mesh.polygons, "normal", 3).astype(np.float64)
        pairs = _neighbours(mesh)
        mesh.calc_loop_triangles()
        count = len(mesh.loop_triangles)
        depths = depths_behind(
            mesh, linear, count if count <= _ALL_TRIANGLES else _LARGEST_TRIANGLES
        )
    outward = own @ np.linalg.inv(linear)
    own_per_world = np.linalg.norm(outward, axis=1)  # own units across, for one of the world's
    normal = outward / np.maximum(own_per_world, 1e-300)[:, None]
    count = len(own)
    straight = np.einsum("nx,nx->n", normal[pairs[0]], normal[pairs[1]]) > _SMOOTH
    width = _widths(depths, _regions(count, pairs[:, straight]))
    good = depths.parallel & (depths.depth * WIDE <= width[depths.face])
    depth = _medians(depths.face[good], depths.depth[good], count)
    there = depth[depths.face]
    alike = good & (np.abs(depths.depth - there) <= ONE_THICKNESS * there)
    area = np.bincount(depths.face, depths.area, count)
    wall = depth > 0
    thickness = np.where(wall, depth * own_per_world, 0.0)
    # a rim counts as the wall that it ends
    for rim, next_to in (pairs, pairs[::-1]):
        beside = ~wall[rim] & wall[next_to]
        np.maximum.at(thickness, rim[beside], thickness[next_to[beside]])
    share = float(depths.area[alike].sum() / max(depths.area.sum(), 1e-300))
    return WallFaces(wall, normal, area, thickness, share)


def _neighbours(mesh: Any) -> Indices:
    """Return the pairs of polygons that share an edge, (2, n)."""
    edge = read_numbers(mesh.loops, "edge_index", dtype=np.int32).ravel()
    sides = read_numbers(mesh.polygons, "loop_total", dtype=np.int32).ravel()
    face = np.repeat(np.arange(len(sides)), sides)
    order = np.argsort(edge, kind="stable")
    same = edge[order][1:] == edge[order][:-1]
    return np.stack([face[order][:-1][same], face[order][1:][same]])


def _regions(count: int, pairs: Indices) -> Indices:
    """Return a number for each of `count` items, the same for those that pairs connect."""
    label = np.arange(count)
    while True:
        least = label[pairs].min(axis=0)
        after = label.copy()
        for side in pairs:
            np.minimum.at(after, side, least)
        after = after[after]
        if np.array_equal(after, label):
            return label
        label = after


def _widths(depths: Depths, region: Indices) -> Real:
    """Return the width of each polygon's region: the lesser side of the rectangle of its moments.

    [Blender units]. A curved surface is as wide as it appears.
    """
    count = len(region)
    of, area = region[depths.face], depths.area
    total = np.maximum(np.bincount(of, area, count), 1e-300)
    mean = np.stack([np.bincount(of, area * x, count) for x in depths.place.T], axis=1)
    away = depths.place - (mean / total[:, None])[of]
    moments = np.zeros((count, 3, 3))
    for i in range(3):
        for j in range(3):
            moments[:, i, j] = np.bincount(of, area * away[:, i] * away[:, j], count) / total
    width = np.sqrt(12 * np.maximum(np.linalg.eigvalsh(moments)[:, 1], 0.0))
    return np.asarray(width[region])


def _medians(groups: Indices, values: Real, count: int) -> Real:
    """Return the lower median of the values of each of `count` groups; 0 without any."""
    order = np.lexsort([values, groups])
    sizes = np.bincount(groups, minlength=count)
    middle = np.cumsum(sizes) - sizes + np.maximum(sizes - 1, 0) // 2
    found = np.zeros(count)
    some = sizes > 0
    found[some] = values[order][middle[some]]
    return found
