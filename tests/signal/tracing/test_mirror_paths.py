# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths over mirrors in scenes of arrays, against images by hand and against one another."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from radarsim_addon.signal.motion import PathImages
from radarsim_addon.signal.paths import CURVED_IMAGE_DTYPE, IMAGE_DTYPE, PATH_DTYPE, PathRows
from radarsim_addon.signal.scene import Mesh, Surface
from radarsim_addon.signal.tracing import (
    ImageChain,
    MirrorPaths,
    mirror_faces,
)
from radarsim_addon.signal.tracing.connections import find_curved_mirrors
from radarsim_addon.signal.tracing.mirror_paths import alike_in_both
from radarsim_addon.signal.tracing.mirrors import find_planes
from tests.signal.tracing import street
from tests.signal.tracing.mirror_scenes import (
    METAL,
    PANE,
    ROUGH,
    WAVELENGTH_M,
    box,
    faces_of,
    glass,
    mesh,
    obstacles,
    panorama,
    paths_in,
    single,
    sphere,
)  # fmt: skip

Bodies = dict[str, tuple[Mesh, Surface]]


def walls_and_plates() -> Bodies:
    (near, far), (low, high) = street.WALL_Y, street.WALL_Z
    found: Bodies = {}
    for name, (x, _) in street.WALLS.items():
        corners = [(x, near, low), (x, far, low), (x, far, high), (x, near, high)]
        found[name] = mesh(corners), glass(street.INDEX)
    for number, (x, y, z, h) in enumerate(street.PLATES):
        corners = [(x - h, y, z - h), (x + h, y, z - h), (x + h, y, z + h), (x - h, y, z + h)]
        found[f"Plate {number}"] = mesh(corners), ROUGH
    return found


def rendered(paths: MirrorPaths, places: tuple[np.ndarray, np.ndarray]) -> tuple[PathRows, int]:
    """Rows as renders give them, with those that the receiver sees in the walls; and how many
    points it sees directly.
    """
    rng = np.random.default_rng(3)
    receiver, transmitter = places
    points, body = [], []
    for number, (x, y, z, half) in enumerate(street.PLATES):
        off = rng.uniform(-half, half, (20, 2)) * 0.99
        points += [np.array([x + u, y, z + v]) for u, v in off]
        body += [number + 3] * 20
    every, bodies = np.array(points), np.array(body)
    normals, solid = np.tile([0.0, -1.0, 0.0], (len(every), 1)), rng.uniform(1, 2, len(every))

    def free(end: np.ndarray) -> np.ndarray:
        return np.array([street.ways(end, point, ()) is not None for point in every])

    seen, pixels = free(receiver), 1 + np.arange(len(every))
    own = np.flatnonzero(seen & free(transmitter))
    rows = single(every, bodies, normals, transmitter, receiver, solid)
    direct = rows[own]
    parts = [paths.number(direct, pixels[own])]
    for image, lamp in enumerate(paths.lamps_m, 1):
        over = single(every, bodies, normals, lamp, receiver, solid)[seen]
        over, through_w = paths.choose(image, paths.number(over, pixels[seen]))
        assert through_w == 0
        parts.append(over)
    # and what the receiver sees of the same plates in the walls, with the light as it is
    for chain in street.CHAINS[1:]:
        mirrored = rows[own].copy()
        keep = np.zeros(own.size, dtype=bool)
        for index, point in enumerate(every[own]):
            way = street.ways(receiver, point, chain)
            if way is not None:
                keep[index] = True
                mirrored["first_scatterer_m"][index] = way[1]
                mirrored["direction"][index] = (way[1] - way[0]) / np.linalg.norm(way[1] - way[0])
                length = street.one_way(way)[0] + np.linalg.norm(point - transmitter)
                mirrored["length_m"][index] = length
        mirrored["order"] = 1 + len(chain)
        mirrored["first_body"] = 1 + list(street.WALLS).index(chain[0])
        parts.append(paths.number(mirrored[keep], pixels[own][keep]))
    assert sum(part.size for part in parts[-4:]) > 25
    return PathRows.joined(parts), int(seen.sum())


