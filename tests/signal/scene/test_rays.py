# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays against meshes and bodies: the same as by trying every face in float64."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from radarsim_addon.errors import MissingDependencyError
from radarsim_addon.signal.scene import RayMesh, RayScene, rays, triangle_distances


def soup(rng, count, size=0.3):
    """Random triangles in the unit cube."""
    middle = rng.uniform(-1, 1, (count, 1, 3))
    points = (middle + size * rng.normal(size=(count, 3, 3))).reshape(-1, 3)
    return points, np.arange(3 * count).reshape(-1, 3)


def sphere(rows=40, columns=80):
    """A closed sphere of radius 1 about the origin, faces outward."""
    theta = np.linspace(0, np.pi, rows + 1)[1:-1]
    phi = np.arange(columns) * 2 * np.pi / columns
    ring = np.stack(
        [
            np.sin(theta)[:, None] * np.cos(phi),
            np.sin(theta)[:, None] * np.sin(phi),
            np.broadcast_to(np.cos(theta)[:, None], (rows - 1, columns)),
        ],
        axis=-1,
    )
    points = np.concatenate([[[0, 0, 1.0]], ring.reshape(-1, 3), [[0, 0, -1.0]]])
    at = 1 + np.arange((rows - 1) * columns).reshape(rows - 1, columns)
    on = np.roll(at, -1, axis=1)
    quads = [
        np.stack([at[:-1], at[1:], on[1:]], -1).reshape(-1, 3),
        np.stack([at[:-1], on[1:], on[:-1]], -1).reshape(-1, 3),
    ]
    top = np.stack([np.zeros(columns, int), at[0], on[0]], -1)
    bottom = np.stack([np.full(columns, len(points) - 1), on[-1], at[-1]], -1)
    return points, np.concatenate([top, *quads, bottom])


CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
CUBE_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def meetings(points, faces, origins, directions):
    """Ray parameters (rays, faces) in float64, infinite where missed, and how far each pair is from
    being decided the other way, as a barycentric weight.
    """
    a, b, c = (points[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        way = np.einsum("fx,rfx->rf", normal, a - origins[:, None]) / (directions @ normal.T)
        there = origins[:, None] + way[..., None] * directions[:, None]
        weights = np.stack(
            [
                np.einsum("rfx,fx->rf", np.cross(q - p, there - p), normal)
                for p, q in ((a, b), (b, c), (c, a))
            ]
        ) / np.einsum("fx,fx->f", normal, normal)
    least = weights.min(axis=0)
    met = (least > 0) & (way > 0)
    return np.where(met, way, np.inf), np.where(way > 0, np.abs(least), np.inf)


def check_first(points, faces, origins, directions, tolerance=1e-12):
    """Compare with every face, but for rays that pass an edge within float32 rounding."""
    ways, edge = meetings(points, faces, origins, directions)
    clear = np.nanmin(edge, axis=1) > 1e-5
    assert clear.mean() > 0.7
    face, way = RayMesh(points, faces).first(origins, directions)
    met = np.isfinite(ways.min(axis=1))
    np.testing.assert_array_equal(face[clear] >= 0, met[clear])
    both = clear & met
    np.testing.assert_array_equal(face[both], ways.argmin(axis=1)[both])
    np.testing.assert_allclose(way[both], ways.min(axis=1)[both], rtol=tolerance)
    assert np.all(np.isinf(way[face < 0]))
    return both.sum()


def rays_at(rng, count, distance=5.0):
    """Rays towards places in the unit cube from so far, with directions of any length."""
    away = rng.normal(size=(count, 3))
    away *= distance / np.linalg.norm(away, axis=1)[:, None]
    return away, (rng.uniform(-1, 1, (count, 3)) - away) * rng.uniform(0.2, 3, (count, 1))


@pytest.mark.parametrize("seed", range(3))
def test_first_hits_of_random_meshes_are_those_of_all_faces(seed):
    rng = np.random.default_rng(seed)
    assert check_first(*soup(rng, 60), *rays_at(rng, 3000)) > 1000


@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1e3])
def test_units_of_length_do_not_matter(unit):
    rng = np.random.default_rng(4)
    points, faces = soup(rng, 40)
    origins, directions = rays_at(rng, 2000)
    check_first(points * unit, faces, origins * unit, directions * unit)
    check_first(points * unit, faces, origins * unit, directions)


