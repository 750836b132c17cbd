# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons that are cut into triangles."""

from __future__ import annotations

import numpy as np

from radarsim_addon.signal.draft import DraftPolygons


def test_quads_keep_their_area_and_normals_their_corners() -> None:
    """A triangle, a square, and an arrow-head whose cut must be the other one."""
    points = np.array(
        [[0, 0], [1, 0], [0, 1], [5, 0], [6, 0], [6, 1], [5, 1],
         [10, 0], [14, 2], [10, 4], [11, 2], [10, 0]], dtype=np.float32,
    )  # fmt: skip
    points = np.column_stack([points, np.zeros(len(points), dtype=np.float32)])
    corners = np.arange(11, dtype=np.int32)
    normals = np.column_stack([corners, corners, corners]).astype(np.float32)
    for shift in range(4):  # whichever corner comes first
        corners[7:] = np.roll(np.arange(7, 11), shift)
        normals[7:] = corners[7:, None]
        mesh = DraftPolygons(
            points, corners, np.array([0, 3, 7], np.int32), np.array([2, 1, 0], np.int32), normals
        ).triangulated()
        a, b, c = points[mesh.triangles].transpose(1, 0, 2)
        area = np.cross(b - a, c - a)[:, 2] / 2
        assert (area > 0).all()  # none turned round, so none overlaps
        assert [area[mesh.slots == slot].sum() for slot in range(3)] == [6.0, 1.0, 0.5]
        np.testing.assert_array_equal(mesh.normals[..., 0], mesh.triangles)
