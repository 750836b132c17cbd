# SPDX-License-Identifier: GPL-3.0-or-later
"""Lengths of paths against the exact ray and the exact mesh, wherever the world's origin is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import pytest

from radarsim_addon.blender.state import take_snapshot
from radarsim_addon.signal import PathFlag
from radarsim_addon.signal.paths import PATH_FLAGS

bpy = pytest.importorskip("bpy")
from mathutils import Euler, Vector

from radarsim_addon.blender.motion import Bodies
from radarsim_addon.blender.paths import view_tracer
from radarsim_addon.blender.paths.hit_points import HitPoints
from radarsim_addon.blender.scene import evaluated_poses
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

CARRIER_HZ = 77e9
WAVELENGTH_M = ph.C0_MPS / CARRIER_HZ
#: Where the object lies from the radar: off all axes.
AWAY = np.array([0.4891, 0.8471, 0.2079]) / np.linalg.norm([0.4891, 0.8471, 0.2079])


def measure(folder: Path, carrier_hz: float = CARRIER_HZ, **options: Any) -> ph.PathRun:
    """One path a pixel of 32 x 32."""
    waveform = rs.Waveform(carrier_hz, 150e6, 2.5e-6, 180e6)
    return ph.run_paths(folder, width_px=32, height_px=32, waveform=waveform, options=options)


def look_at(item: Any, range_m: float, origin: str) -> None:
    """Put the radar or the object at the world's origin, and the other one far from it."""
    radar = bpy.data.objects["Radar"]
    radar.location = -range_m * AWAY if origin == "object" else (0, 0, 0)
    item.location = range_m * AWAY if origin == "radar" else (0, 0, 0)
    turn = Vector((0, 1, 0)).rotation_difference(Vector(AWAY))
    radar.rotation_euler = (turn @ Euler(radar.rotation_euler).to_quaternion()).to_euler()
    ph.field_of_view(math.degrees(2 * math.atan(0.6 / range_m)))


def triangles_of(item: Any) -> np.ndarray:
    """Corners of all triangles in world space, extended precision, (m, 3, 3)."""
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    pose = np.array(evaluated.matrix_world, dtype=np.longdouble)
    mesh = evaluated.to_mesh()
    mesh.calc_loop_triangles()
    corners = np.array([tuple(v.co) for v in mesh.vertices], dtype=np.longdouble)
    faces = np.array([tuple(t.vertices) for t in mesh.loop_triangles])
    return (corners @ pose[:3, :3].T + pose[:3, 3])[faces]


def exact_lengths(run: ph.PathRun, triangles: np.ndarray) -> np.ndarray:
    """Length of each row over the first triangle that its ray meets; infinite where none."""
    rows, record = run.table(), run.record()
    receiver, transmitter = (
        np.array(antenna.matrix_world, dtype=np.longdouble)[:3, 3]
        for antenna in (record.receiver, record.transmitter)
    )
    direction = rows["direction"].astype(np.longdouble)
    best = np.full(rows.size, np.inf, dtype=np.longdouble)
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            way = ((a - receiver) @ normal) / (direction @ normal)
            point = receiver + way[:, None] * direction
            inside = way > 0
            for start, end in ((a, b), (b, c), (c, a)):
                inside &= np.cross(end - start, point - start) @ normal >= 0
        best = np.where(inside & (way < best), way, best)
    with np.errstate(invalid="ignore"):
        point = receiver + best[:, None] * direction
        return np.asarray(
            best + np.linalg.norm((point - transmitter).astype(np.longdouble), axis=1)
        )


