# SPDX-License-Identifier: GPL-3.0-or-later
"""The parallel faces of objects that are layers, of many objects in one pass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...array_types import Indices, Real
from ...vectors import dots, norms
from ..state import evaluated_mesh, read_numbers
from .wall_faces import PARALLEL

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
    """Polygons of several evaluated objects, `of` which each is: normals, areas and centres in
    their own axes; `linear` (n, 3, 3) turns these to the world's."""

    of: Indices
    normal: Real
    area: Real
    center: Real
    linear: Real

    @classmethod
    def read(cls, items: Sequence[Any], depsgraph: Any) -> LayerFaces:
        """Read them from Blender."""
        normal, area, center, sizes = [], [], [], []
        for item in items:
            with evaluated_mesh(item.evaluated_get(depsgraph)) as mesh:
                faces = () if mesh is None else mesh.polygons
                sizes.append(len(faces))
                if len(faces):
                    normal.append(read_numbers(faces, "normal", 3))
                    area.append(read_numbers(faces, "area"))
                    center.append(read_numbers(faces, "center", 3))
        poses = [item.evaluated_get(depsgraph).matrix_world.to_3x3() for item in items]
        return cls(
            np.repeat(np.arange(len(items)), sizes),
            np.concatenate([np.empty((0, 3)), *normal], dtype=np.float64),
            np.concatenate([np.empty((0, 1)), *area], dtype=np.float64)[:, 0],
            np.concatenate([np.empty((0, 3)), *center], dtype=np.float64),
            np.array(poses, dtype=np.float64).reshape(-1, 3, 3),
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
