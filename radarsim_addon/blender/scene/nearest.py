# SPDX-License-Identifier: GPL-3.0-or-later
"""Least distance of the origin from a triangle mesh, in float64. Pure numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real

#: Triangles handled at once, so that memory stays small for any mesh.
_BLOCK = 1 << 17


def nearest_distance(vertices: Real, triangles: NDArray[np.int32]) -> float:
    """Least distance of the origin from a mesh.

    Parameters
    ----------
    vertices
        Shape (n, 3), relative to the point of interest.
    triangles
        Vertex indices, shape (m, 3), m >= 1.

    Returns
    -------
    float
        In the unit of the vertices. (A BVH of Blender would answer in float32, which at
        10 km is worth half a millimetre.)
    """
    best = np.inf
    for start in range(0, len(triangles), _BLOCK):
        a, b, c = (vertices[triangles[start : start + _BLOCK, i]] for i in range(3))
        best = min(best, float(_triangle_distances(a, b, c).min()))
    return best


def _triangle_distances(a: Real, b: Real, c: Real) -> Real:
    """Distance of the origin from each triangle, shape (m,): its plane where the foot is inside,
    else the nearest of its three edges."""
    normal = np.cross(b - a, c - a)
    area2 = np.einsum("ij,ij->i", normal, normal)
    # Foot of the perpendicular is a + t; inside when it is left of all three edges.
    with np.errstate(divide="ignore", invalid="ignore"):
        height = np.einsum("ij,ij->i", a, normal) / np.sqrt(area2)
        foot = normal * (np.einsum("ij,ij->i", a, normal) / area2)[:, None]
    inside = area2 > 0
    for start, end in ((a, b), (b, c), (c, a)):
        side = np.einsum("ij,ij->i", np.cross(end - start, foot - start), normal)
        inside &= side >= 0
    edges = np.minimum(
        np.minimum(_segment_distances(a, b), _segment_distances(b, c)), _segment_distances(c, a)
    )
    return np.where(inside, np.abs(height), edges)


def _segment_distances(start: Real, end: Real) -> Real:
    along = end - start
    length2 = np.einsum("ij,ij->i", along, along)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = -np.einsum("ij,ij->i", start, along) / length2
    share = np.clip(np.where(length2 > 0, share, 0.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(start + share[:, None] * along, axis=1))
