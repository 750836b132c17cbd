# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender programs without scipy find the same, or name what needs it."""

from __future__ import annotations

import sys

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.motion.bodies import pairs_near
from radarsim_addon.errors import MissingDependencyError
from radarsim_addon.signal.motion import smooth_poses
from radarsim_addon.signal.paths.triangles import sorted_places
from tests.blender.motion.test_near_bodies import layout


@pytest.fixture
def no_scipy(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("scipy", "scipy.interpolate", "scipy.spatial", "scipy.sparse"):
        monkeypatch.setitem(sys.modules, name, None)


def test_points_near_boxes_are_the_same(request: pytest.FixtureRequest) -> None:
    rng = np.random.default_rng(1)
    points, pose = rng.normal(size=(400, 3)), np.tile(np.eye(4), (90, 1, 1))
    pose[:, :3, 3] = rng.normal(size=(90, 3))
    box = np.array([[-0.2, -0.2, -0.2], [0.2, 0.2, 0.2]]) + np.zeros((90, 1, 1))
    found = pairs_near(layout(90), slice(0, 90), pose, box, points, 0.05)
    assert found[0].size > 100
    request.getfixturevalue("no_scipy")
    without = pairs_near(layout(90), slice(0, 90), pose, box, points, 0.05)
    assert set(zip(*map(np.ndarray.tolist, found), strict=True)) == set(
        zip(*map(np.ndarray.tolist, without), strict=True)
    )


def test_triangles_lie_in_the_same_buckets(request: pytest.FixtureRequest) -> None:
    bucket = np.random.default_rng(2).integers(0, 64, 3000)
    found = sorted_places(bucket, 64)
    request.getfixturevalue("no_scipy")
    np.testing.assert_array_equal(sorted_places(bucket, 64), found)
    assert np.all(np.diff(bucket[found]) >= 0)


def test_smooth_simulations_name_what_they_need(no_scipy: None) -> None:
    poses = np.tile(np.eye(4), (4, 1, 1))
    with pytest.raises(MissingDependencyError, match=r"scipy.*--motion linear"):
        smooth_poses(np.arange(4.0), poses, np.array([0.5]))