@pytest.mark.parametrize("transmitter", [street.RADAR, np.array([-1.2, 6.0, 0.8])])
def test_all_paths_of_a_street(transmitter: np.ndarray) -> None:
    """Each pair of ways once, with its length, power and phase."""
    places = (street.RADAR, transmitter)
    paths = paths_in(walls_and_plates(), *places)
    assert paths.dtype == IMAGE_DTYPE and paths.findings == []
    before, seen = rendered(paths, places)
    rows, through_w = paths.with_both_ways(before)
    assert through_w == 0
    chain_of = [()] + [
        tuple("left" if normal[0] > 0 else "right" for normal in image.normals)
        for image in paths.records
    ]
    assert sorted(chain_of) == sorted(street.CHAINS)
    keys = np.round(rows["last_scatterer_m"] * 1e6).astype(int)
    assert len(np.unique(keys, axis=0)) == seen
    for key in np.unique(keys, axis=0):
        mine = rows[np.all(keys == key, axis=1)]
        found: dict[tuple[Any, ...], Any] = {
            (chain_of[row["receiver_image"]], chain_of[row["transmitter_image"]]): row
            for row in mine
        }
        assert len(found) == mine.size
        point = mine["last_scatterer_m"][0]
        known = [
            {c: street.one_way(w) for c in street.CHAINS if (w := street.ways(end, point, c))}
            for end in places
        ]
        pairs = {pair for pair in itertools.product(*known) if sum(map(len, pair)) <= 2}
        assert set(found) == pairs
        assert np.unique(mine["point"]).size == 1 and (mine["point"][0] > 0) == (mine.size > 1)
        fields = {pair: known[0][pair[0]][1] * known[1][pair[1]][1] for pair in pairs}
        first = min(pairs, key=lambda pair: sum(map(len, pair)))
        for pair in pairs:
            row, ratio = found[pair], fields[pair] / fields[first]
            length = known[0][pair[0]][0] + known[1][pair[1]][0]
            assert row["length_m"] == pytest.approx(length, abs=1e-9)
            power = row["power_w"] / found[first]["power_w"]
            assert power == pytest.approx(abs(ratio) ** 2, rel=2e-3)  # ways are nearly level
            turned = row["mirror_phase_rad"] - found[first]["mirror_phase_rad"]
            # fields with exp(-j w t), echoes with exp(+j w t)
            expected = np.conj(ratio) / abs(ratio)
            assert abs(np.angle(np.exp(1j * turned) / expected)) < 1e-3
            assert row["mirrors"] == row["order"] - 1 == sum(map(len, pair))
            over = PathImages.of(paths.records, np.array([[row["receiver_image"], 0]]))
            image = over.unfolded(0, point[None])[0] - street.RADAR
            np.testing.assert_allclose(row["direction"], image / np.linalg.norm(image), atol=1e-12)


def test_a_plane_is_a_chain_and_a_curved_mirror() -> None:
    """The same faces, taken for planar and for curved: one connection by images, one by Newton."""
    floor = mesh([(-60, -5, 0), (60, -5, 0), (60, 90, 0), (-60, 90, 0)])
    faces = faces_of({"Floor": (floor, glass(3 + 0.4j)), "Box": (mesh(np.eye(4, 3) - 9), ROUGH)})
    radar = np.array([1.0, 2.0, 4.0])
    ((plane,),), _ = find_planes(faces, [radar], WAVELENGTH_M, 8)
    chain = ImageChain.of([plane], radar)
    faces.curved[:] = True
    curved, said = find_curved_mirrors(faces, radar, WAVELENGTH_M)
    assert curved is not None and not said and not curved.see_each_other
    places = np.random.default_rng(5).uniform((-9, 5, 0.5), (9, 60, 8), (200, 3))
    one, other = chain.ways(places), curved.ways(places)
    assert one.place.tolist() == other.place.tolist() == list(range(200))
    np.testing.assert_allclose(other.stations_m, one.stations_m, atol=1e-9)
    for name in ("normals", "length_m", "beam_m2"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-10)
    for polarisation in ("vertical", "horizontal", "average"):
        waves = [each.reflected(polarisation, WAVELENGTH_M) for each in (one, other)]
        np.testing.assert_allclose(waves[1], waves[0], atol=1e-9)


BALL_M = np.array([6.0, 25.0, 0.0])


