# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of a mesh that are walls: what is behind each of them, across it, and how thick.

A building in one mesh has walls of several thicknesses in several directions. `depths_behind` casts
rays from points of the largest triangles into the object, across them. `find_walls` groups polygons
into smooth surfaces: a face belongs to a wall where the face behind it is parallel, and near
compared to the width of its surface, by the moments of the points. The thickness of a polygon's
wall is the lower median of its depths; a rim has that of the wall that it ends.

`LayerFaces` finds plane-parallel layers, of many objects in one pass: the direction across which
most of the surface lies, and the two outermost planes. `ConvexBodies` are objects that are small
closed convex meshes, as most are in a large scene: a straight way inside one ends at the plane of a
face, so that no ray has to be traced.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ...arrays import Indices, Int32, Mask, Real, crosses, dots, norms
from .mesh import Mesh
from .rays import RayMesh

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
#: Points of a triangle, barycentric: their mean of squares is that of the triangle.
TRIANGLE_POINTS = np.full((3, 3), 1 / 6) + np.eye(3) / 2


class Depths(NamedTuple):
    """What is behind faces of an object, across them, at n points of their triangles."""

    #: Number of the polygon, (n,).
    face: Indices
    #: Part of the surface that each point stands for [square Blender units], (n,).
    area: Real
    #: The points about the object's origin, along the world's axes [Blender units], (n, 3).
    place: Real
    #: [Blender units], (n,); infinite where the mesh is open behind.
    depth: Real
    #: Whether the face behind is parallel, (n,).
    parallel: Mask


class WallFaces(NamedTuple):
    """Walls of an object, by its n polygons."""

    #: Whether each is a face of a wall, (n,).
    wall: Mask
    #: Unit normals in world axes, (n, 3).
    normal: Real
    #: [Square Blender units], (n,).
    area: Real
    #: Of the wall behind each, or next to it, in the object's own units, (n,); 0: unknown.
    thickness: Real
    #: Fraction of the surface that is walls of the thickness given.
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


