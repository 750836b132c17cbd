# SPDX-License-Identifier: GPL-3.0-or-later
"""First hits and triangles, against rays and triangles one by one."""

from __future__ import annotations

import numpy as np
import pytest

from radarsim_addon.signal.draft import DraftPolygons, ViewGrid, first_hits


def moeller_trumbore(points: np.ndarray, triangles: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """Distances along a ray from the origin of each triangle; infinite where it misses."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    first, second = b - a, c - a
    normal = np.cross(ray, second)
    volume = np.einsum("ni,ni->n", first, normal)
    u = -np.einsum("ni,ni->n", a, normal) / volume
    other = np.cross(-a, first)
    v = other @ ray / volume
    distance = np.einsum("ni,ni->n", second, other) / volume
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    return np.where(met, distance, np.inf)


@pytest.mark.parametrize("spread", [0.3, 8.0], ids=["small", "around the receiver"])
def test_the_nearest_triangle_is_found(spread: float) -> None:
    """Triangles of any orientation, some of which reach behind the plane of the view."""
    rng = np.random.default_rng(1)
    centre = rng.uniform([-4, -4, -12], [4, 4, 1], (120, 1, 3))
    points = (centre + rng.normal(0, spread, (120, 3, 3))).reshape(-1, 3)
    triangles = np.arange(360).reshape(-1, 3)
    grid = ViewGrid(-0.7, 0.5, -0.3, 0.6, 23, 17)
    found = first_hits(points, triangles, grid)
    x, y = grid.places(*np.divmod(np.arange(23 * 17), 23)[::-1])
    rays = np.stack([x, y, np.full(x.size, -1.0)], axis=1)
    expected = np.stack([moeller_trumbore(points, triangles, ray) for ray in rays])
    nearest = expected.min(axis=1)
    np.testing.assert_array_equal(found.pixel, np.flatnonzero(np.isfinite(nearest)))
    assert found.pixel.size > 0
    np.testing.assert_array_equal(found.triangle, expected.argmin(axis=1)[found.pixel])
    np.testing.assert_allclose(found.distance, nearest[found.pixel], rtol=1e-9)
    place = np.einsum("nc,nci->ni", found.weights, points[triangles[found.triangle]])
    np.testing.assert_allclose(place, rays[found.pixel] * found.distance[:, None], atol=1e-9)


def test_a_view_without_triangles_meets_none() -> None:
    grid = ViewGrid(-1, 1, -1, 1, 4, 4)
    assert first_hits(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.intp), grid).pixel.size == 0


def test_quads_keep_their_area_and_normals_their_corners() -> None:
    """A triangle, a square, and an arrow-head whose cut must be the other one."""
    points = np.array(
        [[0, 0], [1, 0], [0, 1], [5, 0], [6, 0], [6, 1], [5, 1],
         [10, 0], [14, 2], [10, 4], [11, 2], [10, 0]], dtype=np.float32,
    )  # fmt: skip
    points = np.column_stack([points, np.zeros(len(points), dtype=np.float32)])
    corners = np.arange(11, dtype=np.int32)
    normals = np.column_stack([corners, corners, corners]).astype(np.float32)
    for shift in range(4):  # whichever corner comes first
        corners[7:] = np.roll(np.arange(7, 11), shift)
        normals[7:] = corners[7:, None]
        mesh = DraftPolygons(
            points, corners, np.array([0, 3, 7], np.int32), np.array([2, 1, 0], np.int32), normals
        ).triangulated()
        a, b, c = points[mesh.triangles].transpose(1, 0, 2)
        area = np.cross(b - a, c - a)[:, 2] / 2
        assert (area > 0).all()  # none turned round, so none overlaps
        assert [area[mesh.slots == slot].sum() for slot in range(3)] == [6.0, 1.0, 0.5]
        np.testing.assert_array_equal(mesh.normals[..., 0], mesh.triangles)
