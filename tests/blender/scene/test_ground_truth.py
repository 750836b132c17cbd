# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground truth is that of the rendered surface, once per object; what rays miss is named."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon import blender as radarsim
from radarsim_addon import contract
from radarsim_addon.blender import nodes
from radarsim_addon.blender.scene import echoing_boxes, measure_pixel_spans
from radarsim_addon.blender.state import evaluated_snapshot
from radarsim_addon.signal import open_run
from radarsim_addon.typed_json import read_record
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

#: Distance of the objects from the receiver.
AWAY_M = 20.0


def with_material(item: Any) -> Any:
    made = nodes.make_material(
        "M", n=2.0, kappa=99.0, specularity=0.0, roughness=0.6, penetrable=False
    )
    item.data.materials.append(made)
    return item


def cube(size: float = 4.0) -> Any:
    bpy.ops.mesh.primitive_cube_add(size=size, location=(0, AWAY_M, 0))
    return with_material(bpy.context.object)


def measured(folder: Path, **settings: Any) -> tuple[dict[str, Any], dict[str, float], Any]:
    """Ground truth and least measured range by object, and the findings of the run by code."""
    run = ph.run_paths(folder, **{"width_px": 64, "height_px": 64} | settings)
    path = folder / contract.frame_dir(1) / contract.GROUND_TRUTH_FILE
    objects = read_record(path, contract.GroundTruthRecord).objects
    rows, names = run.table(), run.record().objects
    nearest = {
        name: float(mine.min()) / 2
        for number, name in enumerate(names, start=1)
        if (mine := rows["length_m"][rows["last_object"] == number]).size
    }
    assert len({item.name for item in objects}) == len(objects)
    found = {item.code: item for item in open_run(folder).record.findings}
    return {item.name: item for item in objects}, nearest, found


def subdivided() -> float:
    """Blender puts the vertices of a subdivided cube on the limit surface (Catmull and Clark 1978).

    The first step leaves the middle of a face, half edge a, at a, with edge neighbours at 3/4 a
    (mean of two corners and two face points) and corners at 5/9 a. The limit of a vertex of valence
    4 is (16 v + 4 edges + corners) / 36: (16 + 4 * 4 * 3/4 + 4 * 5/9) / 36 = 0.8395.
    """
    modifier = cube().modifiers.new("Round", "SUBSURF")
    modifier.levels, modifier.render_levels = 0, 3
    return AWAY_M - 2.0 * (16 + 4 * 4 * 3 / 4 + 4 * 5 / 9) / 36


def screwed() -> float:
    """An edge at a radius of 3 m: of 4 steps a corner looks at the radar, of 64 the circle does."""
    mesh = bpy.data.meshes.new("Edge")
    mesh.from_pydata([(3, 0, -1), (3, 0, 1)], [(0, 1)], [])
    item = bpy.data.objects.new("Drum", mesh)
    bpy.context.scene.collection.objects.link(item)
    item.location = (0, AWAY_M, 0)
    modifier = with_material(item).modifiers.new("Turn", "SCREW")
    modifier.axis, modifier.steps, modifier.render_steps = "Z", 3, 64
    return AWAY_M - 3.0


def switched_by_viewport() -> float:
    """Geometry nodes move the object by 3 m, but not in the viewport."""
    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "NodeGroupOutput", "GeometryNodeIsViewport")
    entry, end, viewport = (tree.nodes.new(kind) for kind in kinds)
    switch = tree.nodes.new("GeometryNodeSwitch")
    moved = tree.nodes.new("GeometryNodeTransform")
    switch.input_type = "GEOMETRY"
    moved.inputs["Translation"].default_value = (0, -3, 0)
    choice, no, yes = (socket for socket in switch.inputs if socket.enabled)
    (chosen,) = (socket for socket in switch.outputs if socket.enabled)
    for start, stop in (
        (entry.outputs[0], moved.inputs[0]),
        (viewport.outputs[0], choice),
        (moved.outputs[0], no),
        (entry.outputs[0], yes),
        (chosen, end.inputs[0]),
    ):
        tree.links.new(start, stop)
    cube().modifiers.new("Nodes", "NODES").node_group = tree
    return AWAY_M - 2.0 - 3.0


