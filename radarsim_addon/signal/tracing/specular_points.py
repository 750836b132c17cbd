# SPDX-License-Identifier: GPL-3.0-or-later
"""Points where smooth surfaces reflect waves between two places: found by Newton's method.

The surface is that of a mesh with a normal at each corner (`SmoothPatches`). Over each triangle,
normals are interpolated as for smooth shading, and the surface is lifted off the triangle as far as
these normals say. Neighbours with common corners meet without a gap. Spheres and cylinders with
exact normals are met exactly, other surfaces up to the fourth order of the triangle's size.

`SpecularSearch` finds where the normal halves the angle between an antenna and a place:

1. A tree over the patches holds the directions of normals below each node. A node is left out where
   no normal below can halve the angle.
2. Patches that are large as seen from the place are halved until the mismatch (the part of the
   bisector that is across the normal) is nearly linear over them.
3. Newton's method begins where the linear mismatch vanishes, and must end within the patch.

A reflection on an edge is found in both of its triangles, and counted once.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from ...arrays import Indices, Integers, Mask, Real, crosses, distances, dots, norms
from ..scene import along_curve

#: Largest angle between normals of one triangle, as a cosine: 30 degrees.
_LEAST_COSINE = np.cos(np.radians(30.0))
#: Largest part of an edge by which a cubic deviates from a parabola: t (1 - t) (1 - 2 t) / 2.
_CUBIC = 0.0481
#: Height of an arc over its chord: square of the chord times curvature, over this; the part of it
#: that a curvature has which changes over the triangle is half.
_ARC = 16.0


@dataclass(frozen=True, eq=False)
class SmoothPatches:
    """Patches over k triangles: places [m] and unit normals of their corners, (k, 3, 3).

    `shape` (k, 3, 3, 3) [1/m] are shape operators at the corners: they turn a step on the surface
    into the change of the normal, positive where it is convex. `slope_m` (k, i, j) is how far
    corner j is below the tangent plane of corner i.
    """

    corners_m: Real
    normals: Real
    shape: Real
    slope_m: Real

    @classmethod
    def of_mesh(cls, corners_m: Real, normals: Real, vertices: Integers) -> tuple[Self, Real]:
        """Return the patches over triangles, and the largest distance of each from the true
        surface, (k,) [m].

        `vertices` are the numbers of the corners' vertices in the mesh, (k, 3). The distance is
        infinite if the normals differ too much to know the surface.
        """
        own = _corner_shapes(corners_m, normals)
        area = norms(crosses(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0]))
        # Corners of one vertex and one normal have one curvature.
        key = np.column_stack([vertices.reshape(-1), np.round(normals.reshape(-1, 3) * 1e3)])
        _, group = np.unique(key, axis=0, return_inverse=True)
        group, weight = group.reshape(-1), np.repeat(area, 3)
        total = np.bincount(group, weight)
        entries = own.reshape(-1, 9)
        mean = np.stack([np.bincount(group, weight * one) / total for one in entries.T], axis=1)
        shape = mean[group].reshape(own.shape)
        tangent_m = np.einsum("kij,kij->ki", normals, corners_m)[:, :, None]
        slope = tangent_m - np.einsum("kij,klj->kil", normals, corners_m)
        cubic_m = _CUBIC * np.abs(slope - slope.transpose(0, 2, 1)).max(axis=(1, 2))
        edges = corners_m - np.roll(corners_m, 1, axis=1)
        differs_m = np.einsum("kei,kcij,kej->kec", edges, shape - own, edges) / _ARC
        error_m = np.maximum(cubic_m, np.abs(differs_m).max(axis=(1, 2), initial=0.0))
        cosines = np.einsum("kij,klj->kil", normals, normals).min(axis=(1, 2))
        error_m[~((cosines >= _LEAST_COSINE) & np.isfinite(error_m))] = np.inf
        return cls(corners_m, normals, shape, slope), error_m

    def __len__(self) -> int:
        return len(self.corners_m)

    def select(self, chosen: Indices) -> Self:
        return type(self)(*(getattr(self, one.name)[chosen] for one in fields(self)))

    def at(self, weights: Real) -> tuple[Real, Real]:
        """Return the points and unit normals of all patches at barycentric weights, (k, 3) each."""
        normals = _mean(weights, self.normals)
        size = norms(normals)
        normals = normals / size[:, None]
        lift = self.lift_m(weights) / (1 + size)
        chord_m = _mean(weights, self.corners_m)
        return chord_m + lift[:, None] * normals, normals

    def lift_m(self, weights: Real) -> Real:
        """Return twice the height of patches over their triangles at weights, (k,) [m]."""
        lift = np.zeros(len(weights))
        for i, j in ((0, 1), (1, 2), (2, 0)):
            one, other = self.slope_m[:, i, j], self.slope_m[:, j, i]
            u, v = weights[:, i], weights[:, j]
            lift += u * v * (one + other + (u - v) * (one - other))
        return lift

    def curvature(self, weights: Real, normal: Real, first: Real, second: Real) -> Real:
        """Return the curvature tensors along two axes at weights, (k, 2, 2) [1/m].

        The axes are unit vectors (k, 3) perpendicular to the unit `normal`.
        """
        found = np.zeros((len(weights), 2, 2))
        for corner in range(3):
            there = self.normals[:, corner]
            both = normal + there
            share = 1 + np.einsum("kj,kj->k", normal, there)
            # the axes, turned by the shortest way into the tangent plane of the corner
            axes = np.stack(
                [
                    axis - (np.einsum("kj,kj->k", axis, there) / share)[:, None] * both
                    for axis in (first, second)
                ],
                axis=1,
            )
            own = np.einsum("kai,kij,kbj->kab", axes, self.shape[:, corner], axes)
            found += weights[:, corner, None, None] * own
        return found


def _mean(weights: Real, corners: Real) -> Real:
    """Return means of vectors at corners (k, 3, 3), with weights (k, 3): (k, 3)."""
    first = weights[:, 0, None] * corners[:, 0]
    return np.asarray(
        first + weights[:, 1, None] * corners[:, 1] + weights[:, 2, None] * corners[:, 2]
    )


def _corner_shapes(corners_m: Real, normals: Real) -> Real:
    """Return the shape operators at the corners that follow from the triangle alone, (k, 3, 3, 3)
    [1/m].
    """
    found = np.empty((len(corners_m), 3, 3, 3))
    for i in range(3):
        others = [(i + 1) % 3, (i + 2) % 3]
        here = normals[:, None, i]

        def across(vectors: Real, here: Real = here) -> Real:
            return vectors - np.sum(vectors * here, axis=2)[:, :, None] * here

        steps = across(corners_m[:, others] - corners_m[:, None, i])
        turns = across(normals[:, others])
        with np.errstate(all="ignore"):
            own = np.einsum("kai,kaj->kij", turns, np.linalg.pinv(steps).transpose(0, 2, 1))
        found[:, i] = (own + own.transpose(0, 2, 1)) / 2
    return found


#: Children of a node of the tree, and places that are searched for at a time.
_BRANCHES, _CHUNK = 2, 4096
#: How far the origin may lie outside of a triangle of tangential parts: they are not quite linear.
_OUTSIDE = 0.2
#: Size of a part of a patch over its distance up to which they are taken for linear, and halvings.
_SMALL, _HALVINGS = 0.25, 12
_STEPS = 6
#: Step of barycentric weights for derivatives.
_STEP = 1e-6
#: How far a point may lie outside of its patch, and how far sin(angle) may be off.
_EDGE, _ZERO = 1e-9, 1e-8
#: Mismatch that is left to rounding.
_EXACT = 1e-13
#: Cosine of incidence below which a wave grazes the surface: the mesh tells too little there.
GRAZING = 0.02


@dataclass(frozen=True)
class SpecularPoints:
    """Reflections, sorted by place: numbers of the place and of the patch, (n,), barycentric
    weights on the patch, points [m] and unit normals there, (n, 3).
    """

    place: Indices
    patch: Indices
    weights: Real
    points_m: Real
    normals: Real

    def select(self, chosen: Indices | Mask) -> SpecularPoints:
        return SpecularPoints(*(getattr(self, one.name)[chosen] for one in fields(self)))


class SpecularSearch:
    """Finds reflections at the mirroring side of patches between an antenna and places."""

    def __init__(self, patches: SmoothPatches, antenna_m: Real) -> None:
        self.patches, self._antenna_m = patches, np.asarray(antenna_m, dtype=np.float64)
        edges_m = patches.corners_m[:, 1:] - patches.corners_m[:, :1]
        self._edges = edges_m / np.linalg.norm(edges_m, axis=2)[:, :, None]
        self._build_tree()

    def to(self, antenna_m: Real) -> SpecularSearch:
        """Return the search for another antenna, with the same tree."""
        other = copy(self)
        other._antenna_m = np.asarray(antenna_m, dtype=np.float64)
        return other

    def find(self, places_m: Real) -> SpecularPoints:
        """Return all reflections on ways from places (n, 3) to the antenna. Nothing between them is
        considered.
        """
        starts = range(0, max(len(places_m), 1), _CHUNK)
        parts = [self._find(places_m[start : start + _CHUNK], start) for start in starts]
        columns = ([getattr(part, one.name) for part in parts] for one in fields(SpecularPoints))
        return SpecularPoints(*map(np.concatenate, columns))

    def _find(self, places_m: Real, first: int) -> SpecularPoints:
        place, patch, weights = self._guesses(places_m, *self._candidates(places_m))
        weights = self._newton(patch, places_m[place], weights)
        inside = weights.min(axis=1) >= -_EDGE  # NaN is outside
        place, patch, weights = place[inside], patch[inside], weights[inside]
        points_m, normals = self.patches.select(patch).at(weights)
        onward = _towards(places_m[place], points_m)
        bisector = onward + _towards(self._antenna_m, points_m)
        along = dots(normals, bisector)
        good = norms(bisector - along[:, None] * normals) <= _ZERO
        good &= (dots(normals, onward) >= GRAZING) & (along >= 2 * GRAZING * 0.99)
        found = SpecularPoints(place, patch, weights, points_m, normals).select(good)
        found = found.select(np.argsort(found.place, kind="stable"))
        found = found.select(_first_of_each(found))
        return replace(found, place=found.place + first)

    def _mismatch(self, edges: Real, ends_m: Real, points_m: Real, normals: Real) -> Real:
        """Return the component of the bisector perpendicular to the normal, along edges (n, 2, 3),
        (n, 2).
        """
        bisector = _towards(ends_m, points_m) + _towards(self._antenna_m, points_m)
        across = bisector - dots(bisector, normals)[:, None] * normals
        return np.stack([dots(edges[:, 0], across), dots(edges[:, 1], across)], axis=1)

    def _guesses(
        self, places_m: Real, place: Indices, patch: Indices
    ) -> tuple[Indices, Indices, Real]:
        """Return the numbers of the place (n,) and of the patch (n,) of each pair, and the weights
        of the patch's corners (n, 3) from which the search for the specular point starts.
        """
        parts = np.broadcast_to(np.eye(3), (patch.size, 3, 3))
        found = []
        for halvings in range(_HALVINGS + 1):
            patches, edges, ends_m = self.patches.select(patch), self._edges[patch], places_m[place]
            corners = [patches.at(parts[:, number]) for number in range(3)]
            points_m = np.stack([one[0] for one in corners], axis=1)
            middle_m = points_m.mean(axis=1)
            sides_m = np.linalg.norm(points_m - np.roll(points_m, 1, axis=1), axis=2)
            reach_m = sides_m.max(axis=1, initial=0.0)
            near_m = np.minimum(distances(middle_m, ends_m), distances(middle_m, self._antenna_m))
            small = (reach_m <= _SMALL * near_m) | (halvings == _HALVINGS)
            a, b, c = (self._mismatch(edges, ends_m, *one) for one in corners)
            with np.errstate(all="ignore"):
                area = _cross(b - a, c - a)[:, None]
                guess = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=1) / area
            chosen = np.flatnonzero(small & (guess.min(axis=1) >= -_OUTSIDE))
            weights = np.clip(guess[chosen], 0.0, 1.0)
            weights = np.einsum("ni,nij->nj", weights, parts[chosen])
            found.append((place[chosen], patch[chosen], weights))
            if small.all():
                break
            normals = np.stack([one[1] for one in corners], axis=1)
            axis = normals.sum(axis=1)
            axis /= norms(axis)[:, None]
            cosine = np.einsum("nij,nj->ni", normals, axis).min(axis=1, initial=1.0)
            may = self._may_reflect(ends_m, middle_m, reach_m, axis, np.arccos(cosine))
            large = np.flatnonzero(~small & may)
            # the longest side goes from corner number - 1 to corner number
            first = sides_m[large].argmax(axis=1)[:, None] + np.array([-1, 0, 1])
            one, other, last = np.moveaxis(
                np.take_along_axis(parts[large], (first % 3)[:, :, None], axis=1), 1, 0
            )
            half = (one + other) / 2
            parts = np.concatenate(
                [np.stack([one, half, last], axis=1), np.stack([half, other, last], axis=1)]
            )
            place, patch = np.tile(place[large], 2), np.tile(patch[large], 2)
        place, patch, weights = (np.concatenate(one) for one in zip(*found, strict=True))
        return place, patch, weights

    def _newton(self, patch: Indices, ends_m: Real, weights: Real) -> Real:
        """Search for the weights at which there is no mismatch, from these weights, (n, 3)."""
        patches, edges = self.patches.select(patch), self._edges[patch]
        weights = weights / weights.sum(axis=1)[:, None]
        moves = np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
        for _ in range(_STEPS):
            here = self._mismatch(edges, ends_m, *patches.at(weights))
            if not here.size or np.abs(here).max() <= _EXACT:
                break
            (a, c), (b, d) = (
                (
                    (self._mismatch(edges, ends_m, *patches.at(weights + _STEP * move)) - here)
                    / _STEP
                ).T
                for move in moves
            )
            with np.errstate(all="ignore"):
                first = (here[:, 0] * d - here[:, 1] * b) / (a * d - b * c)
                second = (a * here[:, 1] - c * here[:, 0]) / (a * d - b * c)
                step = np.stack([first, second], axis=1)
                step = step / np.maximum(np.abs(step).max(axis=1), 1.0)[:, None]
                weights = weights - step @ moves
        return weights

    # -- the tree ----------------------------------------------------------------------------------

    def _build_tree(self) -> None:
        """Return the levels of the tree, from single patches to the top.

        Each node has a sphere around its patches, and a cone around their normals. Node i has nodes
        2i and 2i + 1 of the level below.
        """
        patches = self.patches
        curve = along_curve(patches.corners_m.mean(axis=1))
        # Patches that look into like directions come together: a sheet has two sides.
        octant = (patches.normals.mean(axis=1) > 0) @ np.array([1, 2, 4])
        self._order = curve[np.argsort(octant[curve], kind="stable")]
        corners_m, normals = patches.corners_m[self._order], patches.normals[self._order]
        rise_m = np.abs(patches.lift_m(np.full((len(patches), 3), 1 / 3)))[self._order]
        self._levels: list[tuple[Real, ...]] = []
        size = 1
        while not self._levels or len(self._levels[-1][0]) > _BRANCHES:
            begins, node = np.arange(0, len(rise_m), size), np.arange(len(rise_m)) // size
            low_m = np.minimum.reduceat(corners_m.min(axis=1), begins)
            high_m = np.maximum.reduceat(corners_m.max(axis=1), begins)
            centre_m = (low_m + high_m) / 2
            away_m = np.linalg.norm(corners_m - centre_m[node, None], axis=2).max(axis=1)
            radius_m = np.maximum.reduceat(away_m, begins) + np.maximum.reduceat(rise_m, begins)
            axis = np.add.reduceat(normals.sum(axis=1), begins)
            axis /= np.maximum(norms(axis), 1e-300)[:, None]
            cosine = np.einsum("kij,kj->ki", normals, axis[node]).min(axis=1)
            spread = np.arccos(np.clip(np.minimum.reduceat(cosine, begins), -1.0, 1.0))
            self._levels.append((centre_m, radius_m, axis, spread))
            size *= _BRANCHES

    def _candidates(self, places_m: Real) -> tuple[Indices, Indices]:
        """Return the pairs of places and patches that may have a reflection, (n,) each."""
        place, node = np.arange(len(places_m)), np.zeros(len(places_m), dtype=np.intp)
        for level in reversed(self._levels):
            place = np.repeat(place, _BRANCHES)
            node = (_BRANCHES * node[:, None] + np.arange(_BRANCHES)).ravel()
            there = np.flatnonzero(node < len(level[0]))
            place, node = place[there], node[there]
            kept = self._may_reflect(places_m[place], *(one[node] for one in level))
            place, node = place[kept], node[kept]
        return place, self._order[node]

    def _may_reflect(
        self, places_m: Real, centre_m: Real, radius_m: Real, axis: Real, spread: Real
    ) -> Mask:
        """Return True where a normal in cones may bisect the angle between place and antenna, (n,).

        The cones have a unit axis and half an opening angle; their points lie in spheres.
        """
        bisector, turned = bisectors(centre_m, radius_m, places_m, self._antenna_m)
        angle = np.arccos(np.clip(dots(bisector, axis), -1.0, 1.0))
        return np.asarray(angle <= spread + turned + 1e-6)


def bisectors(centre_m: Real, radius_m: Real, one_m: Real, other_m: Real) -> tuple[Real, Real]:
    """Return the bisectors of the directions from spheres to two places, and how much they can
    turn.

    The bisectors are unit vectors at the centres, (n, 3). The second result is the largest angle to
    the bisector of any point in the sphere, (n,) [rad]; pi if every direction is possible. Places
    are (3,) or (n, 3) [m].
    """
    bisector, off = np.zeros_like(centre_m), np.zeros(len(centre_m))
    for end_m in (one_m, other_m):
        away_m = np.maximum(distances(centre_m, end_m), 1e-300)
        bisector += (end_m - centre_m) / away_m[:, None]
        # how far the direction turns over the sphere: 2 sin(asin(x) / 2)
        sine = np.minimum(radius_m / away_m, 1.0)
        off += np.where(sine < 1, np.sqrt(2 - 2 * np.sqrt(1 - sine**2)), 2.0)
    size = np.maximum(norms(bisector), 1e-300)
    turned_rad = np.where(off >= size, np.pi, np.arcsin(np.minimum(off / size, 1.0)))
    return np.asarray(bisector / size[:, None]), turned_rad


def _first_of_each(found: SpecularPoints) -> Mask:
    """Return a mask without repetitions: reflections at a common edge have the same place."""
    kept = np.ones(found.place.size, dtype=bool)
    apart = 0
    while True:
        apart += 1
        same = found.place[apart:] == found.place[:-apart]
        if not same.any():
            return kept
        one_m, other_m = found.points_m[apart:], found.points_m[:-apart]
        close = distances(one_m, other_m) <= 1e-7 * (1e-6 + norms(one_m))
        alike = dots(found.normals[apart:], found.normals[:-apart]) > 1 - 1e-6
        kept[apart:] &= ~(same & close & alike)


def _towards(ends_m: Real, points_m: Real) -> Real:
    """Return unit vectors from points to ends, (n, 3)."""
    way_m = ends_m - points_m
    return np.asarray(way_m / norms(way_m)[:, None])


def _cross(a: Real, b: Real) -> Real:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
