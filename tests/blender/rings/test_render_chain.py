# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed forms through the whole chain: scene, render job, files, companion module."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import contract, signal
from radarsim_addon.typed_json import read_record
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def directions(found: signal.Decoded) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors (x, y, z) of the pixels of a radar at the origin looking along +Y."""
    u, v = np.broadcast_arrays(found.u[None, :], found.v[:, None])
    norm = np.sqrt(1 + u**2 + v**2)
    return u / norm, 1 / norm, v / norm


@pytest.mark.parametrize("tilt_deg", [0.0, 40.0])
@pytest.mark.parametrize("shape", [(32, 32), (40, 24), (24, 40)])
def test_range_of_a_plane(tmp_path: Path, tilt_deg: float, shape: tuple[int, int]) -> None:
    """|n . P| / |n . d| to 1e-5, for every pixel, in landscape and portrait."""
    rs.new_scene()
    rs.add_plate(10.0, size=40.0, tilt_deg=tilt_deg)
    rs.run(tmp_path, width_px=shape[0], height_px=shape[1])
    seen = np.zeros(shape[::-1], dtype=int)
    tilt = math.radians(tilt_deg)
    for found in rs.decoded(tmp_path):
        _, y, z = directions(found)
        expected_m = 10.0 * math.cos(tilt) / (y * math.cos(tilt) - z * math.sin(tilt))
        error = np.abs(found.range_m / expected_m - 1)[found.mask]
        assert error.size == 0 or error.max() < 1e-5
        seen += found.mask
    assert np.all(seen == 1)


def test_lens_shift_and_sensor_fit(tmp_path: Path) -> None:
    """The recorded frustum is the one Cycles used: ranges of a plane fit its rays."""
    scene = rs.new_scene()
    camera = scene.camera.data
    camera.sensor_fit, camera.sensor_height, camera.lens = "VERTICAL", 20.0, 35.0
    camera.shift_x, camera.shift_y = 0.2, -0.1
    rs.add_plate(10.0, size=60.0)
    rs.run(tmp_path, width_px=40, height_px=24)
    seen = np.zeros((24, 40), dtype=int)
    for found in rs.decoded(tmp_path):
        _, y, _ = directions(found)
        error = np.abs(found.range_m * y / 10.0 - 1)[found.mask]
        assert error.size == 0 or error.max() < 1e-5
        seen += found.mask
    assert np.all(seen == 1)


@pytest.mark.parametrize("metres_per_unit", [0.001, 1.0, 100.0])
def test_unit_scale(tmp_path: Path, metres_per_unit: float) -> None:
    scene = rs.new_scene()
    scene.unit_settings.scale_length = metres_per_unit
    rs.add_plate(10.0, size=40.0)
    rs.run(tmp_path, ring_step_m=4.0 * metres_per_unit)
    record = signal.open_run(tmp_path).record
    assert record.metres_per_unit == metres_per_unit
    nearest_m = min(f.range_m[f.mask].min() for f in rs.decoded(tmp_path) if f.mask.any())
    # The pixels nearest to the axis see the plate a little farther than its foot point.
    half_px = (0.72 / 32) / 2
    assert nearest_m == pytest.approx(
        10 * metres_per_unit * math.sqrt(1 + 2 * half_px**2), rel=1e-5
    )
    truth = read_record(
        tmp_path / contract.frame_dir(1) / "ground_truth.json", contract.GroundTruthRecord
    )
    assert truth.objects[0].nearest_range_m == pytest.approx(10 * metres_per_unit, rel=1e-9)


@pytest.mark.parametrize("speed_mps", [-3.0, 10.0])
def test_velocity_of_a_plate(tmp_path: Path, speed_mps: float) -> None:
    """Two passes 10 ms apart: the plate's speed, and the same in the labels."""
    rs.new_scene()
    plate = rs.add_plate(10.0, size=40.0)
    rs.move_steadily(plate, (0.0, speed_mps, 0.0))
    rs.run(tmp_path, snapshots=2, snapshot_interval_s=0.01, rings=1, ring_step_m=40.0)
    frame = signal.open_run(tmp_path).frame(1)
    first, second = (frame.image(0, p) for p in (0, 1))
    interval_s = second[0].time_s - first[0].time_s
    assert interval_s == pytest.approx(0.01, rel=1e-5)
    rate, _ = signal.range_rate(signal.decode(*first), signal.decode(*second), interval_s)
    # Along a fixed ray the range of a plane grows as v / cos; the plane is perpendicular to Y.
    _, y, _ = directions(signal.decode(*first))
    np.testing.assert_allclose(rate * y, speed_mps, rtol=0, atol=2e-3)
    truth = frame.scene()
    assert truth is not None
    assert truth.objects[0].range_rate_mps == pytest.approx(speed_mps, abs=1e-3)


