# SPDX-License-Identifier: GPL-3.0-or-later
"""Distance of the origin from a triangle mesh, in float64. Uses numpy only."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...array_types import Real

#: Number of triangles per block, to limit memory.
_BLOCK = 1 << 17


def nearest_distances(surfaces: Iterable[Real]) -> Real:
    """Return the distance of the origin from each of n surfaces, (n,); infinite without triangles.

    A surface is the corners of its triangles, (m, 3, 3). Blender's BVH computes in float32, which
    has an error of 0.5 mm at 10 km.
    """
    found: list[float] = []
    waiting: list[Real] = []
    owners: list[int] = []
    size = 0

    def measure() -> None:
        corners = np.concatenate(waiting)
        starts = np.cumsum([0, *(len(part) for part in waiting)])[:-1]
        least = np.minimum.reduceat(_triangle_distances(*corners.transpose(1, 0, 2)), starts)
        for owner, distance in zip(owners, least.tolist(), strict=True):
            found[owner] = min(found[owner], distance)
        waiting.clear()
        owners.clear()

    for owner, corners in enumerate(surfaces):
        found.append(np.inf)
        for start in range(0, len(corners), _BLOCK):
            part = corners[start : start + _BLOCK]
            if size + len(part) > _BLOCK and waiting:
                measure()
                size = 0
            waiting.append(part)
            owners.append(owner)
            size += len(part)
    if waiting:
        measure()
    return np.array(found)


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
