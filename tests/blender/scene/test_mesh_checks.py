# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that would make the count of volumes wrong are found, by name; sound ones are not."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender.materials import set_layer_normals
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.scene import check_meshes
from radarsim_addon.blender.state import SettingsRestorer, evaluated_snapshot
from radarsim_addon.findings import Finding
from tests.blender import render_helpers as rh
from tests.blender.slab_scene import physical_material

pytestmark = [pytest.mark.blender, pytest.mark.slow]


@pytest.fixture(autouse=True)
def empty_file() -> None:
    rh.new_scene()


def box(low: tuple[float, ...], high: tuple[float, ...], name: str, **inputs: Any) -> Any:
    item = rh.add_box(low, high, physical_material(2.0, 0.1, **inputs))
    item.name = name
    return item


def findings() -> list[Finding]:
    bpy.context.view_layer.update()
    return check_meshes(evaluated_snapshot(bpy.context.view_layer))


def edit(item: Any, faces: list[int] | None = None, flip: list[int] | None = None) -> None:
    """Remove or turn around faces of a mesh."""
    kept = []
    for number, face in enumerate(item.data.polygons):
        corners = list(face.vertices)
        if flip is not None and number in flip:
            corners.reverse()
        if faces is None or number not in faces:
            kept.append(corners)
    points = [tuple(v.co) for v in item.data.vertices]
    material = item.data.materials[0]
    mesh = bpy.data.meshes.new("edited")
    mesh.from_pydata(points, [], kept)
    mesh.materials.append(material)
    item.data = mesh


def test_what_is_no_layer_is_named() -> None:
    """Its absorption does not follow the angle; a wall's does, and so does what the user sets."""
    box((0, 0, 0), (4, 0.2, 3), "Wall")
    box((0, 5, 0), (4, 9, 3), "Thick")
    box((9, 5, 0), (13, 9, 3), "Told")[attributes.OBJECT_LAYER_NORMAL] = [0.0, 1.0, 0.0]
    bpy.context.view_layer.update()
    recorder = SettingsRestorer()
    (found,) = set_layer_normals(recorder, evaluated_snapshot(bpy.context.view_layer))
    assert (found.code, found.subjects) == ("not-a-layer", ("Thick",))
    assert found.numbers["least_fraction"] == 0.6
    wall = bpy.data.objects["Wall"]
    assert attributes.OBJECT_LAYER_NORMAL in wall
    assert wall[attributes.OBJECT_LAYER_THICKNESS] == pytest.approx(0.2, rel=1e-6)
    # The normal was told, the thickness measured.
    assert bpy.data.objects["Told"][attributes.OBJECT_LAYER_THICKNESS] == pytest.approx(4.0)
    assert recorder.restore() == []
    assert attributes.OBJECT_LAYER_NORMAL not in wall
    assert attributes.OBJECT_LAYER_THICKNESS not in wall
    assert attributes.OBJECT_LAYER_THICKNESS not in bpy.data.objects["Told"]


def test_two_plates_in_one_object_have_no_thickness() -> None:
    """Four parallel faces: a ray that is shorter than their extent may come from outside."""
    first, second = box((0, 0, 0), (4, 0.2, 3), "Two"), box((0, 1, 0), (4, 1.3, 3), "Other")
    with bpy.context.temp_override(
        active_object=first,
        selected_objects=[first, second],
        selected_editable_objects=[first, second],
    ):
        bpy.ops.object.join()
    bpy.context.view_layer.update()
    recorder = SettingsRestorer()
    assert set_layer_normals(recorder, evaluated_snapshot(bpy.context.view_layer)) == []
    assert attributes.OBJECT_LAYER_NORMAL in first
    assert attributes.OBJECT_LAYER_THICKNESS not in first
    recorder.restore()


def test_sound_scene_is_silent() -> None:
    box((0, 0, 0), (1, 1, 1), "A")
    box((1.00002, 0, 0), (2, 1, 1), "Next to A, with a gap")
    box((0.2, 0.2, 0.2), (0.8, 0.8, 0.8), "Inside A")
    box((0.5, 0.5, 0.5), (1.5, 1.5, 1.5), "Across A")
    box((0, 1, 1), (1, 2, 2), "Touches A along an edge")
    mirrored = box((5, 0, 0), (6, 1, 1), "Mirrored")
    mirrored.scale = (-1, 1, 1)
    half = rh.add_plate(9, Matrix.Translation((0, 0, -3)), physical_material(2, 0.1), name="Ground")
    half.rotation_euler = (0, 0, 0)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(9, 9, 9))
    bpy.context.object.data.materials.append(physical_material(2, 0.1))
    assert findings() == []


