# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices of paths in float64: known rays intersected again with the meshes that they met.

Cycles gives hit points in float32 of world coordinates, and traces rays in float32 of the distance
from the camera. The ray of a pixel is known in float64, and so is the mesh in the object's own
space; the hit point tells which triangle was met. `HitPoints.refine` moves the vertices of rows
onto their triangles, and computes their lengths again: for one reflection along the pixel's ray;
for more, the first vertex along its ray, and the last one, which the colours of the transmitter's
light give, along the normal of its face. A length stays that of the range encoding where something
may delay the path: geometry does not see that.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Mask, Real, are_finite, crosses, distances, dots, norms, take_rows
from ...signal.paths import (
    PathFlag,
    PathRows,
    Spaces,
    TriangleMesh,
)
from ...signal.scene import Mesh, SceneModel
from .obstacles import DelayedWays

# -------------------------------------------------------------------------------------------------
# Meshes of bodies that rays hit near known points; small ones of many shapes are one mesh.
# -------------------------------------------------------------------------------------------------


#: Triangles up to which meshes are joined, so that rays of many are treated together.
_SMALL_MESH = 1 << 14
#: Fraction of points off the mesh above which Cycles renders another one (displaced by its
#: material, diced adaptively). At limbs a few thousandths are off.
_MOST_MISSED = 0.05


#: For each mesh one that holds it, maybe with others, and which part of that it is.
Holders = WeakKeyDictionary[Mesh, tuple[TriangleMesh, int]]


class BodyMeshes:
    """Meshes of a scene at one moment, in float64.

    Rows have the numbers of the bodies, from 1. `holders` are those of meshes that were used
    before; more are added.
    """

    def __init__(self, model: SceneModel, holders: Holders) -> None:
        self._model, self._holders = model, holders

    def hit(
        self, bodies: Indices, origins_m: Real, directions: Real, near_m: Real, reach_m: Real
    ) -> tuple[Real, Real]:
        """Return where rays hit the meshes of their bodies.

        The results are the distance along each ray in units of the length of its direction, (n,),
        and the normal there, (n, 3). Both are NaN where the ray misses.
        """
        found, normals = np.full(len(bodies), np.nan), np.full(near_m.shape, np.nan, order="F")
        known = _numbers((bodies > 0) & are_finite(near_m))
        if not bodies[known].size:
            return found, normals
        poses, body = _distinct(bodies[known] - 1)
        own = self._model.pose[poses]
        flat = np.abs(np.linalg.det(own)) < np.finfo(np.float64).tiny
        inverses = np.linalg.inv(np.where(flat[:, None, None], np.eye(4), own))
        turn, place_m = inverses[:, :3, :3], own[:, :3, 3]
        stretch = np.linalg.norm(turn, ord=2, axis=(1, 2))
        for mesh, part in self._meshes_of(self._model.shape[poses], flat):
            kind = part.take(body)
            here = _numbers(kind >= 0)
            parts = kind[here]
            if not parts.size:
                continue
            if np.any(parts[1:] < parts[:-1]):
                # sorted, so that rays that follow one another are of one body
                here = np.arange(kind.size)[here][np.argsort(parts, kind="stable")]
                parts = kind[here]
            each = body[here]
            mine = here if isinstance(known, slice) else known[here]
            # The mesh stays as it is, and the rays come into its space: so its shape stays exact.
            way, normal = mesh.hit(
                rows_of(origins_m, mine),
                _of_rows(directions, mine),
                _of_rows(near_m, mine),
                reach_m[mine] * stretch.take(each),
                parts,
                Spaces(turn, place_m, each),
            )
            lost = np.isnan(way)
            if lost.any():
                missed = np.bincount(parts, weights=lost)
                lost |= (missed > _MOST_MISSED * np.bincount(parts))[parts]
                way[lost], normal[lost] = np.nan, np.nan
            found[mine], normals[mine] = way, normal
        return found, normals

    def _meshes_of(self, shape: Indices, flat: Mask) -> list[tuple[TriangleMesh, Indices]]:
        """Return the meshes of some bodies. For each mesh: the part of the mesh that each body has,
        or -1 for bodies of other meshes.

        The `flat` bodies have no volume, and rays do not hit them.
        """
        numbers, place = np.unique(shape, return_inverse=True)
        read = [self._model.meshes[number] for number in numbers.tolist()]
        self._hold([one for one in read if one is not None and one not in self._holders])
        of_shape = [None if one is None else self._holders[one] for one in read]
        meshes = dict.fromkeys(one[0] for one in of_shape if one is not None)
        found = []
        for mesh in meshes:
            parts = [one[1] if one is not None and one[0] is mesh else -1 for one in of_shape]
            found.append((mesh, np.where(flat, -1, np.array(parts)[place])))
        return found

    def _hold(self, meshes: list[Mesh]) -> None:
        """Prepare meshes for rays. Small meshes become parts of one mesh."""
        units = self._model.metres_per_unit
        small = [mesh for mesh in meshes if len(mesh.triangles) <= _SMALL_MESH]
        for mesh in meshes:
            if len(mesh.triangles) > _SMALL_MESH:
                self._holders[mesh] = TriangleMesh(mesh.vertices * units, mesh.triangles), 0
        if small:
            before = np.cumsum([0, *(len(mesh.vertices) for mesh in small)])
            joined = TriangleMesh(
                np.concatenate([mesh.vertices for mesh in small]) * units,
                np.concatenate([m.triangles + n for m, n in zip(small, before, strict=False)]),
                np.repeat(np.arange(len(small)), [len(mesh.triangles) for mesh in small]),
            )
            self._holders.update({mesh: (joined, n) for n, mesh in enumerate(small)})


