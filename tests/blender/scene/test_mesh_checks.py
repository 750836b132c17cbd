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
from radarsim_addon.blender.state import SettingsRestorer
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
    return check_meshes(bpy.context.evaluated_depsgraph_get())


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
    (found,) = set_layer_normals(recorder, bpy.context.evaluated_depsgraph_get())
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
    assert set_layer_normals(recorder, bpy.context.evaluated_depsgraph_get()) == []
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


def test_a_thousand_boxes_in_one_plane() -> None:
    """Boxes far apart in a plane are not compared with one another: all pairs would take 50 s."""
    for number in range(1000):
        x, y = 3 * (number % 32), 3 * (number // 32)
        box((x, y, 0), (x + 1, y + 1, 1), f"Box {number}")
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


@pytest.mark.parametrize(("penetrable", "codes"), [(True, ["many-interiors"]), (False, [])])
def test_thirty_thousand_instances(penetrable: bool, codes: list[str]) -> None:
    """In one plane each; Cycles would take 2 s before the first pixel."""
    cube = box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1), "Cube", penetrable=penetrable)
    grid = np.stack(np.meshgrid(np.arange(1, 181), np.arange(180), [0]), axis=-1).reshape(-1, 3)
    mesh = bpy.data.meshes.new("Places")
    mesh.vertices.add(len(grid))
    mesh.vertices.foreach_set("co", (grid * 0.5).astype(np.float32).ravel())
    places = bpy.data.objects.new("Places", mesh)
    bpy.context.scene.collection.objects.link(places)
    places.instance_type, cube.parent = "VERTS", places
    found = findings()
    assert [item.code for item in found] == codes
    if codes:
        assert found[0].numbers["count"] == found[0].numbers["total"] == 180**2 + 1
