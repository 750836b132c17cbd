# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of a mesh, and what follows from them."""

from __future__ import annotations

import numpy as np
import pytest

from radarsim_addon.signal.scene import Mesh

#: A triangle, a square, an arrow-head whose cut must be the other one, and a pentagon.
PLACES = np.array(
    [[0, 0], [1, 0], [0, 1], [5, 0], [6, 0], [6, 1], [5, 1],
     [10, 0], [14, 2], [10, 4], [11, 2], [0, 5], [2, 5], [3, 6], [1, 8], [-1, 6]],
    dtype=np.float64,
)  # fmt: skip
AREAS = [0.5, 1.0, 6.0, 7.0]


def mesh(shift: int = 0, pentagon: bool = False, curved: bool = False) -> Mesh:
    """The polygons, whose last one begins at another corner."""
    starts = [0, 3, 7, 11][: 4 if pentagon else 3]
    count = 16 if pentagon else 11
    corners = np.arange(count, dtype=np.int32)
    corners[7:11] = np.roll(corners[7:11], shift)
    cut = None
    if pentagon:
        cut = np.concatenate(
            [mesh(shift).triangle_corners, [[11, 12, 13], [11, 13, 14], [11, 14, 15]]]
        )
    return Mesh(
        np.pad(PLACES, ((0, 0), (0, 1))),
        np.array(starts, dtype=np.int32),
        corners,
        corners,
        np.arange(len(starts), dtype=np.int32)[::-1],
        corners[:, None] + np.zeros(3) if curved else None,
        cut,
    )  # fmt: skip


@pytest.mark.parametrize("shift", range(4))
@pytest.mark.parametrize("pentagon", [False, True])
def test_triangles_cover_their_polygons(shift: int, pentagon: bool) -> None:
    found = mesh(shift, pentagon, curved=True)
    a, b, c = found.vertices[found.triangles].transpose(1, 0, 2)
    area = np.cross(b - a, c - a)[:, 2] / 2
    assert (area > 0).all()  # none turned round, so none overlaps
    np.testing.assert_allclose(np.bincount(found.polygons, area), AREAS[: len(found.sides)])
    np.testing.assert_allclose(found.areas, AREAS[: len(found.sides)])
    # the normals of corners stay with these
    np.testing.assert_array_equal(found.triangle_normals[..., 0], found.triangles)


def test_sides_and_centres() -> None:
    found = mesh(pentagon=True)
    assert found.sides.tolist() == [3, 4, 4, 5]
    np.testing.assert_allclose(found.centers[1], [5.5, 0.5, 0.0])
    np.testing.assert_allclose(found.centers[3], [1.0, 6.0, 0.0])
    np.testing.assert_array_equal(found.triangle_normals, np.tile([0.0, 0.0, 1.0], (8, 3, 1)))


def box(missing: int = 0) -> Mesh:
    """A cube of quads, without a number of its last faces."""
    faces = np.array(
        [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    )[: 6 - missing]
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    numbers = np.unique(edges, axis=0, return_inverse=True)[1].ravel()
    places = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
    starts = 4 * np.arange(len(faces), dtype=np.int32)
    none = np.zeros(len(faces), dtype=np.int32)
    return Mesh(
        places.astype(np.float64),
        starts,
        faces.ravel().astype(np.int32),
        numbers.astype(np.int32),
        none,
    )


def test_closed_and_neighbours() -> None:
    cube = box()
    assert cube.is_closed
    assert not box(1).is_closed
    one, other = np.sort(cube.neighbours, axis=0)
    pairs = set(zip(one.tolist(), other.tolist(), strict=True))
    opposite = {(0, 1), (2, 4), (3, 5)}
    assert pairs == {(i, j) for j in range(6) for i in range(j)} - opposite
    assert len(one) == 12


def test_normals_point_outwards() -> None:
    cube = box()
    away = cube.centers - cube.vertices.mean(axis=0)
    np.testing.assert_allclose(cube.normals, 2 * away)
    flat = mesh()
    flat.vertices[2] = 2 * flat.vertices[1]  # a polygon without an area
    np.testing.assert_array_equal(flat.normals[0], [0.0, 0.0, 1.0])
    assert flat.areas[0] == 0


def test_a_ray_meets_it() -> None:
    cube = box()
    face, way = cube.rays.first(np.array([[0.3, 0.4, -2.0]]), np.array([[0.0, 0.0, 1.0]]))
    assert cube.polygons[face[0]] == 0
    assert way[0] == pytest.approx(2.0, rel=1e-12)


def test_an_empty_mesh() -> None:
    none = np.empty(0, dtype=np.int32)
    empty = Mesh(np.empty((0, 3)), none, none, none, none)
    assert empty.triangles.shape == (0, 3)
    assert empty.triangle_normals.shape == (0, 3, 3)
    assert empty.areas.shape == (0,)
    assert empty.centers.shape == (0, 3)
    assert empty.neighbours.shape == (2, 0)
    assert empty.is_closed
