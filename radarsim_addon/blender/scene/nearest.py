# SPDX-License-Identifier: GPL-3.0-or-later
"""Distance of the origin from a triangle mesh, in float64. Uses numpy only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real

#: Number of triangles per block, to limit memory.
_BLOCK = 1 << 17


def nearest_distance(vertices: Real, triangles: NDArray[np.int32]) -> float:
    """Return the distance of the origin from triangles, (m, 3) indices of vertices (n, 3), m >= 1.

    Blender's BVH computes in float32, which has an error of 0.5 mm at 10 km.
    """
    best = np.inf
    for start in range(0, len(triangles), _BLOCK):
        a, b, c = (vertices[triangles[start : start + _BLOCK, i]] for i in range(3))
        best = min(best, float(_triangle_distances(a, b, c).min()))
    return best


def _triangle_distances(a: Real, b: Real, c: Real) -> Real:
    """Return the distance of the origin from each triangle, shape (m,).

    It is the distance from the plane if the projection of the origin is inside the triangle, else
    that from the nearest edge.
    """
    normal = np.cross(b - a, c - a)
    area2 = np.einsum("ij,ij->i", normal, normal)
    # The projection of the origin is `foot`. It is inside if it is left of all three edges.
    with np.errstate(divide="ignore", invalid="ignore"):
        height = np.einsum("ij,ij->i", a, normal) / np.sqrt(area2)
        foot = normal * (np.einsum("ij,ij->i", a, normal) / area2)[:, None]
    inside = area2 > 0
    for start, end in ((a, b), (b, c), (c, a)):
        side = np.einsum("ij,ij->i", np.cross(end - start, foot - start), normal)
        inside &= side >= 0
    edges = np.minimum.reduce([_segment_distances(*ends) for ends in ((a, b), (b, c), (c, a))])
    return np.asarray(np.where(inside, np.abs(height), edges))


def _segment_distances(start: Real, end: Real) -> Real:
    along = end - start
    length2 = np.einsum("ij,ij->i", along, along)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = -np.einsum("ij,ij->i", start, along) / length2
    fraction = np.clip(np.where(length2 > 0, fraction, 0.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(start + fraction[:, None] * along, axis=1))