@pytest.mark.parametrize("transmitter", [np.zeros(3), np.array([-12.0, 10.0, 0.0])])
def test_ground_and_ball_combine(transmitter: np.ndarray) -> None:
    """Over a wet road on one way and a ball on the other: as the ways by themselves say."""
    road = mesh([(-60, -5, -3), (60, -5, -3), (60, 90, -3), (-60, 90, -3)])
    plate = mesh([(-1, 40, -1), (1, 40, -1), (1, 40, 1), (-1, 40, 1)])
    own = {
        "Road": (road, glass(3 + 0.4j)),
        "Ball": (sphere(32, 64, BALL_M, 1.0), METAL),
        "Plate": (plate, ROUGH),
    }
    radar = np.zeros(3)
    paths = paths_in(own, radar, transmitter)
    assert paths.dtype == CURVED_IMAGE_DTYPE
    assert {item.code for item in paths.findings} == {
        "mirror-curved-in-a-row", "mirror-rounded", "mirror-echo-not-formed",
    }  # fmt: skip
    points = np.array([[0.3, 40.0, 0.2], [-0.4, 40.0, 0.5]])
    body, normals = np.full(2, 3), np.tile([0.0, -1.0, 0.0], (2, 1))
    parts = [
        paths.number(single(points, body, normals, lamp, radar, np.ones(2)), np.array([4, 9]))
        for lamp in (transmitter, *paths.lamps_m)
    ]
    parts[1:] = [paths.choose(n, part)[0] for n, part in enumerate(parts[1:], 1)]
    rows, _ = paths.with_both_ways(PathRows.joined(parts))
    assert rows.size == 2 * 9
    for number in (4, 9):
        mine = {
            (int(one["receiver_image"]), int(one["transmitter_image"])): one
            for one in rows[rows["point"] == number]
        }
        assert set(mine) == set(itertools.product((0, 1, -1), repeat=2))
        direct = mine[0, 0]
        for (a, b), one in mine.items():
            expected = mine[a, 0]["power_w"] * mine[0, b]["power_w"] / direct["power_w"]
            assert one["power_w"] == pytest.approx(expected, rel=1e-12)
            length = mine[a, 0]["length_m"] + mine[0, b]["length_m"] - direct["length_m"]
            assert one["length_m"] == pytest.approx(length, abs=1e-9)
            phase = mine[a, 0]["mirror_phase_rad"] + mine[0, b]["mirror_phase_rad"]
            assert one["mirror_phase_rad"] == pytest.approx(phase, abs=1e-12)
    if transmitter.any():
        assert len(paths.lamps_m) == 2
        # A plate in the transmitter's shadow, lit by the ball alone
        lit = parts[-1]
        dark, _ = paths.with_both_ways(lit)
        assert set(dark["transmitter_image"]) == {-1}
        bright = rows[rows["transmitter_image"] == -1]
        np.testing.assert_allclose(np.sort(dark["power_w"]), np.sort(bright["power_w"]), rtol=1e-9)


RADAR_M = np.array([0.0, 0.0, 4.0])


def over(mirror: tuple[Mesh, Surface], obstacle: tuple[Mesh, Surface]) -> tuple[int, float]:
    """Paths over a mirror on either way to a plate, and the power that is lost in open obstacles,
    over that of the direct path.
    """
    plate = mesh([(-0.2, 40, 3.8), (0.2, 40, 3.8), (0.2, 40, 4.2), (-0.2, 40, 4.2)])
    own = {"Mirror": mirror, "Plate": (plate, ROUGH), "Obstacle": obstacle}
    paths = paths_in(own, RADAR_M, RADAR_M, reflections=2)
    point, body, normal = np.array([[0.0, 40.0, 4.0]]), np.array([2]), np.array([[0, -1.0, 0]])
    parts = [
        paths.number(single(point, body, normal, lamp, RADAR_M, np.ones(1)), np.array([7]))
        for lamp in (RADAR_M, *paths.lamps_m)
    ]
    direct_w, lost_w = parts[0]["power_w"].sum(), 0.0
    for image in range(1, len(parts)):
        parts[image], through_w = paths.choose(image, parts[image])
        lost_w += through_w
    rows, through_w = paths.with_both_ways(PathRows.joined(parts))
    return rows.size - 1, (lost_w + through_w) / direct_w


@pytest.mark.parametrize(
    ("low", "high", "blocks"),
    [
        ((-9, 30, 1), (9, 31, 2.5), True),  # between scatterer and mirror
        ((-9, 9, 1), (9, 10, 2.5), True),  # between mirror and transmitter
        ((-9, 19.5, -1), (9, 20.5, 0.5), True),  # straddling the plane
        ((-9, 1, -9), (9, 35, -1), False),  # below the plane
        ((1, 9, 1), (9, 31, 2.5), False),  # aside
        ((-9, 9, 6), (9, 31, 7), False),  # above
    ],
)
def test_obstacles_next_to_a_plane(low: Any, high: Any, blocks: bool) -> None:
    floor = mesh([(-60, -5, 0), (60, -5, 0), (60, 90, 0), (-60, 90, 0)])
    straight, both = 40 / math.hypot(40, 8), 2 * (not blocks)
    assert over((floor, METAL), (box(low, high), ROUGH)) == (both, 0.0)
    count, lost = over((floor, METAL), (box(low, high), PANE))
    assert count == both
    assert lost == pytest.approx(straight**3 * blocks, rel=2e-3)  # the mirror keeps 99.9 %


