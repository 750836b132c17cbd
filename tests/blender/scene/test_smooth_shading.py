# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth shading across sharp edges is named; on round bodies, and with auto smooth, it is not."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.scene import check_normals, sharpen_walls
from radarsim_addon.blender.state import SettingsRestorer, evaluated_snapshot
from tests.blender.slab_scene import physical_material

pytestmark = pytest.mark.blender


def smooth(item: Any) -> Any:
    item.data.polygons.foreach_set("use_smooth", [True] * len(item.data.polygons))
    return item


def named() -> tuple[str, ...]:
    bpy.context.view_layer.update()
    found = check_normals(evaluated_snapshot(bpy.context.view_layer))
    assert [item.code for item in found] in ([], ["smooth-across-edges"])
    return found[0].subjects if found else ()


def test_what_is_bent_is_named(empty_scene: Any) -> None:
    bpy.ops.mesh.primitive_cube_add()
    box = smooth(bpy.context.object)
    assert named() == (box.name,)
    box.hide_render = True
    assert named() == ()
    box.hide_render = False
    bevel = box.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments, bevel.harden_normals = 0.1, 3, True
    assert named() == ()
    box.modifiers.clear()
    box.data.polygons.foreach_set("use_smooth", [False] * 6)
    assert named() == ()


def test_the_largest_fraction_is_said(empty_scene: Any) -> None:
    """Of a cube all, of one with a plane of the same area apart from it the half."""
    bpy.ops.mesh.primitive_plane_add(size=math.sqrt(24), location=(0, 0, 9))
    bpy.ops.mesh.primitive_cube_add(size=2)
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.join()
    smooth(bpy.context.object)
    bpy.context.view_layer.update()
    for whole, expected in ((False, 0.5), (True, 1.0)):
        if whole:
            bpy.ops.mesh.primitive_cube_add(location=(9, 0, 0))
            smooth(bpy.context.object)
            bpy.context.view_layer.update()
        (found,) = check_normals(evaluated_snapshot(bpy.context.view_layer))
        assert len(found.subjects) == 1 + whole
        assert found.numbers["fraction"] == pytest.approx(expected)


def test_round_bodies_are_as_they_should_be(empty_scene: Any) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    smooth(bpy.context.object)
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    smooth(bpy.context.object)
    bpy.ops.mesh.primitive_torus_add(major_segments=16, minor_segments=10)
    smooth(bpy.context.object)
    bpy.ops.mesh.primitive_grid_add()
    for vertex in bpy.context.object.data.vertices:
        vertex.co.z = 0.1 * math.sin(7 * vertex.co.x)
    smooth(bpy.context.object)
    assert named() == ()
    bpy.ops.mesh.primitive_cylinder_add()
    assert named() == ()
    cylinder = smooth(bpy.context.object)  # its caps bend the normals of its side
    assert named() == (cylinder.name,)


def test_walls_get_sharp_edges_and_stay_round(empty_scene: Any) -> None:
    """A box is as if shaded flat; a tank of 16 segments keeps its round side, without its rims."""
    wall = physical_material(2.3, 0.01)
    bpy.ops.mesh.primitive_cube_add()
    box = smooth(bpy.context.object)
    box[attributes.OBJECT_LAYER_NORMAL] = (0.0, 1.0, 0.0)
    bpy.ops.mesh.primitive_cylinder_add(vertices=16, end_fill_type="NOTHING", depth=1)
    tank = smooth(bpy.context.object)
    tank.modifiers.new("Wall", "SOLIDIFY").thickness = 0.05
    tank[attributes.OBJECT_SHELL_THICKNESS] = 0.05
    for item in (box, tank):
        item.data.materials.append(wall)
    assert named() == (box.name, tank.name)
    before, recorder = list(bpy.data.node_groups), SettingsRestorer()
    sharpen_walls(recorder, evaluated_snapshot(bpy.context.view_layer))
    assert named() == ()
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    mesh = snapshot.evaluated(tank).data
    for polygon in mesh.polygons:
        for index in polygon.loop_indices:
            normal, corner = mesh.corner_normals[index].vector, mesh.loops[index].vertex_index
            radial = mesh.vertices[corner].co.xy.normalized()
            if abs(polygon.normal.z) < 0.5:  # the round side: from the axis, or to it
                assert abs(normal.xy.dot(radial)) == pytest.approx(1, abs=1e-3)
            else:
                assert abs(normal.z) == pytest.approx(1, abs=1e-6)
    assert recorder.restore() == []
    assert not box.modifiers and len(tank.modifiers) == 1
    assert list(bpy.data.node_groups) == before
    assert named() == (box.name, tank.name)


@pytest.mark.parametrize("shared", [False, True])
def test_linked_walls_get_sharp_edges_in_memory(
    empty_scene: Any, tmp_path: Path, shared: bool
) -> None:
    """Unless another object, which is no wall, has the same mesh."""
    bpy.ops.mesh.primitive_cube_add()
    box = smooth(bpy.context.object)
    box.name = "Box"
    box[attributes.OBJECT_LAYER_NORMAL] = (0.0, 1.0, 0.0)
    box.data.materials.append(physical_material(2.3, 0.01))
    library = str(tmp_path / "walls.blend")
    bpy.data.libraries.write(library, {box})
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(library, link=True) as (_, target):
        target.objects = ["Box"]
    (linked,) = target.objects
    bpy.context.scene.collection.objects.link(linked)
    if shared:
        bpy.context.scene.collection.objects.link(bpy.data.objects.new("Plain", linked.data))
    before = named()
    recorder = SettingsRestorer()
    sharpen_walls(recorder, evaluated_snapshot(bpy.context.view_layer))
    assert named() == (before if shared else ())
    assert recorder.restore() == []
    assert named() == before and "Box" in before[0]
    assert "sharp_edge" not in linked.data.attributes
