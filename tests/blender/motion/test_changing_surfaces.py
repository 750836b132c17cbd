# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces whose vertices become other points: speeds are those of the animation, or named."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon.blender.motion import burst_motion, fits
from radarsim_addon.contract import MOTION_FILE, MotionRecord, frame_dir
from radarsim_addon.findings import Finding
from radarsim_addon.signal.radar import Burst
from radarsim_addon.typed_json import read_record
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph

BURST = Burst(10_000.0, 256)
DISTANCE_M = 20.0
SECOND = 24


def measured(folder: Path, frame: int = 1) -> tuple[np.ndarray, MotionRecord, dict[str, Finding]]:
    """Velocities along Y [m/s] of all echoes, motion file, and findings by their code."""
    rows, _, run = mh.measured(folder, 77e9, BURST, frame)
    record = read_record(run.folder / frame_dir(frame) / MOTION_FILE, MotionRecord)
    assert rows.size
    speeds = rows["range_rate_mps"] / rows["direction"][:, 1]
    return speeds, record, {one.code: one for one in record.findings}


def steady(owner: Any, path: str, *values: tuple[int, Any]) -> None:
    """Keyframes with straight lines between them and beyond."""
    mh.key(owner, path, *values)
    where = owner.id_data
    mh.interpolation(where, "LINEAR", "LINEAR")


def wavy_plate(count: int = 12, depth_m: float = 0.05) -> Any:
    """A square of 2 m that faces the radar, with waves."""
    mh.scene_at(DISTANCE_M, 2.6)
    ticks = np.linspace(-1, 1, count + 1)
    corners = [
        (x, depth_m * math.sin(7 * x) * math.cos(5 * z), z)
        for z in ticks.tolist()
        for x in ticks.tolist()
    ]
    starts = [row * (count + 1) + column for row in range(count) for column in range(count)]
    mesh = bpy.data.meshes.new("Plate")
    faces = [(n, n + 1, n + count + 2, n + count + 1) for n in starts]
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(ph.lambert(0.5))
    item = bpy.data.objects.new("Plate", mesh)
    item.location = (0, DISTANCE_M, 0)
    bpy.context.scene.collection.objects.link(item)
    return item


def by_shape_key(item: Any, speed_mps: float) -> None:
    """All vertices move along Y by a shape key."""
    item.shape_key_add(name="Basis")
    moved = item.shape_key_add(name="Moved")
    for point in moved.data:
        point.co.y += speed_mps
    steady(moved, "value", (1, 0.0), (1 + SECOND, 1.0))


def by_armature(item: Any, speed_mps: float) -> None:
    """All vertices move along Y by a bone."""
    armature = bpy.data.armatures.new("Armature")
    rig = bpy.data.objects.new("Rig", armature)
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.edit_bones.new("Bone")
    bone.head, bone.tail = (0, 0, 0), (0, 1, 0)
    bpy.ops.object.mode_set(mode="OBJECT")
    group = item.vertex_groups.new(name="Bone")
    group.add(range(len(item.data.vertices)), 1.0, "REPLACE")
    item.modifiers.new("Armature", "ARMATURE").object = rig
    pose = rig.pose.bones["Bone"]
    steady(pose, "location", (1, (0, 0, 0)), (1 + SECOND, (0, speed_mps, 0)))


@pytest.mark.parametrize("moves", [by_shape_key, by_armature])
@pytest.mark.parametrize(("speed_mps", "ratio"), [(20.0, 0.5), (-8.0, 0.3)])
def test_decimate_after_what_deforms(
    tmp_path: Path, moves: Any, speed_mps: float, ratio: float
) -> None:
    """It chooses other vertices at each moment: the speed is right, or its size is named."""
    plate = wavy_plate()
    moves(plate, speed_mps)
    plate.modifiers.new("Decimate", "DECIMATE").ratio = ratio
    speeds, record, found = measured(tmp_path, 3)
    assert "radarsim_point" not in plate.data.attributes
    if "surface-not-followed" not in found:
        np.testing.assert_allclose(speeds, speed_mps, rtol=1e-5)
        assert not found
        return
    assert not speeds.any()
    said = found["surface-not-followed"]
    assert said.subjects == ("Plate",) and list(found) == ["surface-not-followed"]
    assert said.numbers["speed_mps"] == pytest.approx(abs(speed_mps), rel=0.05)
    moved_m = abs(speed_mps) * BURST.pulses / BURST.prf_hz
    assert said.numbers["apart_m"] == pytest.approx(moved_m, rel=0.05)
    assert record.displacement_error_bound_m == said.numbers["apart_m"]