def test_places_ten_kilometres_away_are_in_float64():
    rng = np.random.default_rng(5)
    origins, directions = rays_at(rng, 2000, distance=1e4)
    points, faces = soup(rng, 40)
    check_first(points, faces, origins, directions, tolerance=1e-13)
    # a scene of a millimetre at ten kilometres from the origin
    place = np.array([7e3, -5e3, 5e3])
    points = np.round(points * 1e-3 * 2**40) / 2**40 + place
    origins, directions = rays_at(rng, 2000, distance=1e-2)
    aim = (rng.uniform(-1e-3, 1e-3, (2000, 3)) - origins) * 3
    check_first(points, faces, place + origins, aim, tolerance=1e-8)


def test_no_ray_leaves_a_closed_mesh():
    rng = np.random.default_rng(6)
    points, faces = sphere()
    mesh = RayMesh(points, faces)
    directions = rng.normal(size=(1_000_000, 3))
    face, way = mesh.first(np.array([0.1, -0.2, 0.3]), directions)
    assert np.all(face >= 0) and np.all(np.isfinite(way))
    # towards corners, and points on edges
    corners = points[faces]
    middles = (corners + np.roll(corners, 1, axis=1)) / 2
    pair = np.concatenate([corners, middles]).reshape(-1, 3)
    for start in ([0.0, 0.0, 0.0], [0.3, 0.2, -0.5], [30.0, 20.0, -50.0], [3e4, 2e4, -5e4]):
        away = start - pair
        inside = np.linalg.norm(start) < 0.9
        # from outside: those in front, clear of the limb
        seen = pair[inside | (np.sum(pair * away, axis=1) > 0.2 * np.linalg.norm(away, axis=1))]
        assert len(seen) > 10_000
        face, way = mesh.first(np.array(start), seen - start)
        assert np.all(face >= 0)
        np.testing.assert_allclose((way - 1) * np.linalg.norm(seen - start, axis=1), 0, atol=1e-6)


def test_edges_and_corners_of_a_cube_are_met():
    targets = np.concatenate([CUBE, (CUBE[CUBE_FACES[:, :2]]).mean(axis=1)])
    face, way = RayMesh(CUBE, CUBE_FACES).first(np.zeros(3), targets)
    assert np.all(face >= 0)
    np.testing.assert_allclose(way, 1.0, rtol=1e-6)


def test_rays_leave_the_face_that_they_begin_on():
    rng = np.random.default_rng(7)
    points, faces = sphere()
    mesh = RayMesh(points, faces)
    on = np.repeat(np.arange(len(faces)), 4)
    weights = rng.dirichlet(np.ones(3), on.size)
    starts = np.einsum("nk,nkx->nx", weights, points[faces[on]])
    inward = rng.normal(size=starts.shape)
    inward *= -np.sign(np.sum(inward * mesh.normals_of(on), axis=1))[:, None]
    face, way = mesh.first(starts, inward)
    assert np.all(face >= 0) and np.all(face != on)
    assert np.all(way > 0)
    np.testing.assert_array_equal(mesh.first(starts, -inward)[0], -1)


def test_rays_along_faces():
    """A ray in the plane of a face does not meet it, but those that it runs into."""
    mesh = RayMesh(CUBE, CUBE_FACES)
    inside = np.array([[-0.5, 0.3, 0.0], [0.0, 0.25, 0.9]])
    along = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    np.testing.assert_allclose(mesh.first(inside, along)[1], [1.5, 1.9], rtol=1e-12)
    # from a point on a face along it: to the edge, or over it
    start, way = np.array([[-1.0, 0.1, 0.2]]), np.array([[0.0, 1.0, 0.0]])
    found = mesh.first(start, way)[1][0]
    assert np.isinf(found) or found == pytest.approx(0.9, abs=1e-5)
    sheet = RayMesh(CUBE[[0, 1, 3, 2]], np.array([[0, 1, 2], [0, 2, 3]]))
    face, way = sheet.first(np.array([[-1.0, -9.0, 0.1]]), np.array([[0.0, 1.0, 0.0]]))
    assert face[0] == -1 or 8 - 1e-6 <= way[0] <= 10 + 1e-6


def test_grazing_rays_stay_within_the_face():
    """However flat a ray is, the place is on the face: within its extent along the ray."""
    rng = np.random.default_rng(8)
    sheet = RayMesh(CUBE[[0, 1, 3, 2]], np.array([[0, 1, 2], [0, 2, 3]]))
    origins = np.stack(
        [-1 + rng.normal(size=4000) * 1e-8, np.full(4000, -9.0), rng.uniform(-1, 1, 4000)], -1
    )
    directions = np.stack([rng.normal(size=4000) * 1e-9, np.ones(4000), np.zeros(4000)], -1)
    face, way = sheet.first(origins, directions)
    assert np.all((face < 0) | ((way > 8 - 1e-6) & (way < 10 + 1e-6)))