def test_each_snapshot_has_its_own_antennas(tmp_path: Path) -> None:
    """Both move at velocities of their own; 10 ms apart is no short interval."""
    rs.new_scene()
    rs.add_plate(10.0, size=40.0)
    radar, emitter = bpy.data.objects["Radar"], bpy.data.objects["Radar Emitter"]
    emitter.location = (0.5, 0.2, 0.0)
    rs.move_steadily(emitter, (0.0, 3.0, 0.0))  # its Y is the world's Z
    rs.move_steadily(radar, (2.0, -5.0, 0.0))
    changes = {"snapshots": 2, "rings": 1, "ring_step_m": 40.0}
    job = rs.run(tmp_path, snapshot_interval_s=0.01, **changes)
    assert "short-snapshot-interval" not in {one.code for one in job.run_findings}
    frame = signal.open_run(tmp_path).frame(1)
    first, second = (frame.image(0, number)[0] for number in (0, 1))
    for side, velocity in (("receiver", (2.0, -5.0, 0.0)), ("transmitter", (2.0, -5.0, 3.0))):
        places = [np.array(getattr(one, side).matrix_world)[:3, 3] for one in (first, second)]
        np.testing.assert_allclose(np.diff(places, axis=0)[0], 0.01 * np.array(velocity), atol=2e-6)
    np.testing.assert_allclose(places[0], (0.5, 0.0, 0.2), atol=1e-6)
    job = rs.run(tmp_path / "short", snapshot_interval_s=0.0015, **changes)
    assert "short-snapshot-interval" in {one.code for one in job.run_findings}


def test_each_frame_has_its_own_antennas(tmp_path: Path) -> None:
    scene = rs.new_scene()
    rs.add_plate(10.0, size=40.0)
    rs.move_steadily(bpy.data.objects["Radar"], (2.0, -5.0, 0.0))
    rs.run(tmp_path, frames=(1, 13), snapshots=1, rings=1, ring_step_m=40.0)
    opened = signal.open_run(tmp_path)
    for frame, at_s in ((1, 0.0), (13, 12 / scene.render.fps)):
        record, _ = opened.frame(frame).image(0, 0)
        for side in (record.receiver, record.transmitter):
            place = np.array(side.matrix_world)[:3, 3]
            np.testing.assert_allclose(place, (2.0 * at_s, -5.0 * at_s, 0.0), atol=1e-5)