def test_open_flipped_and_inside_out_are_named() -> None:
    edit(box((0, 0, 0), (1, 1, 1), "Lid off"), faces=[1])
    edit(box((3, 0, 0), (4, 1, 1), "One face turned"), flip=[2])
    edit(box((6, 0, 0), (7, 1, 1), "All turned"), flip=list(range(6)))
    found = findings()
    assert [(item.code, item.subjects) for item in found] == [
        ("mesh-open", ("Lid off",)),
        ("mesh-flipped", ("One face turned",)),
        ("mesh-inside-out", ("All turned",)),
    ]


def test_without_interior_nothing_is_checked() -> None:
    edit(box((0, 0, 0), (1, 1, 1), "Open shell", penetrable=False), faces=[1])
    box((1, 0, 0), (2, 1, 1), "Touching shell", penetrable=False)
    assert findings() == []


@pytest.mark.parametrize("turn_deg", [0.0, 17.0])
def test_touching_boxes_and_box_on_a_plane(turn_deg: float) -> None:
    box((0, 0, 0), (1, 1, 1), "Left")
    box((1, 0.3, 0.2), (2, 1.3, 1.2), "Right")
    rh.add_plate(20, None, rh.lambert(0.5), name="Floor")
    turn = Matrix.Translation((3.3, -1.7, 0.9)) @ Matrix.Rotation(math.radians(turn_deg), 4, "Y")
    for item in bpy.data.objects:
        if item.type == "MESH":
            item.matrix_world = turn @ item.matrix_world
    (found,) = findings()
    assert found.code == "coincident-faces"
    assert found.subjects == ("Floor and Left", "Left and Right")


def prism(corners: np.ndarray, low: float, high: float, name: str) -> Any:
    """A closed mesh over a polygon (n, 2), counter-clockwise, which may be concave."""
    count = len(corners)
    points = [(*corner, z) for z in (low, high) for corner in corners.tolist()]
    sides = [(k, (k + 1) % count, count + (k + 1) % count, count + k) for k in range(count)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], [range(count)[::-1], range(count, 2 * count), *sides])
    mesh.materials.append(physical_material(2.0, 0.1))
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def place(turn_deg: float, size: float, shift: tuple[float, ...], applied: bool = False) -> None:
    """Turn everything about an oblique axis, scale and shift it, in its pose or in its mesh."""
    turn = Matrix.Rotation(math.radians(turn_deg), 4, (0.48, -0.6, 0.64))
    move = Matrix.Translation(shift) @ turn @ Matrix.Scale(size, 4)
    for item in bpy.data.objects:
        if item.type == "MESH" and applied:
            item.data.transform(move)
        elif item.type == "MESH":
            item.matrix_world = move @ item.matrix_world


#: Corners of two boxes, and whether they have a part of a plane in common.
PAIRS = {
    "apart in line": ((0, 0, 0), (4, 0.2, 3), (6, 0, 0), (10, 0.2, 3), False),
    "apart at a corner": ((0, 0, 0), (4, 3, 3), (4.5, 3.5, 0), (8, 6, 3), False),
    "edge to edge": ((0, 0, 0), (1, 1, 1), (0, 1, 1), (1, 2, 2), False),
    "corner to corner": ((0, 0, 0), (1, 1, 1), (1, 1, 1), (2, 2, 2), False),
    "overlapping partly": ((0, 0, 0), (1, 1, 1), (1, 0.7, 0.6), (2, 1.7, 1.6), True),
    "one inside the other": ((0, 0, 0), (5, 5, 1), (2, 2, 1), (3, 3, 2), True),
    "the same face": ((0, 0, 0), (1, 1, 1), (1, 0, 0), (2, 1, 1), True),
    "a narrow strip": ((0, 0, 0), (1, 1, 1), (1, 0.99, 0), (2, 2, 1), True),
    "nested, free": ((0, 0, 0), (5, 5, 5), (1, 1, 1), (2, 2, 2), False),
    "nested, flush": ((0, 0, 0), (5, 5, 5), (1, 1, 0), (2, 2, 2), True),
    "across": ((0, 0, 0), (2, 2, 2), (1, 1, 1), (3, 3, 3), False),
}