def check(run: ph.PathRun, triangles: np.ndarray) -> None:
    """A millionth of a wavelength, and sigmas that say how exact."""
    rows, exact = run.table(), exact_lengths(run, triangles)
    met = np.isfinite(exact)
    assert met.mean() > 0.995  # along the limb Cycles may meet what the exact ray misses
    assert met.sum() > 80
    error_m = (rows["length_m"] - exact)[met].astype(float)
    bodies = np.bincount(rows["last_body"])  # rays that met none are not told where they met
    flags = {name: int(np.sum(rows["flags"] & flag > 0)) for name, flag in PATH_FLAGS.items()}
    assert np.abs(error_m).max() < 1e-6 * WAVELENGTH_M, f"bodies {bodies}, flags {flags}"
    rms_m = math.sqrt(np.mean(error_m**2))
    sigma_m = math.sqrt(np.mean(rows["length_sigma_m"][met].astype(float) ** 2))
    assert 1 / 1.5 < rms_m / sigma_m < 1.5  # roundings of float64
    # no part of it is common to all rays, which would shift ranges as a whole
    assert abs(error_m.mean()) < 0.3 * rms_m
    assert not np.any(rows["flags"] & PathFlag.ENCODED_LENGTH)
    np.testing.assert_array_equal(rows["first_scatterer_m"], rows["last_scatterer_m"])


@pytest.mark.parametrize("origin", ["radar", "object"])
@pytest.mark.parametrize("range_m", [10.0, 1e3, 1e4])
@pytest.mark.parametrize("shape", ["plate", "sphere", "smooth sphere"])
def test_far_targets(tmp_path: Path, shape: str, range_m: float, origin: str) -> None:
    """Flat, of facets to their limb, and smooth: there Cycles lifts the start of shadow rays."""
    rs.new_scene()
    if shape == "plate":
        item = ph.plate_at(0.0, 1.0, ph.rough_metal(), tilt_deg=40.0)
    else:
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=0.5)
        item = bpy.context.object
        item.data.materials.append(ph.rough_metal())
        for face in item.data.polygons:
            face.use_smooth = shape == "smooth sphere"
    look_at(item, range_m, origin)
    check(measure(tmp_path), triangles_of(item))


def test_scaled_and_sheared_instances(tmp_path: Path) -> None:
    """Three poses of one mesh, 3 km from the world's origin."""
    rs.new_scene()
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=1, radius=0.2)
    ball = bpy.context.object
    ball.data.materials.append(ph.rough_metal())
    stretched = bpy.data.objects.new("Stretched", None)
    bpy.context.scene.collection.objects.link(stretched)
    stretched.scale, stretched.location = (3.0, 0.5, 1.5), (3e3, 10.0, 0.3)
    items = [ball]
    for turn in (0.4, 1.3):
        twin = bpy.data.objects.new("Twin", ball.data)
        bpy.context.scene.collection.objects.link(twin)
        twin.parent, twin.rotation_euler = stretched, (0.3, turn, 0.8)
        twin.location = (0.25 * math.copysign(1, turn - 1), 0, 0)
        items.append(twin)
    ball.location = (3e3, 10.0, -0.4)
    ph.radar_at((3e3, 0, 0))
    ph.field_of_view(14)
    bpy.context.view_layer.update()
    sheared = np.array(items[1].matrix_world)[:3, :3]
    assert np.abs(sheared.T @ sheared - np.diag(np.diag(sheared.T @ sheared))).max() > 0.1
    run = measure(tmp_path)
    assert len(np.unique(run.table()["last_object"])) == 3
    check(run, np.concatenate([triangles_of(item) for item in items]))