def _distinct(numbers: Indices) -> tuple[Indices, Indices]:
    """Return the different values of small numbers, and the place of each number among
    them, (n,).
    """
    there = np.flatnonzero(np.bincount(numbers))
    place = np.zeros(int(there[-1]) + 1, dtype=np.intp)
    place[there] = np.arange(there.size)
    return there, place.take(numbers)


def _numbers(where: Mask) -> Indices | slice:
    """Return the indices of the rows where the mask is True. If it is True everywhere, this is a
    slice, which needs no copy.
    """
    return slice(None) if where.all() else np.flatnonzero(where)


def _of_rows(vectors: Real, rows: Indices | slice) -> Real:
    """Return the vectors of these rows, (n, 3), with contiguous columns."""
    return vectors[rows] if isinstance(rows, slice) else take_rows(vectors, rows)


def rows_of(origins_m: Real, rows: Indices | slice) -> Real:
    """Return the start of the rays of these rows: one place for all, (3,), or one for
    each, (n, 3).
    """
    return origins_m if origins_m.ndim == 1 else origins_m[rows]


# -------------------------------------------------------------------------------------------------
# Rows: vertices moved onto the meshes, lengths and their errors.
# -------------------------------------------------------------------------------------------------


_EPS32 = float(np.finfo(np.float32).eps) / 2
#: Largest error of a hit point, in roundings of its distances from the origin and from the ray's
#: start (7 standard deviations of what was measured).
_ROUNDINGS = 4.0
#: Error of a length over that of its point: twice, and as much again where the ray is slanted.
_LENGTH_OVER_POINT = 4.0
#: Error of a vertex from the transmitter's colours, relative to the length of the path: the
#: largest, and a standard deviation along one axis.
_LARGEST_COLOUR_ERROR, _COLOUR_ERROR = 1e-6, 7e-8
#: Standard deviation of a length in float64, in steps of float64: at normal incidence, and for each
#: unit of the tangent of the angle of incidence. As measured from 10 m to 10 km.
_STRAIGHT, _SLANTED = 0.5, 0.12
#: Standard deviations of such a vertex within which a mirrored ray is taken to have met it.
_MIRRORED_SIGMAS = 6.0
#: Standard deviations of an encoded length within which it is taken to be right.
_LARGEST_SIGMAS = 20.0
#: Path lengths are computed again where float32 may be off by more than this [wavelengths].
TOLERANCE_WAVELENGTHS = 1e-3
#: Rows whose vertices are moved at a time: they stay in the processor's cache.
_ROWS_AT_ONCE = 1 << 13
_READ = (
    "order",
    "flags",
    "transparent_depth",
    "length_m",
    "length_sigma_m",
    "first_scatterer_m",
    "last_scatterer_m",
    "direction",
    "last_body",
    "first_body",
)


