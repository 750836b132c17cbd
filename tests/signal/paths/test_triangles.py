# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays intersected again with meshes, against closed forms and against all triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from radarsim_addon.signal.paths import Spaces, TriangleMesh
from radarsim_addon.signal.paths.triangles import sorted_places

Array = np.ndarray[Any, Any]


def mesh_of(count: int, place: Any) -> tuple[Array, Array]:
    """Triangles of a grid of count x count cells; `place` maps (u, v) in [0, 1] to points."""
    u, v = np.meshgrid(*2 * [np.linspace(0, 1, count + 1)], indexing="ij")
    number = np.arange(u.size).reshape(u.shape)
    a, b, c, d = (
        number[i : i + count, j : j + count].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
    )
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack(place(u, v), axis=-1).reshape(-1, 3), triangles.astype(np.int32)


def sphere(count: int) -> tuple[Array, Array]:
    """A closed unit sphere; the triangles at its poles have no area."""

    def place(u: Array, v: Array) -> tuple[Array, ...]:
        lat, lon = np.pi * v, 2 * np.pi * u
        return np.sin(lat) * np.cos(lon), np.sin(lat) * np.sin(lon), np.cos(lat)

    return mesh_of(count, place)


def plane(count: int, size: float = 4.0) -> tuple[Array, Array]:
    """z = x / 10 over a square."""
    return mesh_of(count, lambda u, v: (size * (u - 0.5), size * (v - 0.5), size * (u - 0.5) / 10))


def beam(origin: Array, spread: float, count: int, seed: int = 1) -> Array:
    """Unit vectors from the origin of rays that come near the world's origin."""
    aims = np.random.default_rng(seed).uniform(-spread, spread, (count, 3))
    away = aims - origin
    return away / np.linalg.norm(away, axis=1, keepdims=True)


def first_hits(vertices: Array, triangles: Array, origin: Array, directions: Array) -> Array:
    """Distance to the first of all triangles, in extended precision; infinite: none."""
    best = np.full(len(directions), np.inf, dtype=np.longdouble)
    origin, directions = origin.astype(np.longdouble), directions.astype(np.longdouble)
    for a, b, c in vertices.astype(np.longdouble)[triangles]:
        normal = np.cross(b - a, c - a)
        if not normal.any():
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            way = ((a - origin) @ normal) / (directions @ normal)
            point = origin + way[:, None] * directions
            inside = np.ones(len(directions), dtype=bool)
            for start, end in ((a, b), (b, c), (c, a)):
                inside &= np.cross(end - start, point - start) @ normal >= 0
        best = np.where(inside & (way > 0) & (way < best), way, best)
    return best


def seen(origin: Array, directions: Array, way: Array, noise: float) -> Array:
    """Hit points as a renderer gives them: off in all directions."""
    points = origin + way.astype(float)[:, None] * directions
    return points + np.random.default_rng(2).normal(size=points.shape) * noise


@pytest.mark.parametrize("range_m", [10.0, 1e3, 1e4, 1e5])
def test_plane_in_closed_form(range_m: float) -> None:
    """Points off by 7e-8 of the range; the distance comes back to float64."""
    origin = range_m * np.array([0.3, 0.1, 0.95])
    directions = beam(origin, 1.5, 3000)
    normal, noise = np.array([-0.1, 0.0, 1.0]), 7e-8 * range_m
    exact = -(origin @ normal) / (directions @ normal)
    points = seen(origin, directions, exact, noise)
    for count in (1, 40):
        found, normals = TriangleMesh(*plane(count)).hit(origin, directions, points, 7 * noise)
        inside = np.abs((origin + exact[:, None] * directions)[:, :2]).max(axis=1) < 1.9
        np.testing.assert_allclose(found[inside], exact[inside], rtol=1e-15, atol=0)
        np.testing.assert_allclose(
            normals[inside] / normals[inside, 2:], normal + 0 * points[inside]
        )


@pytest.mark.parametrize("range_m", [10.0, 1e4])
def test_closed_sphere_to_its_limb(range_m: float) -> None:
    """What all triangles give in extended precision, also where the point lies on another one."""
    vertices, triangles = sphere(16)
    origin = range_m * np.array([0.6, -0.64, 0.48])
    directions = beam(origin, 0.8, 1000)
    exact = first_hits(vertices, triangles, origin, directions)
    directions, exact = directions[np.isfinite(exact)], exact[np.isfinite(exact)]
    noise = 7e-8 * range_m
    points = seen(origin, directions, exact, noise)
    found = TriangleMesh(vertices, triangles).hit(origin, directions, points, 7 * noise)[0]
    error = np.abs((found - exact).astype(float))
    assert error.size > 300
    # A ray within the noise of the limb may meet nothing near its point.
    assert np.mean(error < 1e-15 * range_m * 50) > 0.998
    assert not np.any(error > 7 * noise * 50)


