# SPDX-License-Identifier: GPL-3.0-or-later
"""Buildings in one mesh: walls of several thicknesses in several directions, scaled by axes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.nodes import attributes
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.paths.test_paths_walls import BOUND_DB, medium, passage

pytestmark = [pytest.mark.blender, pytest.mark.slow]

EPS = 4.2 + 0.05j
#: Where walls begin and end along x and along y [m]: outer ones of 0.3 m, inner ones of 0.1 m.
CUTS_X = (-6.0, -5.7, -0.05, 0.05, 5.7, 6.0)
CUTS_Y = (-5.0, -4.7, 0.9, 1.0, 4.7, 5.0)
BOX = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6)]
CENTRE = np.array([0.7, 30.0])


def is_solid(column: int, row: int) -> bool:
    return column % 2 == 0 or row % 2 == 0


def add_mesh(corners: Any, faces: Any, material: Any, scale: Sequence[float] = (1, 1, 1)) -> Any:
    """A mesh of corners in metres, shown at a scale by axes."""
    mesh = bpy.data.meshes.new("Building")
    mesh.from_pydata((np.asarray(corners) / scale).tolist(), [], faces)
    mesh.materials.append(material)
    item = bpy.data.objects.new("Building", mesh)
    item.scale = scale
    bpy.context.scene.collection.objects.link(item)
    return item


def floor_plan(material: Any, scale: Sequence[float] = (1, 1, 1)) -> Any:
    """Walls of a house of four rooms, 6 m high without a roof, as one closed mesh."""
    corners: dict[tuple[float, float, float], int] = {}
    faces = []

    def face(*points: tuple[float, float, float]) -> None:
        faces.append([corners.setdefault(point, len(corners)) for point in points])

    for column, (x0, x1) in enumerate(itertools.pairwise(CUTS_X)):
        for row, (y0, y1) in enumerate(itertools.pairwise(CUTS_Y)):
            if not is_solid(column, row):
                continue
            for z, up in ((-3.0, False), (3.0, True)):
                ring = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
                face(*(ring if up else ring[::-1]))
            sides = (
                (column, row - 1, (x0, y0), (x1, y0)),
                (column + 1, row, (x1, y0), (x1, y1)),
                (column, row + 1, (x1, y1), (x0, y1)),
                (column - 1, row, (x0, y1), (x0, y0)),
            )
            for at_column, at_row, a, b in sides:
                outside = not (0 <= at_column < 5 and 0 <= at_row < 5)
                if outside or not is_solid(at_column, at_row):
                    face((*a, -3.0), (*b, -3.0), (*b, 3.0), (*a, 3.0))
    return add_mesh(list(corners), faces, material, scale)


def crossed(turn_deg: float) -> list[tuple[float, float]]:
    """Thickness and angle of each wall on the way along +Y, by steps through the plan."""
    turn = math.radians(turn_deg)
    along = np.array([math.sin(turn), math.cos(turn)])
    across = np.array([math.cos(turn), -math.sin(turn)])
    start = -CENTRE[0] * across - CENTRE[1] * along
    points = start + np.arange(0, 60, 1e-3)[:, None] * along
    cell = np.stack([np.searchsorted(c, points[:, i]) - 1 for i, c in enumerate((CUTS_X, CUTS_Y))])
    within = np.all((cell >= 0) & (cell < 5), axis=0)
    solid = within & np.any(cell % 2 == 0, axis=0)
    steps = np.flatnonzero(np.diff(solid.astype(int)))
    found = []
    for begin, end in steps.reshape(-1, 2):
        way = (end - begin) * 1e-3 * along
        axis = int(np.argmin(np.abs(np.abs(way)[:, None] - (0.1, 0.3)).min(axis=1)))
        thickness_m = round(abs(float(way[axis])), 2)
        assert thickness_m in (0.1, 0.3)
        found.append((thickness_m, math.degrees(math.acos(abs(along[axis])))))
    return found


def behind(folder: Path, make: Any) -> tuple[float, float, set[str]]:
    """What `make` adds before a plate at 100 m: power [dB], two-way length [m], findings."""
    found = []
    for used in (False, True):
        rs.new_scene()
        ph.field_of_view(0.02)
        rs.add_plate(100.0)
        item = make() if used else None
        run = ph.run_paths(folder / str(used), width_px=4, height_px=4)
        rows = run.table()
        rows = rows[rows["last_scatterer_m"][:, 1] > 99]
        found.append((rows["power_w"].sum(), np.average(rows["length_m"], weights=rows["power_w"])))
    assert item is not None
    assert not item.modifiers and attributes.OBJECT_SHELL_THICKNESS not in item  # restored
    assert not bpy.data.node_groups.get("radarsim walls")
    codes = {one.code for one in run.job.findings}
    return 10 * math.log10(found[1][0] / found[0][0]), found[1][1] - found[0][1], codes


def expected(walls: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Of walls (thickness, angle) that share one plane of incidence."""
    power, longer_m = np.ones(2), 0.0
    for thickness_m, angle_deg in walls:
        once, more_m = passage(EPS, thickness_m, angle_deg)
        power, longer_m = power * once, longer_m + 2 * more_m
    return 20 * math.log10(power.mean()), longer_m