def test_blocked_ways_are_those_with_a_face_between():
    rng = np.random.default_rng(9)
    points, faces = soup(rng, 60)
    starts, ends = rng.uniform(-1.5, 1.5, (2, 3000, 3))
    ways, edge = meetings(points, faces, starts, ends - starts)
    clear = (np.nanmin(edge, axis=1) > 1e-5) & (np.abs(ways - 1).min(axis=1) > 1e-5)
    blocked = (ways < 1).any(axis=1)
    found = RayMesh(points, faces).blocked(starts, ends)
    np.testing.assert_array_equal(found[clear], blocked[clear])
    assert 300 < blocked[clear].sum() < 2700


def test_faces_at_the_ends_of_a_way_do_not_block_it():
    rng = np.random.default_rng(10)
    points, faces = sphere()
    mesh = RayMesh(points, faces)
    one, other = (
        np.einsum("nk,nkx->nx", rng.dirichlet(np.ones(3), 5000), points[faces[on]])
        for on in rng.integers(0, len(faces), (2, 5000))
    )
    far = np.linalg.norm(one - other, axis=1) > 0.1
    assert not mesh.blocked(one[far], other[far]).any()
    assert mesh.blocked(one[far] * 1.01, other[far] * 1.01).sum() > 4000
    assert mesh.blocked(np.zeros(3), one * 1.001).all()
    assert not mesh.blocked(np.zeros(3), one * 0.999).any()


def test_crossings_are_all_faces_in_order():
    rng = np.random.default_rng(11)
    points, faces = soup(rng, 60)
    origins, directions = rays_at(rng, 2000)
    ways, edge = meetings(points, faces, origins, directions)
    clear = np.nanmin(edge, axis=1) > 1e-5
    expected = np.sort(ways, axis=1)
    clear &= np.diff(np.minimum(expected, 1e9 * np.arange(1, 61)), axis=1).min(axis=1) > 1e-5
    count = np.zeros(len(origins), int)
    for number, (passing, face, way) in enumerate(
        RayMesh(points, faces).crossings(origins, directions, 100)
    ):
        mine = clear[passing]
        np.testing.assert_allclose(way[mine], expected[passing[mine], number], rtol=1e-12)
        np.testing.assert_array_equal(face[mine], np.argsort(ways, axis=1)[passing[mine], number])
        count[passing] += 1
    np.testing.assert_array_equal(count[clear], np.isfinite(ways).sum(axis=1)[clear])
    assert clear.sum() > 1000 and count.max() > 5
    assert sum(1 for _ in RayMesh(points, faces).crossings(origins, directions, 2)) == 2


def test_rays_cross_closed_meshes_an_even_number_of_times():
    """Also over edges, at any angle; rays towards silhouettes are left out."""
    rng = np.random.default_rng(12)
    points, faces = sphere()
    targets = (points[faces] + np.roll(points[faces], 1, axis=1)).reshape(-1, 3) / 2 * 0.98
    for mesh_points, mesh_faces, aims in (
        (points, faces, targets),
        (CUBE, CUBE_FACES, rng.uniform(-0.99, 0.99, (5000, 3))),
    ):
        origins = aims + 4 * (lambda v: v / np.linalg.norm(v, axis=1)[:, None])(
            rng.normal(size=aims.shape)
        )
        count = np.zeros(len(aims), int)
        for passing, _, _ in RayMesh(mesh_points, mesh_faces).crossings(origins, aims - origins, 9):
            count[passing] += 1
        np.testing.assert_array_equal(count, 2)


