# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a mesh that overlap, and what lies or moves into a wall, are named."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.materials import overlapping_shells
from radarsim_addon.blender.state import evaluated_snapshot
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.paths.test_paths_buildings import floor_plan
from tests.blender.paths.test_paths_walls import medium, room
from tests.blender.render_helpers import add_box

pytestmark = pytest.mark.blender


def joined(*boxes: tuple[tuple[float, ...], tuple[float, ...]]) -> Any:
    """Boxes by two corners as one mesh."""
    material = medium("Wall", 4.2)
    items = [add_box(low, high, material) for low, high in boxes]
    for item in items:
        item.select_set(True)
    bpy.context.view_layer.objects.active = items[0]
    bpy.ops.object.join()
    bpy.context.view_layer.update()
    return items[0]


def named() -> list[Any]:
    return overlapping_shells(evaluated_snapshot(bpy.context.view_layer))


@pytest.mark.parametrize("mirrored", [False, True])
def test_boxes_joined_to_a_house(mirrored: bool) -> None:
    """Two walls of 4 x 3 x 0.3 m that share a corner: one rim of each lies in the other."""
    rs.new_scene()
    item = joined(((0, 0, 0), (4, 0.3, 3)), ((-0.01, 0.01, 0.01), (0.3, 4, 2.99)))
    item.scale.x = -1 if mirrored else 1
    bpy.context.view_layer.update()
    (said,) = named()
    assert (said.code, said.subjects) == ("shells-overlap", (item.name,))
    surface = 2 * (4 * 3 + 4 * 0.3 + 3 * 0.3) + 2 * (3.99 * 2.98 + 0.31 * (3.99 + 2.98))
    # the middles of triangles tell: of the large faces none is within the corner
    assert said.numbers["fraction"] == pytest.approx((0.3 * 3 + 0.31 * 2.98) / surface, rel=1e-3)


def test_what_does_not_overlap() -> None:
    rs.new_scene()
    joined(((0, 0, 0), (4, 0.3, 3)), ((0, 0.5, 0), (0.3, 4, 3)))
    room((10.0, 10.0, 3.0), 20.0, 0.2, 4.2)
    floor_plan(medium("Plan", 4.2))
    bpy.ops.mesh.primitive_uv_sphere_add()
    bpy.context.object.data.materials.append(medium("Ball", 4.2))
    bpy.context.view_layer.update()
    assert named() == []


@pytest.mark.parametrize("rings", [False, True])
def test_what_moves_into_a_wall(tmp_path: Path, rings: bool) -> None:
    """A ball crosses the front wall of a room, then the radar does; in the room, and before it,
    nothing is said.
    """
    rs.new_scene()
    ph.field_of_view(2.0)
    item = room((10.0, 10.0, 10.0), 0.0, 0.4, 4.2)
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=0.05, location=(0, 14, 0))
    ball = bpy.context.object
    ball.name = "Ball"
    ball.data.materials.append(ph.rough_metal())
    rig = bpy.data.objects["Radar"]
    for frame, place, ahead in ((1, 14.0, 0.0), (2, 15.2, 0.0), (3, 17.0, 15.2), (4, 17.0, 17.0)):
        ball.location.y = place
        ball.keyframe_insert("location", frame=frame)
        rig.location.y = ahead
        rig.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(3)  # what the file shows is not what is measured
    wanted = {"width_px": 4, "height_px": 4, "frames": (1, 2, 3, 4)}
    run = rs.run(tmp_path, rings=1, **wanted) if rings else ph.run_paths(tmp_path, **wanted).job
    said = run.run_findings if rings else run.findings
    codes = ("inside-a-wall", "antenna-in-medium")
    assert [(one.code, one.subjects, one.frames) for one in said if one.code in codes] == [
        ("inside-a-wall", (f"Ball in {item.name}", f"the radar in {item.name}"), (2, 3)),
        ("antenna-in-medium", (item.name,), (3,)),
    ]


@pytest.mark.parametrize("inside", [True, False])
def test_a_radar_inside_a_block(tmp_path: Path, inside: bool) -> None:
    """Absorption, delay and the loss at the face are right; that rays leave straight is named."""
    eps, depth_m, range_m = 2.25 + 0.002j, 0.7, 20.0
    found = []
    for used in (False, True):
        rs.new_scene()
        ph.field_of_view(0.02)
        rs.add_plate(range_m)
        if used:
            add_box(
                (-1, -1 if inside else 1, -1),
                (1, depth_m + (0 if inside else 1), 1),
                medium("M", eps),
            )
        run = ph.run_paths(tmp_path / str(used), width_px=4, height_px=4)
        rows = run.table()
        rows = rows[rows["last_scatterer_m"][:, 1] > range_m - 1]
        power_w = rows["power_w"].sum()
        found.append((power_w, np.average(rows["length_m"], weights=rows["power_w"])))
    index = complex(np.sqrt(eps))
    faces, through_m = (1, depth_m) if inside else (2, depth_m)
    once = (1 - abs((index - 1) / (index + 1)) ** 2) ** faces
    once *= math.exp(-4 * math.pi * index.imag * through_m * 5.3e9 / 299_792_458.0)
    assert found[1][0] / found[0][0] == pytest.approx(once**2, rel=1e-3)
    longer_m = 2 * (index.real - 1) * through_m
    assert found[1][1] - found[0][1] == pytest.approx(longer_m, abs=1e-4)
    said = [one for one in run.job.findings if one.code == "antenna-in-medium"]
    assert len(said) == inside
    if inside:
        # A plane face spreads the waves of a point d below it as one d / n below it, by n.
        straight = depth_m + (range_m - depth_m)
        bent = depth_m + index.real * (range_m - depth_m)
        assert said[0].numbers["power_db"] == pytest.approx(
            40 * math.log10(bent / straight), rel=0.05
        )