def depths_behind(mesh: Mesh, linear: Real, most: int = _LARGEST_TRIANGLES) -> Depths:
    """Look across the `most` largest triangles of a mesh into it.

    `linear` (3, 3) turns its axes to the world's.
    """
    points = mesh.vertices @ linear.T
    triangles = points[mesh.triangles]
    outward = crosses(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    outward *= np.copysign(1.0, np.linalg.det(linear))
    double = np.linalg.norm(outward, axis=1)
    chosen = np.argsort(-double, kind="stable")[:most]
    chosen = chosen[double[chosen] > 0]
    inward = -outward[chosen] / double[chosen, None]
    place = np.einsum("pk,nkx->npx", TRIANGLE_POINTS, triangles[chosen])
    place, inward = place.reshape(-1, 3), np.repeat(inward, 3, axis=0)
    found = RayMesh(points, mesh.triangles)
    behind, depth = found.first(place, inward)
    parallel = np.abs(dots(found.normals_of(behind), inward)) > 1 - PARALLEL**2 / 2
    area = np.repeat(double[chosen] / 6, 3)
    return Depths(np.repeat(mesh.polygons[chosen], 3), area, place, depth, parallel)


def find_walls(mesh: Mesh | None, linear: Real) -> WallFaces | None:
    """Find the walls of a mesh; `linear` (3, 3) turns its axes to the world's.

    None for an object without faces or of no volume. Of a large mesh only some faces are known.
    """
    if mesh is None or not len(mesh.sides) or abs(np.linalg.det(linear)) < 1e-30:
        return None
    own, pairs, count = mesh.normals, mesh.neighbours, len(mesh.triangles)
    depths = depths_behind(mesh, linear, count if count <= _ALL_TRIANGLES else _LARGEST_TRIANGLES)
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


# Layers.

#: Minimum fraction of an object's surface with one pair of opposite normals for a layer.
LAYER_SHARE = 0.6
#: Minimum fraction of a layer's faces in its two outermost planes for a single plate.
MIN_PLATE_FRACTION = 0.9
#: The same where nothing but the rim may be elsewhere.
ALL_FACES = 1 - 1e-6
#: Tolerance of these planes, relative to their distance.
_IN_PLANE = 1e-3
#: Number of directions, by area, that are tried.
_CANDIDATES = 8


def layer_normals(normals: Real, areas: Real, of: Indices, count: int) -> Real:
    """Return the normal of the parallel faces that form most of each of `count` surfaces.

    `normals` are unit normals of the faces, (n, 3), `areas` their areas, (n,), and `of` the numbers
    of their surfaces, (n,). (count, 3); NaN for a surface without such faces.
    """
    found = np.full((count, 3), np.nan)
    if not len(normals):
        return found
    total = np.bincount(of, areas, count)
    # Opposite normals are one direction; rounding makes almost equal ones equal.
    sign = np.where(normals[np.arange(len(normals)), np.abs(normals).argmax(axis=1)] < 0, -1.0, 1.0)
    directions = normals * sign[:, None]
    keys = np.column_stack([of, np.round(directions / PARALLEL).astype(np.int64)])
    _, first, cell = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    by_cell = np.bincount(cell.ravel(), areas, len(first))
    order = np.lexsort([-by_cell, of[first]])  # the largest ones of each surface first
    begin = np.searchsorted(of[first[order]], np.arange(count + 1))
    for number in range(_CANDIDATES):
        left = np.flatnonzero(
            np.isnan(found[:, 0]) & (begin[:-1] + number < begin[1:]) & (total > 0)
        )
        if not left.size:
            break
        tried = np.full((count, 3), np.nan)
        tried[left] = directions[first[order[begin[left] + number]]]
        along = dots(directions, tried[of])
        near = np.abs(np.abs(along) - 1) < PARALLEL**2 / 2
        there = of[near]
        enough = np.bincount(there, areas[near], count) >= LAYER_SHARE * total
        # The rule above can give almost equal directions opposite signs.
        weight = np.sign(along[near]) * areas[near]
        mean = [np.bincount(there, weight * x, count) for x in directions[near].T]
        chosen = left[enough[left]]
        found[chosen] = np.stack(mean, axis=1)[chosen]
    return np.asarray(found / norms(found)[:, None])


class LayerFaces(NamedTuple):
    """Polygons of several objects: normals, areas and centres in their own axes."""

    #: Number of the object of each polygon.
    of: Indices
    normal: Real
    area: Real
    center: Real
    #: Turns the axes of each object to the world's, (n, 3, 3).
    linear: Real

    @classmethod
    def of_meshes(cls, meshes: Sequence[Mesh | None], linear: Real) -> LayerFaces:
        known = [(n, mesh) for n, mesh in enumerate(meshes) if mesh is not None]
        none = [np.empty((0, 3))]
        return cls(
            np.concatenate(
                [np.full(len(mesh.sides), n) for n, mesh in known] or [np.empty(0, int)]
            ),
            np.concatenate([mesh.normals for _, mesh in known] or none),
            np.concatenate([mesh.areas for _, mesh in known] or [np.empty(0)]),
            np.concatenate([mesh.centers for _, mesh in known] or none),
            linear,
        )

    def layer_normals(self) -> Real:
        """Return the layer normal of each object in its own axes, (n, 3); NaN for others."""
        solid = np.abs(np.linalg.det(self.linear)) >= 1e-30
        inverse = np.linalg.inv(np.where(solid[:, None, None], self.linear, np.eye(3)))
        # Area vectors under a linear map: det(A) A^-T.
        vectors = np.einsum("ni,nij->nj", self.normal * self.area[:, None], inverse[self.of])
        lengths = norms(vectors)
        kept = (lengths > 0) & solid[self.of]
        world = layer_normals(
            vectors[kept] / lengths[kept, None], lengths[kept], self.of[kept], len(solid)
        )
        # In the object's own axes, so that the normal rotates with it.
        local = np.einsum("nji,nj->ni", self.linear, world)
        return np.asarray(local / norms(local)[:, None])

    def planes(self, normals: Real, least_fraction: float) -> tuple[Real, Real]:
        """Return where the two outermost faces along normals (n, 3) are, (n,) each.

        NaN unless this fraction of the faces across the normal lies in these two planes.
        """
        count = len(normals)
        unit = (normals / norms(normals)[:, None])[self.of]
        along = np.flatnonzero(np.abs(dots(self.normal, unit)) > 1 - PARALLEL**2 / 2)
        of, area = self.of[along], self.area[along]
        height = dots(self.center[along], unit[along])
        low, high = np.full(count, np.inf), np.full(count, -np.inf)
        np.minimum.at(low, of, height)
        np.maximum.at(high, of, height)
        with np.errstate(invalid="ignore"):
            thick = high - low
            place = (height - low[of]) / thick[of]
        outer = np.abs(2 * place - 1) > 1 - 2 * _IN_PLANE
        all_m2, outer_m2 = (
            np.bincount(of[some], area[some], count) for some in (slice(None), outer)
        )
        found = (all_m2 > 0) & (thick > 0) & (outer_m2 >= least_fraction * all_m2)
        return np.where(found, low, np.nan), np.where(found, high, np.nan)

    def rim_fractions(self, normals: Real) -> Real:
        """Return the fraction of each surface that is not across its normal (n, 3), (n,)."""
        inverse = np.linalg.inv(self.linear)
        vectors = np.einsum("ni,nij->nj", self.normal * self.area[:, None], inverse[self.of])
        across = np.einsum("ni,nij->nj", normals, inverse)
        areas = norms(vectors)
        rim = (
            np.abs(dots(vectors, across[self.of]))
            < (1 - PARALLEL**2 / 2) * areas * norms(across)[self.of]
        )
        total, of_rim = (
            np.bincount(self.of[s], areas[s], len(normals)) for s in (slice(None), rim)
        )
        return np.asarray(of_rim / np.maximum(total, 1e-300))


# Small convex meshes.

#: Triangles of a small mesh, at most.
MOST_TRIANGLES = 64
#: How far a vertex may lie outside a plane, relative to the size of the object.
_OUTSIDE = 1e-6
#: Difference of two normals, and of heights relative to the size, up to which planes are one.
_SAME = 1e-12
#: Planes times points of a part of the bodies, about: a few MB.
_PART = 384


class ConvexBodies(NamedTuple):
    """n closed convex meshes of t triangles each, about their places, along the world's axes.

    [Blender units]
    """

    #: Their objects.
    items: list[Hashable]
    #: Their places, (n, 3).
    origin: Real
    #: (n, t, 3, 3)
    triangles: Real
    #: Outward unit normals, (n, t, 3).
    normals: Real
    #: Of the planes over the origin, (n, t).
    heights: Real
    #: (n, t)
    areas: Real
    #: From each triangle to the vertex farthest behind it, (n, t).
    widths: Real
    #: Largest extent along an axis, (n,).
    size: Real
    #: Numbers of triangles, without those in the plane of another in every body.
    planes: Indices

    def thinnest(self) -> Real:
        """Return the least depth behind the triangles of each body, across them, (n,), at the
        points of `depths_behind`.
        """
        inward = -self.normals.transpose(0, 2, 1)
        starts = np.einsum("pk,ntkx->nxtp", TRIANGLE_POINTS, self.triangles)
        onward = np.repeat(inward, len(TRIANGLE_POINTS), axis=2)
        body = np.arange(len(self.items))
        per_way = self.across(body) @ onward * self.per_height(body, starts.reshape(onward.shape))
        return np.asarray((1 / per_way.max(axis=1)).min(axis=1, initial=np.inf))

    def without_walls(self) -> list[Hashable]:
        """Return the objects in which no face is near enough behind another for a wall.

        A face behind, parallel up to `PARALLEL`, is at least as far as the vertex farthest behind,
        less `PARALLEL` times the diagonal of the body; and no surface is wider than sqrt(3/2) of
        this, by its moments.
        """
        diagonal = np.linalg.norm(np.ptp(self.triangles, axis=(1, 2)), axis=1)
        nearest = self.widths.min(axis=1) - 1.01 * PARALLEL * diagonal
        far = WIDE * nearest > math.sqrt(1.5) * diagonal
        return [item for item, one in zip(self.items, far.tolist(), strict=True) if one]

    def across(self, body: Indices) -> Real:
        """Return the outward normals of the p `planes` of bodies (k,), (k, p, 3)."""
        return np.asarray(self.normals[:, self.planes][body])

    def per_height(self, body: Indices, starts: Real) -> Real:
        """Return 1 over the distance of points from the `planes` of their bodies, (k, p, m).

        The points (k, 3, m) are inside the bodies. A ray from a point first meets the plane for
        which this value, times the cosine between ray and normal, is largest. This product is 1
        over the length of the ray.
        """
        below = self.across(body) @ starts
        np.subtract(self.heights[:, self.planes, None][body], below, out=below)
        # of a body that is convex within a tolerance, points may lie outside by as much
        np.maximum(below, _SAME * self.size[body, None, None], out=below)
        return np.divide(1.0, below, out=below)


def convex_bodies(
    bodies: Sequence[tuple[Hashable, Mesh, Real]],
) -> Iterator[ConvexBodies]:
    """Yield those of some bodies that are small closed convex meshes, in several parts.

    Each of `bodies` has what names it, its mesh and its world matrix, (4, 4).
    """
    alike: dict[tuple[int, int], list[tuple[Hashable, Real, Int32, Real]]] = {}
    for item, mesh, matrix in bodies:
        points, corners = mesh.vertices, mesh.triangles
        if 3 < len(corners) <= MOST_TRIANGLES:
            of_size = alike.setdefault((len(points), len(corners)), [])
            of_size.append((item, points, corners, matrix))
    for (_, count), found in alike.items():
        step = max(1, _PART // count)
        for start in range(0, len(found), step):
            items, *arrays = zip(*found[start : start + step], strict=True)
            convex = _stacked(items, *map(np.stack, arrays))
            if convex.items:
                yield convex


def _stacked(
    items: tuple[Hashable, ...], points: Real, corners: Int32, matrices: Real
) -> ConvexBodies:
    """Return those of the meshes (n, v, 3), (n, t, 3) that are closed and convex."""
    linear = matrices[:, :3, :3]
    points = points @ linear.transpose(0, 2, 1)
    corners = np.where(np.linalg.det(linear)[:, None, None] < 0, corners[:, :, ::-1], corners)
    triangles = np.take_along_axis(points[:, None], corners.reshape(len(corners), 1, -1, 1), axis=2)
    triangles = triangles.reshape(*corners.shape, 3)
    a, b, c = (triangles[:, :, k].reshape(-1, 3) for k in range(3))
    across = crosses(b - a, c - a).reshape(corners.shape)
    double = norms(across.reshape(-1, 3)).reshape(corners.shape[:2])
    with np.errstate(divide="ignore", invalid="ignore"):
        normals = across / double[..., None]
    heights = np.einsum("ntx,ntx->nt", normals, triangles[:, :, 0])
    behind = heights[:, None] - points @ normals.transpose(0, 2, 1)
    size = np.ptp(points, axis=1).max(axis=1)
    convex = _closed(corners, points.shape[1]) & (double > 0).all(axis=1)
    convex &= np.nan_to_num(behind, nan=-np.inf).min(axis=(1, 2)) >= -_OUTSIDE * size
    kept = [item for item, one in zip(items, convex.tolist(), strict=True) if one]
    width = behind.max(axis=1)
    parts = matrices[:, :3, 3], triangles, normals, heights, double / 2, width, size
    of_convex = [part[convex] for part in parts]
    planes = _planes(normals[convex], heights[convex], size[convex])
    return ConvexBodies._make([kept, *of_convex, planes])


def _planes(normals: Real, heights: Real, size: Real) -> Indices:
    """Return triangles without those that in each body lie in the plane of one before them."""
    turned = np.abs(normals[:, :, None] - normals[:, None]).max(axis=-1)
    apart = np.abs(heights[:, :, None] - heights[:, None])
    same = (turned < _SAME) & (apart < _SAME * size[:, None, None])
    return np.flatnonzero(~np.triu(same.all(axis=0), 1).any(axis=0))


def _closed(corners: Int32, vertices: int) -> Mask:
    """Return whether each mesh (n, t, 3) has each of its edges once in each direction, (n,)."""
    edges = np.concatenate([corners[..., pair] for pair in ([0, 1], [1, 2], [2, 0])], axis=1)
    there, back = (edges.astype(np.int64) @ pair for pair in ((vertices, 1), (1, vertices)))
    there.sort(axis=1)
    back.sort(axis=1)
    once = np.all(there[:, 1:] != there[:, :-1], axis=1)
    return np.asarray(once & np.all(there == back, axis=1))