def test_decimate_that_changes_its_choice_is_named(tmp_path: Path) -> None:
    plate = wavy_plate()
    by_shape_key(plate, 20.0)
    plate.modifiers.new("Decimate", "DECIMATE").ratio = 0.5
    assert "surface-not-followed" in measured(tmp_path)[2]


@pytest.mark.parametrize("mode", ["VOXEL", "SMOOTH"])
def test_remesh_after_a_shape_key(tmp_path: Path, mode: str) -> None:
    plate = wavy_plate()
    by_shape_key(plate, 12.0)
    plate.modifiers.new("Solid", "SOLIDIFY").thickness = 0.3
    remesh = plate.modifiers.new("Remesh", "REMESH")
    remesh.mode, remesh.voxel_size, remesh.octree_depth = mode, 0.1, 4
    speeds, _, found = measured(tmp_path)
    if "surface-not-followed" in found:
        assert not speeds.any()
        assert found["surface-not-followed"].numbers["speed_mps"] == pytest.approx(12.0, rel=0.05)
    else:
        np.testing.assert_allclose(speeds, 12.0, rtol=1e-5)


def cut_wall(solver: str, wall_mps: float = 0.0, deforms: bool = False) -> tuple[Any, Any]:
    """A solid wall with a hole, and the cube that cuts it, left of the middle."""
    wall = wavy_plate(1, 0.0)
    wall.name = "Wall"
    if deforms:
        by_shape_key(wall, wall_mps)
    elif wall_mps:
        steady(wall, "location", (1, (0, 20, 0)), (1 + SECOND, (0, 20 + wall_mps, 0)))
    wall.modifiers.new("Solid", "SOLIDIFY").thickness = 0.2
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(-0.4, 20, 0), rotation=(0.3, 0.2, 0.1))
    cutter = bpy.context.object
    cutter.hide_render = True
    boolean = wall.modifiers.new("Cut", "BOOLEAN")
    boolean.object, boolean.operation, boolean.solver = cutter, "DIFFERENCE", solver
    return wall, cutter


@pytest.mark.parametrize(
    ("cutter_mps", "wall_mps", "solver"),
    [
        *(((5.3, 0, 0), wall_mps, "EXACT") for wall_mps in (0.0, 3.0)),
        *(((-1.1, 0, 0.7), wall_mps, "EXACT") for wall_mps in (0.0, 3.0)),
        *(((0, 0.8, 0), wall_mps, "FLOAT") for wall_mps in (0.0, 3.0)),
    ],
)
def test_wall_that_a_moving_boolean_cuts(
    tmp_path: Path, solver: str, wall_mps: float, cutter_mps: tuple[float, float, float]
) -> None:
    """The hole moves along the wall, the wall does not; nothing is faster than both together."""
    _, cutter = cut_wall(solver, wall_mps)
    there = [at + step for at, step in zip((-0.4, 20, 0), cutter_mps, strict=True)]
    steady(cutter, "location", (1, (-0.4, 20, 0)), (1 + SECOND, there))
    speeds, _, found = measured(tmp_path)
    np.testing.assert_allclose(speeds, wall_mps, atol=1e-4)
    assert [*found] == ["surface-not-followed"]
    assert found["surface-not-followed"].subjects == ("Wall",)
    fastest_mps = math.dist(cutter_mps, (0, wall_mps, 0))
    named_mps = found["surface-not-followed"].numbers["speed_mps"]
    assert isinstance(named_mps, float) and 0 < named_mps < 1.6 * fastest_mps


