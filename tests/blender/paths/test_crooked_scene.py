# SPDX-License-Identifier: GPL-3.0-or-later
"""One run of a scene in which no two things are alike, against ray geometry in numpy."""

from __future__ import annotations

import functools
import itertools
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon import contract
from radarsim_addon.signal.paths import PathRows, open_table
from radarsim_addon.signal.radar import Burst
from radarsim_addon.typed_json import read_record
from tests.blender import crooked_scene as cs
from tests.blender import path_helpers as ph

pytestmark = [pytest.mark.blender, pytest.mark.slow]

FRAMES = (1, 6)
BURST = Burst(1000.0, 128)
RENDERS = (0, 1)  # at the beginning and at the end of the burst
INTERVAL_S = 0.05
OBJECTS = ["A wall", "Back", "Post", "Road", "Sled", "Window"]
CORNERS = {"Back": cs.BACK, "Post": cs.POST, "Road": cs.ROAD, "Window": cs.WINDOW}
ROAD, WINDOW = cs.mirror_plane(cs.ROAD), cs.mirror_plane(cs.WINDOW)
#: From the antenna to the scatterer; what the road takes up in the transmitter's view is larger.
IMAGES: list[tuple[str, ...]] = [(), ("Road",), ("Window",), ("Road", "Window"), ("Window", "Road")]
PLANES = {"Road": ROAD, "Window": WINDOW}


class View(NamedTuple):
    """A render of a burst: its frame of the animation, rows and sidecar."""

    at: float
    rows: PathRows
    record: contract.PathsRecord
    folder: Path


@pytest.fixture(scope="module")
def run(
    tmp_path_factory: pytest.TempPathFactory, group_folder: Path
) -> Iterator[dict[tuple[int, int], View]]:
    """All renders by frame and number."""
    from scripts.validation.kept_groups import kept_groups

    folder = tmp_path_factory.mktemp("crooked")
    with kept_groups(group_folder):
        cs.build()
        ph.run_paths(
            folder,
            width_px=24,
            height_px=40,
            frames=FRAMES,
            snapshots=2,
            snapshot_interval_s=INTERVAL_S,
            burst=BURST,
            options={"max_reflections": 3, "tile_px": 24, "visibility_updates": 2},
        )
    views = {}
    for frame in FRAMES:
        for number in RENDERS:
            at = folder / contract.burst_dir(frame, number)
            time = frame + number * BURST.pulses / BURST.prf_hz * cs.FPS
            rows = open_table(at / contract.PATHS_TABLE)
            record = read_record(at / contract.PATHS_FILE, contract.PathsRecord)
            views[frame, number] = View(time, rows, record, at)
    yield views


def corners_of(name: str, at: float) -> np.ndarray:
    return cs.sled_corners(at) if name == "Sled" else np.array(CORNERS[name])


def mirrored(point: np.ndarray, name: str) -> np.ndarray:
    normal, offset = PLANES[name]
    return point - 2 * (point @ normal - offset)[..., None] * normal


