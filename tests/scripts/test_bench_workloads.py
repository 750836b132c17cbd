# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that the benchmark makes are what it says they are."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("bpy")

from scripts.benchmarks import workloads

pytestmark = pytest.mark.blender


def test_the_car_drives_at_constant_speed(bpy: Any) -> None:
    workloads.car()
    scene, car = bpy.context.scene, bpy.data.objects["Car"]
    for frame in (1, 2, 50, workloads.FRAMES):
        scene.frame_set(frame)
        assert car.location.y == pytest.approx(15.0 + 0.6 * (frame - 1), abs=1e-4)  # 15 m/s, 25 Hz


def test_the_city_has_as_many_objects_as_its_row_says(bpy: Any) -> None:
    workloads.city()
    assert sum(item.type == "MESH" for item in bpy.data.objects) == 2367