@pytest.mark.parametrize("modifier", ["WELD", "BOOLEAN"])
def test_scene_with_a_simulation_that_is_not_baked(tmp_path: Path, modifier: str) -> None:
    """Marks would reset it: cloth that falls keeps its speed, and a cut wall its place."""
    wall, cutter = cut_wall("EXACT")
    steady(cutter, "location", (1, (-0.4, 20, 0)), (1 + SECOND, (3.0, 21, 0)))
    if modifier == "WELD":
        bpy.data.objects.remove(wall)
    cloth = bpy.data.meshes.new("Cloth")
    z = 0.0 if modifier == "WELD" else 3.0
    ticks = np.linspace(-0.5, 0.5, 4).tolist()
    cloth.from_pydata(
        [(x, 0, z + up) for up in ticks for x in ticks],
        [],
        [(n, n + 1, n + 5, n + 4) for n in (0, 1, 2, 4, 5, 6, 8, 9, 10)],
    )
    cloth.materials.append(ph.lambert(0.5))
    item = bpy.data.objects.new("Cloth", cloth)
    item.location = (0, DISTANCE_M, 0)
    scene = bpy.context.scene
    scene.collection.objects.link(item)
    scene.gravity = (0, -9.81, 0)
    item.modifiers.new("Cloth", "CLOTH")
    item.modifiers.new("Weld", "WELD").merge_threshold = 1e-5
    y_m = []
    for frame in range(1, 12):
        scene.frame_set(frame)
        shown = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
        y_m.append(np.mean([(shown.matrix_world @ point.co).y for point in shown.data.vertices]))
    scene.frame_set(1)
    speeds, _, found = measured(tmp_path, 9)
    if modifier == "WELD":
        np.testing.assert_allclose(speeds, (y_m[9] - y_m[7]) * 24 / 2, atol=2e-3)
        assert speeds.max() < -1.0
        assert "surface-not-followed" not in found
    else:
        assert not speeds.any()
        assert found["surface-not-followed"].subjects == ("Wall",)


def test_hole_that_moves_with_its_wall(tmp_path: Path) -> None:
    """Shape key and cutter at one speed: vertices stay the same points, so all have that speed."""
    _, cutter = cut_wall("EXACT", 4.0, deforms=True)
    steady(cutter, "location", (1, (-0.4, 20, 0)), (1 + SECOND, (-0.4, 24, 0)))
    speeds, _, found = measured(tmp_path)
    np.testing.assert_allclose(speeds, 4.0, rtol=1e-4)
    assert not found


@pytest.mark.parametrize("together", [False, True])
def test_metaballs(tmp_path: Path, together: bool) -> None:
    """The family moves with its first ball; what another one does alone is named."""
    mh.scene_at(DISTANCE_M, 2.6)
    parent = mh.empty("Parent", (0, DISTANCE_M, 0))
    items = []
    for name, x in (("Meta", -0.5), ("Meta.001", 0.7)):
        data = bpy.data.metaballs.new(name)
        data.resolution = data.render_resolution = 0.1
        data.elements.new().radius = 1.0
        data.materials.append(ph.lambert(0.5))
        items.append(mh.empty("x", (0, 0, 0)))
        bpy.data.objects.remove(items.pop())
        item = bpy.data.objects.new(name, data)
        item.location, item.parent = (x, 0, 0), parent
        bpy.context.scene.collection.objects.link(item)
        items.append(item)
    if together:
        steady(parent, "location", (1, (0, 20, 0)), (1 + SECOND, (0, 26, 0)))
    else:
        steady(items[1], "location", (1, (0.7, 0, 0)), (1 + SECOND, (0.7, 6, 0)))
    speeds, _, found = measured(tmp_path)
    np.testing.assert_allclose(speeds, 6.0 if together else 0.0, atol=1e-4)
    assert ("surface-not-followed" in found) is not together
    if not together:
        speed_mps = found["surface-not-followed"].numbers["speed_mps"]
        assert speed_mps == pytest.approx(6.0, rel=0.05)