def test_own_space_of_a_scaled_and_sheared_instance() -> None:
    """Rays in the instance's space, near points with the noise of the world."""
    vertices, triangles = sphere(12)
    pose = np.array([[2.0, 1.5, 0.0], [0.0, 0.3, 0.2], [0.1, 0.0, 4.0]])
    place, origin = np.array([5e3, -2e3, 300.0]), np.array([5e3 + 40.0, -2e3 - 60.0, 320.0])
    directions = beam(origin - place, 2.0, 1000)
    world = vertices @ pose.T + place
    exact = first_hits(world, triangles, origin, directions)
    directions, exact = directions[np.isfinite(exact)], exact[np.isfinite(exact)]
    noise = 3e-4
    points = seen(origin, directions, exact, noise)
    inverse = np.linalg.inv(pose)
    found = TriangleMesh(vertices, triangles).hit(
        inverse @ (origin - place),
        directions @ inverse.T,
        (points - place) @ inverse.T,
        7 * noise * np.linalg.norm(inverse, 2),
    )[0]
    error = np.abs((found - exact).astype(float))
    assert error.size > 300
    assert np.mean(error < 1e-11) > 0.98


def test_rays_of_several_poses_of_one_mesh() -> None:
    """World rays, each into the space of its pose, against all triangles in the world."""
    vertices, triangles = sphere(12)
    turns = np.array(
        [np.diag([1.0, 2.0, 0.5]), [[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.3, 0.0, 1.5]]]
    )
    places, count, noise = np.array([[5e3, 0.0, 9.0], [5e3, 8.0, 9.0]]), 400, 1e-4
    origin = np.array([5e3 - 50.0, 4.0, 30.0])
    each = np.random.default_rng(4).integers(0, 2, count)
    directions, exact = np.empty((count, 3)), np.empty(count)
    for number, (turn, place) in enumerate(zip(turns, places, strict=True)):
        mine = each == number
        directions[mine] = beam(origin - place, 0.3, int(mine.sum()))
        exact[mine] = first_hits(vertices @ turn.T + place, triangles, origin, directions[mine])
    assert np.isfinite(exact).all()
    inverses = np.linalg.inv(turns)
    stretch = np.linalg.norm(inverses, 2, axis=(1, 2))
    points = seen(origin, directions, exact, noise)
    for order in (np.arange(count), np.argsort(each, kind="stable")):
        way, normal = TriangleMesh(vertices, triangles).hit(
            origin,
            directions[order],
            points[order],
            7 * noise * stretch[each[order]],
            spaces=Spaces(inverses, places, each[order]),
        )
        np.testing.assert_allclose(way, exact[order], rtol=1e-13)
        # away from the middle of its own ellipsoid
        away = origin + way[:, None] * directions[order] - places[each[order]]
        cosine = (normal * away).sum(axis=1) / np.linalg.norm(normal, axis=1)
        assert np.all(np.abs(cosine) > 0.3 * np.linalg.norm(away, axis=1))


def test_wall_of_two_sheets() -> None:
    """The point tells which sheet was seen, far more closely than the sheets lie apart."""
    front, triangles = plane(3)
    back = front - [0.0, 0.0, 0.02]
    wall = TriangleMesh(
        np.concatenate([front, back]), np.concatenate([triangles, triangles + len(front)])
    )
    origin = np.array([0.0, 0.0, 1e3])
    directions = beam(origin, 1.0, 500)
    for sheet in (front, back):
        exact = first_hits(sheet, triangles, origin, directions)
        found = wall.hit(origin, directions, seen(origin, directions, exact, 5e-5), 2e-3)[0]
        np.testing.assert_allclose(found, exact.astype(float), rtol=1e-14)


def test_triangles_of_all_sizes_in_one_mesh() -> None:
    """A ground of a kilometre and grains of a millimetre on it."""
    ground, triangles = plane(1, 1e3)
    places = np.random.default_rng(5).uniform(-20, 20, (300, 2))
    grains, each = [], np.array([[0, 1, 2]])
    for x, y in places:
        top = x / 10 + 0.01
        grains.append([[x - 1e-3, y - 1e-3, top], [x + 1e-3, y - 1e-3, top], [x, y + 2e-3, top]])
    vertices = np.concatenate([ground, np.concatenate(grains)])
    faces = np.concatenate([triangles, *(each + 4 + 3 * n for n in range(len(places)))])
    mesh = TriangleMesh(vertices, faces.astype(np.int32))
    origin = np.array([3.0, 4.0, 200.0])
    aims = np.array(grains).mean(axis=1)
    directions = (aims - origin) / np.linalg.norm(aims - origin, axis=1, keepdims=True)
    on_grain = np.linalg.norm(aims - origin, axis=1)
    found = mesh.hit(origin, directions, seen(origin, directions, on_grain, 1e-5), 1e-4)[0]
    np.testing.assert_allclose(found, on_grain, rtol=1e-14)
    normal = np.array([-0.1, 0.0, 1.0])
    under = -(origin @ normal) / (directions @ normal)
    found = mesh.hit(origin, directions, seen(origin, directions, under, 1e-5), 1e-4)[0]
    np.testing.assert_allclose(found, under, rtol=1e-14)