def text() -> float:
    bpy.ops.object.text_add(location=(-1, AWAY_M, 0), rotation=(math.pi / 2, 0, 0))
    item = with_material(bpy.context.object)
    item.data.body, item.data.size, item.data.extrude = "III", 3.0, 0.2
    return AWAY_M - 0.2


def metaball() -> float:
    """The surface is where the field of one ball equals the threshold, 1.15 m for these numbers."""
    bpy.ops.object.metaball_add(radius=2, location=(0, AWAY_M, 0))
    with_material(bpy.context.object).data.threshold = 0.6
    return math.nan


def bevelled_curve() -> float:
    """Two segments in the viewport, 64 in renders: a circle of 3 m with a bevel of 1 m."""
    bpy.ops.curve.primitive_bezier_circle_add(location=(0, AWAY_M, 0), radius=3)
    data = with_material(bpy.context.object).data
    data.bevel_depth, data.resolution_u, data.render_resolution_u = 1.0, 1, 64
    return AWAY_M - 3.0 - 1.0


@pytest.mark.parametrize(
    "make", [subdivided, screwed, switched_by_viewport, text, metaball, bevelled_curve]
)
def test_nearest_range_is_that_of_what_renders(make: Callable[[], float], tmp_path: Path) -> None:
    """By construction, and as rays measure it, which never see less: one record per object."""
    rs.new_scene()
    ph.field_of_view(40)
    expected_m = make()
    truth, nearest, _ = measured(tmp_path)
    (item,), (ray_m,) = truth.values(), nearest.values()
    assert "/" not in item.name
    if math.isfinite(expected_m):
        assert item.nearest_range_m == pytest.approx(expected_m, abs=0.01)
    # The nearest of 64 x 64 rays misses the nearest point by half of a pixel at most.
    assert -1e-4 < ray_m - item.nearest_range_m < 0.05


def test_node_groups_are_as_before(tmp_path: Path) -> None:
    rs.new_scene()
    ph.field_of_view(40)
    switched_by_viewport()
    (tree,) = (one for one in bpy.data.node_groups if one.type == "GEOMETRY")

    def links() -> list[tuple[str, str, str]]:
        return sorted(
            (link.from_node.bl_idname, link.to_node.bl_idname, link.to_socket.identifier)
            for link in tree.links
        )

    before = links()
    measured(tmp_path)
    assert links() == before


@pytest.mark.parametrize("method", ["BUMP", "DISPLACEMENT", "BOTH"])
def test_displaced_surfaces_have_no_nearest_range(method: str, tmp_path: Path) -> None:
    """A shader moves a plate 1.5 m towards the radar; Blender's mesh does not show it."""
    rs.new_scene()
    ph.field_of_view(20)
    bpy.ops.mesh.primitive_grid_add(
        x_subdivisions=20, y_subdivisions=20, size=4, location=(0, AWAY_M, 0),
        rotation=(math.pi / 2, 0, 0),
    )  # fmt: skip
    with_material(bpy.context.object)
    material = bpy.context.object.data.materials[0]
    material.displacement_method = method
    shift = material.node_tree.nodes.new("ShaderNodeDisplacement")
    for name, value in (("Height", 1.5), ("Midlevel", 0.0), ("Scale", 1.0)):
        shift.inputs[name].default_value = value
    output = material.node_tree.get_output_node("CYCLES")
    material.node_tree.links.new(shift.outputs[0], output.inputs["Displacement"])
    truth, nearest, found = measured(tmp_path)
    displaced = method != "BUMP"
    ((name, item),) = truth.items()
    assert nearest[name] == pytest.approx(AWAY_M - 1.5 * displaced, abs=0.01)
    assert item.nearest_range_m == (None if displaced else pytest.approx(AWAY_M, rel=1e-6))
    assert ("displaced-by-shader" in found) == displaced
    if displaced:
        assert found["displaced-by-shader"].subjects == (name,)


@pytest.mark.parametrize("shift_m", [(0.0, 0.0, 0.0), (3.0, -7.0, 2.0)])
def test_centre_and_rate_do_not_depend_on_the_origin(
    shift_m: tuple[float, float, float], tmp_path: Path
) -> None:
    """A cube whose origin is elsewhere, maybe at the radar, recedes with 6 m/s."""
    rs.new_scene()
    ph.field_of_view(40)
    item = cube()
    item.data.transform(Matrix.Translation((0, AWAY_M, 0)) @ Matrix.Translation(shift_m).inverted())
    item.location = shift_m
    rs.move_steadily(item, (0.0, 6.0, 0.0))
    bpy.context.scene.frame_set(1)
    truth, _, _ = measured(tmp_path, snapshots=2, width_px=16, height_px=16)
    (record,) = truth.values()
    assert record.centre_range_m == pytest.approx(AWAY_M, rel=1e-6)
    assert record.range_rate_mps == pytest.approx(6.0, rel=1e-3)


