# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflection at smooth surfaces of meshes: against closed forms, and against beams of rays."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from radarsim_addon.arrays import dots, norms
from radarsim_addon.physics.mirrors import reflected_widths
from radarsim_addon.signal.tracing.specular_points import (
    SmoothPatches,
    SpecularPoints,
    SpecularSearch,
)

RADAR_M = np.array([0.0, 0.0, 1.0])
MIDDLE_M = np.array([2.0, 5.0, 0.3])
Surface = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def ball(axes_m: tuple[float, float, float]) -> Surface:
    """Points and normals of an ellipsoid at angles from its pole and around it."""

    def at(polar: np.ndarray, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        unit = np.stack(
            [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1
        )
        normal = unit / np.array(axes_m)
        return MIDDLE_M + unit * axes_m, normal / np.linalg.norm(normal, axis=-1)[..., None]

    return at


def mesh(surface: Surface, rows: int, columns: int, low: float, high: float) -> SmoothPatches:
    """Patches over a closed band of a surface, as of a UV sphere."""
    polar = np.linspace(low, high, rows + 1)
    around = np.arange(columns) * 2 * math.pi / columns
    points, normals = surface(*np.meshgrid(polar, around, indexing="ij"))
    triangles = []
    for i in range(rows):
        for j in range(columns):
            a, b = i * columns + j, i * columns + (j + 1) % columns
            c, d = a + columns, b + columns
            triangles += [(a, c, b)] * (i > 0 or low > 0) + [(b, c, d)] * (i < rows - 1 or low > 0)
    numbers = np.array(triangles)
    points, normals = points.reshape(-1, 3), normals.reshape(-1, 3)
    patches, error_m = SmoothPatches.of_mesh(points[numbers], normals[numbers], numbers)
    assert np.all(np.isfinite(error_m))
    return patches


def places(count: int) -> np.ndarray:
    """Places around the surfaces, outside of them."""
    points = np.random.default_rng(7).normal(size=(count, 3)) * 4 + [0, 8, 0]
    return points[np.linalg.norm(points - MIDDLE_M, axis=1) > 1.5]


def length_over(found: SpecularPoints, ends: np.ndarray) -> np.ndarray:
    """Length of the ways from the radar over points of reflection to ends."""
    back = norms(ends[found.place] - found.points_m)
    return np.asarray(back + norms(found.points_m - RADAR_M))


def on_sphere(end: np.ndarray, radius_m: float) -> np.ndarray | None:
    """Point of reflection on a sphere by Alhazen's quartic, (3,); None in its shadow."""
    a, b = RADAR_M - MIDDLE_M, end - MIDDLE_M
    first = a / np.linalg.norm(a)
    second = b - (b @ first) * first
    second /= np.linalg.norm(second)
    p, q, r = complex(a @ first, 0) / radius_m, complex(b @ first, b @ second) / radius_m, 1
    # conj(p) conj(q) z^4 - conj(p + q) z^3 + (p + q) z - p q = 0 on |z| = 1
    roots = np.roots([(p * q).conjugate(), -((p + q).conjugate()), 0, p + q, -p * q]) * r
    for z in roots[np.abs(np.abs(roots) - 1) < 1e-7]:
        to_p, to_q = p - z, q - z
        cosines = [(one * z.conjugate()).real / abs(one) for one in (to_p, to_q)]
        sines = [(one * z.conjugate()).imag for one in (to_p, to_q)]
        if min(cosines) > 0.03 and sines[0] * sines[1] <= 0:
            return np.asarray(MIDDLE_M + radius_m * (z.real * first + z.imag * second))
    return None


def test_sphere_against_alhazens_quartic() -> None:
    radius_m = 0.8
    search = SpecularSearch(mesh(ball((radius_m,) * 3), 16, 32, 0.0, math.pi), RADAR_M)
    ends = places(400)
    found = search.find(ends)
    expected = [on_sphere(end, radius_m) for end in ends]
    reflected = np.array([one is not None for one in expected])
    assert np.bincount(found.place, minlength=len(ends)).max() == 1
    assert reflected[found.place].mean() > 0.99  # the others graze
    assert np.all(np.isin(np.flatnonzero(reflected), found.place))
    chosen = found.select(reflected[found.place])
    points = np.array([expected[place] for place in chosen.place])
    np.testing.assert_allclose(chosen.points_m, points, atol=1e-7)
    length = norms(ends[chosen.place] - points) + norms(points - RADAR_M)
    np.testing.assert_allclose(length_over(chosen, ends), length, atol=1e-12)


def tilted(surface: Surface) -> Surface:
    """A surface turned around its middle, so that no edge is in a plane of symmetry."""
    c, s = math.cos(0.4), math.sin(0.4)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ np.array(
        [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    )

    def at(polar: np.ndarray, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        points, normals = surface(polar, around)
        return (points - MIDDLE_M) @ turn.T + MIDDLE_M, normals @ turn.T

    return at


def cylinder(radius_m: float) -> Surface:
    def at(height: np.ndarray, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        normal = np.stack([np.cos(around), np.sin(around), 0 * around], axis=-1)
        return MIDDLE_M + radius_m * normal + [0, 0, 1] * (5 - height)[..., None], normal

    return at


#: Surface, mesh, largest error of a length [m] and of the irradiance [dB].
CASES = {
    "sphere": (ball((0.8, 0.8, 0.8)), (16, 32, 0.0, math.pi), 1e-12, 1e-6),
    "cylinder": (tilted(cylinder(0.5)), (4, 32, 0.5, 9.5), 1e-12, 1e-6),
    "ellipsoid": (tilted(ball((0.8, 0.5, 0.6))), (32, 64, 0.0, math.pi), 1e-5, 0.1),
    "fine ellipsoid": (tilted(ball((0.8, 0.5, 0.6))), (64, 128, 0.0, math.pi), 1e-6, 0.05),
}


@pytest.mark.parametrize("name", CASES)
def test_irradiance_is_that_of_beams_of_rays(name: str) -> None:
    """Four rays around each, traced to the exact surface and on: ratio of areas of the beam.

    Lengths are the least (or stationary) ones over the exact surface, also by its parameters alone.
    """
    surface, size, length_bound_m, level_bound_db = CASES[name]
    patches = mesh(surface, *size)
    ends = places(60)
    found = SpecularSearch(patches, RADAR_M).find(ends)
    assert found.place.size > 25
    incoming = found.points_m - RADAR_M
    before_m = norms(incoming)
    incoming /= before_m[:, None]
    cosine = -dots(incoming, found.normals)
    across = np.cross(incoming, found.normals)
    across /= norms(across)[:, None]
    along = np.cross(found.normals, across)
    curvature = patches.select(found.patch).curvature(found.weights, found.normals, along, across)
    after_m = norms(ends[found.place] - found.points_m)
    widths = reflected_widths(curvature, cosine, before_m, after_m)
    level = np.prod(widths, axis=1) * before_m**2
    for number, place in enumerate(found.place):
        if cosine[number] < 0.2:
            continue
        parameters = exact_reflection(surface, found.points_m[number], ends[place])
        point, normal = surface(*parameters)
        exact_m = np.linalg.norm(ends[place] - point) + np.linalg.norm(point - RADAR_M)
        assert length_over(found, ends)[number] == pytest.approx(exact_m, abs=length_bound_m)
        area = beam_area(surface, parameters, np.linalg.norm(ends[place] - point), normal)
        assert 10 * math.log10(level[number] / area) == pytest.approx(0, abs=level_bound_db)


def exact_reflection(surface: Surface, near: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Parameters of the point of a surface where the bisector is its normal, from one close by."""
    grid = np.stack(
        np.meshgrid(np.linspace(0.02, 9.5, 190), np.linspace(-math.pi, math.pi, 60)), axis=-1
    ).reshape(-1, 2)
    x = grid[np.argmin(np.linalg.norm(surface(grid[:, 0], grid[:, 1])[0] - near, axis=1))]

    def slopes(x: np.ndarray) -> np.ndarray:
        point, normal = surface(x[0], x[1])
        bisector = (end - point) / np.linalg.norm(end - point)
        bisector = bisector + (RADAR_M - point) / np.linalg.norm(RADAR_M - point)
        return np.asarray(np.cross(bisector, normal))

    for _ in range(30):
        columns = [(slopes(x + step) - slopes(x - step)) / 2e-6 for step in 1e-6 * np.eye(2)]
        x = x - np.linalg.lstsq(np.stack(columns, axis=1), slopes(x), rcond=None)[0]
    assert np.linalg.norm(slopes(x)) < 1e-9
    return x


def beam_area(surface: Surface, x: np.ndarray, after_m: float, normal: np.ndarray) -> float:
    """Area of a beam behind the surface over its solid angle from the radar [m^2]."""
    step = 1e-5

    def ray(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        point, normal = surface(x[0], x[1])
        way = (point - RADAR_M) / np.linalg.norm(point - RADAR_M)
        out = way - 2 * (way @ normal) * normal
        return way, point + after_m * out

    ways, ends = zip(
        *(
            [np.subtract(*pair) for pair in zip(ray(x + s), ray(x - s), strict=True)]
            for s in step * np.eye(2)
        ),
        strict=True,
    )
    way, _ = ray(x)
    out = way - 2 * (way @ normal) * normal
    solid_angle = abs(np.cross(*ways) @ way)
    return float(abs(np.cross(*ends) @ out) / solid_angle)


def test_planes_and_foci() -> None:
    """A plane is the image method; a concave sphere has its foci where the textbook says."""
    plane = reflected_widths(np.zeros((1, 2, 2)), np.array([0.5]), np.array([3.0]), np.array([4.0]))
    np.testing.assert_allclose(plane, (3 + 4) / 3, rtol=1e-14)
    radius_m, cosine = 2.0, math.cos(0.7)
    bowl = -np.eye(2)[None] / radius_m
    far = np.array([1e12])
    for focus_m, which in ((radius_m * cosine / 2, 0), (radius_m / 2 / cosine, 1)):
        widths = reflected_widths(bowl, np.array([cosine]), far, np.array([focus_m]))
        assert widths[0, which] == pytest.approx(0, abs=1e-9)


def test_meshes_that_do_not_tell_the_surface() -> None:
    """A box that is shaded smooth, and a large flat face next to a rounded edge."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    normals = np.array([[-1, -1, 1], [1, -1, 1], [-1, 1, 1]]) / math.sqrt(3)
    _, error_m = SmoothPatches.of_mesh(corners[None], normals[None], np.array([[0, 1, 2]]))
    assert np.isinf(error_m[0])
    turn = math.radians(10)
    strip = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1.02, 0, -0.008]])
    tilt = np.array([math.sin(turn), 0, math.cos(turn)])
    steep = np.array([math.sin(3 * turn), 0, math.cos(3 * turn)])
    up = np.array([0, 0, 1.0])
    numbers = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2]])
    normals = np.array([up, tilt, tilt, up, steep])
    _, error_m = SmoothPatches.of_mesh(strip[numbers], normals[numbers], numbers)
    assert error_m[0] > 0.005  # a bulge that the mesh does not have