class Normals:
    """Normals at the first and the last vertices of a number of rows, of any length; NaN:
    unknown.
    """

    def __init__(self, rows: int) -> None:
        self._rows = rows
        self._found: list[tuple[Indices, Real, Real]] = []

    def add(self, rows: Indices, first: Real, last: Real) -> None:
        self._found.append((rows, first, last))

    def all(self) -> tuple[Real, Real]:
        for rows, first, last in self._found:
            if rows.size == self._rows:
                return first, last
        first, last = (np.full((self._rows, 3), np.nan, order="F") for _ in range(2))
        for rows, one, other in self._found:
            first[rows], last[rows] = one, other
        return first, last


class HitPoints:
    """Meshes of a scene at one moment, and the rays that hit them; see `BodyMeshes`.

    `opaque`: nothing in the scene lets power through, so no path is delayed. `ways` are those to
    the transmitter; None if nothing delays what is seen directly.
    """

    def __init__(
        self,
        model: SceneModel,
        wavelength_m: float,
        opaque: bool,
        holders: Holders,
        ways: DelayedWays | None = None,
    ) -> None:
        self._surfaces = BodyMeshes(model, holders)
        self._tolerance_m = TOLERANCE_WAVELENGTHS * wavelength_m
        self._opaque, self._ways = opaque, ways

    def refine(self, rows: PathRows, origin_m: Real, transmitter_m: Real) -> Normals:
        """Move the vertices of labelled rows onto their triangles; change path lengths and their
        sigmas.

        Rays start at `origin_m`, (3,) or (n, 3) [m]. Returns the normals at the vertices.
        """
        normals = Normals(rows.size)
        read = rows.copy(*_READ)
        flags, order = read["flags"], read["order"]
        one_path = flags & PathFlag.MIXED == 0
        seen = (flags & PathFlag.ENCODED_LENGTH == 0) | (read["transparent_depth"] == 0) & one_path
        one = np.flatnonzero((order == 1) & seen)
        self._refine_order_1(rows, read, one, rows_of(origin_m, one), transmitter_m, normals)
        later = np.flatnonzero((order > 1) & one_path)
        self._refine_later(rows, read, later, rows_of(origin_m, later), transmitter_m, normals)
        return normals

    def _refine_order_1(
        self,
        rows: PathRows,
        read: PathRows,
        chosen: Indices,
        origins_m: Real,
        transmitter_m: Real,
        normals: Normals,
    ) -> None:
        mine = read.chosen(chosen)
        reach_m = _reach_m(mine["last_scatterer_m"], origins_m)
        needed = np.flatnonzero(_LENGTH_OVER_POINT * reach_m > self._tolerance_m)
        if not needed.size:
            return
        if needed.size < chosen.size:
            chosen, reach_m = chosen[needed], reach_m[needed]
            mine, origins_m = mine[needed], rows_of(origins_m, needed)
        points_m, direction = mine["last_scatterer_m"], mine["direction"]
        way_m, normal = self._surfaces.hit(
            mine["last_body"], origins_m, direction, points_m, reach_m
        )
        normals.add(chosen, normal, normal)
        for start in range(0, chosen.size, _ROWS_AT_ONCE):
            some = slice(start, start + _ROWS_AT_ONCE)
            part = mine[some]
            begin_m = origins_m if origins_m.ndim == 1 else origins_m[some]
            found = way_m[some], normal[some], reach_m[some]
            self._move_order_1(rows, chosen[some], part, begin_m, transmitter_m, *found)

    def _move_order_1(
        self,
        rows: PathRows,
        chosen: Indices,
        mine: PathRows,
        origins_m: Real,
        transmitter_m: Real,
        way_m: Real,
        normal: Real,
        reach_m: Real,
    ) -> None:
        """Move the vertices of the chosen rows to the places where their rays hit; `mine` has the
        columns of these rows.
        """
        direction, flags = mine["direction"], mine["flags"]
        ray_m = way_m[:, None] * direction
        found_m = origins_m + ray_m
        # numbers no larger than the length, wherever the world's origin is
        length_m = way_m + norms(ray_m + (origins_m - transmitter_m))
        with np.errstate(divide="ignore", invalid="ignore"):
            # The encoding holds a delay on the way to the transmitter. For a ray that grazes the
            # surface it holds the hit of another ray close by. It is too short where Cycles
            # lifts the start of shadow rays off smooth meshes (shadow terminator).
            cosine = np.abs(dots(direction, normal)) / norms(normal)
            grazed_m = 2 * reach_m / cosine
            tangent_2 = np.maximum(1 / (cosine * cosine) - 1, 0.0)
            delay_m = mine["length_m"] - length_m
            undelayed = delay_m <= grazed_m + _LARGEST_SIGMAS * mine["length_sigma_m"]
        encoded = flags & PathFlag.ENCODED_LENGTH != 0
        if self._ways is not None:
            asked = np.flatnonzero(encoded & undelayed)
            undelayed[asked] = ~self._ways.to(take_rows(mine["last_scatterer_m"], asked))
        hit = np.isfinite(way_m) & (~encoded | undelayed)
        # Behind transparent surfaces a delay below the encoding's noise goes unnoticed.
        direct = hit & (mine["transparent_depth"] == 0)
        sigma_m = np.spacing(length_m) * np.sqrt(_STRAIGHT**2 + _SLANTED**2 * tangent_2)
        for name, found, where in (
            ("last_scatterer_m", found_m, hit),
            ("first_scatterer_m", found_m, hit),
            ("length_m", length_m, hit),
            ("length_sigma_m", sigma_m, direct),
            ("flags", flags & ~np.uint16(PathFlag.ENCODED_LENGTH), hit),
        ):
            _put(rows[name], chosen, found, where)

    def _refine_later(
        self,
        rows: PathRows,
        read: PathRows,
        chosen: Indices,
        origins_m: Real,
        transmitter_m: Real,
        normals: Normals,
    ) -> None:
        """Refine paths of several reflections.

        The ray of the transmitter through the last vertex gives the face of that vertex. Along this
        ray, the error of the vertex would be divided by the cosine of incidence, so the vertex
        moves along the normal instead.
        """
        needed = np.flatnonzero(
            _LARGEST_SIGMAS * read["length_sigma_m"][chosen] > self._tolerance_m
        )
        if not needed.size:
            return
        chosen, origins_m = chosen[needed], rows_of(origins_m, needed)
        mine = read[chosen]
        direction, first_m = mine["direction"], mine["first_scatterer_m"]
        coloured_m = _LARGEST_COLOUR_ERROR * mine["length_m"]
        reach_m = coloured_m + _reach_m(first_m, origins_m)
        way_m, normal = self._surfaces.hit(
            mine["first_body"], origins_m, direction, first_m, reach_m
        )
        seen = np.isfinite(way_m)
        first_m = np.where(seen[:, None], origins_m + way_m[:, None] * direction, first_m)

        last_m = mine["last_scatterer_m"]
        reach_m = coloured_m + _reach_m(last_m, transmitter_m)
        segment_m = last_m - transmitter_m
        share, last = self._surfaces.hit(
            mine["last_body"], transmitter_m, segment_m, last_m, reach_m
        )
        normals.add(chosen, normal, last)
        lit = np.isfinite(share)
        with np.errstate(invalid="ignore"):
            last /= norms(last)[:, None]
            off_m = dots((share - 1)[:, None] * segment_m, last)
            last_m = np.where(lit[:, None], last_m + off_m[:, None] * last, last_m)
        # If the first surface is a mirror, its ray gives the second vertex better.
        two = seen & lit & (mine["order"] == 2)
        within_m = _MIRRORED_SIGMAS * _COLOUR_ERROR * mine["length_m"]
        with np.errstate(invalid="ignore"):
            turn = 2 * dots(direction, normal) / dots(normal, normal)
            mirrored = direction - turn[:, None] * normal
            # Rays of rough surfaces rarely pass as near as that.
            passes = norms(crosses(mirrored, last_m - first_m)) <= (1 + 1e-6) * within_m
        further_m, _ = self._surfaces.hit(
            np.where(two & passes, mine["last_body"], 0), first_m, mirrored, last_m, reach_m
        )
        reflected_m = first_m + further_m[:, None] * mirrored
        with np.errstate(invalid="ignore"):
            exact = distances(reflected_m, last_m) <= within_m
        last_m = np.where(exact[:, None], reflected_m, last_m)
        rows["first_scatterer_m"][chosen], rows["last_scatterer_m"][chosen] = first_m, last_m

        between_m, back_m = last_m - first_m, last_m - transmitter_m
        far_m, near_m = norms(between_m), norms(back_m)
        length_m = way_m + far_m + near_m
        with np.errstate(divide="ignore", invalid="ignore"):
            # how the length changes as the last vertex moves within its face
            slope = between_m / far_m[:, None] + back_m / near_m[:, None]
            slope -= dots(slope, last)[:, None] * last
            sigma_m = norms(slope) * _COLOUR_ERROR * mine["length_m"]
            sigma_m = np.where(exact, _rounding_m(last_m, length_m), sigma_m)
            # Geometry does not see a pane between the vertices, which delays.
            agrees_m = 2 * coloured_m + _LARGEST_SIGMAS * mine["length_sigma_m"]
            known = two & self._opaque & (np.abs(length_m - mine["length_m"]) <= agrees_m)
        sure = chosen[known]
        rows["length_m"][sure], rows["length_sigma_m"][sure] = length_m[known], sigma_m[known]
        rows["flags"][sure] &= ~np.uint16(PathFlag.ENCODED_LENGTH)

    def normals(
        self, bodies: Indices, starts_m: Real, points_m: Real, known: Real | None = None
    ) -> Real:
        """Return the unit normals, (n, 3), where rays from `starts_m` hit bodies near `points_m`;
        NaN: unknown.

        `known` has the normals that are known already, of any length, or NaN.
        """
        found = np.full((bodies.size, 3), np.nan, order="F") if known is None else known
        sought = np.flatnonzero(np.isnan(found[:, 0]))
        if sought.size:
            bodies, starts_m = bodies[sought], rows_of(starts_m, sought)
            points_m = take_rows(points_m, sought)
            reach_m = _LARGEST_COLOUR_ERROR * distances(points_m, starts_m) + _reach_m(
                points_m, starts_m
            )
            normal = self._surfaces.hit(bodies, starts_m, points_m - starts_m, points_m, reach_m)[1]
            found = found.copy("K")
            found[sought] = normal
        return np.asarray(found / norms(found)[:, None])


def _put(column: NDArray[Any], rows: Indices, values: NDArray[Any], where: Mask) -> None:
    """Set a column to `values` in those of the rows where the mask is True."""
    if where.all() and rows[-1] - rows[0] == rows.size - 1:  # numbers that rise
        column[rows[0] : rows[-1] + 1] = values
    else:
        column[rows[where]] = values[where]


def _reach_m(points_m: Real, start_m: Real) -> Real:
    """Return the largest error of each hit point of rays from `start_m`, (n,) [m]."""
    return _ROUNDINGS * _EPS32 * (norms(points_m) + distances(points_m, start_m))


def _rounding_m(points_m: Real, length_m: Real) -> Real:
    """Return the rounding error of each length, (n,) [m]: the step of float64 at the largest number
    in its computation.
    """
    return np.asarray(np.spacing(np.maximum(length_m, np.abs(points_m).max(axis=1))))
