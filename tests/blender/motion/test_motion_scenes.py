# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion by all that moves things in Blender, against echoes in continuous time."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from radarsim_addon import contract
from radarsim_addon.contract import MOTION_FILE, MotionRecord, frame_dir
from radarsim_addon.signal.radar import Burst
from radarsim_addon.typed_json import read_record
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

FPS = 24.0
CARRIER_HZ = 77e9
BURST = Burst(10_000.0, 256)
WITHIN = 1e-3


def motion_record(run: ph.PathRun, frame: int = 1) -> MotionRecord:
    """The motion file of a run's frame."""
    return read_record(run.folder / frame_dir(frame) / MOTION_FILE, MotionRecord)


def steady(velocity: Any) -> mh.Motion:
    """Constant velocity."""
    return lambda points, times_s: points[:, None] + times_s[:, None] * np.asarray(velocity)


@pytest.mark.parametrize("motion", ["kinematic", "off"])
def test_antennas_apart_that_do_not_move(tmp_path: Path, motion: str) -> None:
    mh.scene_at(20.0, 2.0)
    mh.facets("Target", [(0, 20, 0)], 1.0)
    bpy.data.objects["Radar Emitter"].location = (0.7, 0.1, -0.4)  # Y up, -Z ahead
    options = {"motion": motion}
    run = ph.run_paths(tmp_path, width_px=8, height_px=8, options=options)
    ends = motion_record(run).antennas
    assert [one.object for one in ends] == ["Radar Receiver", "Radar Emitter"]
    places = [np.array(one.pose)[:3, 3] for one in ends]
    np.testing.assert_allclose(places, [(0, 0, 0), (0.7, 0.4, 0.1)], atol=1e-6)


def test_radar_that_flies_over_flat_ground(tmp_path: Path) -> None:
    """All ground closes in at v cos(angle) although no range along a ray changes."""
    rs.new_scene()
    ph.field_of_view(30)
    radar = ph.radar_at((0, 0, 30))
    radar.rotation_euler.x -= math.radians(60)
    velocity = np.array([2.3, 25.1, 0.0])
    rs.move_steadily(radar, tuple(velocity))
    ph.quad("Ground", [(-90, -90, 0), (90, -90, 0), (90, 90, 0), (-90, 90, 0)], ph.lambert(0.5))
    rows, paths, run = mh.measured(tmp_path, CARRIER_HZ, BURST, width_px=12, height_px=12)
    assert rows.size == 144
    assert paths.lengths.moving.all()
    error = mh.iq_error(
        rows,
        paths,
        CARRIER_HZ,
        BURST,
        lambda p, t: np.repeat(p[:, None], t.size, axis=1),
        lambda p, t: np.array([0, 0, 30.0]) + p[:, None] + t[:, None] * velocity,
    )
    assert error < WITHIN, error
    bin_mps = 299_792_458.0 / CARRIER_HZ * BURST.prf_hz / (2 * BURST.pulses)
    assert np.abs(rows["range_rate_mps"] + rows["direction"] @ velocity).max() < 1e-3 * bin_mps
    assert [b.segments for b in motion_record(run).bodies] == [[]], "the ground is stationary"


def test_parent_and_constraint(tmp_path: Path) -> None:
    """A target that copies the place of an empty that rides on another one."""
    mh.scene_at(20.0, 3.0)
    cart = mh.empty("Cart", (0, 20, 0))
    mh.key(cart, "location", (1, (0, 20, 0)), (25, (7.0, 33.0, 0)))
    mh.interpolation(cart, "LINEAR")
    mast = mh.empty("Mast", (0.2, 0.1, 0.4), cart)
    target = mh.facets("Target", [(0, 0, 0), (0.3, 0.2, -0.4)], 0.6)
    constraint = target.constraints.new("COPY_LOCATION")
    constraint.target = mast
    rows, paths, _ = mh.measured(tmp_path, CARRIER_HZ, BURST)
    assert rows.size > 10
    error = mh.iq_error(rows, paths, CARRIER_HZ, BURST, steady((7.0, 13.0, 0)))
    assert error < WITHIN, error