def test_place_velocity_and_direction_of_an_object(tmp_path: Path) -> None:
    """From a radar at (1, 2, 3) that looks along +X with its top to the side, in centimetres."""
    rs.new_scene()
    bpy.context.scene.unit_settings.scale_length = 0.01
    away_m, azimuth, elevation = 20.0, math.radians(12.0), math.radians(-7.0)
    forward, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    right = np.cross(forward, up)
    unit = math.cos(elevation) * (math.cos(azimuth) * forward + math.sin(azimuth) * right)
    place_m = np.array([1.0, 2.0, 3.0]) + away_m * (unit + math.sin(elevation) * up)
    rig = bpy.data.objects["Radar"]
    rig.location = (100.0, 200.0, 300.0)
    rig.rotation_euler = Matrix(np.column_stack([right, up, -forward]).tolist()).to_euler()
    bpy.ops.mesh.primitive_cube_add(size=100, location=(100 * place_m).tolist())
    rs.move_steadily(with_material(bpy.context.object), (300.0, -400.0, 50.0))
    bpy.context.scene.frame_set(1)
    ph.field_of_view(60)
    truth, _, _ = measured(tmp_path, snapshots=2, width_px=16, height_px=16)
    (record,) = truth.values()
    assert record.centre_m == pytest.approx(place_m.tolist(), abs=1e-5)
    assert record.velocity_mps == pytest.approx([3.0, -4.0, 0.5], rel=1e-3)
    angles = record.azimuth_deg, record.elevation_deg
    assert angles == pytest.approx((12.0, -7.0), abs=1e-4)
    assert record.range_rate_mps == pytest.approx(
        float((place_m - [1.0, 2.0, 3.0]) @ [3.0, -4.0, 0.5]) / away_m, rel=1e-3
    )


def restrict(name: str) -> Callable[[Any], None]:
    def set_object(item: Any) -> None:
        setattr(item, name, not getattr(item, name))

    return set_object


def restrict_collection(name: str) -> Callable[[Any], None]:
    def set_collection(item: Any) -> None:
        collection = bpy.data.collections.new("Set")
        bpy.context.scene.collection.children.link(collection)
        bpy.context.scene.collection.objects.unlink(item)
        collection.objects.link(item)
        setattr(bpy.context.view_layer.layer_collection.children["Set"], name, True)

    return set_collection


UNSEEN = {
    "camera": restrict("visible_camera"),
    "holdout": restrict("is_holdout"),
    "shadow catcher": restrict("is_shadow_catcher"),
    "collection holdout": restrict_collection("holdout"),
    "collection indirect only": restrict_collection("indirect_only"),
}
PASSED = {kind: restrict(f"visible_{kind}") for kind in ("shadow", "diffuse", "glossy")}


@pytest.mark.parametrize("kind", [*UNSEEN, *PASSED, "nothing"])
def test_objects_that_rays_do_not_meet_are_named(kind: str, tmp_path: Path) -> None:
    rs.new_scene()
    ph.field_of_view(40)
    item = cube()
    rs.add_plate(30.0, 9.0).name = "Back"
    ({**UNSEEN, **PASSED}.get(kind) or (lambda _: None))(item)
    truth, nearest, found = measured(tmp_path, width_px=32, height_px=32)
    codes = {"hidden-from-receiver": kind in UNSEEN, "rays-pass-through": kind in PASSED}
    for code, expected in codes.items():
        assert (code in found) == expected
        if expected:
            assert found[code].subjects == (item.name,)
            assert found[code].severity == "caution"
    assert set(truth) == {item.name, "Back"}
    assert (item.name in nearest) == (kind not in UNSEEN)


def test_members_of_an_instance_follow_its_visibility(tmp_path: Path) -> None:
    rs.new_scene()
    ph.field_of_view(40)
    item = cube()
    rs.instance_of(item, name="Shown").visible_camera = False
    rs.add_plate(30.0, 9.0)
    _, nearest, found = measured(tmp_path, width_px=32, height_px=32)
    assert found["hidden-from-receiver"].subjects == ("Shown",)
    assert item.name not in nearest
    assert np.isfinite(list(nearest.values())).all()


