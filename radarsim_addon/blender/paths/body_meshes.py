# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of bodies that rays hit near known points; small ones of many shapes are one mesh."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Mask, Real
from ...signal.paths import Spaces, TriangleMesh
from ...vectors import are_finite, take_rows
from ..motion import Bodies
from ..state import Shape, read_triangles

#: Triangles up to which meshes are joined, so that rays of many are treated together.
_SMALL_MESH = 1 << 14
#: Fraction of a mesh's points off it above which Cycles renders another one (displaced by its
#: material, diced adaptively). At limbs a few thousandths are.
_MOST_MISSED = 0.05


#: Mesh of each shape and its part of it; None without a surface.
Meshes = WeakKeyDictionary[Shape, tuple[TriangleMesh, int] | None]


class BodyMeshes:
    """Meshes of a scene at one moment, in float64.

    Parameters
    ----------
    bodies
        Those whose numbers the rows have. Blender must evaluate nothing else while meshes are
        read.
    metres_per_unit
        Length of a Blender unit [m].
    meshes
        Meshes that Blender has not evaluated since they were read; more are added.
    """

    def __init__(self, bodies: Bodies, metres_per_unit: float, meshes: Meshes) -> None:
        self._bodies, self._units, self._meshes = bodies, metres_per_unit, meshes

    def hit(
        self, bodies: Indices, origins_m: Real, directions: Real, near_m: Real, reach_m: Real
    ) -> tuple[Real, Real]:
        """Distances along rays in lengths of their directions, (n,), and normals, (n, 3).

        NaN where nothing is hit.
        """
        found, normals = np.full(len(bodies), np.nan), np.full(near_m.shape, np.nan, order="F")
        known = _numbers((bodies > 0) & are_finite(near_m))
        if not bodies[known].size:
            return found, normals
        poses, body = _distinct(bodies[known] - 1)
        inverses, flat = self._inverses(poses)
        turn, place_m = inverses[:, :3, :3], self._bodies.pose[poses][:, :3, 3]
        stretch = np.linalg.norm(turn, ord=2, axis=(1, 2))
        for mesh, part in self._meshes_of(self._bodies.shape[poses], flat):
            kind = part.take(body)
            here = _numbers(kind >= 0)
            parts = kind[here]
            if not parts.size:
                continue
            if np.any(parts[1:] < parts[:-1]):
                # rays that follow one another are of one body then
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

    def _inverses(self, bodies: Indices) -> tuple[Real, Mask]:
        """Ways into the spaces of bodies, (n, 4, 4), and which of them have no volume, (n,)."""
        poses = self._bodies.pose[bodies]
        flat = np.abs(np.linalg.det(poses)) < np.finfo(np.float64).tiny
        return np.linalg.inv(np.where(flat[:, None, None], np.eye(4), poses)), flat

    def _meshes_of(self, shape: Indices, flat: Mask) -> list[tuple[TriangleMesh, Indices]]:
        """Meshes of some bodies, and each body's part of the mesh; -1 for bodies of others.

        Nothing is seen of the `flat` ones.
        """
        numbers, place = np.unique(shape, return_inverse=True)
        self._read(numbers.tolist())
        of_shape = [self._meshes[self._bodies.snapshot.shapes[n]] for n in numbers.tolist()]
        meshes = dict.fromkeys(one[0] for one in of_shape if one is not None)
        found = []
        for mesh in meshes:
            parts = [one[1] if one is not None and one[0] is mesh else -1 for one in of_shape]
            found.append((mesh, np.where(flat, -1, np.array(parts)[place])))
        return found

    def _read(self, numbers: list[int]) -> None:
        """Read meshes of shapes that are not known yet; the small ones become parts of one."""
        snapshot = self._bodies.snapshot
        small: list[tuple[Shape, Real, NDArray[np.int32]]] = []
        for shape in (snapshot.shapes[number] for number in numbers):
            if shape in self._meshes:
                continue
            self._meshes[shape] = None
            with snapshot.mesh(shape) as mesh:
                if mesh is None:
                    continue
                vertices, triangles = read_triangles(mesh)
            vertices_m = vertices.astype(np.float64) * self._units
            if len(triangles) > _SMALL_MESH:
                self._meshes[shape] = TriangleMesh(vertices_m, triangles), 0
            else:
                small.append((shape, vertices_m, triangles))
        if small:
            shapes, vertices_of, triangles_of = zip(*small, strict=True)
            before = np.cumsum([0, *map(len, vertices_of)])
            joined = TriangleMesh(
                np.concatenate(vertices_of),
                np.concatenate([own + n for own, n in zip(triangles_of, before, strict=False)]),
                np.repeat(np.arange(len(small)), [len(own) for own in triangles_of]),
            )
            self._meshes.update({shape: (joined, n) for n, shape in enumerate(shapes)})


def _distinct(numbers: Indices) -> tuple[Indices, Indices]:
    """Return the different ones of small numbers, and the place of each among them, (n,)."""
    there = np.flatnonzero(np.bincount(numbers))
    place = np.zeros(int(there[-1]) + 1, dtype=np.intp)
    place[there] = np.arange(there.size)
    return there, place.take(numbers)


def _numbers(where: Mask) -> Indices | slice:
    """Numbers of the rows where it is so; a slice, which costs nothing, where it is so of all."""
    return slice(None) if where.all() else np.flatnonzero(where)


def _of_rows(vectors: Real, rows: Indices | slice) -> Real:
    """Vectors of these rows, (n, 3), with contiguous columns."""
    return vectors[rows] if isinstance(rows, slice) else take_rows(vectors, rows)


def rows_of(origins_m: Real, rows: Indices | slice) -> Real:
    """Where the rays of these rows start, of one place for all, (3,), or of one each, (n, 3)."""
    return origins_m if origins_m.ndim == 1 else origins_m[rows]