@pytest.mark.parametrize(
    ("low", "high", "blocks"),
    [
        ((1.5, 31, 0), (4.5, 31.2, 6), True),  # between ball and plate
        ((2.0, 12, 0), (3.2, 12.2, 6), True),  # between radar and ball
        ((7.2, 26, 0), (9.0, 27, 6), False),  # behind the ball
    ],
)
def test_obstacles_next_to_a_ball(low: Any, high: Any, blocks: bool) -> None:
    ball = sphere(32, 64, np.array([6.0, 25.0, 4.0]), 1.0)
    both = 2 * (not blocks)
    assert over((ball, METAL), (box(low, high), ROUGH)) == (both, 0.0)
    count, lost = over((ball, METAL), (box(low, high), PANE))
    assert count == both and (lost > 0) == blocks


@pytest.mark.parametrize("other", [None, "ball", "road"])
def test_two_mirrors_in_a_row_are_named(other: str | None) -> None:
    """A ball alone has no second reflection; with another mirror it has."""
    bodies = {"Ball": (sphere(32, 64, BALL_M, 1.0), METAL)}
    if other == "ball":
        bodies["Other"] = sphere(32, 64, BALL_M * [-1, 1, 1], 1.0), METAL
    elif other == "road":
        bodies["Other"] = mesh([(-60, -5, -3), (60, -5, -3), (60, 90, -3), (-60, 90, -3)]), METAL
    for reflections in (2, 3):
        said = paths_in(bodies, np.zeros(3), np.zeros(3), reflections).findings
        named = other is not None and reflections == 3
        assert ("mirror-curved-in-a-row" in {item.code for item in said}) == named


def test_a_point_that_is_seen_in_a_mirror_at_grazing_incidence() -> None:
    """Its place is known to a millionth of the length, which moves the reflection much more."""
    floor = mesh([(-9, -9, -0.5), (9, -9, -0.5), (9, 60, -0.5), (-9, 60, -0.5)])
    plate = mesh([(-1, 40, -0.4), (1, 40, -0.4), (1, 40, 1), (-1, 40, 1)])
    paths = paths_in({"Floor": (floor, METAL), "Plate": (plate, ROUGH)}, np.zeros(3), np.zeros(3))
    point, image = np.array([0.3, 40.0, -0.3]), np.array([0.3, 40.0, -0.7])
    rows = PathRows.zeros(2, IMAGE_DTYPE)
    rows["order"], rows["last_body"], rows["first_body"] = 2, 2, 1
    rows["direction"] = image / np.linalg.norm(image)
    rows["first_scatterer_m"] = image * 0.5 / 0.7
    rows["length_m"] = np.linalg.norm(image) + np.linalg.norm(point)
    rows["last_scatterer_m"] = point + np.array([[0, 0, 8e-5], [0, 0, -8e-5]])
    every, _ = paths.with_both_ways(rows)
    assert every.size == 0


def test_fewer_reflections() -> None:
    """Of two at most, paths go over one mirror; of one, none."""
    places = (street.RADAR, street.RADAR)
    paths = paths_in(walls_and_plates(), *places, reflections=2)
    assert len(paths.images) == 2 and paths.reflections(1) == 1
    assert [item.code for item in paths.findings] == ["mirror-both-ways-left-out"]
    rows, _ = paths.with_both_ways(rendered(paths, places)[0])
    added = rows[(rows["transmitter_image"] > 0) | (rows["receiver_image"] > 0)]
    assert set(added["order"]) == {2} and added.size > 50
    assert paths_in({"Plate": (mesh(np.eye(4, 3)), ROUGH)}, *places).dtype == PATH_DTYPE


def test_points_without_a_direct_path() -> None:
    """With the antennas in one place, nothing tells of the ways back from them."""
    places = (street.RADAR, street.RADAR)
    paths = paths_in(walls_and_plates(), *places, reflections=2)
    rows = rendered(paths, places)[0]
    alone = rows[rows["transmitter_image"] == 1]
    alone = alone[~np.isin(alone["point"], rows["point"][rows["transmitter_image"] == 2])]
    assert alone.size > 5
    power_w = alone["power_w"].copy()
    every, _ = paths.with_both_ways(alone)
    np.testing.assert_array_equal(every["power_w"], power_w)
    assert not every["point"].any()


