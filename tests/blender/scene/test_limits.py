# SPDX-License-Identifier: GPL-3.0-or-later
"""What is just within a limit is taken; what is just beyond it is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.plan import parse_frames
from radarsim_addon.blender.plan.render_arguments import parse_axis
from radarsim_addon.blender.scene.finite_checks import check_pose
from radarsim_addon.blender.scene.rig import check_scale
from radarsim_addon.blender.scene.view_checks import ground_below
from radarsim_addon.blender.state import evaluated_snapshot
from radarsim_addon.errors import ConfigError, SceneError
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def antenna(scale: float) -> None:
    check_scale(bpy.data.objects["Radar"], np.diag([scale, 1.0, 1.0, 1.0]))


def ground(tilt_deg: float) -> None:
    rs.add_plate(0.0, 100.0, 90.0 - tilt_deg).location.z = -5.0
    ground_below(evaluated_snapshot(bpy.context.view_layer), np.zeros(3))


@pytest.mark.parametrize(
    ("check", "within", "beyond", "error"),
    [
        (antenna, 1 + 4e-5, 1 + 6e-5, SceneError),  # its square is off by at most 1e-4
        (ground, 0.9, 1.1, SceneError),
        (lambda at: check_pose("It", np.diag([1.0, 1.0, at, 1.0])), 0.9e18, 1.1e18, SceneError),
        (lambda steps: parse_axis("--x", f"0:{steps}:1"), 100_000, 100_001, ConfigError),
        (lambda last: parse_frames(f"999998:{last}"), 999_999, 1_000_000, ConfigError),
    ],
    ids=["scale", "level ground", "coordinates", "steps", "frames"],
)
def test_limits(
    check: Callable[[Any], object], within: float, beyond: float, error: type[Exception]
) -> None:
    rs.new_scene()
    check(within)
    rs.new_scene()
    with pytest.raises(error):
        check(beyond)
