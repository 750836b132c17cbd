# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run asks of Blender for each object, and that Cycles still takes over what is set."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.materials import make_physical_material
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.state import snapshot
from radarsim_addon.signal.paths import PathRows
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

BOXES = 12


def test_each_mesh_is_read_once_and_never_evaluated_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Concrete boxes, each with a mesh of its own, up to the first render."""
    rs.new_scene()
    material = make_physical_material("Inside", "index", carrier_hz=5.3e9, n=2.3, k=0.02)
    for number in range(BOXES):
        bpy.ops.mesh.primitive_cube_add(location=(5 * number - 27, 80, 0))
        bpy.context.object.data.materials.append(material)
    bpy.context.view_layer.update()
    read: list[int] = []
    evaluated_again: list[str] = []
    read_mesh = snapshot.read_mesh

    def count(mesh: Any) -> Any:
        read.append(len(mesh.vertices))
        return read_mesh(mesh)

    def note(_scene: Any, depsgraph: Any) -> None:
        changed = (one.id.name for one in depsgraph.updates if one.is_updated_geometry)
        evaluated_again.extend(name for name in changed if name.startswith("Cube"))

    monkeypatch.setattr(snapshot, "read_mesh", count)
    bpy.app.handlers.depsgraph_update_post.append(note)
    try:
        with ph.job_for(tmp_path, width_px=16, height_px=16) as job:
            next(job.pending())
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(note)
    assert read == [8] * BOXES
    assert evaluated_again == []


def test_cycles_hears_of_walls_in_a_later_run(tmp_path: Path) -> None:
    """A wall that was no layer for the user in one run is one in the next of the same Blender."""

    def look(name: str) -> PathRows:
        run = ph.run_paths(tmp_path / name, width_px=8, height_px=8)
        rows = run.table()
        return rows[rows["last_scatterer_m"][:, 1] > 9.0]

    def build() -> Any:
        rs.new_scene()
        rs.add_plate(10.0)
        bpy.ops.mesh.primitive_cube_add(size=1, location=(0.1, 4, 0.2), rotation=(0, 0, 0.8))
        wall = bpy.context.object
        wall.scale = 12.0, 0.2, 12.0
        wall.data.materials.append(
            make_physical_material("Wall", "index", carrier_hz=5.3e9, n=2.3, k=0.05)
        )
        return wall

    build()[attributes.OBJECT_LAYER_NORMAL] = [0.0, 0.0, 0.0]
    other = look("other")
    build()
    alone = look("alone")
    wall = build()
    wall[attributes.OBJECT_LAYER_NORMAL] = [0.0, 0.0, 0.0]
    assert look("as other").equals(other)
    del wall[attributes.OBJECT_LAYER_NORMAL]
    found = look("after")
    assert found.equals(alone)
    loss_db = 10 * math.log10(other["power_w"].sum() / found["power_w"].sum())
    assert abs(loss_db) > 0.5
