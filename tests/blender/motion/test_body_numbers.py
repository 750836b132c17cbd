# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of many instances a point lies on, against one comparison after another."""

from __future__ import annotations

import bpy
import numpy as np

from radarsim_addon.blender.motion import Bodies
from radarsim_addon.blender.scene import distance_from_box, evaluated_poses
from radarsim_addon.blender.state import evaluated_snapshot
from tests.blender import motion_helpers as mh
from tests.blender import radar_scenes as rs


def test_points_on_many_boxes_of_all_sizes() -> None:
    rs.new_scene()
    rng = np.random.default_rng(4)
    for number in range(150):
        item = mh.facets(f"Box {number}", [(0, 0, 0), (0, 0.3, 0)], 1.0)
        item.location = rng.uniform(-30, 30, 3)
        item.rotation_euler = rng.uniform(0, 6, 3)
        item.scale = 10 ** rng.uniform(-2, 1, 3)
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    poses = evaluated_poses(snapshot, 1.0)
    names = sorted(item.name for item in bpy.data.objects if item.type == "MESH")
    bodies = Bodies(names, poses, 1.0)
    assert len(bodies) == 150
    at = rng.integers(0, 150, 600)
    inside = bodies.box[at, 0] + rng.uniform(0, 1, (600, 3)) * np.ptp(bodies.box[at], axis=1)
    points = np.einsum("nij,nj->ni", bodies.pose[at, :3, :3], inside) + bodies.pose[at, :3, 3]
    points[::7] += rng.normal(size=points[::7].shape) * 5
    allowed = rng.choice([1e-4, 0.2, 1.0], 600)
    outside = np.array(
        [np.linalg.norm(distance_from_box(one.instance, points)[1], axis=1) for one in bodies]
    )
    expected = np.full(600, -1)
    for row, near in enumerate((outside <= allowed).T):
        candidates = np.flatnonzero(near)
        if candidates.size == 1:
            expected[row] = candidates[0]
        elif candidates.size:
            place, far_m = points[row][None], np.array([np.inf])
            apart = [
                bodies._distances_m(bodies[int(index)], place, far_m)[0] for index in candidates
            ]
            if min(apart) <= allowed[row]:
                expected[row] = candidates[np.argmin(apart)]
    found = bodies._find(points, allowed, np.arange(150))
    np.testing.assert_array_equal(found, expected)
    assert np.count_nonzero(found >= 0) > 300