def test_what_is_not_there_is_not_met():
    directions = np.array([[0.0, 0, 1], [np.nan, 0, 1], [0, 0, 0], [np.inf, 0, 0]])
    ahead = np.array([[0, -0.1, -5.0]])
    empty = RayMesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert len(empty) == 0 and np.all(empty.first(ahead, directions)[0] == -1)
    assert not empty.blocked(ahead, directions).any()
    assert list(empty.crossings(ahead, directions, 3)) == []
    assert empty.near(ahead)[0].tolist() == [-1]
    points = np.concatenate([CUBE, [[np.nan, 0, 0], [np.inf, 0, 0], [0.5, 0.5, 0.5]]])
    odd = np.array([[0, 1, 8], [9, 0, 1], [10, 10, 10], [0, 7, 7]])
    damaged = RayMesh(points, np.concatenate([odd, CUBE_FACES]))
    face, way = damaged.first(ahead, directions)
    whole, there = RayMesh(CUBE, CUBE_FACES).first(ahead, directions)
    assert face.tolist() == [whole[0] + 4, -1, -1, -1]
    assert way.tolist() == there.tolist() == [4.0, np.inf, np.inf, np.inf]
    assert damaged.first(np.array([np.nan, 0, -5]), directions[:1])[0] == [-1]
    assert np.all(RayMesh(points, odd).first(ahead, directions)[0] == -1)
    assert RayMesh(CUBE, CUBE_FACES).first(np.zeros((0, 3)), np.zeros((0, 3)))[0].size == 0


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_the_nearest_face_is_that_of_all(unit):
    rng = np.random.default_rng(13)
    points, faces = soup(rng, 300, size=0.05)
    # large ones, a line and a point among them
    points = np.concatenate([points, 3 * CUBE]) * unit
    more = np.array([[900, 901, 903], [904, 906, 907], [5, 5, 8], [7, 7, 7]])
    faces = np.concatenate([faces, more])
    places = rng.uniform(-2, 2, (500, 3)) * unit
    expected = np.stack([triangle_distances(*(points[faces.T] - place)) for place in places])
    mesh = RayMesh(points, faces)
    face, distance = mesh.near(places)
    np.testing.assert_allclose(distance, expected.min(axis=1), rtol=1e-12)
    np.testing.assert_array_equal(expected[np.arange(500), face], expected.min(axis=1))
    within = 0.25 * unit
    some, near = mesh.near(places, within)
    close = expected.min(axis=1) <= within
    np.testing.assert_array_equal(some >= 0, close)
    np.testing.assert_array_equal(near[close], distance[close])
    assert np.all(np.isinf(near[~close])) and 20 < close.sum() < 480
    lost, far = mesh.near(np.array([[np.nan, 0, 0]]))
    assert lost.tolist() == [-1] and far.tolist() == [np.inf]


def test_distances_from_triangles_are_those_of_dense_points():
    rng = np.random.default_rng(14)
    corners = rng.normal(size=(3, 30, 3)) + rng.normal(size=(30, 3))
    weights = rng.dirichlet(np.full(3, 0.5), 40_000)
    dense = np.linalg.norm(np.einsum("nk,kfx->nfx", weights, corners), axis=2).min(axis=0)
    found = triangle_distances(*corners)
    assert np.all(found <= dense + 1e-12)
    np.testing.assert_allclose(found, dense, atol=0.02)


def test_without_embreex_an_error_names_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore", None)
    rays._device.cache_clear()
    with pytest.raises(MissingDependencyError, match="embreex is not installed"):
        RayMesh(CUBE, CUBE_FACES).first(np.zeros(3), np.ones((1, 3)))


# -- bodies ----------------------------------------------------------------------------------------


def scene_of(rng, count, kinds=3):
    """Bodies with turned, mirrored and unevenly scaled poses, and all their triangles."""
    meshes = [(soup(rng, 12, 0.4)), (CUBE, CUBE_FACES), sphere(6, 9)][:kinds]
    shapes = rng.integers(0, kinds, count)
    poses = np.tile(np.eye(4), (count, 1, 1))
    turn, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    sizes = rng.uniform(0.05, 0.5, (count, 1, 3)) * rng.choice([-1, 1], (count, 1, 3))
    poses[:, :3, :3] = turn * sizes
    poses[:, :3, 3] = rng.uniform(-5, 5, (count, 3))
    boxes = np.array([[meshes[s][0].min(axis=0), meshes[s][0].max(axis=0)] for s in shapes])
    asked = []

    def mesh(shape):
        asked.append(shape)
        return made[shape]

    made = [RayMesh(*each) for each in meshes]
    corners = [
        (meshes[s][0] @ pose[:3, :3].T + pose[:3, 3])[meshes[s][1]]
        for s, pose in zip(shapes, poses)
    ]
    body = np.repeat(np.arange(count), [len(each) for each in corners])
    face = np.concatenate([np.arange(len(each)) for each in corners])
    return RayScene(poses, boxes, shapes, mesh), np.concatenate(corners), body, face, asked


