# SPDX-License-Identifier: GPL-3.0-or-later
"""Where rays that are known to hit a triangle mesh near a point hit it exactly, in float64.

Renders give hit points in float32. The ray and the mesh are known better, and the point selects the
triangles that the ray may have hit. Triangles lie in grids of cells, with one grid for each power
of two of their extent. So no triangle is in more than eight cells, and no cell has many triangles.
Neighbouring pixels mostly see the same triangle. Therefore only one ray of many searches the cells;
the others first test the triangles of the rays next to them.

Many small meshes are parts of one mesh, so that their rays are processed together. A ray meets only
its own part, and each part may have its own axes.

Arrays of n vectors are (n, 3) with contiguous columns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Mask, Real, crosses, dots, largest, norms, take_rows, turned

#: Factors that spread cells over buckets (Teschner et al. 2003), and one for parts.
_SPREAD, _SPREAD_PARTS = (73856093, 19349663, 83492791), 2654435761


class CellLevel:
    """Triangles of similar extent, by the cells that their boxes touch.

    Several cells may share a bucket, so callers compare the boxes of the candidates.
    """

    def __init__(
        self, cell: float, low: Real, high: Real, part: Indices, triangles: Indices
    ) -> None:
        self.cell = cell
        bits = max(int(triangles.size).bit_length() + 2, 6)
        self._mask = (1 << bits) - 1
        first, last = (np.floor(corner.T / cell).astype(np.int64) for corner in (low, high))
        further = last > first
        buckets, owners = [], []
        for corner in np.ndindex(2, 2, 2):
            touched = np.flatnonzero(further[np.flatnonzero(corner)].all(axis=0))
            cells = first.take(touched, axis=1) + np.array(corner)[:, None]
            buckets.append(self._bucket(cells, part[touched]))
            owners.append(triangles[touched])
        owner = np.concatenate(owners)
        bucket = np.concatenate(buckets)
        self._starts = np.append(0, np.cumsum(np.bincount(bucket, minlength=1 << bits)))
        self._triangles = owner[sorted_places(bucket, 1 << bits)]

    def _bucket(self, cells: NDArray[np.int64], part: Indices) -> NDArray[np.int64]:
        """Return the number of the bucket of each cell, (3, n), of a part."""
        x, y, z = (one * factor for one, factor in zip(cells, _SPREAD, strict=True))
        return np.asarray((x ^ y ^ z ^ (part * _SPREAD_PARTS)) & self._mask)

    def candidates(self, points: Real, part: Indices) -> tuple[Indices, Indices]:
        """Return pairs of points and of triangles in the buckets of their cells, by point."""
        bucket = self._bucket(np.floor(points.T / self.cell).astype(np.int64), part)
        starts = self._starts.take(bucket)
        count = self._starts.take(bucket + 1) - starts
        total = np.cumsum(count)
        number = np.arange(total[-1] if total.size else 0)
        number += np.repeat(starts - total + count, count)
        return np.repeat(np.arange(len(points)), count), self._triangles.take(number)


def sorted_places(bucket: NDArray[np.int64], count: int) -> Indices:
    """Return the stable order of bucket numbers below `count`, at most 2**32."""
    # numpy sorts 16 bits by counting, many times faster than more of them
    order = np.argsort(bucket.astype(np.uint16), kind="stable")
    if count > 1 << 16:
        order = order[np.argsort((bucket >> 16).astype(np.uint16)[order], kind="stable")]
    return np.asarray(order)


#: Rays that are treated at once: a few megabytes of arrays.
_BLOCK = 1 << 14
#: One ray in the first number searches the cells; one in each further number tests the triangles
#: of the rays before it.
_EVERY = 64, 8, 1
#: Least fraction of the others that hit a neighbour's triangle, for the next block to test them.
_WORTHWHILE = 0.3
#: Least reach as a fraction of the mesh's extent: boxes are kept in float32.
_LEAST_REACH = 1e-6
#: Cost of a unit of distance from the plane, against one outside the triangle.
_PLANE_COUNTS = 1e-3
#: Cost of the way along the ray, and the part of a point's error that distinguishes planes.
_WAY_COUNTS, _SURE = 1e-6, 0.25
#: Rounding of a place in a triangle, as a fraction of its sides.
_ROUNDING = 1e-9
#: Places along a ray at which triangles past a limb are searched, in cells.
_STEPS = np.linspace(-2.0, 2.0, 17)


class TriangleMesh:
    """A mesh that finds where rays hit it, from a point near each hit; in any one unit of length.

    Vertices are (v, 3), triangles (m, 3); triangles without area are left out. Part numbers (m,)
    count from 0 (None: one part).
    """

    def __init__(
        self, vertices: Real, triangles: NDArray[np.int32], parts: Indices | None = None
    ) -> None:
        places = np.asfortranarray(vertices, dtype=np.float64)
        a, b, c = (take_rows(places, corner) for corner in triangles.T)
        normal = crosses(b - a, c - a)
        with np.errstate(invalid="ignore"):
            kept = np.flatnonzero(dots(normal, normal) > 0)
        a, b, c, normal = (take_rows(each, kept) for each in (a, b, c, normal))
        self._low, self._high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        self._part = np.zeros(len(kept), dtype=np.intp) if parts is None else parts[kept]
        self._count = 1 if parts is None else int(parts.max(initial=0)) + 1
        farthest = np.maximum(largest(self._low), largest(self._high))
        self._least_reach = _LEAST_REACH * _largest_of_parts(farthest, self._part, self._count)
        sizes = np.stack([norms(normal), np.maximum(norms(b - a), norms(c - a))])
        # Products of these with a place in the plane, from the first corner, are the coefficients
        # of both edges.
        across = crosses(c - a, normal), crosses(normal, b - a)
        across_1, across_2 = (one.T / dots(normal, normal) for one in across)
        #: First corner, what gives the coefficients of both edges, normal, its length, longer edge.
        self._shape = np.concatenate([a.T, across_1, across_2, normal.T, sizes])
        self._reach = np.full(self._count, -1.0)
        self._levels: list[CellLevel] = []

    def __len__(self) -> int:
        return int(self._shape.shape[1])

    def hit(
        self,
        origins: Real,
        directions: Real,
        near: Real,
        reach: Real | float,
        parts: Indices | None = None,
        spaces: Spaces | None = None,
    ) -> tuple[Real, Real]:
        """Return where rays hit the mesh near known points.

        The ray parameter t of each hit, origin + t * direction, (n,), is NaN if no triangle was
        found. The second result is the normal of the triangle, of any length, (n, 3). This is
        fastest if consecutive rays hit the same triangle.

        Origins are (n, 3) or (3,), directions of any length (n, 3). `near` are points near the
        hits, (n, 3), and `reach` is their largest error, (n,) or one for all: a ray that passes an
        edge at a smaller distance counts as a hit. `parts` are the parts that rays meet (None: the
        first one). `spaces` transform origins, directions and points into the mesh's own space, in
        which `reach` is (None: they are the same).
        """
        way, normals = np.full(len(near), np.nan), np.full((3, len(near)), np.nan)
        if not len(self):
            return way, normals.T
        origins, reach = np.asarray(origins), np.broadcast_to(reach, len(near))
        part = np.broadcast_to(0, len(near)) if parts is None else parts
        self._prepare(_largest_of_parts(reach, part, self._count))
        follow = True
        for start in range(0, len(near), _BLOCK):
            some = slice(start, start + _BLOCK)
            begin = origins if origins.ndim == 1 else origins[some]
            space = None if spaces is None else spaces.of(some)
            rays = _Rays.towards(
                begin, directions[some], near[some], reach[some], part[some], space
            )
            best = _Best(len(rays.ahead))
            follow = self._find(rays, best, follow)
            way[some] = rays.ahead + best.way / rays.length
            normal = self._shape[9:12].take(best.triangle, axis=1)
            normals[:, some] = normal if space is None else turned(space[0].swapaxes(0, 1), normal)
        return way, normals.T

    def _prepare(self, reach: Real) -> None:
        """Sort the triangles into cells; again if points are less accurate than before.

        `reach` is the largest one of the points on each part.
        """
        if np.all(reach <= self._reach):
            return
        self._reach = np.maximum(self._reach, np.maximum(2 * reach, self._least_reach))
        margin = self._reach[self._part][:, None]
        low, high = self._low - margin, self._high + margin
        #: float32: six comparisons of these decide which triangles are looked at.
        self._boxes = low.T.astype(np.float32), high.T.astype(np.float32)
        exponent = np.frexp((high - low).max(axis=1))[1]
        sizes, count = np.unique(exponent, return_counts=True)
        self._levels = []
        for size in sizes[np.argsort(-count, kind="stable")]:
            here = np.flatnonzero(exponent == size)
            boxes = take_rows(low, here), take_rows(high, here)
            self._levels.append(CellLevel(2.0 ** int(size), *boxes, self._part[here], here))

    def _find(self, rays: _Rays, best: _Best, follow: bool) -> bool:
        """Find what all rays hit. With `follow`, most rays first test their neighbours' triangles.

        Return whether neighbours are worth a test in the next block.
        """
        every = np.arange(len(rays.ahead))
        first, *further = _EVERY
        known, worthwhile = every[:: first if follow else 1], follow
        self._search(rays, best, known)
        for step in further if follow else ():
            others = np.ones(every[::step].size, dtype=bool)
            others[:: first // step] = False
            left = tried = every[::step].compress(others)
            triangles = best.triangle.take(known)
            for offset in (0, 1):
                neighbour = np.minimum(left // first + offset, known.size - 1)
                left = self._missed(rays, best, left, triangles.take(neighbour))
            self._search(rays, best, left)
            worthwhile = left.size <= (1 - _WORTHWHILE) * tried.size
            first, known = step, every[::step]
        return worthwhile

    def _missed(self, rays: _Rays, best: _Best, chosen: Indices, triangles: Indices) -> Indices:
        """Test one triangle for each chosen ray; return the rays that do not surely hit it."""
        outside, off_plane, way = self._intersect(rays, chosen, triangles)
        with np.errstate(invalid="ignore"):
            hit = (outside == 0) & (off_plane <= _SURE * rays.reach.take(chosen))
        if self._count > 1:
            hit &= self._part.take(triangles) == rays.part.take(chosen)
        best.take(chosen.compress(hit), way.compress(hit), triangles.compress(hit))
        return chosen.compress(~hit)

    def _search(self, rays: _Rays, best: _Best, chosen: Indices) -> None:
        """Find what the chosen rays hit among the triangles in the cells of their points."""
        touched = np.zeros(len(rays.ahead), dtype=bool)
        near, part = take_rows(rays.near, chosen), rays.part.take(chosen)
        places = near.T.astype(np.float32)
        for level in self._levels:
            points, triangles = self._candidates(level, near, part)
            for place, low, high in zip(places, *self._boxes, strict=True):
                at = place.take(points)
                inside = (at >= low.take(triangles)) & (at <= high.take(triangles))
                points, triangles = points.compress(inside), triangles.compress(inside)
            if not points.size:
                continue
            points = chosen.take(points)
            outside, off_plane, way = self._intersect(rays, points, triangles)
            # A ray that meets a triangle beats one that passes by it. Of triangles that it meets,
            # in two sheets of a wall, it is the one in whose plane the point lies; where the point
            # does not decide, the first one.
            most = rays.reach.take(points)
            cost = outside + _PLANE_COUNTS * np.maximum(off_plane, _SURE * most)
            cost += _WAY_COUNTS * most * np.arctan(way / most)
            cost[~((outside <= most) & (off_plane <= most))] = np.inf
            best.offer(points, cost, way, triangles, outside > 0)
            touched[points[off_plane <= most]] = True
        self._search_along(rays, best, chosen[touched[chosen] & best.passed[chosen]])

    def _search_along(self, rays: _Rays, best: _Best, lost: Indices) -> None:
        """Search further along rays that miss the surface on which their points lie: beyond the
        limb of a body.
        """
        if not lost.size:
            return
        along, part = take_rows(rays.along, lost), rays.part[lost]
        feet = take_rows(rays.near, lost) + take_rows(rays.start, lost)
        for level in self._levels:
            for step in _STEPS * level.cell:
                points, triangles = self._candidates(level, feet + step * along, part)
                points = lost[points]
                outside, _, way = self._intersect(rays, points, triangles)
                met = (outside == 0) & (np.abs(way) <= _STEPS[-1] * level.cell)
                # any of these beats what was missed
                cost = np.where(met, np.arctan(np.abs(way)) - math.pi, np.inf)
                best.offer(points, cost, way, triangles, ~met)

    def _candidates(self, level: CellLevel, near: Real, part: Indices) -> tuple[Indices, Indices]:
        """Return pairs of points and of triangles of their parts nearby, ordered by point."""
        points, triangles = level.candidates(near, part)
        if self._count == 1:
            return points, triangles
        mine = np.flatnonzero(part[points] == self._part[triangles])
        return points[mine], triangles[mine]

    def _intersect(
        self, rays: _Rays, chosen: Indices, triangles: Indices
    ) -> tuple[Real, Real, Real]:
        """Return distances of rays from triangles, of points from their planes, and the ways along
        the rays.

        One triangle for each chosen ray. NaN or infinite where a ray is parallel to the plane.
        """
        shape = self._shape.take(triangles, axis=1)
        across_1, across_2, normal = (shape[i : i + 3].T for i in (3, 6, 9))
        along = take_rows(rays.along, chosen)
        # From the point on the ray on all numbers are small.
        corner = shape[:3].T - take_rows(rays.near, chosen)
        arm = take_rows(rays.start, chosen) - corner
        with np.errstate(divide="ignore", invalid="ignore"):
            way = -dots(arm, normal) / dots(along, normal)
            arm += way[:, None] * along
            u, v = dots(arm, across_1), dots(arm, across_2)
            outside = -np.minimum(np.minimum(u, v), 1 - u - v) - _ROUNDING
            outside = np.maximum(outside, 0.0) * shape[13]
            off_plane = np.abs(dots(corner, normal)) / shape[12]
            return outside, off_plane, way


@dataclass(frozen=True)
class Spaces:
    """Transformations into the spaces of meshes: turn @ (x - place)."""

    #: Of each space, shapes (k, 3, 3) and (k, 3).
    turn: Real
    place: Real
    #: Number of the space that each ray is to come into, (n,).
    each: Indices

    def of(self, some: slice) -> tuple[Real, Real]:
        """Return turn and place for some rays: (3, 3, n) and (n, 3) if they differ."""
        each = self.each[some]
        if each.size and np.all(each == each[0]):  # much faster
            return self.turn[each[0]], self.place[each[0]]
        return self.turn.transpose(1, 2, 0).take(each, axis=2), self.place[each]


@dataclass(frozen=True)
class _Rays:
    """Rays by unit vectors `along`, and points `near` their hits, known to `reach`.

    `length` is that of the direction given, in the mesh's space; `ahead` the ray parameter of the
    foot of the point on the ray, which is at `start` from the point; `part` what each ray meets.
    """

    along: Real
    length: Real
    near: Real
    ahead: Real
    start: Real
    reach: Real
    part: Indices

    @classmethod
    def towards(
        cls,
        origins: Real,
        directions: Real,
        near: Real,
        reach: Real,
        part: Indices,
        space: tuple[Real, Real] | None,
    ) -> _Rays:
        """Make rays from origins, (n, 3) or (3,), along directions of any length."""
        # From the foot on all numbers are small, and what rounding a pose's inverse does to the
        # place of all points alike has no arm to act on.
        away = near - origins
        ahead = dots(away, directions) / dots(directions, directions)
        start = ahead[:, None] * directions - away
        if space is None:
            near = np.asfortranarray(near)
        else:
            turn, place = space
            near = turned(turn, (near - place).T).T
            start, directions = turned(turn, start.T).T, turned(turn, directions.T).T
        length = norms(directions)
        return cls(directions / length[:, None], length, near, ahead, start, reach, part)


class _Best:
    """The candidate with the least cost for each ray."""

    def __init__(self, count: int) -> None:
        self._cost = np.full(count, np.inf)
        #: Distance along the ray.
        self.way = np.full(count, np.nan)
        self.triangle = np.zeros(count, dtype=np.intp)
        #: Whether the ray passes by the triangle, or none was found.
        self.passed = np.ones(count, dtype=bool)

    def take(self, rays: Indices, way: Real, triangles: Indices) -> None:
        """Set the hits of these rays, whatever their candidates are."""
        self.way[rays], self.triangle[rays], self.passed[rays] = way, triangles, False

    def offer(self, rays: Indices, cost: Real, way: Real, triangles: Indices, passed: Mask) -> None:
        """Keep the best of these candidates, ordered by ray."""
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


def _largest_of_parts(values: Real, part: Indices, count: int) -> Real:
    """Return the largest of the positive values of each part, 0 where it has none."""
    largest_of = np.zeros(count)
    if count == 1 or not part.size:
        largest_of[0] = values.max(initial=0.0)
    else:
        # many times faster than one by one, where neighbours are of one part
        begins = np.flatnonzero(np.diff(part, prepend=-1))
        np.maximum.at(largest_of, part[begins], np.maximum.reduceat(values, begins))
    return largest_of