@pytest.mark.parametrize("deforms", [False, True])
def test_curve(tmp_path: Path, deforms: bool) -> None:
    """A curve that grows does not move; one with a shape key does."""
    mh.scene_at(DISTANCE_M, 2.6)
    data = bpy.data.curves.new("Curve", "CURVE")
    data.dimensions, data.bevel_depth = "3D", 0.3
    spline = data.splines.new("POLY")
    spline.points.add(4)
    for number, point in enumerate(spline.points):
        point.co = (-1 + 0.5 * number, DISTANCE_M, 0.0, 1)
    data.materials.append(ph.lambert(0.5))
    item = bpy.data.objects.new("Curve", data)
    bpy.context.scene.collection.objects.link(item)
    if deforms:
        by_shape_key(item, 5.0)
    else:
        steady(data, "bevel_factor_end", (1, 0.55), (1 + SECOND, 0.8))
    speeds, _, found = measured(tmp_path)
    np.testing.assert_allclose(speeds, 5.0 if deforms else 0.0, rtol=1e-4)
    assert [*found] == ([] if deforms else ["surface-changes"])


def test_build(tmp_path: Path) -> None:
    """Faces that appear are no motion."""
    plate = wavy_plate()
    build = plate.modifiers.new("Build", "BUILD")
    build.frame_start, build.frame_duration = 1, 30
    speeds, _, found = measured(tmp_path, 20)
    assert not speeds.any()
    assert [*found] == ["surface-changes"]


def node_group(*kinds: str) -> tuple[Any, list[Any]]:
    """An empty group for Geometry Nodes with an output, and nodes of these kinds."""
    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    nodes = ("NodeGroupInput", "NodeGroupOutput", *(f"GeometryNode{kind}" for kind in kinds))
    return tree, [tree.nodes.new(kind) for kind in nodes]


@pytest.mark.parametrize("made", [False, True])
def test_nodes_that_move_points(tmp_path: Path, made: bool) -> None:
    """Set Position by the time, on the object's mesh or on a grid that nodes make."""
    plate = wavy_plate()
    tree, (start, end, position, clock, grid, material) = node_group(
        "SetPosition", "InputSceneTime", "MeshGrid", "SetMaterial"
    )
    combine = tree.nodes.new("ShaderNodeCombineXYZ")
    times = tree.nodes.new("ShaderNodeMath")
    times.operation = "MULTIPLY"
    times.inputs[1].default_value = 7.0
    tree.links.new(clock.outputs["Seconds"], times.inputs[0])
    tree.links.new(times.outputs[0], combine.inputs["Z" if made else "Y"])
    tree.links.new(combine.outputs[0], position.inputs["Offset"])
    tree.links.new((grid if made else start).outputs[0], position.inputs["Geometry"])
    material.inputs["Material"].default_value = plate.data.materials[0]
    tree.links.new(position.outputs[0], material.inputs["Geometry"])
    tree.links.new(material.outputs[0], end.inputs[0])
    grid.inputs["Size X"].default_value = grid.inputs["Size Y"].default_value = 2.0
    if made:  # the grid is in X and Y
        plate.rotation_euler.x = -math.pi / 2
    plate.modifiers.new("Nodes", "NODES").node_group = tree
    speeds, _, found = measured(tmp_path)
    np.testing.assert_allclose(speeds, 7.0, rtol=1e-4)
    assert not found


def test_nodes_that_cut(tmp_path: Path) -> None:
    wall, cutter = cut_wall("EXACT")
    wall.modifiers.remove(wall.modifiers["Cut"])
    tree, (start, end, boolean, info) = node_group("MeshBoolean", "ObjectInfo")
    info.inputs["Object"].default_value, info.transform_space = cutter, "RELATIVE"
    boolean.operation = "DIFFERENCE"
    tree.links.new(start.outputs[0], boolean.inputs["Mesh 1"])
    tree.links.new(info.outputs["Geometry"], boolean.inputs["Mesh 2"])
    tree.links.new(boolean.outputs[0], end.inputs[0])
    wall.modifiers.new("Nodes", "NODES").node_group = tree
    steady(cutter, "location", (1, (-0.4, 20, 0)), (1 + SECOND, (3.0, 21, 0)))
    speeds, _, found = measured(tmp_path)
    assert not speeds.any()
    assert [*found] == ["surface-not-followed"]