def test_pixels_are_of_objects_ahead_and_within_the_frame() -> None:
    """Boxes at all sides, also where one ahead would be if it were mirrored in the receiver."""
    rs.new_scene()
    places = {
        "Ahead": (0, 10, 0), "Behind": (0, -10, 0), "Right": (4, 10, 0), "Beyond": (6, 10, 0),
        "Left behind": (-4, -10, 1), "Above": (0, 10, 2), "Higher": (0, 10, 4),
    }  # fmt: skip
    for name, place in places.items():
        bpy.ops.mesh.primitive_cube_add(size=0.2, location=place)
        bpy.context.object.name = name
    bpy.context.view_layer.update()
    boxes = echoing_boxes(evaluated_snapshot(bpy.context.view_layer), any_material=True)
    matrix = np.array(bpy.context.scene.camera.matrix_world, dtype=np.float64)
    sizes = rs.finished(measure_pixel_spans(boxes, matrix, (-0.5, 0.5, -0.3, 0.3), 1.0)).sizes
    assert set(sizes) == {"Ahead", "Right", "Above"}
    assert sizes["Ahead"] == pytest.approx(0.2 * math.sqrt(3) / 10)


def test_pixels_on_the_ground_are_long_in_metres() -> None:
    """2 units of half a metre above it: range times the tangent of the angle to the normal."""
    rs.new_scene()
    bpy.ops.mesh.primitive_plane_add(size=60.0, location=(0, 40, -2))
    bpy.context.object.name = "Ground"
    bpy.context.view_layer.update()
    boxes = echoing_boxes(evaluated_snapshot(bpy.context.view_layer), any_material=True)
    matrix = np.array(bpy.context.scene.camera.matrix_world, dtype=np.float64)
    found = rs.finished(measure_pixel_spans(boxes, matrix, (-0.5, 0.5, -0.3, 0.3), 0.5))
    range_m, span_m = found.surfaces["Ground"]
    along_m = range_m * np.sqrt(range_m**2 - 1)
    # a step across the image turns by its cosine, of 0.864 in the corners
    assert np.all(span_m <= along_m * (1 + 1e-9)) and np.all(span_m >= 0.86 * along_m)


def test_a_part_names_the_surface_or_armature_that_it_is_parented_to(tmp_path: Path) -> None:
    """Empties join nothing, clutter has no parts, and instances are counted as they were."""
    rs.new_scene()
    armature = bpy.data.objects.new("Walker", bpy.data.armatures.new("Bones"))
    axle, fleet, slot = (bpy.data.objects.new(name, None) for name in ("Axle", "Fleet", "Slot"))
    for item in (armature, axle, fleet, slot):
        bpy.context.scene.collection.objects.link(item)
    parents = {
        "Ground": None, "Car": "Ground", "Hub": "Car", "Axle": "Car", "Wheel": "Hub",
        "Tyre": "Axle", "Taxi": "Fleet", "Bus": "Fleet", "Arm": "Walker", "Hand": "Arm",
        "Slot": "Car",
    }  # fmt: skip
    for number, name in enumerate(parents):
        if name not in bpy.data.objects:
            rs.add_plate(10.0 + number, 1.0).name = name
    ground = bpy.data.objects["Ground"]
    made = radarsim.material("itu_medium_dry_ground")
    radarsim.set_clutter(made, "constant_gamma", gamma_db=-12.0)
    ground.data.materials.clear()
    ground.data.materials.append(made)
    rs.instance_of(rs.add_plate(40.0, 1.0), name="Shown").parent = bpy.data.objects["Car"]
    for name, parent in parents.items():
        if parent is not None:
            bpy.data.objects[name].parent = bpy.data.objects[parent]
    truth, _, _ = measured(tmp_path, width_px=16, height_px=16)
    wholes = {name: item.part_of for name, item in truth.items()}
    assert wholes == {
        "Ground": "", "Car": "", "Hub": "Car", "Wheel": "Car", "Tyre": "Car", "Taxi": "",
        "Bus": "", "Arm": "Walker", "Hand": "Walker", "Shown/Plate": "",
    }  # fmt: skip