def test_neighbours_change_nothing() -> None:
    """Rays in the order of an image, whose neighbours hit the same triangle, and in any order."""
    vertices, triangles = sphere(16)
    back = vertices @ np.diag([3.0, 3.0, 0.1]) - [0.0, 0.0, 2.0]
    both = np.concatenate([vertices, back]), np.concatenate([triangles, triangles + len(vertices)])
    mesh = TriangleMesh(*both)
    origin = np.array([0.3, -0.2, 30.0])
    u, v = np.meshgrid(*2 * [np.linspace(-2.5, 2.5, 60)])
    aims = np.stack([u.ravel(), v.ravel(), np.zeros(u.size)], axis=1)
    directions = (aims - origin) / np.linalg.norm(aims - origin, axis=1, keepdims=True)
    exact = first_hits(*both, origin, directions)
    met = np.isfinite(exact)
    directions, exact = directions[met], exact[met].astype(float)
    points = seen(origin, directions, exact, 1e-6)
    way, normal = mesh.hit(origin, directions, points, 7e-6)
    np.testing.assert_allclose(way, exact, rtol=1e-13)
    order = np.random.default_rng(6).permutation(len(points))
    shuffled, normals = mesh.hit(origin, directions[order], points[order], 7e-6)
    np.testing.assert_array_equal(way[order], shuffled)
    np.testing.assert_array_equal(normal[order], normals)


def test_rays_meet_their_own_part_only() -> None:
    """Spheres of three sizes about one place, two of them as close as points are known."""
    vertices, triangles = sphere(12)
    sizes = (1.0, 1.0 + 2e-6, 1e3)
    joined = TriangleMesh(
        np.concatenate([size * vertices for size in sizes]),
        np.concatenate([triangles + n * len(vertices) for n in range(3)]).astype(np.int32),
        np.repeat(np.arange(3), len(triangles)),
    )
    origin = np.array([30.0, -20.0, 4.0])
    part = np.random.default_rng(3).integers(0, 3, 600)
    size = np.array(sizes)[part]
    directions = size[:, None] * beam(origin, 0.5, 600)
    exact = first_hits(vertices, triangles, origin, directions / size[:, None]).astype(float)
    # in each sphere's own measure the same rays, so the same parameter
    starts, noise = size[:, None] * origin, 1e-6 * size
    points = starts + exact[:, None] * directions
    points += np.random.default_rng(2).normal(size=points.shape) * noise[:, None]
    for order in (np.arange(600), np.argsort(part, kind="stable")):
        way, normal = joined.hit(
            starts[order], directions[order], points[order], 7 * noise[order], part[order]
        )
        np.testing.assert_allclose(way, exact[order], rtol=1e-13)
        np.testing.assert_allclose(np.sign((normal * directions[order]).sum(axis=1)), 1.0)


def test_points_off_the_mesh_and_empty_meshes() -> None:
    """Nothing is invented: NaN."""
    origin, directions = np.zeros(3), np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    mesh = TriangleMesh(*plane(2))
    above, elsewhere = np.array([0.0, 0.0, 9.0]), np.full((2, 3), 5.0)
    assert np.isnan(mesh.hit(above, directions, elsewhere, 1e-3)[0]).all()
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    for triangles in (np.empty((0, 3), np.int32), np.array([[0, 1, 2]], np.int32)):
        empty = TriangleMesh(line, triangles)
        assert np.isnan(empty.hit(origin, directions, np.zeros((2, 3)), 1e-3)[0]).all()


@pytest.mark.parametrize("bits", [6, 16, 17, 24])
def test_buckets_are_sorted_stably(bits: int) -> None:
    """Also more of them than 16 bits hold, by Python's own stable sort."""
    bucket = np.random.default_rng(bits).integers(0, 1 << bits, 3000)
    bucket[1000:2000] = bucket[:1000]
    expected = sorted(range(bucket.size), key=lambda place: int(bucket[place]))
    assert sorted_places(bucket, 1 << bits).tolist() == expected
