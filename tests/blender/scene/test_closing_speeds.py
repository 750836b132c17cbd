# SPDX-License-Identifier: GPL-3.0-or-later
"""Before the first render a run names what is faster than its PRF holds."""

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon.blender import nodes
from radarsim_addon.blender.paths import PathJob
from radarsim_addon.blender.plan import PathOptions
from radarsim_addon.blender.scene import echoing_boxes, find_rig, keyed_speeds
from radarsim_addon.blender.state import evaluated_snapshot
from radarsim_addon.findings import Finding
from radarsim_addon.signal.radar import Burst, FmcwWaveform
from tests.blender import radar_scenes as rs

C0_MPS = 299_792_458.0


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
    assert found.numbers["fastest_mps"] == pytest.approx(10.0, rel=2e-3)
    rs.new_scene()
    rs.add_plate(60.0)
    rs.move_steadily(bpy.data.objects["Radar"], (0.0, 20.0, 0.0))
    (found,) = fast_ones(tmp_path / "drive", 1000.0)
    assert found.subjects == ("Plate",)
    assert found.numbers["fastest_mps"] == pytest.approx(20.0, rel=0.01)


def rotor(rate: float, start: float = 0.0) -> Any:
    """A blade from 0.2 m to 1 m off its hub at 50 m that turns about Z; linear keys."""
    mesh = bpy.data.meshes.new("Rotor")
    corners = [(x, y, z) for x in (0.2, 1.0) for y in (-0.02, 0.02) for z in (-0.05, 0.05)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    item = bpy.data.objects.new("Rotor", mesh)
    bpy.context.scene.collection.objects.link(item)
    nodes.assign_radar_material([item], "metal")
    item.location, item.rotation_euler[2] = (0.0, 50.0, 0.0), start
    seconds = 24 / bpy.context.scene.render.fps
    item.keyframe_insert("rotation_euler", frame=1)
    item.rotation_euler[2] += rate * seconds
    item.keyframe_insert("rotation_euler", frame=25)
    for curve in rs.animation_curves(item.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    bpy.context.scene.frame_set(1)
    return item


def tip_speed(rate: float, span_s: float, start: float = 0.0) -> float:
    """Largest closing speed of the blade's tip while it turns, in closed form on a fine grid."""
    angle = start + rate * np.linspace(0, span_s, 20_001)
    best = 0.0
    for y in (-0.02, 0.02):
        x = np.cos(angle) - y * np.sin(angle)
        along = np.sin(angle) + y * np.cos(angle)
        place, speed = np.stack([x, 50 + along]), rate * np.stack([-along, x])
        best = max(best, float(np.abs((place * speed).sum(axis=0) / np.hypot(*place)).max()))
    return best


@pytest.mark.parametrize("rate", [5.0, 30.0, 70.0])
def test_the_tip_of_a_rotor_at_its_fastest_in_the_burst(tmp_path: Path, rate: float) -> None:
    """It turns by 0.3 to 4.5 rad in the first burst, and the PRF that is advised is enough."""
    rs.new_scene()
    rotor(rate)
    prf_hz = 1000.0
    found = fast_ones(tmp_path / "first", prf_hz)
    expected = tip_speed(rate, 64 / prf_hz)
    assert found[0].numbers["fastest_mps"] == pytest.approx(expected, rel=0.01)
    prf_hz = math.ceil(float(found[0].numbers["prf_hz"]) * 1.001)
    assert fast_ones(tmp_path / "second", prf_hz) == []
    assert tip_speed(rate, 64 / prf_hz) < prf_hz * C0_MPS / 77e9 / 4


def test_speeds_of_keyed_objects_need_no_evaluation(tmp_path: Path) -> None:
    """Those that the panel shows are those of the run, without a look at another frame."""
    scene = rs.new_scene()
    turning = rotor(30.0, math.pi / 2)  # it points away, and its tip moves across
    car = rs.add_plate(60.0)
    car.name = "Car"
    rs.move_steadily(car, (0.0, 15.0, 0.0))
    hub = bpy.data.objects.new("Hub", None)
    scene.collection.objects.link(hub)
    rs.move_steadily(hub, (0.0, -7.0, 0.0))
    carried = rs.add_plate(70.0)
    carried.name, carried.parent = "Carried", hub
    rs.add_plate(80.0).name = "Still"
    bound = rs.add_plate(90.0)
    bound.name = "Bound"
    bound.constraints.new("COPY_LOCATION").target = car
    scene.frame_set(1)
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    found = echoing_boxes(snapshot, any_material=False)
    rig = find_rig(scene)
    span_s = 64 / 1000.0
    speeds = keyed_speeds(found, (rig.camera, rig.emitter), 1.0, scene.render.fps, span_s)
    assert scene.frame_current_final == 1
    assert set(speeds) == {"Car", "Carried", turning.name}
    assert speeds["Car"] == pytest.approx(15.0, rel=2e-3)
    assert speeds["Carried"] == pytest.approx(7.0, rel=2e-3)
    assert speeds[turning.name] == pytest.approx(tip_speed(30.0, span_s, math.pi / 2), rel=0.01)