def test_instances_of_geometry_nodes(tmp_path: Path) -> None:
    """Meshes that exist in instances alone."""
    rs.new_scene()
    tree = bpy.data.node_groups.new("Cubes", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes = {
        name: tree.nodes.new(kind)
        for name, kind in {
            "line": "GeometryNodeMeshLine",
            "cube": "GeometryNodeMeshCube",
            "put": "GeometryNodeInstanceOnPoints",
            "paint": "GeometryNodeSetMaterial",
            "out": "NodeGroupOutput",
        }.items()
    }
    nodes["line"].inputs["Count"].default_value = 3
    nodes["line"].inputs["Offset"].default_value = (0.5, 0.1, 0.1)
    nodes["cube"].inputs["Size"].default_value = (0.3, 0.2, 0.25)
    nodes["put"].inputs["Rotation"].default_value = (0.3, 0.5, 0.7)
    nodes["paint"].inputs["Material"].default_value = ph.rough_metal()
    for start, end in (("line", "Points"), ("cube", "Instance")):
        tree.links.new(nodes[start].outputs["Mesh"], nodes["put"].inputs[end])
    tree.links.new(nodes["put"].outputs[0], nodes["paint"].inputs["Geometry"])
    tree.links.new(nodes["paint"].outputs[0], nodes["out"].inputs[0])
    item = bpy.data.objects.new("Cubes", bpy.data.meshes.new("Cubes"))
    bpy.context.scene.collection.objects.link(item)
    item.modifiers.new("Cubes", "NODES").node_group = tree
    item.location = (400.0, 20.0, 0.0)
    ph.radar_at((400.5, 0, 0))
    ph.field_of_view(5)
    run = measure(tmp_path)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    corners = []
    for one in depsgraph.object_instances:
        if one.is_instance:
            pose = np.array(one.matrix_world, dtype=np.longdouble)
            mesh = one.object.data
            mesh.calc_loop_triangles()
            own = np.array([tuple(v.co) for v in mesh.vertices], dtype=np.longdouble)
            faces = np.array([tuple(t.vertices) for t in mesh.loop_triangles])
            corners.append((own @ pose[:3, :3].T + pose[:3, 3])[faces])
    assert len(corners) == 3
    check(run, np.concatenate(corners))


@pytest.mark.parametrize("encoding", ["materials", "world"])
@pytest.mark.parametrize("origin", ["radar", "object"])
def test_two_reflections(tmp_path: Path, origin: str, encoding: str) -> None:
    """Both vertices on their faces, and the length over them: it was half a wavelength off."""
    range_m, side = 1e4, 0.5
    rs.new_scene()
    y = range_m if origin == "radar" else 0.0
    low, high = (0, y, -side), (0, y, side)
    normals = []
    for name, x, depth in (("Left", -side, side), ("Right", side, 0.9 * side)):
        corners = [low, (x, y - depth, -side), (x, y - depth, side), high]
        face = ph.quad(name, corners, ph.rough_metal())
        own = np.array([tuple(v.co) for v in face.data.vertices], dtype=np.float64)
        normal = np.cross(own[1] - own[0], own[3] - own[0])
        normals.append((own[0], normal / np.linalg.norm(normal)))
    ph.radar_at((0, 0 if origin == "radar" else -range_m, 0))
    ph.field_of_view(math.degrees(2 * math.atan(0.5 / range_m)))
    run = measure(tmp_path, max_reflections=2, range_encoding=encoding)
    rows, record = run.table(), run.record()
    rows = rows[rows["order"] == 2]
    assert rows.size > 150
    receiver, transmitter = (
        np.array(antenna.matrix_world)[:3, 3] for antenna in (record.receiver, record.transmitter)
    )
    ends = rows["first_scatterer_m"], rows["last_scatterer_m"]
    for points, column in zip(ends, ("first_object", "last_object"), strict=True):
        for number, (corner, normal) in enumerate(normals, start=1):
            mine = rows[column] == record.objects.index(("Left", "Right")[number - 1]) + 1
            assert mine.sum() > 50
            assert np.abs((points[mine] - corner) @ normal).max() < 1e-10
    away = ends[0] - receiver
    side_m = np.linalg.norm(np.cross(away, rows["direction"]), axis=1)
    assert side_m.max() < 1e-10
    length_m = (
        np.linalg.norm(away, axis=1)
        + np.linalg.norm(ends[1] - ends[0], axis=1)
        + np.linalg.norm(ends[1] - transmitter, axis=1)
    )
    assert np.abs(rows["length_m"] - length_m).max() < 1e-6 * WAVELENGTH_M
    # Where on its face the second vertex lies, the renders tell to 1e-7 of the range.
    assert 1e-8 * range_m < rows["length_sigma_m"].max() < 3e-7 * range_m
    assert not np.any(rows["flags"] & PathFlag.ENCODED_LENGTH)


def test_what_passes_a_pane_keeps_its_delay_and_its_sigma(tmp_path: Path) -> None:
    """Behind a pane the range encoding tells the length, and its noise how exact that is."""
    rs.new_scene()
    pane = rs.add_plate(50.0, 40.0, 0.0, preset="glass")
    pane.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.004
    ph.plate_at(100.0, 30.0, ph.rough_metal(), tilt_deg=25.0)
    ph.field_of_view(8)
    run = measure(tmp_path)
    rows = run.table()
    behind = rows[rows["last_object"] == run.record().objects.index("Plate.001") + 1]
    assert behind.size > 100
    # the plate's own plane, whatever the points are
    normal = np.array([0.0, -math.cos(math.radians(25)), math.sin(math.radians(25))])
    way_m = 100.0 * normal[1] / (behind["direction"] @ normal)
    cosine = behind["direction"][:, 1]
    # ITU-R P.2040: permittivity 6.31; straight through a layer, both ways
    delay_m = 2 * 0.004 * (np.sqrt(6.31 - 1 + cosine**2) - cosine)
    error_m = behind["length_m"] - 2 * way_m - delay_m
    rms_m = math.sqrt(np.mean(error_m**2))
    sigma_m = behind["length_sigma_m"].astype(float)
    assert 1 / 3 < rms_m / np.median(sigma_m) < 1.5
    assert np.all(behind["flags"] & PathFlag.ENCODED_LENGTH)


def test_a_long_wave_needs_none_of_it(tmp_path: Path) -> None:
    """Where float32 is enough no mesh is read, and the sigma is that of float32."""
    rs.new_scene()
    item = ph.plate_at(0.0, 1.0, ph.rough_metal(), tilt_deg=40.0)
    look_at(item, 30.0, "radar")
    run = measure(tmp_path, carrier_hz=3e9)
    rows, exact = run.table(), exact_lengths(run, triangles_of(item))
    error_m = (rows["length_m"] - exact)[np.isfinite(exact)].astype(float)
    rms_m = math.sqrt(np.mean(error_m**2))
    assert 1e-8 < rms_m < 1e-3 * 0.1
    assert 1 / 2 < rms_m / np.median(rows["length_sigma_m"]) < 2


def test_mirror_in_closed_form(tmp_path: Path) -> None:
    """By way of a mirror the second vertex lies where the unfolded ray ends."""
    end_m, side_m = 1e3, 4.0
    rs.new_scene()
    corners = [(side_m, 500, -9), (side_m, 999, -9), (side_m, 999, 9), (side_m, 500, 9)]
    ph.quad("Mirror", corners, ph.mirror())
    ph.quad(
        "End", [(-9, end_m, -9), (9, end_m, -9), (9, end_m, 9), (-9, end_m, 9)], ph.rough_metal()
    )
    ph.field_of_view(1)
    rows = measure(tmp_path, max_reflections=2, mirror_images=0).table()
    rows = rows[rows["order"] == 2]
    assert rows.size > 100
    way_m = end_m / rows["direction"][:, 1]
    ends = way_m[:, None] * rows["direction"]
    ends[:, 0] = 2 * side_m - ends[:, 0]
    exact_m = way_m + np.linalg.norm(ends, axis=1)
    assert np.abs(rows["last_scatterer_m"] - ends).max() < 1e-9
    assert np.abs(rows["length_m"] - exact_m).max() < 1e-6 * WAVELENGTH_M
    assert rows["length_sigma_m"].max() < 1e-6 * WAVELENGTH_M


def test_opaque_scenes_need_fewer_renders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing lets power through, two renders hold what others do: the same table."""
    tables, renders, limits = [], [], view_tracer.TraceLimits
    for told in (True, False):
        rs.new_scene()
        ph.quad("Floor", [(-9, 5, -2), (9, 5, -2), (9, 40, -2), (-9, 40, -2)], ph.rough_metal())
        ph.plate_at(20.0, 6.0, ph.rough_metal(), tilt_deg=20.0)
        ph.field_of_view(30)
        if not told:
            monkeypatch.setattr(
                view_tracer, "TraceLimits", lambda **each: limits(**each | {"all_opaque": False})
            )
        run = measure(tmp_path / str(told), max_reflections=2)
        tables.append(run.table().tobytes())
        renders.append(run.record().renders)
    assert tables[0] == tables[1]
    assert renders[0] < renders[1]
    assert np.sum(run.table()["order"] == 2) > 50


@pytest.mark.parametrize("range_m", [10.0, 1e4])
def test_the_mesh_of_renders_is_that_of_lengths(tmp_path: Path, range_m: float) -> None:
    """Modifiers that show another mesh in the viewport; one of them in a linked file."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.mesh.primitive_cube_add(size=1.2)
    source = bpy.context.object
    smoother = source.modifiers.new("Smoother", "SUBSURF")
    smoother.levels, smoother.render_levels = 1, 3
    bent = source.modifiers.new("Bend", "SIMPLE_DEFORM")
    bent.deform_method, bent.angle, bent.show_viewport = "TAPER", 1.5, False
    bpy.data.libraries.write(str(tmp_path / "linked.blend"), {source}, fake_user=True)
    rs.new_scene()
    with bpy.data.libraries.load(str(tmp_path / "linked.blend"), link=True) as (_, wanted):
        wanted.objects = ["Cube"]
    linked = bpy.data.objects["Cube"]
    holder = bpy.data.collections.new("Holder")
    holder.objects.link(linked)
    item = rs.instance_of(holder)
    look_at(item, range_m, "radar")
    run = measure(tmp_path / "run", range_encoding="world")
    assert linked.modifiers[0].levels == 1
    assert not linked.modifiers[1].show_viewport
    linked.modifiers[0].levels, linked.modifiers[1].show_viewport = 3, True
    triangles = triangles_of(linked)
    bpy.context.view_layer.update()
    check(run, triangles + np.array(item.matrix_world, dtype=np.longdouble)[:3, 3])


def test_displaced_surfaces_keep_the_hit_points_of_cycles(tmp_path: Path) -> None:
    """The mesh that is hit is not the one that Blender evaluates: sigmas stay those of float32."""
    rs.new_scene()
    material = ph.lambert(0.5)
    material.displacement_method = "DISPLACEMENT"
    tree = material.node_tree
    shift = tree.nodes.new("ShaderNodeDisplacement")
    for name, value in (("Midlevel", 0.0), ("Height", 0.05), ("Scale", 1.0)):
        shift.inputs[name].default_value = value
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(shift.outputs[0], output.inputs["Displacement"])
    item = ph.plate_at(0.0, 1.0, material)
    look_at(item, 100.0, "radar")
    rows = measure(tmp_path, range_encoding="world").table()
    assert rows.size > 100
    # the plate faces -y and was lifted by 5 cm
    lifted_m = item.location.y - rows["last_scatterer_m"][:, 1]
    np.testing.assert_allclose(lifted_m, 0.05, atol=1e-4)
    assert rows["length_sigma_m"].min() > 1e-6


def test_of_two_sheets_at_one_place_the_first_is_hit() -> None:
    """A plate thinner than the points' error: normals are of the side that rays come from."""
    rs.new_scene()
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 1000.0, 0))
    bpy.context.object.name, bpy.context.object.scale = "Plate", (4.0, 1e-4, 4.0)
    bpy.context.view_layer.update()
    snapshot = take_snapshot(bpy.context.evaluated_depsgraph_get())
    bodies = Bodies(["Plate"], evaluated_poses(snapshot, 1.0), 1.0)
    hits = HitPoints(bodies, 0.05, True, WeakKeyDictionary())
    for side in (1.0, -1.0):
        start = np.array([0.3, 1000.0 - side * 1000.0, 0.2])
        points = np.array([[x, 1000.0, z] for x in (-1.0, 0.4) for z in (-0.7, 1.3)])
        normals = hits.normals(np.ones(4, dtype=np.intp), np.tile(start, (4, 1)), points)
        np.testing.assert_allclose(normals, np.tile([0.0, -side, 0.0], (4, 1)), atol=1e-9)