def test_which_mirrors_get_an_image() -> None:
    """Those in which the antenna sees most, or those that the user wants first."""
    bodies = walls_and_plates()
    radar = np.array([0.0, 15.0, 0.0])  # nearer to the right wall

    def planes(wanted: tuple[str, ...], most: int) -> tuple[list[tuple[str, ...]], list[str]]:
        found, said = find_planes(faces_of(bodies), [radar], WAVELENGTH_M, most, wanted)
        return [plane.objects for plane in found[0]], [item.code for item in said]

    assert planes((), 8) == ([("right",), ("left",)], [])
    assert planes((), 1) == ([("right",)], ["mirrors-left-out"])
    assert planes(("left",), 1) == ([("left",)], ["mirrors-left-out"])
    assert planes(("Plate 0",), 8)[1] == ["mirror-first-without-image"]
    bodies["left"] = bodies["left"][0], Surface(kind="simple", kappa=0.1, roughness=0.0)
    assert planes((), 8) == ([("right",)], ["mirror-without-image"])
    found, _ = find_planes(faces_of(bodies), [radar, radar - [20, 0, 0]], WAVELENGTH_M, 8)
    assert len(found[0]) == 1 and found[0] == found[1]  # one plane for both antennas
    del bodies["right"]
    assert find_planes(faces_of(bodies), [radar], WAVELENGTH_M, 8)[0] == [[]]


def test_a_closed_body_mirrors_on_its_outer_side() -> None:
    closed = box((0, 0, 0), (1, 1, 1))
    lidless = mesh(closed.vertices, closed.triangles[2:])
    mirrored = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirrored[0, 3] = 1.0
    for own, pose, within, above in (
        (closed, np.eye(4), 0, 1), (closed, mirrored, 0, 1), (lidless, np.eye(4), 5, 5),
    ):  # fmt: skip
        faces_ = mirror_faces(obstacles({"Box": (own, METAL)}, pose))
        for antenna, count in ((np.full(3, 0.4), within), (np.array([0.4, 0.6, 3.0]), above)):
            planes, _ = find_planes(faces_, [antenna], WAVELENGTH_M, 8)
            assert len(planes[0]) == count
            assert all(plane.heights_m(antenna[None])[0] > 0 for plane in planes[0])


def test_an_echo_that_does_not_form() -> None:
    """A mirror at normal incidence: its level by physical optics, and nothing behind a screen."""
    plate = mesh([(-1, 40, -1), (1, 40, -1), (1, 40, 1), (-1, 40, 1)])
    screen = mesh([(-1, 30, -1), (1, 30, -1), (1, 30, 1), (-1, 30, 1)])
    for hidden in (False, True):
        bodies = {"Plate": (plate, METAL)} | ({"Screen": (screen, ROUGH)} if hidden else {})
        said = paths_in(bodies, np.zeros(3), np.zeros(3)).findings
        assert [item.code for item in said] == [] if hidden else ["mirror-echo-not-formed"]
        if said:
            image_m2 = 4 * math.pi * (40 * 40 / 80) ** 2  # less than that of the plate
            assert said[0].numbers["expected_dbsm"] == pytest.approx(10 * math.log10(image_m2))


def test_lobes_wide_and_narrow() -> None:
    point, radar = np.array([[0.0, 40.0, 4.0]]), np.array([0.0, 0.0, 4.0])
    image = np.array([0.0, 0.0, -4.0])
    angle = math.atan(8 / 40)
    for lobe, alike in ((math.inf, True), (0.0, False), (0.1, False), (1.0, True)):
        found = alike_in_both(point, radar, image, np.array([lobe]))
        assert found.tolist() == [alike]
    edge = angle / math.sqrt(0.1)  # angle^2 / (2 alpha^2) = 0.05
    for factor, alike in ((0.99, False), (1.01, True)):
        assert alike_in_both(point, radar, image, np.array([factor * edge]))[0] == alike


def test_an_orthographic_view_has_no_ways_back() -> None:
    receiver = panorama(street.RADAR)
    receiver = type(receiver)(**{**vars(receiver), "kind": "orthographic"})
    paths = paths_in(walls_and_plates(), receiver, street.RADAR)
    assert [item.code for item in paths.findings] == ["mirror-ways-not-in-phase"]
    rows = PathRows.zeros(2, IMAGE_DTYPE)
    assert paths.with_both_ways(rows) == (rows, 0.0)
