# SPDX-License-Identifier: GPL-3.0-or-later
"""Waves that meet a face from inside beyond the critical angle are named, with their fraction."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.materials import (
    convex_objects,
    interior_losses_db,
    layers,
    total_reflection,
    total_reflections,
)
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.state import evaluated_snapshot
from radarsim_addon.findings import finding_about
from radarsim_addon.signal.scene import RayMesh, walls
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.slab_scene import physical_material, walls_of

pytestmark = pytest.mark.blender
WAVELENGTH = 0.03


def prism(apex_deg: float, index: float) -> Any:
    """A wedge 20 m ahead: its front is upright and square to the ray, its back leans."""
    rs.new_scene()
    depth = 2.0 * math.tan(math.radians(apex_deg))
    corners = [(x, y, z) for x in (-1, 1) for y, z in ((0, -1), (0, 1), (depth, -1))]
    faces = [(0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (0, 2, 5, 3)]
    mesh = bpy.data.meshes.new("Prism")
    mesh.from_pydata(corners, [], faces)
    item = bpy.data.objects.new("Prism", mesh)
    item.location = (0, 2000, 0)
    bpy.context.scene.collection.objects.link(item)
    mesh.materials.append(physical_material(index, 0.0))
    bpy.context.view_layer.update()
    return item


def found() -> list[Any]:
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    return total_reflections(snapshot, [(0, 0, 0), (0, 0, 0)], WAVELENGTH, 1.0)


def fractions(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """Those of the objects that are named."""
    named: dict[str, float] = {}

    def note(code: str, objects: Any) -> Any:
        named.update({name: numbers["fraction"] for name, numbers in objects.items()})
        return finding_about(code, objects)

    with monkeypatch.context() as patch:
        patch.setattr(total_reflection, "finding_about", note)
        assert {name for item in found() for name in item.subjects} == set(named)
    return named


@pytest.mark.parametrize("index", [1.5, 2.3])
@pytest.mark.parametrize("above_deg", [-1.0, 1.0])
def test_a_prism_about_its_critical_angle(index: float, above_deg: float) -> None:
    """Along the normal of the front, the wave meets the back at the apex angle."""
    apex_deg = math.degrees(math.asin(1 / index)) + above_deg
    prism(apex_deg, index)
    assert [item.code for item in found()] == (["total-reflection"] if above_deg > 0 else [])
    if above_deg > 0:
        (said,) = found()
        assert said.subjects == ("Prism",)
        assert said.numbers["fraction"] > 0.95
        assert said.numbers["index"] == pytest.approx(index)


@pytest.mark.parametrize("widths", [0.0, 1.0, 5.0, 30.0])
def test_a_block_seen_at_a_slant(tmp_path: Path, widths: float) -> None:
    """A cube, 40 degrees from its front: bent to asin(sin 40 / n), waves reach the side on
    tan of that of the width, and there beyond the critical angle for any n above 1.41. Over its
    width, power falls by exp(-widths)."""
    index, angle = 2.3, math.radians(40)
    kappa = widths / 2 * WAVELENGTH / (4 * math.pi)
    rs.new_scene()
    bpy.ops.mesh.primitive_cube_add(size=2, location=(0, 2000, 0), rotation=(0, 0, angle))
    cube = bpy.context.object
    cube.scale = (1, 1, 50)  # no top in reach
    cube.data.materials.append(physical_material(index, kappa))
    bpy.context.view_layer.update()
    (said,) = found()
    # Two faces are seen, under 40 and 50 degrees, each with its own bent angle. At x from the edge
    # the straight ray has the shorter way to the side, x / sin.
    want = 0.0
    for seen in (angle, math.pi / 2 - angle):
        reached, per_width = math.tan(math.asin(math.sin(seen) / index)), widths / math.sin(seen)
        left = -math.expm1(-per_width * reached) / per_width if widths else reached
        want += math.cos(seen) * left
    want /= math.cos(angle) + math.sin(angle)
    assert said.numbers["fraction"] == pytest.approx(want, rel=0.06)
    if widths > 0:
        return
    run = ph.run_paths(tmp_path, width_px=8, height_px=8)
    assert "total-reflection" in {item.code for item in run.job.findings}


def test_rims_and_facets_are_information_with_their_fraction() -> None:
    """A rim of a hundredth of the width, at 40 degrees, and a sphere of flat facets."""
    rs.new_scene()
    for number, turn in enumerate((0.0, 0.7)):
        bpy.ops.mesh.primitive_cube_add(location=(20 * number, 2000, 0), rotation=(0, 0, turn))
        bpy.context.object.scale = (6, 0.05, 6)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64, location=(40, 2000, 0))
    for item in bpy.data.objects:
        if item.type == "MESH":
            item.data.materials.append(physical_material(2.3, 0.0))
    bpy.context.view_layer.update()
    (said,) = found()
    assert (said.severity, *said.subjects) == ("info", "Cube.001", "Sphere")
    index, width, depth = 2.3, 12.0, 0.1
    # Waves through the front reach the far rim from the last tan(bent) of the depth; those through
    # the near rim all meet a face, beyond the critical angle.
    angle = 0.7 - math.atan2(20, 2000)
    bent = math.asin(math.sin(angle) / index)
    reached = math.cos(angle) * depth * math.tan(bent) + math.sin(angle) * depth
    want = reached / (math.cos(angle) * width + math.sin(angle) * depth)
    least, _ = said.numbers["fraction"]
    assert least == pytest.approx(want, rel=0.3)
    prism(44.0, 1.4)  # the critical angle of 1.4 is 45.6 degrees
    assert found() == []


def box_and_rays() -> tuple[Any, Any, Any, Any]:
    """A skewed box, and rays that start within it."""
    rng = np.random.default_rng(4)
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    points = (corners - 0.5) @ (np.eye(3) + 0.3 * rng.random((3, 3)))
    squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    halves = [half for a, b, c, d in squares for half in ((a, b, c), (a, c, d))]
    onward = rng.normal(size=(400, 3))
    onward /= np.linalg.norm(onward, axis=1, keepdims=True)
    return points, np.array(halves, dtype=np.int32), 0.2 * rng.normal(size=(400, 3)), onward


def stacked(*meshes: tuple[Any, Any], flip: float = 1.0) -> Any:
    """Those of meshes that are convex bodies, named by their place."""
    points, corners = (np.stack(parts) for parts in zip(*meshes, strict=True))
    poses = np.stack([np.diag([flip, 1.0, 1.0, 1.0])] * len(points))
    return walls._stacked(tuple(range(len(points))), points, corners, poses)


def test_planes_of_convex_meshes_tell_where_rays_arrive() -> None:
    """As rays do."""
    points, halves, starts, onward = box_and_rays()
    inside = np.linalg.norm(starts, axis=1) < 0.3
    starts, onward = starts[inside], onward[inside]
    bodies = stacked((2 * points, halves), (points, halves))
    second = np.array([1])
    cosines = bodies.across(second)[0] @ onward.T
    per_way = cosines * bodies.per_height(second, starts.T[None])[0]
    first = per_way.argmax(axis=0), np.arange(len(starts))
    by_planes = [cosines[first], 1 / per_way[first]]
    rays = RayMesh(points, halves)
    face, way = rays.first(starts, onward)
    by_rays = np.sum(rays.normals_of(face) * onward, axis=1), way
    assert len(starts) > 100
    assert bodies.planes.size == len(halves) // 2  # two triangles of a face are one plane
    assert np.all(by_planes[0] > 0)
    np.testing.assert_allclose(by_planes, by_rays, rtol=1e-12)


def test_open_and_hollow_meshes_have_no_such_planes() -> None:
    """A ray leaves an open box through the hole; a dent hides planes behind others."""
    points, halves, starts, onward = box_and_rays()
    dented = points.copy()
    dented[0] *= -0.2
    inwards = halves[:, ::-1]
    open_box = np.concatenate([halves[:-2], halves[:2]])
    found = stacked((points, inwards), (points, halves), (points, open_box), (dented, halves))
    assert found.items == [1]
    # a mirrored object turns its faces round
    assert stacked((points, inwards), (points, halves), flip=-1.0).items == [1]
    assert stacked((points, halves[:-2])).items == []
    normals, way = total_reflection._met(RayMesh(points, halves[:-2]), starts, onward)
    assert 0 < np.isnan(way).sum() < len(way) / 2
    np.testing.assert_array_equal(np.isnan(normals[:, 0]), np.isnan(way))


def test_many_convex_objects_have_the_numbers_of_each_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Boxes and wedges of several shapes and poses, one mirrored, against rays."""
    rng = np.random.default_rng(5)
    rs.new_scene()
    for number in range(12):
        add = bpy.ops.mesh.primitive_cube_add if number % 2 else bpy.ops.mesh.primitive_cone_add
        place = (30 * number, 200, 0)
        sides = {} if number % 2 else {"vertices": 3 + number, "radius2": 0.5}
        add(location=place, rotation=tuple(rng.uniform(0, 3, 3)), **sides)
        bpy.context.object.scale = rng.uniform(0.3, 3, 3) * (1, 1, -1 if number == 3 else 1)
        bpy.context.object.data.materials.append(physical_material(2.3, 0.005))
    bpy.context.view_layer.update()
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    together = fractions(monkeypatch)
    losses_db, convex = (
        interior_losses_db(WAVELENGTH, snapshot),
        convex_objects(snapshot),
    )
    assert len(convex) == len(together) == 12
    for module in (total_reflection, layers):
        monkeypatch.setattr(module, "convex_parts", lambda _: [])
    assert together == pytest.approx(fractions(monkeypatch), abs=2e-3)
    assert losses_db == pytest.approx(interior_losses_db(WAVELENGTH, snapshot), rel=1e-9)


