# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays that are known to hit a triangle mesh near a point: where exactly, in float64.

Renders give hit points to float32. The ray and the mesh are known better, and the point tells which
triangles may have been hit. Triangles lie in grids of cells, one grid for each power of two of
their extent, so that no triangle is in more than eight cells and no cell has many.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Mask, Real

#: Points that are treated at once: a few megabytes of arrays.
_BLOCK = 1 << 15
#: Bits of a cell's number along each axis. Cells further apart than that share their triangles.
_BITS = 21
#: Least reach as a fraction of the mesh's extent: boxes are kept in float32.
_LEAST_REACH = 1e-6
#: What a unit of distance from the plane counts, against one outside the triangle.
_PLANE_COUNTS = 1e-3
#: What the way along the ray counts, and the part of a point's error that tells planes apart.
_WAY_COUNTS, _SURE = 1e-6, 0.25
#: Rounding of a place in a triangle, as a fraction of its sides.
_ROUNDING = 1e-9
#: How far to both sides is looked for what a ray meets past a limb, in cells.
_STEPS = np.linspace(-2.0, 2.0, 17)


class TriangleMesh:
    """A mesh that finds where rays hit it, from a point near each hit; in any one unit of length.

    Triangles without area are left out.

    Parameters
    ----------
    vertices
        Shape (v, 3).
    triangles
        Vertex indices, shape (m, 3).
    """

    def __init__(self, vertices: Real, triangles: NDArray[np.int32]) -> None:
        vertices = np.asarray(vertices, dtype=np.float64)
        corners = vertices[triangles]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        with np.errstate(invalid="ignore"):
            flat = ~(np.einsum("ij,ij->i", area, area) > 0)
        #: First corner and the two edges from it, (m, 9): one gather each.
        first = corners[~flat, 0]
        edges = corners[~flat, 1:] - first[:, None]
        self._shape = np.concatenate([first, edges.reshape(-1, 6)], axis=1)
        self._low, self._high = corners[~flat].min(axis=1), corners[~flat].max(axis=1)
        self._extent = float(np.abs(corners[~flat]).max(initial=0.0))
        self._reach = -1.0
        self._levels: list[_Level] = []

    def __len__(self) -> int:
        return len(self._shape)

    def hit(
        self, origins: Real, directions: Real, near: Real, reach: Real | float
    ) -> tuple[Real, Real]:
        """Return where rays hit the mesh near known points.

        Parameters
        ----------
        origins
            Where the rays start, shape (n, 3) or (3,).
        directions
            Of any length, shape (n, 3).
        near
            Points near the hits, shape (n, 3).
        reach
            Largest error of `near`, (n,) or one for all. A ray that passes an edge within it counts
            as a hit.

        Returns
        -------
        way
            Ray parameter t of the hit, origin + t * direction, (n,); NaN if no triangle was found.
        normal
            Normal of the triangle that was hit, of any length, (n, 3); arbitrary if `way` is NaN.
        """
        way, triangle = np.full(len(near), np.nan), np.zeros(len(near), dtype=np.intp)
        if not len(self):
            return way, np.full((len(near), 3), np.nan)
        self._prepare(float(np.max(reach, initial=0.0)))
        origins, reach = np.broadcast_to(origins, near.shape), np.broadcast_to(reach, len(near))
        for start in range(0, len(near), _BLOCK):
            part = slice(start, start + _BLOCK)
            way[part], triangle[part] = self._hit(
                origins[part], directions[part], near[part], reach[part]
            )
        shape = self._shape[triangle]
        return way, _cross(shape[:, 3:6], shape[:, 6:])

    def _prepare(self, reach: float) -> None:
        """Sort the triangles into cells; again where points are less well known than before."""
        if reach <= self._reach:
            return
        self._reach = max(2 * reach, _LEAST_REACH * self._extent)
        low, high = self._low - self._reach, self._high + self._reach
        self._boxes = low.T.astype(np.float32), high.T.astype(np.float32)
        exponent = np.ceil(np.log2((high - low).max(axis=1))).astype(np.int64)
        sizes, count = np.unique(exponent, return_counts=True)
        self._levels = []
        for size in sizes[np.argsort(-count)]:
            here = np.flatnonzero(exponent == size)
            self._levels.append(_Level(2.0 ** int(size), low[here], high[here], here))

    def _hit(
        self, origins: Real, directions: Real, near: Real, reach: Real
    ) -> tuple[Real, Indices]:
        """Distances along rays and numbers of triangles, (n,) each."""
        # From the foot of the point on the ray on all numbers are small.
        length = np.sqrt(np.einsum("ij,ij->i", directions, directions))
        along = directions / length[:, None]
        ahead = np.einsum("ij,ij->i", near - origins, along)
        start = origins + ahead[:, None] * along - near
        best, touched = _Best(len(near)), np.zeros(len(near), dtype=bool)
        places = near.T.astype(np.float32)
        for level in self._levels:
            points, triangles = level.candidates(near)
            for place, low, high in zip(places, *self._boxes, strict=True):
                at = place[points]
                inside = np.flatnonzero((at >= low[triangles]) & (at <= high[triangles]))
                points, triangles = points[inside], triangles[inside]
            outside, off_plane, way = _intersect(
                start[points], along[points], near[points], self._shape[triangles]
            )
            # A ray that meets a triangle beats one that passes by it. Of triangles that it meets,
            # in two sheets of a wall, it is the one in whose plane the point lies; where the point
            # does not tell, the first one.
            most = reach[points]
            cost = outside + _PLANE_COUNTS * np.maximum(off_plane, _SURE * most)
            cost += _WAY_COUNTS * most * np.arctan(way / most)
            cost[~((outside <= most) & (off_plane <= most))] = np.inf
            best.offer(points, cost, way, triangles, outside > 0)
            touched[points[off_plane <= most]] = True
        self._search_along(best, np.flatnonzero(touched & best.passed), near + start, along)
        return (ahead + best.way) / length, best.triangle

    def _search_along(self, best: _Best, lost: Indices, feet: Real, along: Real) -> None:
        """Look further along rays that miss what their points lie on: past the limb of a body."""
        for level in self._levels if lost.size else ():
            for step in _STEPS * level.cell:
                points, triangles = level.candidates(feet[lost] + step * along[lost])
                points = lost[points]
                outside, _, way = _intersect(
                    np.zeros((points.size, 3)), along[points], feet[points], self._shape[triangles]
                )
                met = (outside == 0) & (np.abs(way) <= _STEPS[-1] * level.cell)
                # any of these beats what was missed
                cost = np.where(met, np.arctan(np.abs(way)) - math.pi, np.inf)
                best.offer(points, cost, way, triangles, ~met)