def test_a_lone_triangle_of_a_quartic_surface_has_an_error() -> None:
    """Nothing next to it tells of another curvature: the ends of its edges do."""
    x = np.array([0.2, 0.6, 0.4])
    corners = np.stack([x, np.array([0.0, 0.0, 0.3]), 0.2 * x**4], axis=1)[None]
    normals = np.stack([-0.8 * x**3, 0 * x, 0 * x + 1], axis=1)[None]
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    patches, error_m = SmoothPatches.of_mesh(corners, normals, np.array([[0, 1, 2]]))
    weights = np.random.default_rng(1).dirichlet(np.ones(3), 2000)
    points, _ = patches.select(np.zeros(2000, dtype=int)).at(weights)
    off_m = np.abs(points[:, 2] - 0.2 * points[:, 0] ** 4) / (1 + 0.64 * points[:, 0] ** 6) ** 0.5
    assert off_m.max() > 2e-4
    assert off_m.max() <= error_m[0] <= 10 * off_m.max()


def test_reflections_on_edges_and_along_one_ray_are_found_once() -> None:
    """A plane of eight triangles: inside, on edges, on the common corner. Places behind one another
    have one point of reflection, each its own reflection."""
    x, y = (one.ravel() for one in np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]))
    corners = np.stack([x, y, 0 * x + 0.2], axis=1)
    squares = np.array([0, 1, 3, 4])[:, None]
    numbers = np.concatenate([squares + np.array(one) for one in ([0, 1, 4], [0, 4, 3])])
    normals = np.broadcast_to([0, 0, 1.0], (8, 3, 3))
    patches, error_m = SmoothPatches.of_mesh(corners[numbers], normals, numbers)
    np.testing.assert_allclose(error_m, 0, atol=1e-12)
    antenna = np.array([-0.7, 0.4, 1.9])
    spots = np.array([[0.61, 0.24], [0.37, 0.37], [0.0, 0.43], [-0.29, 0.0], [0.0, 0.0]])
    points = np.column_stack([spots, np.full(5, 0.2)])
    after = (points - antenna) * [1, 1, -1]
    ends = (points[:, None] + np.array([0.5, 1.0, 3.0])[:, None] * after[:, None]).reshape(-1, 3)
    found = SpecularSearch(patches, antenna).find(ends)
    assert found.place.tolist() == list(range(15))
    np.testing.assert_allclose(found.points_m, np.repeat(points, 3, axis=0), atol=1e-9)
    np.testing.assert_allclose(found.normals, np.tile([0, 0, 1.0], (15, 1)), atol=1e-12)
