# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that are small convex meshes, many of them in one pass.

Most objects of a large scene are boxes and prisms. A straight way inside one ends at the plane of a
face, so that no ray has to be traced.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from functools import cache
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ...array_types import Indices, Int32, Mask, Real
from ...vectors import crosses, norms
from ..nodes.materials import has_interior
from ..state import Snapshot, take_snapshot
from .assignments import assigned_materials
from .wall_faces import PARALLEL, TRIANGLE_POINTS, WIDE

#: Triangles of a small mesh, at most.
_MOST_TRIANGLES = 64
#: How far a vertex may lie outside a plane, relative to the size of the object.
_OUTSIDE = 1e-6
#: Difference of two normals, and of heights relative to the size, up to which planes are one.
_SAME = 1e-12
#: Planes times points of a part of the bodies, about: a few MB.
_PART = 384


class ConvexBodies(NamedTuple):
    """n closed convex meshes of t triangles and v vertices each, along the world's axes.

    `items` are their objects, `origin` (n, 3) their places. About these places: `triangles`
    (n, t, 3, 3) with outward unit `normals` (n, t, 3) at `heights` (n, t), and the `areas` (n, t).
    `widths` (n, t): from each triangle to the vertex farthest behind it. `size` (n,): largest
    extent along an axis. `planes`: triangles, without those in the plane of another in every body.
    [Blender units]
    """

    items: list[Any]
    origin: Real
    triangles: Real
    normals: Real
    heights: Real
    areas: Real
    widths: Real
    size: Real
    planes: Indices

    def thinnest(self) -> Real:
        """Return the least depth behind the triangles of each body, across them, (n,).

        As `depths_behind` has it, at the same points.
        """
        inward = -self.normals.transpose(0, 2, 1)
        starts = np.einsum("pk,ntkx->nxtp", TRIANGLE_POINTS, self.triangles)
        off = _OUTSIDE * self.size[:, None]
        starts += off[..., None, None] * inward[..., None]
        onward = np.repeat(inward, len(TRIANGLE_POINTS), axis=2)
        body = np.arange(len(self.items))
        per_way = self.across(body) @ onward * self.per_height(body, starts.reshape(onward.shape))
        return np.asarray((1 / per_way.max(axis=1) + off).min(axis=1, initial=np.inf))

    def without_walls(self) -> list[Any]:
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
        """Return one over the heights of `planes` above points (k, 3, m) in bodies, (k, p, m).

        A ray from there arrives where the cosine to the normal times this is largest; this product
        is one over the length of its way.
        """
        below = self.across(body) @ starts
        np.subtract(self.heights[:, self.planes, None][body], below, out=below)
        # of a body that is convex within a tolerance, points may lie outside by as much
        np.maximum(below, _SAME * self.size[body, None, None], out=below)
        return np.divide(1.0, below, out=below)


#: Those of a snapshot, once they were asked for.
_of_snapshots: WeakKeyDictionary[Snapshot, list[ConvexBodies]] = WeakKeyDictionary()


def convex_parts(depsgraph: Any) -> list[ConvexBodies]:
    """Find the objects with an interior that are small closed convex meshes, in several parts."""
    snapshot = take_snapshot(depsgraph)
    if snapshot not in _of_snapshots:
        _of_snapshots[snapshot] = list(_find(depsgraph))
    return _of_snapshots[snapshot]


def convex_objects(depsgraph: Any) -> set[Any]:
    """Return the objects with an interior that are small closed convex meshes, faces outwards.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    set of bpy.types.Object
        Originals.
    """
    return {item for part in convex_parts(depsgraph) for item in part.items}


def least_depths(depsgraph: Any) -> dict[Any, float]:
    """Return the least depth behind a face of each object of `convex_parts` [Blender units]."""
    found: dict[Any, float] = {}
    for bodies in convex_parts(depsgraph):
        found.update(zip(bodies.items, bodies.thinnest().tolist(), strict=True))
    return found


def _find(depsgraph: Any) -> Iterable[ConvexBodies]:
    inside = cache(has_interior)
    alike: defaultdict[tuple[int, int], list[Any]] = defaultdict(list)
    snapshot = take_snapshot(depsgraph)
    own = {shape.original: shape for shape in snapshot.shapes if shape.own and shape.kind == "MESH"}
    row_of = snapshot.layout.row_of
    for item, materials in assigned_materials(depsgraph):
        if item not in own or not any(map(inside, materials)):
            continue
        if (
            own[item].triangles is None
            and not 3 < snapshot.face_count(own[item]) <= _MOST_TRIANGLES
        ):
            continue
        points, corners = snapshot.triangles(own[item])
        if 3 < len(corners) <= _MOST_TRIANGLES:
            if item in row_of:
                matrix = snapshot.matrices[row_of[item]]
            else:  # only instances of it are there
                matrix = np.array(item.evaluated_get(depsgraph).matrix_world, dtype=np.float64)
            alike[len(points), len(corners)].append((item, points, corners, matrix))
    for (_, count), found in alike.items():
        step = max(1, _PART // count)
        for start in range(0, len(found), step):
            items, *arrays = zip(*found[start : start + step], strict=True)
            shaped = ((len(items), *array[0].shape) for array in arrays)
            joined = [np.concatenate(a).reshape(s) for a, s in zip(arrays, shaped, strict=True)]
            bodies = _stacked(items, *joined)
            if bodies.items:
                yield bodies


def _stacked(items: tuple[Any, ...], points: Real, corners: Int32, matrices: Real) -> ConvexBodies:
    """Return those of meshes (n, v, 3), (n, t, 3) that are closed and convex."""
    linear = matrices[:, :3, :3]
    points = points.astype(np.float64) @ linear.transpose(0, 2, 1)
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
    """Whether each mesh (n, t, 3) has each of its edges once in each direction, (n,)."""
    edges = np.concatenate([corners[..., pair] for pair in ([0, 1], [1, 2], [2, 0])], axis=1)
    there, back = (edges.astype(np.int64) @ pair for pair in ((vertices, 1), (1, vertices)))
    there.sort(axis=1)
    back.sort(axis=1)
    once = np.all(there[:, 1:] != there[:, :-1], axis=1)
    return np.asarray(once & np.all(there == back, axis=1))
