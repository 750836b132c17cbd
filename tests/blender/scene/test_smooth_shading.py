# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth shading across sharp edges is named; on round bodies, and with auto smooth, it is not."""

from __future__ import annotations

import math
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.scene import check_normals

pytestmark = pytest.mark.blender


def smooth(item: Any) -> Any:
    item.data.polygons.foreach_set("use_smooth", [True] * len(item.data.polygons))
    return item


def named() -> tuple[str, ...]:
    bpy.context.view_layer.update()
    found = check_normals(bpy.context.evaluated_depsgraph_get())
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
