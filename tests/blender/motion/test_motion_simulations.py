# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigid bodies, which Blender stores at whole frames, against free fall in closed form."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon import signal
from radarsim_addon.blender.motion import burst_motion
from radarsim_addon.contract import MOTION_FILE, MotionRecord, frame_dir
from radarsim_addon.errors import SceneError
from radarsim_addon.signal.decoding import frame_paths
from radarsim_addon.signal.radar import Burst
from radarsim_addon.typed_json import read_record
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

FPS = 24.0
CARRIER_HZ = 77e9
GRAVITY = 9.81
BURST = Burst(20_000.0, 64)


def falling_plate(distance_m: float = 20.0, units_per_m: float = 1.0) -> Any:
    """A plate in front of the radar that falls towards it along -Y, from frame 1 on."""
    mh.scene_at(distance_m, 2.0)
    scene = bpy.context.scene
    scene.unit_settings.scale_length = 1 / units_per_m
    scene.gravity = (0.0, -GRAVITY * units_per_m, 0.0)
    item = mh.facets("Falling", [(0, 0, 0)], 1.2 * units_per_m)
    item.location = (0.0, distance_m * units_per_m, 0.0)
    bpy.context.view_layer.objects.active = item
    item.select_set(True)
    bpy.ops.rigidbody.world_add()
    bpy.ops.rigidbody.object_add()
    item.rigid_body.linear_damping = 0.0
    item.rigid_body.angular_damping = 0.0
    scene.rigidbody_world.substeps_per_frame = 100
    return item


def measured(
    folder: Path, frame: int, burst: Burst = BURST, **options: Any
) -> tuple[np.ndarray, Any, MotionRecord]:
    """Table, paths and motion file of a small run."""
    rows, paths, run = mh.measured(folder, CARRIER_HZ, burst, frame, **options)
    path = run.folder / frame_dir(frame) / MOTION_FILE
    return rows, paths, read_record(path, MotionRecord)


@pytest.mark.parametrize("frame", [5, 9])
@pytest.mark.parametrize("units_per_m", [1.0, 100.0])
def test_a_jump_to_a_later_frame_has_the_simulation_of_that_frame(
    tmp_path: Path, frame: int, units_per_m: float
) -> None:
    """Blender's own state after such a jump is that of the first frame: no range rate."""
    falling_plate(units_per_m=units_per_m)
    rows, _, record = measured(tmp_path, frame)
    time_s = (frame - 1) / FPS
    speed = rows["range_rate_mps"] / rows["direction"][:, 1]
    # Bullet's own steps: the speed at a frame is g t within a step, the place lags by one
    assert np.abs(speed + GRAVITY * time_s).max() < 0.02
    assert np.ptp(speed) < 1e-4
    assert np.abs(rows["last_scatterer_m"][:, 1] - 20 + GRAVITY * time_s**2 / 2).max() < 5e-3
    assert [f.code for f in record.findings] == ["motion-between-frames"]
    assert record.samples < 300


def test_a_run_of_several_frames(tmp_path: Path) -> None:
    falling_plate()
    run = ph.run_paths(
        tmp_path, waveform=mh.waveform(CARRIER_HZ), burst=BURST, frames=(3, 8, 5), width_px=8,
        height_px=8,
    )  # fmt: skip
    for frame in (3, 8, 5):
        rows = run.table(frame)
        speed = rows["range_rate_mps"] / rows["direction"][:, 1]
        assert np.abs(speed + GRAVITY * (frame - 1) / FPS).max() < 0.02