class _Best:
    """What costs least of all that rays were offered.

    `way` is how far along the ray it is, and `passed` where the ray passes by it or none was found.
    """

    def __init__(self, count: int) -> None:
        self._cost = np.full(count, np.inf)
        self.way = np.full(count, np.nan)
        self.triangle = np.zeros(count, dtype=np.intp)
        self.passed = np.ones(count, dtype=bool)

    def offer(self, rays: Indices, cost: Real, way: Real, triangles: Indices, passed: Mask) -> None:
        """Take the best of these, ordered by ray."""
        if not rays.size:
            return
        begins = np.flatnonzero(np.diff(rays, prepend=-1))
        least = np.minimum.reduceat(cost, begins)
        # the first of each ray's candidates that costs no more
        cheapest = np.flatnonzero(cost == np.repeat(least, np.diff(begins, append=rays.size)))
        cheapest = cheapest[np.diff(rays[cheapest], prepend=-1) > 0]
        better = cheapest[least < self._cost[rays[begins]]]
        ray = rays[better]
        self._cost[ray], self.way[ray] = cost[better], way[better]
        self.triangle[ray], self.passed[ray] = triangles[better], passed[better]


class _Level:
    """Triangles of about one extent, by the cells that their boxes touch."""

    def __init__(self, cell: float, low: Real, high: Real, triangles: Indices) -> None:
        self.cell = cell
        first, last = np.floor(low / cell).astype(np.int64), np.floor(high / cell).astype(np.int64)
        keys, owners = [], []
        for corner in np.ndindex(2, 2, 2):
            touched = np.flatnonzero((first + corner <= last).all(axis=1))
            keys.append(_key(first[touched] + corner))
            owners.append(triangles[touched])
        key, owner = np.concatenate(keys), np.concatenate(owners)
        order = np.argsort(key, kind="stable")
        self._triangles = owner[order]
        self._keys, self._starts = np.unique(key[order], return_index=True)
        self._ends = np.append(self._starts[1:], owner.size)

    def candidates(self, points: Real) -> tuple[Indices, Indices]:
        """Pairs of points and of triangles in their cells, ordered by point."""
        key = _key(np.floor(points / self.cell).astype(np.int64))
        place = np.minimum(np.searchsorted(self._keys, key), self._keys.size - 1)
        here = np.flatnonzero(self._keys[place] == key)
        starts, ends = self._starts[place[here]], self._ends[place[here]]
        count = ends - starts
        total = np.cumsum(count)
        number = np.arange(total[-1] if total.size else 0)
        number += np.repeat(starts - total + count, count)
        return np.repeat(here, count), self._triangles[number]


def _key(cell: NDArray[np.int64]) -> NDArray[np.int64]:
    """One number for each cell (n, 3)."""
    cell = cell & ((1 << _BITS) - 1)
    return np.asarray(cell[:, 0] | cell[:, 1] << _BITS | cell[:, 2] << 2 * _BITS)


def _intersect(start: Real, direction: Real, near: Real, shape: Real) -> tuple[Real, Real, Real]:
    """How far rays pass by triangles, how far points are off their planes, and the way to these.

    The rays start at `start` relative to the points `near`, with unit vectors. NaN or infinite
    where a ray is parallel to the plane.
    """
    corner, edge_1, edge_2 = shape[:, :3] - near, shape[:, 3:6], shape[:, 6:]
    normal = _cross(edge_1, edge_2)
    # Moeller and Trumbore 1997
    across = _cross(direction, edge_2)
    arm = start - corner
    other = _cross(arm, edge_1)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / _dot(edge_1, across)
        u, v = _dot(arm, across) * scale, _dot(direction, other) * scale
        size = np.sqrt(np.maximum(_dot(edge_1, edge_1), _dot(edge_2, edge_2)))
        outside = np.maximum(-np.minimum(np.minimum(u, v), 1 - u - v) - _ROUNDING, 0.0) * size
        off_plane = np.abs(_dot(corner, normal)) / np.sqrt(_dot(normal, normal))
        return outside, off_plane, _dot(edge_2, other) * scale


def _dot(a: Real, b: Real) -> Real:
    return np.asarray(np.einsum("ij,ij->i", a, b))


def _cross(a: Real, b: Real) -> Real:
    """Cross product of rows; numpy's own takes three times as long."""
    x, y, z = a.T
    p, q, r = b.T
    return np.stack([y * r - z * q, z * p - x * r, x * q - y * p], axis=1)
