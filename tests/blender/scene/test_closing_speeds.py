# SPDX-License-Identifier: GPL-3.0-or-later
"""Before the first render a run names what is faster than its PRF holds."""

import math
from pathlib import Path

import bpy
import pytest

from radarsim_addon.blender import nodes
from radarsim_addon.blender.paths import PathJob
from radarsim_addon.blender.plan import PathOptions
from radarsim_addon.findings import Finding
from radarsim_addon.signal.radar import Burst, FmcwWaveform
from tests.blender import radar_scenes as rs


def fast_ones(folder: Path, prf_hz: float, sampling_mode: str = "paths") -> list[Finding]:
    """What a run at 77 GHz says of range rates before it renders."""
    scene = bpy.context.scene
    measured = rs.measurement(
        waveform=FmcwWaveform(77e9, 300e6, 256, 20e6),
        burst=Burst(prf_hz, 64),
        snapshots=1 if sampling_mode == "paths" else 2,
        rings=4,
    )
    if sampling_mode == "rings":
        job = rs.RingJob(scene, scene.view_layers[0], measured, folder)
    else:
        job = PathJob(scene, scene.view_layers[0], measured, folder, PathOptions(replicates=1))
    with job:
        assert not list(folder.glob("frame_*/*.exr"))
        return [f for f in job.run_findings if f.code == "scene-beyond-unambiguous-velocity"]


@pytest.mark.parametrize("sampling_mode", ["paths", "rings"])
def test_a_car_that_the_prf_does_not_hold_is_named(tmp_path: Path, sampling_mode: str) -> None:
    """1 kHz at 77 GHz hold 0.97 m/s; 15 m/s need 4 x 15 / lambda = 15.4 kHz."""
    rs.new_scene()
    rs.add_plate(60.0, 80.0)
    car = rs.add_plate(50.0)
    car.name = "Car"
    rs.move_steadily(car, (0.0, 15.0, 0.0))
    (found,) = fast_ones(tmp_path / "slow", 1000.0, sampling_mode)
    assert found.subjects == ("Car",)
    assert found.numbers["fastest_mps"] == pytest.approx(15.0, rel=1e-3)
    assert "at least 15.5 kHz" in found.remedy
    assert fast_ones(tmp_path / "fast", 15500.0, sampling_mode) == []


def test_the_rim_of_a_wheel_and_a_moving_radar_count(tmp_path: Path) -> None:
    """A disc of 2 m in diameter, on edge, at 10 rad/s: its rim has 10 m/s."""
    scene = rs.new_scene()
    bpy.ops.mesh.primitive_cylinder_add(
        radius=1.0, depth=0.1, location=(0, 50, 0), rotation=(0, math.pi / 2, 0)
    )
    wheel = bpy.context.object
    wheel.name = "Wheel"
    nodes.assign_radar_material([wheel], "metal")
    wheel.rotation_mode = "ZYX"  # about its own axis, then on edge
    seconds = 24 / scene.render.fps
    wheel.keyframe_insert("rotation_euler", frame=1)
    wheel.rotation_euler[2] = 10.0 * seconds
    wheel.keyframe_insert("rotation_euler", frame=25)
    for curve in rs.animation_curves(wheel.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    scene.frame_set(1)
    (found,) = fast_ones(tmp_path / "wheel", 1000.0)
    assert found.numbers["fastest_mps"] == pytest.approx(10.0, rel=0.1)  # a mean over 0.6 rad
    rs.new_scene()
    rs.add_plate(60.0)
    rs.move_steadily(bpy.data.objects["Radar"], (0.0, 20.0, 0.0))
    (found,) = fast_ones(tmp_path / "drive", 1000.0)
    assert found.subjects == ("Plate",)
    assert found.numbers["fastest_mps"] == pytest.approx(20.0, rel=0.01)