def test_doppler_is_smooth_across_whole_frames(tmp_path: Path) -> None:
    """Over three frames the range rate grows by g t; straight lines step by g / fps."""
    burst = Burst(1000.0, 128)
    times_s = np.arange(burst.pulses) / burst.prf_hz
    steps = {}
    for motion in ("kinematic", "linear"):
        falling_plate()
        rows, paths, record = measured(tmp_path / motion, 5, burst, motion=motion)
        lengths_m = paths.lengths.lengths_m(times_s, slice(None))[rows.size // 2]
        rate_mps = np.diff(lengths_m) / 2 * burst.prf_hz
        steps[motion] = np.diff(rate_mps)
        codes = [f.code for f in record.findings]
        assert codes == (["motion-between-frames"] if motion == "kinematic" else [])
        assert record.samples < 600
    per_pulse = GRAVITY / burst.prf_hz
    assert np.abs(steps["kinematic"] + per_pulse).max() < 0.1 * per_pulse
    assert np.abs(steps["linear"]).max() > 0.9 * GRAVITY / FPS / 2
    assert np.median(np.abs(steps["linear"])) < 0.1 * per_pulse


def test_a_turning_body_and_its_child(tmp_path: Path) -> None:
    """A child off the axis of a body that turns steadily goes around smoothly."""
    spin = 2.0
    body = falling_plate()
    scene = bpy.context.scene
    scene.gravity = (0.0, 0.0, 0.0)
    body.hide_render = True
    # the simulation takes over the rotation that keys give until frame 4
    for at in (0, 3):
        body.rotation_euler = (0.0, 0.0, spin * (at - 1) / FPS)
        body.keyframe_insert("rotation_euler", frame=at)
    mh.interpolation(body, "LINEAR", "LINEAR")
    body.rigid_body.kinematic = True
    body.rigid_body.keyframe_insert("kinematic", frame=3)
    body.rigid_body.kinematic = False
    body.rigid_body.keyframe_insert("kinematic", frame=4)
    child = mh.facets("Child", [(0.0, 0.0, 0.0)], 0.4)
    child.parent = body
    child.location = (0.5, -0.2, 0.0)
    rows, _, record = measured(tmp_path, 9)
    assert rows.size > 4
    centre = np.array([0.0, 20.0, 0.0])
    arm = rows["last_scatterer_m"] - centre
    velocity = spin * np.stack([-arm[:, 1], arm[:, 0], np.zeros(len(arm))], axis=1)
    want = np.sum(velocity * rows["direction"], axis=1)
    assert np.abs(want).max() > 0.5
    assert np.abs(rows["range_rate_mps"] - want).max() < 0.01
    assert [f.subjects for f in record.findings if f.code == "motion-between-frames"] == [
        ("Child",)
    ]


def test_baked_and_played_simulations_are_not_stepped(tmp_path: Path) -> None:
    from radarsim_addon.blender.scene import simulation_frames

    falling_plate()
    scene = bpy.context.scene
    assert simulation_frames(scene, 9) == range(1, 10)
    with bpy.context.temp_override(scene=scene, point_cache=scene.rigidbody_world.point_cache):
        bpy.ops.ptcache.bake(bake=True)
    assert len(simulation_frames(scene, 9)) == 0
    rs.new_scene()
    ph.quad("Still", [(-1, 5, -1), (1, 5, -1), (1, 5, 1), (-1, 5, 1)], ph.lambert(0.5))
    assert len(simulation_frames(bpy.context.scene, 9)) == 0


def write_point_cache(path: Path, item: Any, frames: int) -> None:
    """Vertices at whole frames, in free fall along -Y from frame 1 on, as a PC2 file."""
    corners = np.array([vertex.co[:] for vertex in item.data.vertices], dtype=np.float32)
    with open(path, "wb") as stream:
        stream.write(b"POINTCACHE2\0" + struct.pack("<iiffi", 1, len(corners), 1.0, 1.0, frames))
        for number in range(frames):
            moved = corners.copy()
            moved[:, 1] -= np.float32(GRAVITY * (number / FPS) ** 2 / 2)
            stream.write(moved.astype("<f4").tobytes())


@pytest.mark.parametrize("motion", ["kinematic", "linear"])
def test_a_mesh_cache_is_a_cubic_through_whole_frames(tmp_path: Path, motion: str) -> None:
    """Straight lines between the frames of the file have the mean speed of a frame."""
    mh.scene_at(20.0, 2.0)
    item = mh.facets("Cached", [(0, 20.0, 0)], 1.2)
    write_point_cache(tmp_path / "fall.pc2", item, 40)
    cache = item.modifiers.new("Cache", "MESH_CACHE")
    cache.cache_format, cache.filepath = "PC2", str(tmp_path / "fall.pc2")
    cache.frame_start, cache.forward_axis, cache.up_axis = 1, "POS_Y", "POS_Z"
    rows, _, record = measured(tmp_path / "run", 9, motion=motion)
    speed = rows["range_rate_mps"] / rows["direction"][:, 1]
    if motion == "kinematic":
        assert np.abs(speed + GRAVITY * 8 / FPS).max() < 1e-4
        assert [f.code for f in record.findings] == ["motion-between-frames"]
    else:
        assert np.abs(speed + GRAVITY * 8.5 / FPS).max() < 1e-3


@pytest.mark.parametrize("known", [True, False])
def test_a_cache_with_frames_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, known: bool
) -> None:
    """Four frames of the file in five of the scene: straight lines between the file's frames."""
    if not known:  # as of a file whose frames Blender does not say
        monkeypatch.setattr(burst_motion, "cache_frames", lambda _: None)
    mh.scene_at(20.0, 2.0)
    item = mh.facets("Cached", [(0, 20.0, 0)], 1.2)
    write_point_cache(tmp_path / "fall.pc2", item, 40)
    cache = item.modifiers.new("Cache", "MESH_CACHE")
    cache.cache_format, cache.filepath = "PC2", str(tmp_path / "fall.pc2")
    cache.frame_start, cache.frame_scale = 1, 0.8
    cache.forward_axis, cache.up_axis = "POS_Y", "POS_Z"
    rows, _, record = measured(tmp_path / "run", 9)
    shown = 0.8 * 9 - 1  # frame of the file
    off = rows["range_rate_mps"] / rows["direction"][:, 1] + 0.8 * GRAVITY * shown / FPS
    said = [one for one in record.findings if one.code == "cache-between-frames"]
    if known:
        assert np.abs(off).max() < 1e-4
        assert not said
    else:
        (one,) = said
        assert one.subjects == ("Cached",)
        bound_mps = one.numbers["speed_mps"]
        assert isinstance(bound_mps, float)
        assert 0.01 < np.abs(off).max() < bound_mps < 0.5