@pytest.mark.parametrize("count", [1, 7, 300])
def test_bodies_are_met_as_their_triangles_in_the_world(count):
    rng = np.random.default_rng(count)
    scene, corners, body, face, _ = scene_of(rng, count)
    points, faces = corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
    origins, aims = rng.uniform(-8, 8, (600, 3)), rng.uniform(-4, 4, (600, 3))
    aims[:100] = corners[rng.integers(0, len(corners), 100)].mean(axis=1)
    ways, edge = meetings(points, faces, origins, aims - origins)
    clear = np.nanmin(edge, axis=1) > 1e-4
    met = np.isfinite(ways.min(axis=1))
    found = scene.first(origins, aims - origins)
    np.testing.assert_array_equal(found[0][clear] >= 0, met[clear])
    both = clear & met
    assert both.sum() > 40
    best = ways.argmin(axis=1)[both]
    np.testing.assert_array_equal(found[0][both], body[best])
    np.testing.assert_array_equal(found[1][both], face[best])
    np.testing.assert_allclose(found[2][both], ways.min(axis=1)[both], rtol=1e-11)
    between = clear & (np.abs(ways - 1).min(axis=1) > 1e-4)
    blocked = scene.blocked(origins, aims)
    np.testing.assert_array_equal(blocked[between], (ways < 1).any(axis=1)[between])
    among = rng.random(count) < 0.5
    np.testing.assert_array_equal(
        scene.blocked(origins, aims, among)[between],
        ((ways < 1) & among[body]).any(axis=1)[between],
    )


def test_meshes_are_read_when_rays_come_near():
    scene, corners, body, _, asked = scene_of(np.random.default_rng(15), 9)
    away = np.array([[0.0, 0.0, 50.0]])
    assert scene.first(away, np.array([[0.0, 0, 1]]))[0].tolist() == [-1] and not asked
    here = corners[body == 4][0].mean(axis=0)
    assert scene.first(away, here - away)[0][0] >= 0 and asked
    boxes = np.array([[CUBE.min(axis=0), CUBE.max(axis=0)]])
    cube = RayMesh(CUBE, CUBE_FACES)
    gone = RayScene(np.eye(4)[None], boxes, np.zeros(1, int), lambda _: None)
    assert gone.first(away, -away)[0].tolist() == [-1] and not gone.blocked(away, -away).any()
    empty = RayScene(np.zeros((0, 4, 4)), np.zeros((0, 2, 3)), np.zeros(0, int), lambda _: cube)
    assert empty.first(away, -away)[0].tolist() == [-1] and not empty.blocked(away, -away).any()


def test_bodies_that_a_pose_makes_flat_are_met():
    """Between others of the same mesh: each flat one where it lies."""
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[1:3, 2, 2] = 0.0, 1e-17
    poses[1, :3, :3] = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]) @ poses[1, :3, :3]
    poses[:, :3, 3] = [[-9, 0, 0], [0, 0, 2], [5, 0, 1], [9, 0, 0]]
    cube = RayMesh(CUBE, CUBE_FACES)
    boxes = np.tile([CUBE.min(axis=0), CUBE.max(axis=0)], (4, 1, 1))
    scene = RayScene(poses, boxes, np.zeros(4, int), lambda _: cube)
    above = np.array([[-9.0, 0.1, 9], [0.4, 0.1, 9], [5.3, 0.1, 9], [9, 0.1, 9], [2, 0, 9]])
    body, _, way = scene.first(above, np.tile([0.0, 0, -1], (5, 1)))
    assert body.tolist() == [0, 1, 2, 3, -1]
    np.testing.assert_allclose(way, [8, 7.3, 8, 8, np.inf], rtol=1e-12)


def test_a_hundred_thousand_instances():
    """A grid of cubes: rays along its lanes pass, others meet the first one, to 1e-12."""
    side = 317
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    count = side * side
    poses = np.tile(np.diag([0.25, 0.25, 0.25, 1.0]), (count, 1, 1))
    poses[:, 0, 3], poses[:, 1, 3] = 10.0 * x.ravel(), 10.0 * y.ravel()
    boxes = np.tile([CUBE.min(axis=0), CUBE.max(axis=0)], (count, 1, 1))
    cube = RayMesh(CUBE, CUBE_FACES)
    scene = RayScene(poses, boxes, np.zeros(count, int), lambda _: cube)
    lanes = np.stack([np.full(side, -100.0), 10.0 * np.arange(side), np.zeros(side)], -1)
    ahead = np.tile([1.0, 0, 0], (side, 1))
    body, _, way = scene.first(lanes, ahead)
    np.testing.assert_array_equal(body, np.arange(side))
    np.testing.assert_allclose(way, 99.75, rtol=1e-12)
    between = lanes + np.array([0.0, 5.0, 0.0])
    assert np.all(scene.first(between, ahead)[0] == -1)
    assert scene.blocked(lanes, lanes + 1e4 * ahead).all()
    assert not scene.blocked(between, between + 1e4 * ahead).any()