@pytest.mark.parametrize("frame", [32, 250, 10_000, -7])
def test_velocity_at_any_frame(tmp_path: Path, frame: int) -> None:
    """Between two keys 20 frames apart, around the frame; the scene's time comes back."""
    scene, speed_mps = rs.new_scene(), 10.0
    plate = rs.add_plate(10.0, size=40.0)
    for passed in (-10, 10):
        plate.location.y = 10.0 + speed_mps * passed / scene.render.fps
        plate.keyframe_insert("location", index=1, frame=frame + passed)
    for curve in rs.animation_curves(plate.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    scene.frame_set(frame - 3, subframe=0.25)
    before = scene.frame_current, scene.frame_subframe
    changes = {"snapshots": 2, "snapshot_interval_s": 0.01, "rings": 1, "ring_step_m": 40.0}
    rs.run(tmp_path, frames=(frame,), **changes)
    assert (scene.frame_current, scene.frame_subframe) == before
    found = signal.open_run(tmp_path).frame(frame)
    paths = signal.frame_paths(found)
    _, y, _ = directions(signal.decode(*found.image(0, 0)))
    assert len(paths) == 32 * 32
    rates_mps = paths.range_rate_mps * y[paths.row, paths.col]
    np.testing.assert_allclose(rates_mps, speed_mps, rtol=0, atol=2e-3)


def test_rings_add_up_to_the_ungated_render(tmp_path: Path) -> None:
    """Every path is in exactly one ring, also with soft materials and many samples."""
    rs.new_scene()
    rs.add_plate(10.0, size=3.0, preset="ground")
    rs.add_plate(17.0, size=60.0, tilt_deg=50.0, preset="ground")
    rs.run(tmp_path / "rings", ring_step_m=2.5, rings=40, samples=4)
    rs.run(tmp_path / "whole", ring_step_m=100.0, rings=1, samples=4)
    rings = rs.images(tmp_path / "rings")
    (whole,) = rs.images(tmp_path / "whole")
    assert sum(np.any(ring["B"] > 0) for ring in rings) > 4
    total = sum(ring["B"] for ring in rings)
    np.testing.assert_allclose(total, whole["B"], rtol=2e-6, atol=0)


def test_ring_edge_belongs_to_the_outer_ring(tmp_path: Path) -> None:
    """Echoes of ring n lie at n step <= r < (n+1) step, to float32 rounding."""
    rs.new_scene()
    rs.add_plate(10.0, size=40.0, tilt_deg=60.0)
    rs.run(tmp_path, ring_step_m=1.5)
    rings = rs.decoded(tmp_path)
    assert sum(bool(found.mask.any()) for found in rings) > 3
    for ring, found in enumerate(rings):
        if found.mask.any():
            assert found.range_m[found.mask].min() >= 1.5 * ring * (1 - 1e-6)
            assert found.range_m[found.mask].max() <= 1.5 * (ring + 1) * (1 + 1e-6)


def test_dihedral_doubles_bounce(tmp_path: Path) -> None:
    """One more bounce adds echoes that no single reflection gives, and codes do not underflow."""
    rs.new_scene()
    rs.add_plate(10.0, size=6.0)
    rs.add_plate(10.0, size=6.0).rotation_euler = (0, 0, math.radians(80.0))
    rs.run(tmp_path / "one", rings=1, ring_step_m=40.0, samples=64)
    rs.run(tmp_path / "two", rings=1, ring_step_m=40.0, samples=64, max_reflections=2)
    one, two = rs.images(tmp_path / "one")[0], rs.images(tmp_path / "two")[0]
    assert two["B"].sum() > one["B"].sum() * 1.001
    lit = two["B"] > 0
    assert np.all(two["G"][lit] > 1e-30)


def test_empty_scene_is_valid(tmp_path: Path) -> None:
    rs.new_scene()
    job = rs.run(tmp_path, snapshots=2)
    assert job.plan.rings == 1
    assert all(not found.mask.any() for found in rs.decoded(tmp_path))
    truth = read_record(
        tmp_path / contract.frame_dir(1) / "ground_truth.json", contract.GroundTruthRecord
    )
    assert truth.objects == []


def test_automatic_rings_reach_the_farthest_point_through_instances(tmp_path: Path) -> None:
    rs.new_scene()
    rs.instance_of(rs.add_plate(5.0, size=1.0), (0, 15.0, 0), "Holder")
    job = rs.run(tmp_path, ring_step_m=4.0)
    # Corners at (+-0.5, 20, +-0.5): 20.0125 m, in the sixth ring.
    assert job.plan.extent.from_emitter_m == pytest.approx(math.hypot(20.0, 0.5, 0.5), rel=1e-6)
    assert job.plan.rings == 6
    truth = read_record(
        tmp_path / contract.frame_dir(1) / "ground_truth.json", contract.GroundTruthRecord
    )
    assert [item.name for item in truth.objects] == ["Holder/Plate"]
    assert truth.objects[0].nearest_range_m == pytest.approx(20.0, rel=1e-7)
    assert any(found.mask.any() for found in rs.decoded(tmp_path))


def test_same_paths_in_both_passes(tmp_path: Path) -> None:
    """Nothing moves: the passes are equal, bit for bit, whatever the number of samples."""
    rs.new_scene()
    rs.add_plate(10.0, preset="ground")
    rs.run(tmp_path, snapshots=2, samples=4)
    assert any(np.any(image["B"] > 0) for image in rs.images(tmp_path))
    for first, second in zip(
        rs.images(tmp_path), rs.images(tmp_path, snapshot_index=1), strict=True
    ):
        for name in contract.CHANNELS:
            np.testing.assert_array_equal(first[name], second[name])