def test_compact_bodies_have_no_walls() -> None:
    """What is passed over is what a look across all faces finds no wall in; plates are not."""
    rng = np.random.default_rng(6)
    rs.new_scene()
    for number in range(30):
        bpy.ops.mesh.primitive_cube_add(location=(9 * number, 0, 0))
        bpy.context.object.scale = 10 ** rng.uniform(-1.3, 0, 3)
        bpy.context.object.data.materials.append(physical_material(2.3, 0.0))
    bpy.context.view_layer.update()
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    (bodies,) = layers.convex_parts(snapshot)
    compact = set(bodies.without_walls())
    assert 3 < len(compact) < 27
    assert not any(walls_of(item, snapshot).wall.any() for item in compact)


@pytest.mark.parametrize(("index", "code"), [(2.05, "total-reflection"), (1.1, "wall-corners")])
def test_corners_of_a_room(index: float, code: str) -> None:
    """Of each front that is seen, two walls' thicknesses lead into the walls at its ends, and there
    to faces across: beyond the critical angle for any index above 1.41, and else where the sine at
    the front is below sqrt(index^2 - 1). Straight rays leave them, past half of each wall. Rays
    bent to more than 45 degrees lead into the far wall from more of the front."""
    rs.new_scene()
    turn, width, depth, thickness = 0.6, 8.0, 6.0, 0.5
    bpy.ops.mesh.primitive_cube_add(location=(0, 2000, 0), rotation=(0, 0, turn))
    item = bpy.context.object
    item.data.transform(np.diag([width / 2, depth / 2, 50, 1]).tolist())
    walls = item.modifiers.new("Walls", "SOLIDIFY")
    walls.thickness, walls.offset, walls.use_even_offset = thickness, -1, True
    item.data.materials.append(physical_material(index, 0.0))
    item[attributes.OBJECT_SHELL_THICKNESS] = thickness
    bpy.context.view_layer.update()
    (said,) = found()
    assert said.code == code
    lost = 0.0
    for angle in (turn, math.pi / 2 - turn):
        aside = math.tan(math.asin(math.sin(angle) / index))
        lost += thickness * math.cos(angle) * (1 + aside + max(1 - aside, 0.0))
    want = lost / (width * math.cos(turn) + depth * math.sin(turn))
    assert said.numbers["fraction"] == pytest.approx(want, rel=0.15 if index > 1.41 else 0.2)


