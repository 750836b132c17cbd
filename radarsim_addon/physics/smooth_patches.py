# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth surfaces of meshes: curved patches over triangles with a normal at each corner.

A patch has the places and normals of its corners. Between them, normals are interpolated as for
smooth shading, and the surface is lifted off the triangle as far as these normals say. Neighbours
with common corners meet without a gap. Spheres and cylinders with exact normals are met exactly,
other surfaces up to the fourth order of the triangle's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from ..array_types import Indices, Integers, Real
from ..vectors import norms

#: Largest angle between normals of one triangle, as a cosine: 30 degrees.
_LEAST_COSINE = np.cos(np.radians(30.0))
#: Largest part of an edge by which a cubic deviates from a parabola: t (1 - t) (1 - 2 t) / 2.
_CUBIC = 0.0481
#: Height of an arc over its chord: square of the chord times curvature, over this; the part of it
#: that a curvature has which changes over the triangle is half.
_ARC = 16.0


@dataclass(frozen=True, eq=False)
class SmoothPatches:
    """Patches over k triangles.

    Attributes
    ----------
    corners_m
        Places of corners, (k, 3, 3) [m].
    normals
        Unit normals at corners, (k, 3, 3).
    shape
        Shape operators at corners, (k, 3, 3, 3) [1/m]: they turn a step on the surface into the
        change of the normal. Positive where the surface is convex.
    slope_m
        How far corner j is below the tangent plane of corner i, (k, i, j) [m].
    """

    corners_m: Real
    normals: Real
    shape: Real
    slope_m: Real

    @classmethod
    def of_mesh(cls, corners_m: Real, normals: Real, vertices: Integers) -> tuple[Self, Real]:
        """Return the patches over triangles, and how far each may be off the surface.

        Parameters
        ----------
        corners_m, normals
            As the attributes.
        vertices
            Numbers of the corners' vertices in the mesh, (k, 3).

        Returns
        -------
        patches, error_m
            The error is (k,) [m]; infinite where normals differ too much to tell the surface.
        """
        own = _corner_shapes(corners_m, normals)
        area = norms(np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0]))
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
        patches = cls(corners_m, normals, shape, slope)
        cubic_m = _CUBIC * np.abs(slope - slope.transpose(0, 2, 1)).max(axis=(1, 2))
        edges = corners_m - np.roll(corners_m, 1, axis=1)
        differs_m = np.einsum("kei,kcij,kej->kec", edges, shape - own, edges) / _ARC
        error_m = np.maximum(cubic_m, np.abs(differs_m).max(axis=(1, 2), initial=0.0))
        cosines = np.einsum("kij,klj->kil", normals, normals).min(axis=(1, 2))
        error_m[~(cosines >= _LEAST_COSINE)] = np.inf
        return patches, np.where(np.isfinite(error_m), error_m, np.inf)

    def __len__(self) -> int:
        return len(self.corners_m)

    def select(self, chosen: Indices) -> Self:
        """Return some of the patches."""
        return type(self)(*(getattr(self, one.name)[chosen] for one in fields(self)))

    def flipped(self) -> Self:
        """Return the other sides of the patches."""
        return type(self)(self.corners_m, -self.normals, -self.shape, -self.slope_m)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the patches of all parts."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))

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

        The axes are unit vectors (k, 3) across the unit `normal` there.
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
    """Means of vectors at corners (k, 3, 3), with weights (k, 3): (k, 3)."""
    first = weights[:, 0, None] * corners[:, 0]
    return np.asarray(
        first + weights[:, 1, None] * corners[:, 1] + weights[:, 2, None] * corners[:, 2]
    )


def _corner_shapes(corners_m: Real, normals: Real) -> Real:
    """Shape operators at the corners by the triangle alone, (k, 3, 3, 3) [1/m]."""
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
