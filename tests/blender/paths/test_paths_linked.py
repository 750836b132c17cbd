# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects of another file, linked or overridden, next to local ones with the same names."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.nodes import attributes
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.paths.test_paths_buildings import CENTRE, EPS, crossed, expected, floor_plan
from tests.blender.paths.test_paths_walls import BOUND_DB, medium

pytestmark = [pytest.mark.blender, pytest.mark.slow]

RECEDES_MPS, APPROACHES_MPS = 5.0, -3.0


def saved(item: Any, path: Path) -> str:
    """Save an object, in a collection, as a file of its own."""
    collection = bpy.data.collections.new("Asset")
    collection.objects.link(item)
    bpy.context.scene.collection.objects.unlink(item)
    bpy.data.libraries.write(str(path), {collection}, fake_user=True)
    return str(path)


def linked(path: str, override: bool = False) -> Any:
    """An instance of the file's collection, or its objects, overridden."""
    with bpy.data.libraries.load(path, link=True) as (_, target):
        target.collections = ["Asset"]
    shown = rs.instance_of(target.collections[0])
    if override:
        shown.select_set(True)
        bpy.context.view_layer.objects.active = shown
        bpy.ops.object.make_override_library()
    return shown


@pytest.fixture
def moving(tmp_path: Path) -> str:
    """A file with a plate that recedes."""
    rs.new_scene()
    plate = rs.add_plate(20.0, 1.0)
    rs.move_steadily(plate, (0, RECEDES_MPS, 0))
    path = saved(plate, tmp_path / "moving.blend")
    rs.new_scene()
    ph.field_of_view(8.0)
    return path


def test_an_overridden_object_moves(tmp_path: Path, moving: str) -> None:
    """Blender keeps the linked object next to the override, with the same name."""
    linked(moving, override=True)
    assert [item.name for item in bpy.data.objects].count("Plate") == 2
    rows = ph.run_paths(tmp_path / "run", width_px=16, height_px=16).table()
    np.testing.assert_allclose(rows["range_rate_mps"], RECEDES_MPS, rtol=3e-3)


@pytest.mark.parametrize("deforms", [False, True])
def test_two_objects_of_one_name_move_by_themselves(
    tmp_path: Path, moving: str, deforms: bool
) -> None:
    own = rs.add_plate(25.0, 1.0)
    own.location.x = 1.2
    rs.move_steadily(own, (0, APPROACHES_MPS, 0))
    if deforms:
        own.modifiers.new("Wave", "WAVE").height = 1e-9
    linked(moving).location.x = -0.6
    run = ph.run_paths(tmp_path / "run", width_px=32, height_px=32)
    rows, objects = run.table(), run.record().objects
    assert objects == ["Plate", "Plate [moving.blend]"]
    for name, rate_mps in zip(objects, (APPROACHES_MPS, RECEDES_MPS), strict=True):
        mine = rows[rows["last_object"] == objects.index(name) + 1]
        assert mine.size > 20
        np.testing.assert_allclose(mine["range_rate_mps"], rate_mps, rtol=5e-3)


@pytest.mark.parametrize("override", [False, True])
def test_a_house_of_another_file(tmp_path: Path, override: bool) -> None:
    """Its walls have several thicknesses; another object of its name is here already."""
    rs.new_scene()
    house = floor_plan(medium("Wall", EPS))
    house.location, house.rotation_euler = (*CENTRE, 0.0), (0, 0, math.radians(25.0))
    path = saved(house, tmp_path / "house.blend")
    found = []
    for used in (False, True):
        rs.new_scene()
        ph.field_of_view(0.02)
        rs.add_plate(100.0)
        if used:
            other = rs.add_plate(50.0, 0.1, preset=None)
            other.name, other.location.x = "Building", 30.0
            other.data.materials.append(medium("Other", 2.0 + 3j))
            linked(path, override)
        run = ph.run_paths(tmp_path / str(used), width_px=4, height_px=4)
        rows = run.table()
        rows = rows[rows["last_scatterer_m"][:, 1] > 99]
        found.append((rows["power_w"].sum(), np.average(rows["length_m"], weights=rows["power_w"])))
    want_db, want_m = expected(crossed(25.0))
    assert "not-a-layer" not in {one.code for one in run.job.findings}
    assert 10 * math.log10(found[1][0] / found[0][0]) == pytest.approx(want_db, abs=BOUND_DB)
    assert found[1][1] - found[0][1] == pytest.approx(want_m, abs=2e-4)
    for mesh in bpy.data.meshes:
        assert attributes.FACE_WALL_THICKNESS not in mesh.attributes