def test_little_of_each_of_many_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Thin walls in a row, each below half a percent: what stays unsaid does so in the sum."""
    rs.new_scene()
    for number in range(6):
        bpy.ops.mesh.primitive_cube_add(location=(0, 200 + number, 0), rotation=(0, 0, 0.5))
        bpy.context.object.scale = (6, 0.02, 6)
        bpy.context.object.data.materials.append(physical_material(2.3, 0.0))
    bpy.context.view_layer.update()
    named = fractions(monkeypatch)
    assert len(named) >= 3 and max(named.values()) < 0.005
    assert (6 - len(named)) * min(named.values()) <= 0.005
    for item in [item for item in bpy.data.objects if item.type == "MESH"][1:]:
        bpy.data.objects.remove(item)
    bpy.context.view_layer.update()
    assert found() == []


def test_walls_are_absorbed_across() -> None:
    """A slab of 1 by 12: its straight rays leave by the rim with the absorption of the way across
    it alone."""
    index, angle, widths = 2.3, 0.7, 3.0
    rs.new_scene()
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 2000, 0), rotation=(0, 0, angle))
    slab = bpy.context.object
    slab.scale = (12, 1, 60)
    slab.data.materials.append(physical_material(index, widths * WAVELENGTH / (4 * math.pi)))
    slab[attributes.OBJECT_LAYER_NORMAL] = (0.0, 1.0, 0.0)
    bpy.context.view_layer.update()
    (said,) = found()
    # By the front, x from the far rim: x / tan across. By the near rim all arrive at the back
    # beyond the critical angle, across what is left of the depth.
    bent = math.asin(math.sin(angle) / index)
    front = math.cos(angle) * math.tan(angle) / widths
    front *= -math.expm1(-widths * math.tan(bent) / math.tan(angle))
    depth = (np.arange(4000) + 0.5) / 4000
    rim_part = math.sin(angle) * np.exp(-widths * depth).mean()
    want = (front + rim_part) / (12 * math.cos(angle) + math.sin(angle))
    assert said.numbers["fraction"] == pytest.approx(want, rel=0.15)
