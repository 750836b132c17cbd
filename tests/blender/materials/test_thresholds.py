# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits are crossed: just below and just above."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")


from radarsim_addon.blender.materials import (
    convex_objects,
    interiors,
    layers,
    make_physical_material,
    read_surface,
    scattered_lobe,
    total_reflection,
)
from radarsim_addon.blender.materials.physical_materials import suggest_material
from radarsim_addon.blender.nodes import attributes, make_material
from radarsim_addon.blender.nodes.physical_material import table_angles_rad
from radarsim_addon.blender.state import SettingsRestorer, evaluated_snapshot
from radarsim_addon.signal.scene import RayMesh, walls
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.render_helpers import add_box
from tests.blender.slab_scene import physical_material, walls_of

pytestmark = pytest.mark.blender


def updated() -> Any:
    bpy.context.view_layer.update()
    return evaluated_snapshot(bpy.context.view_layer)


def two_walls(
    turn_rad: float = 0.0, thinner: float = 0.0, share: float = 1.0, part: float = 0.5
) -> Any:
    """Two faces, one of them (a part of the area) turned, and thinner by a fraction."""
    normals = np.array([(0, 0, 1), (0, math.sin(turn_rad), math.cos(turn_rad))])
    thickness = np.array([1.0, 1.0 - thinner])
    both = np.ones(2, dtype=bool)
    return walls.WallFaces(both, normals, np.array([1 - part, part]), thickness, share)


def across(turn_rad: float) -> bool:
    return two_walls(turn_rad).across(np.array([0.0, 0.0, 1.0])) > 0


def differ(thinner: float) -> bool:
    return two_walls(thinner=thinner).one_thickness is None


def three_planes(height: float) -> bool:
    heights = np.array([0.0, height, 1.0])[:, None] * [0, 0, 1]
    normals, of = np.tile([0.0, 0.0, 1.0], (3, 1)), np.zeros(3, dtype=int)
    faces = walls.LayerFaces(of, normals, np.ones(3), heights, np.eye(3)[None])
    return bool(np.isnan(faces.planes(normals[:1], 0.9)[0][0]))


def layered(share: float) -> bool:
    areas, of = np.array([share, 1 - share]), np.zeros(2, dtype=int)
    return not np.isnan(walls.layer_normals(np.eye(3)[:2], areas, of, 1)).any()