def displaced_plate(height: tuple[float, float]) -> tuple[Any, Any]:
    """A plate with True Displacement of a height from frame 1 to 25, and its height's socket."""
    plate = wavy_plate(40, 0.0)
    material = plate.data.materials[0]
    material.displacement_method = "DISPLACEMENT"
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeDisplacement")
    node.inputs["Midlevel"].default_value, node.inputs["Scale"].default_value = 0.0, 1.0
    output = next(one for one in tree.nodes if one.type == "OUTPUT_MATERIAL")
    tree.links.new(node.outputs[0], output.inputs["Displacement"])
    steady(node.inputs["Height"], "default_value", (1, height[0]), (1 + SECOND, height[1]))
    return plate, node


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize("plate_mps", [0.0, 6.0])
def test_true_displacement(tmp_path: Path, changes: bool, plate_mps: float) -> None:
    """A constant one moves with its object; one that changes is named."""
    plate, _ = displaced_plate((0.5, 3.0 if changes else 0.5))
    if plate_mps:
        steady(plate, "location", (1, (0, 20, 0)), (1 + SECOND, (0, 20 + plate_mps, 0)))
    speeds, _, found = measured(tmp_path)
    np.testing.assert_allclose(speeds, plate_mps, atol=1e-4)
    assert [*found] == (["displacement-changes"] if changes else [])


def test_colours_that_change_are_no_displacement(tmp_path: Path) -> None:
    plate, _ = displaced_plate((0.2, 0.2))
    tree = plate.data.materials[0].node_tree
    shader = next(one for one in tree.nodes if one.type == "BSDF_DIFFUSE")
    steady(shader.inputs[0], "default_value", (1, (0.2,) * 4), (25, (0.8,) * 4))
    assert not measured(tmp_path, 5)[2]


@pytest.mark.parametrize("rate", [40, 300])
def test_vibration_of_vertices_that_is_fast_for_the_samples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rate: float
) -> None:
    """Up to 29 periods in a burst: followed, or named; no constant with an error bound of 0.

    How many samples are taken depends on the scene, and not on how long they take.
    """
    monkeypatch.setattr(burst_motion, "_MOST_POSES", 400)
    plate = wavy_plate()
    plate.shape_key_add(name="Basis")
    key = plate.shape_key_add(name="Moved")
    for point in key.data:
        point.co.y += 1.0
    curve = key.driver_add("value")
    curve.driver.expression = f"0.5 + 0.01 * sin(frame * {rate})"
    rows, paths, run = mh.measured(tmp_path, 77e9, BURST, 3)
    times_s = np.arange(BURST.pulses) / BURST.prf_hz
    lengths_m = paths.lengths.lengths_m(times_s, slice(None))
    moved_m = 0.01 * (np.sin((3 + 24 * times_s) * rate) - math.sin(3 * rate))
    want_m = 2 * moved_m * rows["direction"][:, 1:2]
    miss_m = float(np.abs(lengths_m - lengths_m[:, :1] - want_m).max())
    record = read_record(run.folder / frame_dir(3) / MOTION_FILE, MotionRecord)
    assert record.bodies[0].deforms
    codes = {one.code for one in record.findings}
    assert "motion-jumps" not in codes
    assert "motion-sampling-slow" in codes and record.samples < 60
    if miss_m > 2e-4:
        assert "displacement-error" in codes
        assert record.displacement_error_bound_m > miss_m / 5


def by_voxels(item: Any) -> None:
    remesh = item.modifiers.new("Remesh", "REMESH")
    remesh.mode, remesh.voxel_size = "VOXEL", 0.1


def by_volume(item: Any) -> None:
    """Mesh to volume to mesh, in a nested group."""
    inner = bpy.data.node_groups.new("Inner", "GeometryNodeTree")
    outer = bpy.data.node_groups.new("Outer", "GeometryNodeTree")
    for tree in (inner, outer):
        for way in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Mesh", in_out=way, socket_type="NodeSocketGeometry")
    chains = {
        inner: ("GeometryNodeMeshToVolume", "GeometryNodeVolumeToMesh", "GeometryNodeSetMaterial"),
        outer: ("GeometryNodeGroup",),
    }
    for tree, names in chains.items():
        last = tree.nodes.new("NodeGroupInput")
        for name in (*names, "NodeGroupOutput"):
            node = tree.nodes.new(name)
            if name == "GeometryNodeGroup":
                node.node_tree = inner
            if name == "GeometryNodeMeshToVolume":
                node.inputs["Voxel Amount"].default_value = 24
            if name == "GeometryNodeSetMaterial":
                node.inputs["Material"].default_value = item.data.materials[0]
            tree.links.new(last.outputs[0], node.inputs[0])
            last = node
    item.modifiers.new("Nodes", "NODES").node_group = outer


