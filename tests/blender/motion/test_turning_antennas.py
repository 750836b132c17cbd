# SPDX-License-Identifier: GPL-3.0-or-later
"""Antennas that turn: their rounding is no motion that the samples miss."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
import pytest

from radarsim_addon.contract import MOTION_FILE, MotionRecord, frame_dir
from radarsim_addon.signal.radar import Burst
from radarsim_addon.typed_json import read_record
from tests.blender import motion_helpers as mh
from tests.blender import radar_scenes as rs

BURST = Burst(10_000.0, 256)


def measured(folder: Path, carrier_hz: float) -> tuple[np.ndarray, MotionRecord]:
    """Rows and motion file of frame 1."""
    rows, _, run = mh.measured(folder, carrier_hz, BURST)
    assert rows.size
    return rows, read_record(run.folder / frame_dir(1) / MOTION_FILE, MotionRecord)


@pytest.mark.parametrize("carrier_hz", [5.3e9, 77e9])
@pytest.mark.parametrize("radar_m", [(0.0, 0.0, 0.0), (3.0, -2.0, 1.0)])
def test_antennas_that_track_a_target(
    tmp_path: Path, carrier_hz: float, radar_m: tuple[float, float, float]
) -> None:
    """They turn about their own places, so range rates are those of the target."""
    mh.scene_at(20.0, 3.0)
    target = mh.facets("Target", [(0, 0, 0), (0.3, 0.2, -0.4)], 0.6)
    velocity = np.array([3.1, 5.9, 0.3])
    target.location = (radar_m[0], radar_m[1] + 20, radar_m[2])
    rs.move_steadily(target, tuple(velocity))
    bpy.context.scene.camera.parent.location = radar_m
    for item in bpy.data.objects:
        if item.type in ("CAMERA", "LIGHT"):
            constraint = item.constraints.new("TRACK_TO")
            constraint.target = target
            constraint.track_axis, constraint.up_axis = "TRACK_NEGATIVE_Z", "UP_Y"
    rows, record = measured(tmp_path, carrier_hz)
    np.testing.assert_allclose(rows["range_rate_mps"], rows["direction"] @ velocity, atol=2e-5)
    assert not record.findings
    assert record.samples <= 257


@pytest.mark.parametrize(("turns_per_min", "arm_m"), [(40, 0.0), (40, 0.1), (600, 0.35)])
def test_radar_that_spins(tmp_path: Path, turns_per_min: float, arm_m: float) -> None:
    """Antennas on an arm along X move along Y at the angular rate times the arm."""
    mh.scene_at(20.0, 3.0)
    mh.facets("Target", [(0, 20, 0), (0.3, 20.2, -0.4)], 0.6)
    axis = mh.empty("Axis", (0, 0, 0))
    radar = bpy.context.scene.camera.parent
    radar.parent, radar.location.x = axis, arm_m
    rate = 2 * math.pi * turns_per_min / 60
    mh.key(axis, "rotation_euler", (1, (0, 0, 0)), (25, (0, 0, rate)))
    mh.interpolation(axis, "LINEAR", "LINEAR")
    rows, record = measured(tmp_path, 77e9)
    want_mps = -rate * arm_m * rows["direction"][:, 1]
    np.testing.assert_allclose(rows["range_rate_mps"], want_mps, atol=2e-5)
    assert not record.findings
    assert record.samples <= 129
