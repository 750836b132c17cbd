# SPDX-License-Identifier: GPL-3.0-or-later
"""Areas of boxes in views of every kind, and which small objects get tiles of their own."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import contract
from radarsim_addon.blender.paths import frame as path_frame
from radarsim_addon.blender.paths.error_budget import rank_by_error, small_boxes
from radarsim_addon.blender.paths.tiles import projected_bounds
from radarsim_addon.blender.scene import InstancePose, Poses
from radarsim_addon.blender.views import ViewWindow
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.paths.test_paths_wide import DISTANCE, add_target, lambert, wide_camera

IDENTITY = np.eye(4).tolist()

SHARED = "small-objects-share-tiles"


def sphere_camera(left: float = -math.pi, right: float = math.pi) -> contract.ReceiverRecord:
    """At the origin, looking along -z."""
    half = math.pi / 2
    return contract.ReceiverRecord("equirectangular", IDENTITY, left, right, -half, half, 0.0)


def poses_of(shown: dict[str, InstancePose]) -> Poses:
    """Poses of objects without instances."""
    return Poses(
        list(shown),
        np.arange(len(shown)),
        np.array([one.pose for one in shown.values()]),
        np.array([one.box for one in shown.values()]),
    )


def random_box(rng: np.random.Generator, reach: float) -> InstancePose:
    """A turned box of random sides somewhere around the receiver."""
    pose = np.eye(4)
    pose[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.2, 2.0, 3)
    direction = rng.normal(size=3)
    pose[:3, 3] = direction / np.linalg.norm(direction) * rng.uniform(2.5, 8) * reach
    half = rng.uniform(0.0, 1.0, 3) * reach
    return InstancePose(pose, np.stack([-half, half]))


def test_areas_on_a_sphere_are_those_of_the_whole_body() -> None:
    """Longitudes and latitudes of many points on boxes at random; edges bulge beyond corners."""
    rng = np.random.default_rng(3)
    shown = [random_box(rng, 1.0) for _ in range(400)]
    poses = poses_of({str(i): box for i, box in enumerate(shown)})
    boxes = projected_bounds(poses, [str(i) for i in range(len(shown))], sphere_camera())
    # points on all twelve edges and six faces
    t = np.linspace(0, 1, 41)
    grid = np.stack(np.meshgrid(t, t, [0.0, 1.0], indexing="ij"), axis=-1).reshape(-1, 3)
    part = np.concatenate([grid, np.roll(grid, 1, axis=1), np.roll(grid, 2, axis=1)])
    bulges = 0
    assert len(boxes) > 350
    for i, number in enumerate(boxes.number):
        box = shown[number - 1]
        local = box.box[0] + part * (box.box[1] - box.box[0])
        points = local @ box.pose[:3, :3].T + box.pose[:3, 3]
        latitude = np.arctan2(points[:, 1], np.hypot(points[:, 0], points[:, 2]))
        middle = (boxes.left[i] + boxes.right[i]) / 2
        longitude = np.arctan2(points[:, 0], -points[:, 2])
        longitude = (longitude - middle + math.pi) % (2 * math.pi) + middle - math.pi
        low, high = latitude.min(), latitude.max()
        on_axis = boxes.right[i] - boxes.left[i] > 2 * math.pi * (1 - 1e-12)
        assert boxes.bottom[i] <= low + 1e-12
        assert boxes.top[i] >= high - 1e-12
        # Little more than they need: the finest sampled edge is near the true one.
        if not on_axis:
            assert boxes.left[i] == pytest.approx(longitude.min(), abs=1e-9)
            assert boxes.right[i] == pytest.approx(longitude.max(), abs=1e-9)
            assert boxes.bottom[i] == pytest.approx(low, abs=3e-3)
            assert boxes.top[i] == pytest.approx(high, abs=3e-3)
        else:
            assert max(-boxes.bottom[i], boxes.top[i]) == math.pi / 2
        corners = np.isin(part, (0.0, 1.0)).all(axis=1)
        bulges += latitude[corners].max() < high - 1e-3
        least = np.cos(latitude).max()
        assert boxes.stretch[i] >= least - 1e-12
    assert bulges > 20


def test_an_area_across_the_seam_comes_twice() -> None:
    """Where longitudes begin anew, in frames that end there and in frames turned past it."""
    pose = np.eye(4)
    pose[:3, 3] = (0.0, 0.0, 10.0)  # behind
    poses = poses_of({"a": InstancePose(pose, np.array([[-1.0, -1, 0], [1, 1, 0]]))})
    half = math.atan2(1.0, 10.0)
    whole = ViewWindow(-math.pi, math.pi, -1.5, 1.5, 64, 32, sphere=True)
    areas = projected_bounds(poses, ["a"], sphere_camera()).areas(whole)
    edges = sorted((area.left, area.right) for area in areas)
    np.testing.assert_allclose(edges[0], [-math.pi - half, -math.pi + half])
    np.testing.assert_allclose(edges[1], [math.pi - half, math.pi + half])
    turned = ViewWindow(2.0, 4.0, -1.5, 1.5, 64, 32, sphere=True)
    (area,) = projected_bounds(poses, ["a"], sphere_camera(2.0, 4.0)).areas(turned)
    np.testing.assert_allclose((area.left, area.right), (math.pi - half, math.pi + half))
    assert len(projected_bounds(poses, ["a"], sphere_camera(-2.0, 2.0))) == 0
    assert area.shorter == pytest.approx(2 * half, rel=0.01)


def test_faint_is_what_transmitter_and_receiver_make_of_it() -> None:
    """Echoes fall with the square of the distance to the transmitter, which stands 10 km ahead.

    The small box beside it has 1e-4 of the echo of the large one beside the receiver: it counts.
    """

    def box(x: float, z: float, half: float) -> InstancePose:
        pose = np.eye(4)
        pose[:3, 3] = x, 0.0, z
        return InstancePose(pose, np.array([[-half] * 3, [half] * 3]))

    near, beside, between = box(0, -10, 1.0), box(1.0, -1e4, 1e-3), box(3.0, -1000, 1.5)
    poses = poses_of({"near": near, "beside": beside, "between": between})
    receiver = contract.ReceiverRecord("perspective", IDENTITY, -0.5, 0.5, -0.5, 0.5, 0.0)
    boxes = projected_bounds(poses, ["near", "beside", "between"], receiver)
    window = ViewWindow(-0.5, 0.5, -0.5, 0.5, 64, 64)
    small = small_boxes(boxes, window)
    assert small.number.tolist() == [2, 3]
    for transmitter_m, chosen in ((np.array([0, 0, -1e4]), 2), (np.zeros(3), 3)):
        found = rank_by_error(
            small, np.ones(2, dtype=bool), boxes, window, receiver, transmitter_m, 1
        )
        assert found.number.tolist() == [chosen]


@pytest.mark.blender
@pytest.mark.parametrize("kind", ["PANO", "PERSP", "ORTHO"])
def test_tiles_go_to_the_small_in_sight(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of many small objects the smallest in sight whose echo counts; not the hidden ones."""
    monkeypatch.setattr(path_frame, "MOST_TILED", 6)
    rs.new_scene()
    camera = bpy.context.scene.camera.data
    if kind == "PANO":
        wide_camera(-math.pi, math.pi, -math.pi / 2, math.pi / 2)
    elif kind == "ORTHO":
        camera.type, camera.ortho_scale = "ORTHO", 16.0
    else:
        camera.angle = math.radians(80)
    visible = [0.010 + 0.004 * i for i in range(9)]
    for i, half in enumerate(visible):
        add_target(-0.6 + 0.1 * i, -0.3, half, f"seen {i}")
    for i in range(8):  # smaller, behind a plate
        add_target(-0.1 + 0.03 * i, 0.3, 0.004, f"hidden {i}")
    ph.quad("Wall", [(-2, 7, 1), (2, 7, 1), (2, 7, 4), (-2, 7, 4)], lambert())
    add_target(0.5, 0.0, 5e-6, "dust")  # so faint that it drives nothing
    run = ph.run_paths(
        tmp_path,
        width_px=64,
        height_px=32,
        options={
            "replicates": 2,
            "max_standard_error": 0.1,
            "refine_for": "objects",
            "max_refinement_level": 9,
            "tile_px": 16,  # what is in sight is so in tiles before the last
        },
    )
    record, rows = run.record(), run.table()
    small = 19 if kind == "PANO" else 18  # there the wall is small, too
    assert (record.small_objects, record.small_objects_tiled) == (small, 6)
    (found,) = [item for item in record.findings if item.code == SHARED]
    assert found.numbers == {"small": small, "tiled": 6}
    pixel = {"PANO": 2 * math.pi / 64, "PERSP": 2 * math.tan(math.radians(40)) / 64, "ORTHO": 0.25}
    per_metre = 1.0 if kind == "ORTHO" else 1 / DISTANCE
    for i, half in enumerate(visible):
        number = record.objects.index(f"seen {i}") + 1
        found = rows[rows["last_object"] == number]
        expected = (2 * half * per_metre / pixel[kind]) ** 2 * 2  # rays of two shifts, untiled
        if i < 6:
            assert len(found) > 20 * expected, i
    assert not any(
        name.startswith("hidden") for name in np.array(record.objects)[rows["last_object"] - 1]
    )