@pytest.mark.parametrize("remesh", [by_voxels, by_volume])
@pytest.mark.parametrize("speed_mps", [1.0, -0.4])
def test_vertices_on_a_grid_are_not_points_of_the_surface(
    tmp_path: Path, remesh: Any, speed_mps: float
) -> None:
    """They keep their number and faces for a while, and slide by up to twice the speed."""
    mh.scene_at(DISTANCE_M, 6)
    bpy.ops.mesh.primitive_cube_add(location=(0, DISTANCE_M, 0), rotation=(0.3, 0.2, 0.5))
    item = bpy.context.object
    item.data.materials.append(ph.lambert(0.5))
    by_shape_key(item, speed_mps)
    remesh(item)
    speeds, record, found = measured(tmp_path, 3)
    said = found["surface-not-followed"]
    assert not speeds.any() and said.subjects == ("Cube",)
    assert record.displacement_error_bound_m == said.numbers["apart_m"]
    moved_m = abs(speed_mps) * BURST.pulses / BURST.prf_hz
    assert 0.3 * moved_m < said.numbers["apart_m"] < 4 * moved_m


def test_a_remeshed_object_that_moves_as_a_whole(tmp_path: Path) -> None:
    mh.scene_at(DISTANCE_M, 6)
    bpy.ops.mesh.primitive_cube_add(location=(0, DISTANCE_M, 0), rotation=(0.3, 0.2, 0.5))
    item = bpy.context.object
    item.data.materials.append(ph.lambert(0.5))
    by_voxels(item)
    steady(item, "location", (1, (0, 20, 0)), (1 + SECOND, (0, 23, 0)))
    speeds, _, found = measured(tmp_path, 3)
    assert not found
    np.testing.assert_allclose(speeds, 3.0, rtol=1e-4)


@pytest.mark.parametrize("above", [True, False])
def test_remesh_above_and_below_what_deforms(tmp_path: Path, above: bool) -> None:
    """The remedy that the finding gives: above it, the vertices are points of the surface."""
    mh.scene_at(DISTANCE_M, 6)
    bpy.ops.mesh.primitive_cube_add(location=(0, DISTANCE_M, 0))
    item = bpy.context.object
    item.data.materials.append(ph.lambert(0.5))
    item.modifiers.new("Subdivision", "SUBSURF")
    by_voxels(item)
    moved = item.modifiers.new("Displace", "DISPLACE")
    moved.direction, moved.mid_level = "Y", 0.0
    moved.driver_add("strength").driver.expression = "frame / 12"
    if not above:
        item.modifiers.move(2, 0)
    speeds, _, found = measured(tmp_path, 3)
    assert [*found] == ([] if above else ["surface-not-followed"])
    np.testing.assert_allclose(speeds, 2.0 if above else 0.0, rtol=1e-4)


def test_errors_of_vertices_are_relative_to_the_render(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The path's length is that of its render, at the begin or at the end of the burst; from there
    on the displacement counts, and its error.
    """
    by_shape_key(wavy_plate(), 20.0)
    fit_vertices, epochs_s = fits.fit_vertices, []

    def spied(*given: Any, epoch_s: float = 0.0, **options: Any) -> Any:
        epochs_s.append(epoch_s)
        return fit_vertices(*given, epoch_s=epoch_s, **options)

    monkeypatch.setattr(fits, "fit_vertices", spied)
    mh.measured(tmp_path, 77e9, BURST, visibility_updates=2)
    assert epochs_s == pytest.approx([0.0, BURST.pulses / BURST.prf_hz], abs=1e-7)