def met(start: np.ndarray, towards: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Where rays meet the plane of a quadrilateral, (n, 3); NaN outside its edges."""
    normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    part = (corners[0] - start) @ normal / ((towards - start) @ normal)
    found = start + part[:, None] * (towards - start)
    inside = np.ones(len(found), dtype=bool)
    size = np.linalg.norm(normal)
    for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= np.cross(other - one, found - one) @ normal > -1e-5 * size**1.5
    return np.where(inside[:, None], found, np.nan)


def way(points: np.ndarray, antenna: np.ndarray, names: tuple[str, ...]) -> list[np.ndarray]:
    """Points of the paths from scatterers over mirrors to an antenna, (n, 3) each."""
    images = [antenna]
    for name in names:
        images.append(mirrored(images[-1], name))
    found = [points]
    for name, image in zip(names[::-1], images[:0:-1], strict=True):
        found.append(met(found[-1], np.broadcast_to(image, points.shape), corners_of(name, 1)))
    return [*found, np.broadcast_to(antenna, points.shape)]


def length(points: list[np.ndarray]) -> np.ndarray:
    return sum(np.linalg.norm(b - a, axis=1) for a, b in itertools.pairwise(points))


def through_wall(points: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Transmitted power and excess length of paths; NaN near the edges of the wall."""
    corners, normal = cs.wall_corners()
    power, longer = np.ones(len(points[0])), np.zeros(len(points[0]))
    inner, outer = (
        np.mean(corners, axis=0) + scale * (corners - np.mean(corners, axis=0))
        for scale in (0.95, 1.05)
    )
    for a, b in itertools.pairwise(points):
        hits = []
        for box in (inner, outer):
            # the face at each side, in order around its edge
            sides = [box[[0, 1, 5, 4]], box[[2, 3, 7, 6]]]
            own = [met(a, b, side) for side in sides]
            hits.append(np.array([np.isfinite(one[:, 0]) for one in own]))
        ends = [(point - corners.mean(axis=0)) @ normal for point in (a, b)]
        crosses = ends[0] * ends[1] < 0
        whole, some = hits[0].all(axis=0) & crosses, hits[1].any(axis=0) & crosses
        along = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
        cosine = np.abs(along @ normal)
        q = np.sqrt(cs.WALL_EPS - 1 + cosine**2)
        r = np.array(
            [(cosine - q) / (cosine + q), (cs.WALL_EPS * cosine - q) / (cs.WALL_EPS * cosine + q)]
        )
        k0 = 2 * math.pi * cs.CARRIER_HZ / ph.C0_MPS
        lost = np.abs(1 - r**2) ** 2 * np.exp(-2 * k0 * q.imag * cs.WALL_M)
        power = power * np.where(whole, lost.mean(axis=0), np.where(some, np.nan, 1.0))
        longer = longer + np.where(whole, cs.WALL_M * (q.real - cosine), 0.0)
    return power, longer


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def families(view: View) -> Iterator[tuple[str, tuple[str, ...], tuple[str, ...], np.ndarray]]:
    """Rows by object, and by the mirrors from each antenna to it.

    A mirror of the receiver is met as the first vertex, or known by formula from the direct path.
    """
    rows, images = view.rows, [(), *(tuple(one.objects) for one in view.record.images)]
    columns = ("last_object", "transmitter_image", "receiver_image", "first_object")
    keys = np.stack([rows[name] for name in columns]).T
    for last, there, back, first in np.unique(keys, axis=0).tolist():
        mine = rows[(keys == (last, there, back, first)).all(axis=1)]
        name = OBJECTS[last - 1]
        if name in cs.SCATTERING and first:
            seen = images[back] if first == last else (OBJECTS[first - 1],)
            yield name, images[there], seen, mine


VIEWS = [(frame, number) for frame in FRAMES for number in RENDERS]


def moved(points: np.ndarray, name: str, start: float, stop: float) -> np.ndarray:
    if name != "Sled":
        return points
    change = cs.sled_pose(stop) @ np.linalg.inv(cs.sled_pose(start))
    return points @ change[:3, :3].T + change[:3, 3]


def half_m(
    points: np.ndarray, name: str, start: float, there: Any, back: Any, at: float
) -> np.ndarray:
    """Half the lengths of paths over points of an object at another frame."""
    total = np.zeros(len(points))
    for end, names in zip(cs.antennas(at), (back, there), strict=True):
        for one in names:
            end = mirrored(end, one)
        total += np.linalg.norm(moved(points, name, start, at) - end, axis=1)
    return total / 2


@pytest.mark.parametrize("key", VIEWS)
def test_paths_are_those_of_ray_geometry(run: Any, key: tuple[int, int]) -> None:
    """Vertices, lengths, range rates, powers, numbers of bodies and objects of each path."""
    view = run[key]
    receiver, transmitter = cs.antennas(view.at)
    bodies = [
        one["object"] for one in json.loads((view.folder / "motion.json").read_text())["bodies"]
    ]
    assert view.record.objects == OBJECTS
    seen, checked_w = set(), 0.0
    step = 2 * math.tan(math.radians(56) / 2) / 40  # the longer side of the frame
    pose = cs.matrix((0, 0, 0), cs.MOUNT_TURN, (1, 1, 1))[:3, :3]
    for name, there, back, rows in families(view):
        corners = corners_of(name, view.at)
        image = receiver
        for one in back:
            image = mirrored(image, one)
        # Behind a wall a vertex is where it seems to be: on its ray.
        by_formula = rows["receiver_image"] > 0
        source = np.where(by_formula[:, None], receiver, image)
        point = met(source, rows["last_scatterer_m"], corners)
        forth, home = way(point, transmitter, there), way(point, receiver, back)
        (lost, longer), (lost_back, longer_back) = through_wall(forth), through_wall(home)
        good = np.isfinite(forth[-2] + home[-2]).all(axis=1) & np.isfinite(lost * lost_back)
        if not good.any():
            continue
        label = f"{name}, transmitter over {there}, receiver over {back}"
        atol = 2e-6 if name != "Back" else 2e-5
        want_m = length(forth) + length(home) + longer + longer_back
        np.testing.assert_allclose(rows["length_m"][good], want_m[good], atol=atol, err_msg=label)
        np.testing.assert_allclose(
            rows["direction"][good], unit(home[-2] - receiver)[good], atol=1e-6, err_msg=label
        )
        first = np.where(by_formula[:, None], point, home[-2])
        straight = good & (longer_back == 0)
        np.testing.assert_allclose(
            rows["first_scatterer_m"][straight], first[straight], atol=2e-5, err_msg=label
        )
        if straight.any():
            np.testing.assert_allclose(
                rows["last_scatterer_m"][straight], point[straight], atol=2e-5, err_msg=label
            )
        assert {bodies[one - 1] for one in set(rows["last_body"].tolist())} == {name}, label
        # power: what the surface sends to the receiver, in the pixel's part of the view
        normal = unit(np.cross(corners[1] - corners[0], corners[3] - corners[0]))
        cosine = np.abs(unit(forth[1] - point) @ normal)
        pixel = np.where(by_formula[:, None], unit(point - receiver), rows["direction"])
        local = pixel @ pose
        pixel_sr = step**2 * np.abs(local[:, 2]) ** 3
        direct, other = receiver - point, image - point
        seen_by = [
            np.abs(one @ normal) / np.linalg.norm(one, axis=1) ** 3 for one in (direct, other)
        ]
        pixel_sr = np.where(by_formula, pixel_sr * seen_by[1] / seen_by[0], pixel_sr)
        aperture_m2 = (ph.C0_MPS / cs.CARRIER_HZ) ** 2 / (4 * math.pi)
        sent = cs.ALBEDO / math.pi * ph.irradiance(length(forth)) * cosine
        want_w = sent * lost * lost_back * pixel_sr * aperture_m2
        # each mirror takes 4 Re(1/n) / cos of vertical waves
        rtol = 0.003 + 0.008 * (len(there) + len(back))
        bare = good & ((lost == 1) & (lost_back == 1) | (not there and not back))
        np.testing.assert_allclose(rows["power_w"][bare], want_w[bare], rtol=rtol, err_msg=label)
        half = functools.partial(half_m, point, name, view.at, there, back)
        h = 1e-3
        rate = (half(view.at + h) - half(view.at - h)) / (2 * h) * cs.FPS
        np.testing.assert_allclose(
            rows["range_rate_mps"][good], rate[good], atol=3e-5, err_msg=label
        )
        seen.add((name, there, back))
        checked_w += rows["power_w"][good].sum()
    assert checked_w > 0.9 * view.rows["power_w"].sum()
    one, sides = (), (("Road",), ("Window",))
    assert {(name, one, one) for name in cs.SCATTERING} <= seen
    assert {("Sled", a, b) for a in (one, *sides) for b in (one, *sides)} <= seen
    assert any(len(there) == 2 for _, there, _ in seen)


@pytest.mark.parametrize("key", VIEWS)
def test_records_hold_each_antenna_and_mirror(run: Any, key: tuple[int, int]) -> None:
    view = run[key]
    receiver, transmitter = cs.antennas(view.at)
    for pose, place in (
        (view.record.receiver.matrix_world, receiver),
        (view.record.transmitter.matrix_world, transmitter),
    ):
        found = np.array(pose)
        np.testing.assert_allclose(found[:3, 3], place, atol=1e-6)
        turn = cs.matrix((0, 0, 0), cs.MOUNT_TURN, (1, 1, 1))[:3, :3]
        np.testing.assert_allclose(found[:3, :3], turn, atol=1e-6)
    half = math.tan(math.radians(56) / 2)
    edges = [getattr(view.record.receiver, side) for side in ("left", "right", "bottom", "top")]
    middle = np.array([0.04, 0.04, -0.07, -0.07]) * 2 * half
    want = middle + np.array([-0.6, 0.6, -1.0, 1.0]) * half
    np.testing.assert_allclose(edges, want, atol=1e-6)
    motion = json.loads((view.folder / "motion.json").read_text())
    ends = (("Radar Receiver", receiver), ("Radar Emitter", transmitter))
    for one, (name, place) in zip(motion["antennas"], ends, strict=True):
        assert one["object"] == name
        np.testing.assert_allclose(np.array(one["pose"])[:3, 3], place, atol=1e-6)
        # Blender rounds places in its units: to 2^-16 of 1 cm from 128 on
        assert 5e-8 < one["displacement_error_bound_m"] < 1e-6
    names = [one["object"] for one in motion["bodies"]]
    assert names == [one for one in OBJECTS if one in names] and "Sled" in names
    first, second = view.record.images[:2]
    for image, name in ((first, "Road"), (second, "Window")):
        normal, offset = PLANES[name]
        assert image.objects == [name] and [names[one - 1] for one in image.bodies] == [name]
        np.testing.assert_allclose(image.normals, [normal], atol=1e-6)
        np.testing.assert_allclose(image.offsets_m, [offset], atol=1e-5)


def centre(name: str, at: float) -> np.ndarray:
    """Centre of the box around a mesh in its own axes, in the world."""
    if name == "Sled":
        pose, points = cs.sled_pose(at), cs.sled_corners(at)
    else:
        pose, points = cs.pose_of(name), cs.world_of(name)
    local = (points - pose[:3, 3]) @ np.linalg.inv(pose[:3, :3]).T
    return pose[:3, :3] @ (local.min(axis=0) + local.max(axis=0)) / 2 + pose[:3, 3]


@pytest.mark.parametrize("frame", FRAMES)
def test_ground_truth_is_that_of_both_snapshots(run: Any, frame: int) -> None:
    folder = run[frame, 0].folder
    record = read_record(folder / contract.GROUND_TRUTH_FILE, contract.GroundTruthRecord)
    assert [one.name for one in record.objects] == OBJECTS
    assert record.time_s == pytest.approx(frame / cs.FPS)
    for one in record.objects:
        ranges = [
            float(np.linalg.norm(centre(one.name, at) - cs.antennas(at)[0]))
            for at in (frame, frame + INTERVAL_S * cs.FPS)
        ]
        assert one.centre_range_m == pytest.approx(ranges[0], abs=2e-6), one.name
        rate = (ranges[1] - ranges[0]) / INTERVAL_S
        assert one.range_rate_mps == pytest.approx(rate, abs=1e-4), one.name