def dented(depth: float) -> bool:
    """A cube of side 1 of which one corner is pushed in, along an edge."""
    points = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    points[4, 2] -= depth
    quads = [(4, 5, 7, 6), (0, 2, 3, 1), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    corners = [part for a, b, c, d in quads for part in ((a, b, c), (a, c, d))]
    made = np.array(corners, dtype=np.int32)[None]
    return not walls._stacked(("Cube",), points[None], made, np.eye(4)[None]).items


def many_triangles(count: float) -> bool:
    bpy.ops.mesh.primitive_cone_add(vertices=round(count / 2) + 1, end_fill_type="NGON")
    bpy.context.object.data.materials.append(physical_material(1.5, 0.0))
    return not convex_objects(updated())


def folded(fold_deg: float) -> bool:
    """Two strips that are 1 wide and 0.25 thick: only together they are wide enough for walls."""
    half = math.radians(fold_deg / 2)
    line = [(x * math.cos(half), -abs(x) * math.sin(half)) for x in (-1, 0, 1)]
    outline = [*line, *((x, y - 0.25) for x, y in reversed(line))]
    points = [(x, y, z) for z in (0, 10) for x, y in outline]
    sides = [(i, i + 6, (i + 1) % 6 + 6, (i + 1) % 6) for i in range(6)]
    ends = [(0, 1, 4, 5), (1, 2, 3, 4), (11, 10, 7, 6), (10, 9, 8, 7)]
    mesh = bpy.data.meshes.new("Folded")
    mesh.from_pydata(points, [], sides + ends)
    item = bpy.data.objects.new("Folded", mesh)
    bpy.context.scene.collection.objects.link(item)
    found = walls_of(item, updated())
    assert found is not None
    return not found.wall.any()


def shell_beyond(loss_db: float) -> str | None:
    """Severity of what is said about an object whose faces absorb."""
    item = rs.add_plate(10.0, preset=None)
    item[attributes.OBJECT_SHELL_THICKNESS] = 0.1
    said = layers.beyond_float32({item.name_full: loss_db})
    return said[0].severity if said else None


def lost_in_faces(loss_db: float) -> bool:
    return shell_beyond(loss_db) is not None


def nothing_behind_it(loss_db: float) -> bool:
    return shell_beyond(loss_db) != shell_beyond(120.0)


def is_shell(found: Any, normal: Any = None) -> bool:
    item = rs.add_plate(10.0, preset=None)
    layers._set_what_is_found(SettingsRestorer(), item, np.eye(3), normal, found)
    return attributes.OBJECT_SHELL_THICKNESS in item


def pane_is_single(depth_m: float, other_m2: float = 0.0) -> bool:
    """A pane of 10 mm on a box of 1 m^2 and a depth; and a face that is open behind."""
    glass = make_physical_material(
        "Pane", "index", carrier_hz=5.3e9, n=2.5, k=0.0, sheet_thickness_m=0.01
    )
    item = add_box((0, 10, 0), (1, 10 + depth_m, 1), glass)
    if other_m2:
        side = math.sqrt(other_m2)
        square = [(5, 20, 0), (5 + side, 20, 0), (5 + side, 20, side), (5, 20, side)]
        other = ph.quad("Other", square, glass)
        with bpy.context.temp_override(active_object=item, selected_editable_objects=[item, other]):
            bpy.ops.object.join()
    return not layers.doubled_panes(updated(), 1.0)


def antenna_inside(index: float) -> bool:
    add_box((-1, -1, -1), (1, 1, 1), physical_material(index, 0.0))
    return bool(interiors.found_inside(updated(), [np.zeros(3)]))


def rim_echoes(depth_m: float) -> bool:
    """Of a rough wall of 1 m^2: the rim is 2 depths of (1 m + 2 depths)."""
    item = add_box((0, 0, 0), (1, depth_m, 1), physical_material(1.5, 0.0, 0.5))
    item[attributes.OBJECT_LAYER_NORMAL] = [0.0, 1.0, 0.0]
    return bool(interiors._echoes_from_its_rim(item, updated()))


def not_flat(thickness: float) -> bool:
    return not interiors._is_flat(SimpleNamespace(dimensions=(2.0, 2.0 * thickness, 1.0)))


def simple_is_rough(roughness: float) -> bool:
    material = make_material("Simple", 3.0, 0.0, specularity=1.0, roughness=roughness)
    return not read_surface(material).is_mirror_like


def physical_is_rough(roughness: float) -> bool:
    return not read_surface(physical_material(3.0, 0.0, roughness)).is_mirror_like


def is_metal(index: float) -> bool:
    material = make_material("Simple", index, 0.0, specularity=1.0, roughness=0.5)
    return read_surface(material).reciprocal_lobe > 0


def has_glints(colour: float, metallic: float) -> bool:
    material = bpy.data.materials.new("Foreign")
    material.use_nodes = True
    shader = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (colour, colour, colour, 1.0)
    shader.inputs["Metallic"].default_value = metallic
    shader.inputs["Roughness"].default_value = 0.5
    return read_surface(material).glint_slope > 0


def is_rendered(albedo: float) -> bool:
    """Of clutter: Cycles drops 1e-5 of the mean channel, a third of the largest one."""
    db = 10 * np.log10(albedo * 4 * np.sin(table_angles_rad()) ** 2)
    model: Any = SimpleNamespace(
        is_valid=lambda _hz, grazing: np.ones(np.shape(grazing), dtype=bool),
        band_hz=(1e9, 2e9),
        grazing_rad=(0.0, 1.0),
    )
    return not scattered_lobe._limits_of(SimpleNamespace(name="Weak"), model, 1e9, db)


def is_corner(turn_deg: float) -> bool:
    """A ray leaves, unbent, by a face that is turned against the one where it entered."""
    slope = math.tan(math.radians(turn_deg))
    points = [(x, y, -1 - slope * x) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    rays = RayMesh(np.array(points), np.array([(0, 1, 2), (0, 2, 3)]))
    body = total_reflection._Body(1.0, 0.0, np.full(3, np.nan), 1.0)
    up = np.array([[0.0, 0.0, 1.0]])
    begin = np.array([[0.01, 0.02, 0.0]])
    return bool(total_reflection._cut(body, -up, np.ones(1), up, begin, rays)[0] > 0)


UPRIGHT = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("decide", "below", "above"),
    [
        (across, 0.015, 0.025),
        (differ, 0.018, 0.022),
        (three_planes, 0.8e-3, 1.2e-3),
        (layered, 0.58, 0.62),
        (dented, 0.7e-6, 1.4e-6),
        (many_triangles, 64, 66),
        (folded, 20.0, 35.0),
        (lost_in_faces, 95.0, 105.0),
        (nothing_behind_it, 345.0, 355.0),
        (lambda share: is_shell(two_walls(share=share)), 0.72, 0.78),
        (lambda part: is_shell(two_walls(0.5, part=part), UPRIGHT), 0.008, 0.012),
        (pane_is_single, 0.09, 0.11),
        (lambda other_m2: pane_is_single(0.01, other_m2), 16.0, 20.0),
        (antenna_inside, 1.002, 1.003),
        (rim_echoes, 0.004, 0.006),
        (not_flat, 0.7e-6, 1.4e-6),
        (simple_is_rough, 0.0035, 0.004),
        (physical_is_rough, 0.008, 0.012),
        (is_metal, 900.0, 1100.0),
        (lambda colour: not has_glints(colour, 0.0), 0.15, 0.25),
        (lambda metallic: has_glints(0.8, metallic), 0.15, 0.25),
        (is_rendered, 2e-5, 4e-5),
        (is_corner, 35.0, 45.0),
    ],
)
def test_limits(decide: Callable[[float], bool], below: float, above: float) -> None:
    decided = []
    for value in (below, above):
        rs.new_scene()
        decided.append(decide(value))
    assert decided == [False, True]


def test_words_of_five_letters_begin_longer_ones() -> None:
    assert suggest_material("Lakeside") is None
    assert suggest_material("Watery") == "Fresh water"
