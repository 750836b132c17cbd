# SPDX-License-Identifier: GPL-3.0-or-later
"""Range rates of paths: radar, plates, mirrors and instances that move."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from tests.blender import path_helpers as ph
from tests.blender import path_scenes as ps
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def test_animated_radar_frames(tmp_path: Path) -> None:
    """Each frame is measured from where the radar is then; the sidecar says where that was."""
    rs.new_scene()
    ph.field_of_view(20)
    rs.move_steadily(bpy.data.objects["Radar"], (0.0, 2.4, 0.0))
    ph.plate_at(30, 60, ph.rough_metal())
    run = ph.run_paths(tmp_path, frames=(1, 11), width_px=8, height_px=8)
    for frame, travelled in ((1, 0.0), (11, 2.4 * 10 / 24)):
        rows, record = run.table(frame), run.record(frame)
        assert record.receiver.matrix_world[1][3] == pytest.approx(travelled, abs=1e-6)
        want = 2 * (30 - travelled) / rows["direction"][:, 1]
        np.testing.assert_allclose(rows["length_m"], want, rtol=3e-7)
    assert bpy.context.scene.frame_current == 1


@pytest.mark.parametrize("velocity", [(0.0, 3.0, 0.0), (20.0, 0.0, 0.0), (3.0, -7.0, 2.0)])
def test_moving_plate(tmp_path: Path, velocity: tuple[float, float, float]) -> None:
    """Receding positive, crossing by the angle of each path; what is stationary has none."""
    rs.new_scene()
    ph.field_of_view(20)
    plate = ph.plate_at(15, 2, ph.rough_metal())
    ph.plate_at(30, 60, ph.rough_metal()).name = "Wall"
    rs.move_steadily(plate, velocity)
    run = ph.run_paths(tmp_path, width_px=32, height_px=32, snapshots=2)
    rows, names = run.table(), run.record().objects
    moving = rows["last_object"] == names.index("Plate") + 1
    assert moving.sum() > 20
    want = rows["direction"][moving] @ np.array(velocity)
    # Float32 of the poses over 10 ms.
    np.testing.assert_allclose(rows["range_rate_mps"][moving], want, atol=5e-4)
    assert np.all(rows["range_rate_mps"][~moving] == 0)


def test_spinning_plate(tmp_path: Path) -> None:
    """omega x r of each path's own point, exact although the plate turns on during the interval."""
    rs.new_scene()
    ph.field_of_view(16)
    plate = ph.plate_at(15, 3, ph.rough_metal())
    plate.rotation_euler = (0, 0, 0.3)
    plate.keyframe_insert("rotation_euler", frame=1)
    rate_rad_s = 12.0
    plate.rotation_euler = (0, 0, 0.3 + rate_rad_s)
    plate.keyframe_insert("rotation_euler", frame=25)
    for curve in rs.animation_curves(plate.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    bpy.context.scene.frame_set(1)
    rows = ph.run_paths(tmp_path, width_px=32, height_px=32, snapshots=2).table()
    assert rows.size > 200
    arm = rows["last_scatterer_m"] - (0, 15, 0)
    speed = np.cross((0, 0, rate_rad_s), arm)
    want = np.sum(rows["direction"] * speed, axis=1)
    assert np.ptp(want) > 20
    np.testing.assert_allclose(rows["range_rate_mps"], want, atol=2e-3)


def test_moving_radar_over_ground(tmp_path: Path) -> None:
    """Clutter: each path closes in at v cos(angle), 2 v cos/lambda of Doppler."""
    rs.new_scene()
    ph.field_of_view(40)
    velocity = np.array([5.0, 50.0, -1.0])
    radar = ph.radar_at((0, 0, 100))
    radar.rotation_euler.x -= math.radians(40)
    rs.move_steadily(radar, tuple(velocity))
    ph.quad(
        "Ground", [(-900, -900, 0), (900, -900, 0), (900, 900, 0), (-900, 900, 0)], ph.rough_metal()
    )
    run = ph.run_paths(tmp_path, width_px=32, height_px=32, snapshots=2)
    rows = run.table()
    assert rows.size == 32 * 32
    want = -rows["direction"] @ velocity
    np.testing.assert_allclose(rows["range_rate_mps"], want, atol=2e-3)


def test_moving_mirror_of_two_bounces(tmp_path: Path) -> None:
    """A wall that approaches, seen in the floor: each leg shortens by its own cosine."""
    rs.new_scene()
    ph.field_of_view(50)
    ph.radar_at((0, 0, 2))
    floor = nodes.make_material("Floor", 1e4, 1e4, 1.0, 0.0, penetrable=False)
    ph.quad("Floor", [(-30, -5, 0), (30, -5, 0), (30, 30, 0), (-30, 30, 0)], floor)
    wall = ph.plate_at(10, 60, ph.rough_metal())
    rs.move_steadily(wall, (0.0, -4.0, 0.0))
    rows = ph.run_paths(
        tmp_path, width_px=24, height_px=24, snapshots=2, options={"max_reflections": 2}
    ).table()
    two = rows[rows["order"] == 2]
    assert two.size > 100
    image = two["direction"] * (10 / two["direction"][:, 1:2])
    last = (image + np.array([0.0, 0.0, 2.0])) * (1, 1, -1)
    back = np.linalg.norm(last - (0, 0, 2), axis=1)
    way = np.linalg.norm(image, axis=1)
    # The vertex of the frozen path moves with the wall: d|image|/dt and d|back|/dt at fixed x, z.
    want = -4.0 * (image[:, 1] / way + last[:, 1] / back) / 2
    np.testing.assert_allclose(two["range_rate_mps"], want, atol=1e-3)


def test_moving_instance(tmp_path: Path) -> None:
    """An instancer that moves takes its plates along."""
    rs.new_scene()
    ph.field_of_view(40)
    collection = ps.plate_collection()
    moving_targets = [rs.instance_of(collection, place) for place in ps.PLACES]
    rs.move_steadily(moving_targets[1], (0.0, 6.0, 0.0))
    rows = ph.run_paths(tmp_path, width_px=48, height_px=48, snapshots=2).table()
    planes = np.array([place[1] for place in ps.PLACES])
    which = np.argmin(np.abs(rows["last_scatterer_m"][:, 1:2] - planes), axis=1)
    want = np.where(which == 1, 6.0 * rows["direction"][:, 1], 0.0)
    np.testing.assert_allclose(rows["range_rate_mps"], want, atol=5e-4)