@pytest.mark.parametrize("turn_deg", [10.0, 25.0, 40.0, 65.0])
@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (0.5, 3.0, 1.4)])
def test_a_house_of_four_rooms(
    tmp_path: Path, turn_deg: float, scale: tuple[float, float, float]
) -> None:
    walls = crossed(turn_deg)
    assert len({thickness_m for thickness_m, _ in walls}) == 2 and len(walls) in (3, 4)

    def make() -> Any:
        item = floor_plan(medium("Wall", EPS), scale)
        item.location = (*CENTRE, 0.0)
        item.rotation_euler = (0, 0, math.radians(turn_deg))
        return item

    got_db, got_m, codes = behind(tmp_path, make)
    want_db, want_m = expected(walls)
    assert "not-a-layer" not in codes
    assert got_db == pytest.approx(want_db, abs=BOUND_DB)
    assert got_m == pytest.approx(want_m, abs=2e-4)


@pytest.mark.parametrize("own_normals", [False, True])
def test_a_house_shaded_smooth(tmp_path: Path, own_normals: bool) -> None:
    """As imported buildings often are, with normals in the file or without: its edges count."""

    def make() -> Any:
        item = floor_plan(medium("Wall", EPS))
        item.location = (*CENTRE, 0.0)
        item.rotation_euler = (0, 0, math.radians(25.0))
        mesh = item.data
        mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
        if own_normals:
            corners = [mesh.vertices[loop.vertex_index].co.normalized() for loop in mesh.loops]
            mesh.normals_split_custom_set(corners)
        return item

    got_db, got_m, codes = behind(tmp_path, make)
    want_db, want_m = expected(crossed(25.0))
    assert "smooth-across-edges" not in codes
    assert got_db == pytest.approx(want_db, abs=BOUND_DB)
    assert got_m == pytest.approx(want_m, abs=2e-4)


@pytest.mark.parametrize("count", [1, 2, 4])
@pytest.mark.parametrize("angle_deg", [37.0, 70.0])
def test_loose_walls_of_one_mesh(tmp_path: Path, count: int, angle_deg: float) -> None:
    """Each of another thickness and another tilt, in one object that a scale by axes distorts."""
    walls = [(0.05 + 0.03 * n, angle_deg - 9 * n) for n in range(count)]

    def make() -> Any:
        corners: list[Any] = []
        faces: list[tuple[int, ...]] = []
        for number, (thickness_m, tilt_deg) in enumerate(walls):
            angle, first = math.radians(tilt_deg), len(corners)
            up = np.array([0.0, -math.sin(angle), math.cos(angle)])
            normal = np.array([0.0, math.cos(angle), math.sin(angle)])
            for x in (-1, 1):
                for s in (-1, 1):
                    for z in (-1, 1):
                        place = 3.01 * x * np.array([1.0, 0, 0]) + s * thickness_m / 2 * normal
                        corners.append(place + 3.2 * z * up + (0.05, 12.0 + 9 * number, 0.07))
            faces += [tuple(first + corner for corner in side) for side in BOX]
        return add_mesh(corners, faces, medium("Wall", EPS), (1.7, 0.6, 1.0))

    got_db, got_m, codes = behind(tmp_path, make)
    want_db, want_m = expected(walls)
    assert "not-a-layer" not in codes
    assert got_db == pytest.approx(want_db, abs=BOUND_DB)
    assert got_m == pytest.approx(want_m, abs=2e-4)