def test_a_simulation_zone_that_is_not_baked_is_played(tmp_path: Path) -> None:
    """After a jump to frame 9 Blender shows the state after a single step."""
    mh.scene_at(20.0, 2.0)
    item = mh.facets("Simulated", [(0, 20.0, 0)], 1.2)
    tree = bpy.data.node_groups.new("Zone", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = (
        "NodeGroupInput", "GeometryNodeSimulationInput", "GeometryNodeSetPosition",
        "GeometryNodeSimulationOutput", "NodeGroupOutput", "ShaderNodeMath", "ShaderNodeCombineXYZ",
    )  # fmt: skip
    source, begin, move, end, target, speed, vector = (tree.nodes.new(kind) for kind in kinds)
    begin.pair_with_output(end)
    speed.operation = "MULTIPLY"
    speed.inputs[1].default_value = -5.0
    links = tree.links.new
    links(source.outputs[0], begin.inputs["Geometry"])
    links(begin.outputs["Geometry"], move.inputs["Geometry"])
    links(begin.outputs["Delta Time"], speed.inputs[0])
    links(speed.outputs[0], vector.inputs["Y"])
    links(vector.outputs[0], move.inputs["Offset"])
    links(move.outputs[0], end.inputs["Geometry"])
    links(end.outputs["Geometry"], target.inputs[0])
    item.modifiers.new("Zone", "NODES").node_group = tree
    rows, _, record = measured(tmp_path, 9)
    assert np.abs(rows["last_scatterer_m"][:, 1] - (20 - 5 * 8 / FPS)).max() < 1e-5
    assert np.abs(rows["range_rate_mps"] / rows["direction"][:, 1] + 5.0).max() < 1e-3
    assert [f.code for f in record.findings] == ["motion-between-frames"]


def cloth_plate(kind: str) -> Any:
    """A cloth or soft body in front of the radar that falls towards it along -Y, from frame 1."""
    mh.scene_at(20.0, 2.0)
    bpy.context.scene.gravity = (0.0, -GRAVITY, 0.0)
    item = mh.facets("Falling", [(0, 20.0, 0)], 1.2)
    settings = item.modifiers.new("Simulation", kind).settings
    if kind == "SOFT_BODY":
        settings.use_goal = False
    return item


def shown_y(item: Any, frame: int) -> float:
    """Mean distance of an object's vertices at a whole frame, as Blender shows it."""
    bpy.context.scene.frame_set(frame)
    shown = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return float(np.mean([(shown.matrix_world @ one.co).y for one in shown.data.vertices]))


@pytest.mark.parametrize("kind", ["CLOTH", "SOFT_BODY"])
def test_cloth_that_is_not_baked_falls(tmp_path: Path, kind: str) -> None:
    """A cache that is played further later on loses frames: the plate seemed to rise."""
    item = cloth_plate(kind)
    y = [shown_y(item, frame) for frame in range(1, 13)]
    bpy.context.scene.frame_set(1)
    rows, _, record = measured(tmp_path, 9)
    speed = rows["range_rate_mps"] / rows["direction"][:, 1]
    assert np.abs(speed - (y[9] - y[7]) * FPS / 2).max() < 1e-3
    assert np.abs(speed).min() > 1.5
    assert np.abs(rows["last_scatterer_m"][:, 1] - y[8]).max() < 1e-6
    assert [f.code for f in record.findings] == ["motion-between-frames"]


@pytest.mark.parametrize("what", ["object", "mesh", "object at 30 frames per second"])
def test_an_alembic_file_is_a_cubic_through_whole_frames(tmp_path: Path, what: str) -> None:
    """Blender holds vertices of a file from frame to frame, so that nothing moves in a burst."""
    mh.scene_at(20.0, 2.0)
    item = mh.facets("Fallen", [(0, 20.0, 0)], 1.2)
    fallen = [GRAVITY * ((frame - 1) / FPS) ** 2 / 2 for frame in range(1, 41)]
    if what != "mesh":
        mh.key(item, "location", *((n, (0.0, -y, 0.0)) for n, y in enumerate(fallen, start=1)))
        mh.interpolation(item, "LINEAR")
    else:
        item.shape_key_add(name="Basis")
        shape = item.shape_key_add(name="Near")
        for one in shape.data:
            one.co.y -= 20.0
        for frame, y in enumerate(fallen, start=1):
            shape.value = y / 20
            shape.keyframe_insert("value", frame=frame)
    bpy.context.view_layer.objects.active = item
    item.select_set(True)
    file = str(tmp_path / "fall.abc")
    bpy.ops.wm.alembic_export(filepath=file, start=1, end=40, selected=True)
    bpy.data.objects.remove(item)
    bpy.ops.wm.alembic_import(filepath=file, set_frame_range=False)
    (read,) = (one for one in bpy.data.objects if one.type == "MESH")
    read.data.materials.clear()
    read.data.materials.append(ph.lambert(0.5))
    if what not in ("object", "mesh"):  # frames of the file are between those of the scene
        bpy.context.scene.render.fps = 30
    rows, _, record = measured(tmp_path / "run", 9)
    speed = rows["range_rate_mps"] / rows["direction"][:, 1]
    if what not in ("object", "mesh"):
        said = record.findings[-1]
        assert (said.code, said.subjects) == ("cache-between-frames", (read.name,))
        # Blender has frame 1 of the file at 1 / 24 s
        off_mps = np.abs(speed + GRAVITY * (9 / 30 - 1 / FPS)).max()
        bound_mps = said.numbers["speed_mps"]
        assert isinstance(bound_mps, float)
        assert 0.01 < off_mps < bound_mps < 1.0
        return
    assert np.abs(speed + GRAVITY * 8 / FPS).max() < 1e-4
    assert np.abs(rows["last_scatterer_m"][:, 1] - (20 - fallen[8])).max() < 1e-6
    assert [f.code for f in record.findings] == ["motion-between-frames"]


def bake(source: Any) -> None:
    """Bake the particles of an object."""
    cache = source.particle_systems[0].point_cache
    cache.frame_end = 40
    with bpy.context.temp_override(object=source, point_cache=cache):
        bpy.ops.ptcache.bake(bake=True)


@pytest.mark.parametrize("baked", [False, True])
@pytest.mark.parametrize("pulses", [64, 512])
def test_particles_carry_their_instances(tmp_path: Path, baked: bool, pulses: int) -> None:
    """Blender's own places at the frames before and after tell the speed of a baked particle."""
    mh.scene_at(20.0, 2.0)
    scene = bpy.context.scene
    scene.gravity = (0.0, -GRAVITY, 0.0)
    bpy.ops.mesh.primitive_cube_add(size=0.3, location=(0, 500, 0))
    carried = bpy.context.object
    carried.data.materials.append(ph.lambert(0.5))
    source = mh.facets("Source", [(0, 20, 0)], 0.8)
    source.modifiers.new("Particles", "PARTICLE_SYSTEM")
    source.show_instancer_for_render = False
    settings = source.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 30, 1, 1, 200
    settings.normal_factor, settings.particle_size = 5.0, 1.0
    settings.render_type, settings.instance_object = "OBJECT", carried
    y = []
    for frame in range(1, 13):
        scene.frame_set(frame)
        shown = source.evaluated_get(bpy.context.evaluated_depsgraph_get())
        y.append(shown.particle_systems[0].particles[0].location.y)
    scene.frame_set(1)
    burst = Burst(20_000.0, pulses)
    if not baked:
        with pytest.raises(SceneError, match=r"of 'Source' is not baked.*Cache > Bake"):
            measured(tmp_path, 9, burst)
        rings = {"frames": (9,), "ring_step_m": 100.0, "rings": 1}
        with pytest.raises(SceneError, match=r"of 'Source' is not baked.*--snapshots 1"):
            rs.run(tmp_path / "two", snapshots=2, snapshot_interval_s=0.01, **rings)
        assert not list((tmp_path / "two").glob("**/*.exr"))
        assert rs.run(tmp_path / "one", snapshots=1, **rings).done == 1
        assert not measured(tmp_path / "off", 9, burst, motion="off")[0]["range_rate_mps"].any()
        return
    bake(source)
    rs.run(tmp_path / "rings", frames=(9,), snapshots=2, ring_step_m=100.0, rings=1)
    rows, _, record = measured(tmp_path, 9, burst)
    assert rows.size
    speed = rows["range_rate_mps"] / rows["direction"][:, 1]
    assert np.abs(speed - (y[9] - y[7]) * FPS / 2).max() < 2e-3
    assert np.abs(rows["last_scatterer_m"][:, 1] - y[8]).max() < 0.15 * 3**0.5  # a cube, turned
    assert not record.findings


def test_rings_of_simulations(tmp_path: Path) -> None:
    """Two snapshots differ by a simulation that is not baked, or a finding says they may not.

    Between whole frames Blender moves rigid bodies on straight lines.
    """
    for kind in ("RIGID", "CLOTH"):
        item = falling_plate() if kind == "RIGID" else cloth_plate(kind)
        item.data.materials.clear()
        item.data.materials.append(ph.rough_metal())
        y = [shown_y(item, frame) for frame in range(1, 14)]
        bpy.context.scene.frame_set(1)
        job = rs.run(
            tmp_path / kind, frames=(9,), snapshots=2, snapshot_interval_s=0.01, ring_step_m=100.0,
            rings=1,
        )  # fmt: skip
        found = frame_paths(signal.open_run(tmp_path / kind).frame(9))
        stuck = [f.subjects for f in job.findings if f.code == "rendered-at-whole-frames"]
        assert stuck == ([] if kind == "RIGID" else [("Falling",)])
        if kind == "RIGID":
            want = (y[9] - y[8]) * FPS
            assert np.median(found.range_rate_mps) == pytest.approx(want, rel=5e-3)