@pytest.mark.parametrize("applied", [False, True], ids=["pose", "applied"])
@pytest.mark.parametrize("far_m", [0.0, 1000.0])
@pytest.mark.parametrize("unit_m", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("turn_deg", [0.0, 45.0, 30.0])
def test_pairs_of_boxes(turn_deg: float, unit_m: float, far_m: float, applied: bool) -> None:
    """Boxes of metres, wherever they are and in any unit; pairs are 7 m apart and more."""
    for number, (name, (low, high, second_low, second_high, _)) in enumerate(PAIRS.items()):
        aside = np.array([17.0 * (number % 4), 13.0 * (number // 4), 11.0 * (number % 3)])
        box(tuple(aside + low), tuple(aside + high), f"{name}, A")
        box(tuple(aside + second_low), tuple(aside + second_high), f"{name}, B")
    place(turn_deg, 1 / unit_m, (0.6 * far_m / unit_m, 0.8 * far_m / unit_m, 0), applied)
    (found,) = findings()
    assert found.code == "coincident-faces"
    touching = [name for name, (*_, touches) in PAIRS.items() if touches]
    assert sorted(found.subjects) == sorted(f"{name}, A and {name}, B" for name in touching)


@pytest.mark.parametrize(("gap_m", "touches"), [(0.0, True), (1e-5, True), (1.5e-3, False)])
def test_the_recommended_gap_is_enough(gap_m: float, touches: bool) -> None:
    """In 100 m, float32 has steps of 8e-6 m; the finding names 50 times the tolerance, 1 mm."""
    box((0, 0, 0), (1, 1, 1), "A")
    box((1 + gap_m, 0, 0), (2, 1, 1), "B")
    place(0.0, 1.0, (100.0, 0.0, 0.0))
    found = findings()
    assert [item.code for item in found] == ["coincident-faces"] * touches
    if touches:
        assert found[0].numbers["least_gap"] == pytest.approx(50 * 2e-7 * 102, rel=1e-3)


def test_a_large_ground_far_away_does_not_widen_the_tolerance_of_houses() -> None:
    """The tolerance is that of the two faces, not of the farthest object."""
    box((0, 0, 0), (1, 1, 1), "A")
    box((1.0001, 0, 0), (2, 1, 1), "B")
    box((-9000, -9000, -9), (9000, 9000, -5), "Ground")
    assert findings() == []


def clipped_area(one: np.ndarray, other: np.ndarray) -> float:
    """Area that two counter-clockwise triangles share (Sutherland and Hodgman 1974)."""
    points = [np.array(corner) for corner in one]
    for start, end in zip(other, np.roll(other, -1, axis=0), strict=True):
        along, kept = end - start, []
        sides = [along[0] * (p - start)[1] - along[1] * (p - start)[0] for p in points]
        for k, p in enumerate(points):
            if sides[k - 1] * sides[k] < 0:
                part = sides[k - 1] / (sides[k - 1] - sides[k])
                kept.append(points[k - 1] + part * (p - points[k - 1]))
            if sides[k] >= 0:
                kept.append(p)
        points = kept
    if not points:
        return 0.0
    x, y = np.array(points).T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


@pytest.mark.parametrize("turn_deg", [0.0, 45.0, 77.0])
def test_random_triangles_against_clipping(turn_deg: float) -> None:
    """Prisms below and above a plane: those coincide whose triangles share an area."""
    rng, expected = np.random.default_rng(5), []
    for number in range(120):
        corners = rng.uniform(-1, 1, (2, 3, 2))
        for own in corners:
            (a, b), (c, d) = own[1] - own[0], own[2] - own[0]
            own[:] = own if a * d - b * c > 0 else own[::-1]
        area = clipped_area(*corners)
        if 0 < area < 1e-3:
            continue
        corners += np.array([number % 11, number // 11]) * 3.0
        prism(corners[0], -1, 0, f"Low {number}")
        prism(corners[1], 0, 1, f"High {number}")
        expected += [f"High {number} and Low {number}"] if area else []
    assert 40 < len(expected) < 80
    place(turn_deg, 1.0, (3.0, -2.0, 1.0))
    (found,) = findings()
    assert list(found.subjects) == sorted(expected)


@pytest.mark.parametrize("turn_deg", [0.0, 45.0])
@pytest.mark.parametrize(("corner", "touches"), [(2.0, False), (0.9, True)])
def test_in_the_notch_of_a_concave_face(turn_deg: float, corner: float, touches: bool) -> None:
    """The box of an L has a corner that is not part of it."""
    outline = np.array([(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)], dtype=float)
    prism(outline, 0, 1, "L")
    box((corner, corner, 1), (3, 3, 2), "Box")
    place(turn_deg, 1.0, (0.0, 0.0, 0.0))
    assert [item.code for item in findings()] == ["coincident-faces"] * touches


@pytest.mark.parametrize("turn_deg", [0.0, 45.0, 17.0])
def test_sixteen_houses(turn_deg: float) -> None:
    """Walls in one plane, 2 m and 4 m apart: 24 false pairs at 45 degrees with boxes of faces."""
    for number in range(16):
        x, y = 12 * (number % 4), 12 * (number // 4)
        box((x, y, 0), (x + 10, y + 8, 6), f"House {number}")
    turn = Matrix.Rotation(math.radians(turn_deg), 4, "Z")
    for item in bpy.data.objects:
        if item.type == "MESH":
            item.matrix_world = turn @ item.matrix_world
    assert findings() == []
    rh.add_plate(200, None, rh.lambert(0.5), name="Street")
    (found,) = findings()
    assert sorted(found.subjects) == sorted(f"House {n} and Street" for n in range(16))


@pytest.mark.parametrize("turn_deg", [0.0, 45.0])
def test_instances_that_touch(turn_deg: float) -> None:
    """Of three instances in a row the first two touch; a fourth has a gap of 2 m."""
    cube = box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), "Cube")
    mesh = bpy.data.meshes.new("Places")
    mesh.from_pydata([(10, 0, 0), (11, 0.3, 0), (14, 0, 0), (17, 0, 0)], [], [])
    places = bpy.data.objects.new("Places", mesh)
    bpy.context.scene.collection.objects.link(places)
    places.instance_type, cube.parent = "VERTS", places
    places.rotation_euler = (0.0, math.radians(turn_deg), 0.0)
    (found,) = findings()
    assert found.subjects == ("Cube (instance) and Cube (instance)",)
    mesh.vertices[1].co = (12, 0.3, 0)
    mesh.update()
    assert findings() == []


def grid(side: int, low: tuple[float, float], name: str, z: float = 0.0) -> Any:
    """A flat mesh of side x side quads of 1 m."""
    x, y = np.meshgrid(np.arange(side + 1), np.arange(side + 1))
    points = np.column_stack([x.ravel() + low[0], y.ravel() + low[1], np.full(x.size, z)])
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    quads = np.column_stack([corner, corner + 1, corner + side + 2, corner + side + 1])
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], quads.tolist())
    mesh.materials.append(physical_material(2.0, 0.1))
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.mark.parametrize(("shift", "touches"), [(0.5, True), (100.0, False)])
def test_many_faces_in_one_plane(shift: float, touches: bool) -> None:
    """Two floors of 10 000 faces each, one on the other or edge to edge."""
    grid(100, (0.0, 0.0), "Floor")
    grid(100, (shift, 0.25), "Carpet")
    place(45.0, 1.0, (0.0, 0.0, 0.0))
    bpy.context.view_layer.update()
    found = check_meshes(evaluated_snapshot(bpy.context.view_layer))
    assert [item.code for item in found] == ["coincident-faces"] * touches


def test_a_thousand_boxes_in_one_plane() -> None:
    """Boxes far apart in a plane are not compared with one another: all pairs would take 50 s."""
    material = physical_material(2.0, 0.1)
    for number in range(1000):
        x, y = 3 * (number % 32), 3 * (number // 32)
        rh.add_box((x, y, 0), (x + 1, y + 1, 1), material).name = f"Box {number}"
    box((1, 0.5, 0), (2, 1.5, 1), "Touching")
    (found,) = findings()
    assert found.subjects == ("Box 0 and Touching",)


def test_more_than_31_nested() -> None:
    for number in range(31):
        r = 1 + number * 0.1
        box((-r, -r, -r), (r, r, r), f"Shell {number}")
    assert findings() == []
    box((-9, -9, -9), (9, 9, 9), "One too many")
    (found,) = findings()
    assert found.code == "interiors-nested-too-deep"
    assert found.numbers == {"count": 32, "limit": 31}


def test_thirty_thousand_instances() -> None:
    """In one plane each; Cycles would take 2 s before the first pixel."""
    cube = box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1), "Cube", penetrable=False)
    grid = np.stack(np.meshgrid(np.arange(1, 181), np.arange(180), [0]), axis=-1).reshape(-1, 3)
    mesh = bpy.data.meshes.new("Places")
    mesh.vertices.add(len(grid))
    mesh.vertices.foreach_set("co", (grid * 0.5).astype(np.float32).ravel())
    places = bpy.data.objects.new("Places", mesh)
    bpy.context.scene.collection.objects.link(places)
    places.instance_type, cube.parent = "VERTS", places
    assert findings() == []
    cube.data.materials[0] = physical_material(2.0, 0.1)
    (found,) = findings()
    assert found.code == "many-interiors"
    assert found.numbers["count"] == found.numbers["total"] == 180**2