@pytest.mark.blender
def test_few_small_objects_all_get_tiles(tmp_path: Path) -> None:
    rs.new_scene()
    wide_camera(-1.0, 1.0, -0.5, 0.5)
    for i in range(5):
        add_target(-0.6 + 0.3 * i, 0.1, 0.01, f"plate {i}")
    record = ph.run_paths(
        tmp_path, options={"replicates": 2, "max_standard_error": 0.05}, width_px=32, height_px=16
    ).record()
    assert (record.small_objects, record.small_objects_tiled) == (5, 5)
    assert SHARED not in [item.code for item in record.findings]


@pytest.mark.blender
def test_a_time_budget_limits_the_tiles(tmp_path: Path) -> None:
    """A budget that no render can meet pays for no tile; the frame is measured all the same."""
    rs.new_scene()
    wide_camera(-1.0, 1.0, -0.5, 0.5)
    for i in range(5):
        add_target(-0.6 + 0.3 * i, 0.1, 0.01, f"plate {i}")
    options = {"replicates": 2, "time_limit_s": 1e-6}
    record = ph.run_paths(tmp_path, options=options, width_px=32, height_px=16).record()
    assert (record.small_objects, record.small_objects_tiled) == (5, 0)
    assert SHARED in [item.code for item in record.findings]


@pytest.mark.parametrize("modified", [False, True])
def test_points_that_carry_instances_need_no_material(modified: bool, tmp_path: Path) -> None:
    """A mesh without faces cannot echo: Radar Materials encode, and all that is there is opaque.

    A modifier may give it faces.
    """
    rs.new_scene()
    plate = ph.plate_at(10, 4, ph.rough_metal())
    mesh = bpy.data.meshes.new("Places")
    mesh.from_pydata([(0.0, 0.0, 0.0), (5.0, 0.0, 0.0)], [], [])
    places = bpy.data.objects.new("Places", mesh)
    bpy.context.scene.collection.objects.link(places)
    plate.parent, places.instance_type = places, "VERTS"
    if modified:
        places.modifiers.new("Skin", "SKIN")
    run = ph.run_paths(tmp_path, width_px=8, height_px=8)
    assert run.record().range_encoding == ("world" if modified else "materials")
    assert run.job.path_scene.all_opaque is not modified
    assert run.table().size > 0