def test_driver(tmp_path: Path) -> None:
    """A vibration by a driver on the frame: sin in float32 of Blender's own time."""
    mh.scene_at(20.0, 2.0)
    target = mh.facets("Target", [(0, 0, 0), (0.3, 0.2, -0.4)], 0.4)
    target.location = (0, 20, 0)
    curve = target.driver_add("location", 1)
    curve.driver.expression = "20 + 0.01 * sin(frame * 10)"
    rows, paths, _ = mh.measured(tmp_path, CARRIER_HZ, BURST, frame=3)

    def motion(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        along = 0.01 * (np.sin((3 + times_s * FPS) * 10) - math.sin(30))
        return points[:, None] + along[:, None] * np.array([0, 1.0, 0])

    error = mh.iq_error(rows, paths, CARRIER_HZ, BURST, motion)
    assert error < WITHIN, error


def test_instances_move_each_their_own_way(tmp_path: Path) -> None:
    mh.scene_at(20.0, 5.0)
    source = bpy.data.collections.new("Source")
    target = mh.facets("Target", [(0, 0, 0)], 0.5)
    bpy.context.scene.collection.objects.unlink(target)
    source.objects.link(target)
    velocities = np.array([[0, 11.0, 0], [0, 0, 0], [3.0, -9.0, 1.0]])
    for number, velocity in enumerate(velocities):
        item = mh.empty(f"Instance {number}", (1.5 * (number - 1), 20, 0))
        item.instance_type, item.instance_collection = "COLLECTION", source
        if velocity.any():
            rs.move_steadily(item, tuple(velocity))
    rows, paths, run = mh.measured(tmp_path, CARRIER_HZ, BURST, width_px=40, height_px=40)
    which = np.rint(rows["last_scatterer_m"][:, 0] / 1.5).astype(int) + 1
    assert set(which) == {0, 1, 2}
    bodies = motion_record(run).bodies
    assert len(bodies) == 3
    assert [body.instance.split("/")[0] for body in bodies] == [f"Instance {n}" for n in range(3)]
    for number in range(3):
        assert set(rows["last_body"][which == number]) == {number + 1}

    def motion(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        return points[:, None] + times_s[:, None] * velocities[which][:, None]

    error = mh.iq_error(rows, paths, CARRIER_HZ, BURST, motion)
    assert error < WITHIN, error


def test_unit_scale_of_centimetres(tmp_path: Path) -> None:
    mh.scene_at(20.0, 2.0)
    bpy.context.scene.unit_settings.scale_length = 0.01
    target = mh.facets("Target", [(0, 0, 0), (30, 20, -40)], 40.0)
    mh.key(target, "location", (1, (0, 2000, 0)), (25, (0, 3310, 0)))
    mh.interpolation(target, "LINEAR")
    rows, paths, _ = mh.measured(tmp_path, CARRIER_HZ, BURST)
    assert 19 < rows["last_scatterer_m"][:, 1].min() < 22
    # of one reflection both ends are the same
    assert (rows["order"] == 1).all() and (rows["last_body"] == 1).all()
    np.testing.assert_array_equal(rows["first_body"], rows["last_body"])
    error = mh.iq_error(rows, paths, CARRIER_HZ, BURST, steady((0, 13.1, 0)))
    assert error < WITHIN, error


def test_turning_child_of_a_stretched_parent(tmp_path: Path) -> None:
    """Rotation inside a non-uniform, turned scale: no rigid motion, sheared matrices."""
    mh.scene_at(20.0, 3.0)
    parent = mh.empty("Parent", (0, 20, 0))
    parent.scale = (1.5, 0.8, 1.0)
    parent.rotation_euler = (0.2, 0.1, 0.3)
    child = mh.facets("Child", [(0, 0, 0.4), (0, 0, -0.4), (0.5, 0, 0)], 0.3)
    child.parent = parent
    rate = 40.0
    mh.key(child, "rotation_euler", (1, (0, 0, 0.0)), (25, (0, rate, 0)))
    mh.interpolation(child, "LINEAR", "LINEAR")
    rows, paths, run = mh.measured(tmp_path, CARRIER_HZ, BURST)
    bpy.context.view_layer.update()
    outer = np.array(Matrix.LocRotScale(parent.location, parent.rotation_euler, parent.scale))
    axes, place = outer[:3, :3], outer[:3, 3]

    def motion(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        own = (points - place) @ np.linalg.inv(axes).T
        return mh.turned(own, (0, 0, 0), 1, rate * times_s) @ axes.T + place

    error = mh.iq_error(rows, paths, CARRIER_HZ, BURST, motion)
    assert np.abs(rows["range_rate_mps"]).max() > 1
    assert error < WITHIN, error
    assert motion_record(run).bodies[0].segments[0].linear


@pytest.mark.parametrize("kind", ["shape keys", "armature", "simple deform"])
def test_deforming_meshes(tmp_path: Path, kind: str) -> None:
    """A plate of many faces, bent in three ways, and moved as a whole at the same time."""
    mh.scene_at(20.0, 2.6)
    plate = _grid("Plate", 12, 2.0)
    plate.location = (0, 20, 0)
    motion = {"shape keys": _shape_keys, "armature": _armature, "simple deform": _bend}[kind](plate)
    before = _snapshot()
    rows, paths, run = mh.measured(tmp_path, CARRIER_HZ, BURST, frame=3, width_px=24, height_px=24)
    assert _snapshot() == before
    assert rows.size > 200 and (rows["last_surface_point"] > 0).all()
    assert np.ptp(rows["range_rate_mps"]) > 0.3
    error = mh.iq_error(rows, paths, CARRIER_HZ, BURST, motion)
    assert error < WITHIN, error
    record = motion_record(run, 3)
    assert record.bodies[0].deforms and record.unknown_motion_fraction == 0
    # the instantaneous rate is the slope of the lengths
    step_s = 1e-5
    ahead = paths.lengths.lengths_m(np.array([step_s]), slice(None))[:, 0]
    slope = (ahead - rows["length_m"]) / (2 * step_s)
    np.testing.assert_allclose(rows["range_rate_mps"], slope, atol=2e-3)


def test_a_frame_whose_files_are_not_whole_is_rendered_again(tmp_path: Path) -> None:
    """As the errors of these files advise; whole frames are kept."""

    def rendered() -> int:
        mh.scene_at(20.0, 2.6)
        plate = _grid("Plate", 12, 2.0)
        plate.location = (0, 20, 0)
        _shape_keys(plate)
        return int(
            mh.measured(tmp_path, CARRIER_HZ, BURST, identity="file")[2].job.path_scene.renders
        )

    assert rendered() > 0
    folder = tmp_path / contract.frame_dir(1)
    for name in (contract.DEFORMING_SURFACES_FILE, contract.MOTION_FILE, contract.PATHS_TABLE):
        assert rendered() == 0
        path = folder / name
        whole = path.read_bytes()
        path.unlink()
        assert rendered() > 0, name
        assert path.read_bytes() == whole
        path.write_bytes(whole[:-20])
        assert rendered() > 0, name
    truth = folder / contract.GROUND_TRUTH_FILE
    whole = truth.read_bytes()
    truth.unlink()
    assert rendered() == 0, "nothing to render for it"
    assert truth.read_bytes() == whole


@pytest.mark.parametrize("units_per_m", [100.0, 0.1])
def test_deforming_mesh_in_other_units(tmp_path: Path, units_per_m: float) -> None:
    """The same plate in centimetres, and in units of ten metres: velocities in metres."""
    mh.scene_at(20.0, 2.6)
    bpy.context.scene.unit_settings.scale_length = 1 / units_per_m
    plate = _grid("Plate", 12, 2.0 * units_per_m)
    plate.location = (0, 20 * units_per_m, 0)
    motion = _shape_keys(plate, units_per_m)
    rows, paths, run = mh.measured(tmp_path, CARRIER_HZ, BURST, width_px=16, height_px=16)
    assert rows.size > 100 and (rows["last_surface_point"] > 0).all()
    assert motion_record(run).bodies[0].deforms
    x_m = rows["last_scatterer_m"][:, 0]
    want_mps = rows["direction"][:, 1] * (4 + 5 * x_m)
    np.testing.assert_allclose(rows["range_rate_mps"], want_mps, atol=1e-3)
    error = mh.iq_error(rows, paths, CARRIER_HZ, BURST, motion)
    assert error < WITHIN, error


def _snapshot() -> tuple[Any, ...]:
    scene = bpy.context.scene
    return scene.frame_current, scene.frame_subframe, len(bpy.data.meshes), len(bpy.data.objects)


def _grid(name: str, count: int, size: float) -> Any:
    """A square of count x count faces that faces -Y."""
    ticks = np.linspace(-size / 2, size / 2, count + 1)
    corners = [(float(x), 0.0, float(z)) for z in ticks for x in ticks]
    starts = [r * (count + 1) + c for r in range(count) for c in range(count)]
    faces = [(n, n + 1, n + count + 2) for n in starts]
    faces += [(n, n + count + 2, n + count + 1) for n in starts]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(ph.lambert(0.5))
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def _shape_keys(plate: Any, units_per_m: float = 1.0) -> mh.Motion:
    """A corner is pulled along: linear in its place, and in time."""
    plate.shape_key_add(name="Basis")
    pulled = plate.shape_key_add(name="Pulled")
    for point in pulled.data:
        point.co.y += 0.5 * point.co.x
    for frame, value in ((1, 0.0), (25, 10.0)):
        pulled.slider_max = 10.0
        pulled.value = value
        pulled.keyframe_insert("value", frame=frame)
    for curve in rs.animation_curves(plate.data.shape_keys.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    bpy.context.scene.frame_set(1)
    rs.move_steadily(plate, (0.0, 4.0 * units_per_m, 0.0))

    def motion(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        along = 4.0 * times_s + 0.5 * 10.0 * points[:, :1] * times_s
        return points[:, None] + along[..., None] * np.array([0, 1.0, 0])

    return motion


def _armature(plate: Any) -> mh.Motion:
    """Two bones, each with its half of the plate; one turns."""
    data = bpy.data.armatures.new("Skeleton")
    skeleton = bpy.data.objects.new("Skeleton", data)
    skeleton.location = (0, 20, 0)
    bpy.context.scene.collection.objects.link(skeleton)
    bpy.context.view_layer.objects.active = skeleton
    bpy.ops.object.mode_set(mode="EDIT")
    for name, x in (("Left", -1.0), ("Right", 1.0)):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = (0, 0, 0), (x, 0, 0)
    bpy.ops.object.mode_set(mode="OBJECT")
    for name in ("Left", "Right"):
        group = plate.vertex_groups.new(name=name)
        sign = -1 if name == "Left" else 1
        members = [v.index for v in plate.data.vertices if v.co.x * sign > -1e-6]
        group.add([n for n in members if abs(plate.data.vertices[n].co.x) > 1e-6], 1.0, "REPLACE")
    middle = [v.index for v in plate.data.vertices if abs(v.co.x) <= 1e-6]
    plate.vertex_groups["Left"].add(middle, 1.0, "REPLACE")
    plate.modifiers.new("Armature", "ARMATURE").object = skeleton
    bone = skeleton.pose.bones["Right"]
    bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (25, 8.0)):
        # the bone's own axes: x' = -Y, y' = X, z' = Z, whatever the roll turns about X
        bone.rotation_euler = (0, 0, angle)
        bone.keyframe_insert("rotation_euler", frame=frame)
    for curve in rs.animation_curves(skeleton.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    bpy.context.scene.frame_set(3)
    bpy.context.view_layer.update()
    axis = np.array(bone.matrix)[:3, 2].round(6)
    number = int(np.argmax(np.abs(axis)))
    sign = float(np.sign(axis[number]))
    # the strip at the hinge shears; its faces have vertices of both bones
    spacing = 2.0 / 12

    def motion(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        centre = np.array([0, 20.0, 0])
        start = sign * 8.0 * 2 / FPS
        # rest positions: turned back, where they are right of the hinge's strip
        own = points - centre
        angles = sign * 8.0 * (2 / FPS + times_s)
        rest = mh.turned(own, (0, 0, 0), number, np.array([-start]))[:, 0]
        right = rest[:, 0] > spacing - 1e-6
        left = own[:, 0] < 0
        moved = np.repeat(own[:, None], times_s.size, axis=1)
        moved[right] = mh.turned(rest[right], (0, 0, 0), number, angles)
        strip = ~right & ~left
        # between hinge and first column the face stretches linearly: P = s * column(t)
        column = mh.turned(np.array([[spacing, 0, 0.0]]), (0, 0, 0), number, angles)[0]
        column_0 = mh.turned(np.array([[spacing, 0, 0.0]]), (0, 0, 0), number, np.array([start]))
        share = own[strip] @ column_0[0, 0] / spacing**2
        height = own[strip] - share[:, None] * column_0[0, 0]
        moved[strip] = share[:, None, None] * column + height[:, None]
        return moved + centre

    return motion


def _bend(plate: Any) -> mh.Motion:
    """A modifier: the plate tapers along X, each point moves in a straight line."""
    modifier = plate.modifiers.new("Stretch", "SIMPLE_DEFORM")
    modifier.deform_method, modifier.deform_axis = "TAPER", "Z"
    plate.rotation_euler = (math.radians(25), 0, 0)
    for frame, factor in ((1, 0.0), (25, 8.0)):
        modifier.factor = factor
        modifier.keyframe_insert("factor", frame=frame)
    for curve in rs.animation_curves(plate.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    bpy.context.scene.frame_set(3)
    angle = math.radians(25)
    turn = np.array(
        [[1, 0, 0], [0, math.cos(angle), -math.sin(angle)], [0, math.sin(angle), math.cos(angle)]]
    )

    rest = np.array([tuple(v.co) for v in plate.data.vertices])
    triangles = np.array([tuple(p.vertices) for p in plate.data.polygons])

    def tapered(factor: float) -> np.ndarray:
        # x and y times 1 + factor * z, over the plate's height of 2
        return rest * (1 + factor * rest[:, 2:] / 2 * np.array([1, 1, 0]))

    def motion(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        own = (points - (0, 20.0, 0)) @ turn
        corners = tapered(8.0 * 2 / FPS)[triangles][:, :, [0, 2]]
        edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
        arms = own[:, None, [0, 2]] - corners[:, 0]
        shares = np.einsum("fij,nfj->nfi", np.linalg.inv(edges), arms)
        inside = np.minimum(shares.min(axis=-1), 1 - shares.sum(axis=-1))
        face = np.argmax(inside, axis=1)
        share = shares[np.arange(len(own)), face]
        weights = np.column_stack([1 - share.sum(axis=1), share])
        moved = np.empty((len(own), times_s.size, 3))
        for number, time_s in enumerate(times_s):
            now = tapered(8.0 * (2 / FPS + time_s))[triangles[face]]
            moved[:, number] = np.einsum("nk,nki->ni", weights, now)
        # rendered positions lie beside their plane by float32, and stay there
        start = np.einsum("nk,nki->ni", weights, tapered(8.0 * 2 / FPS)[triangles[face]])
        return points[:, None] + (moved - start[:, None]) @ turn.T

    return motion
