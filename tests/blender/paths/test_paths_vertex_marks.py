# SPDX-License-Identifier: GPL-3.0-or-later
"""Last vertices by the light of the surfaces themselves, against the transmitter's colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.signal import PathFlag

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.blender.nodes import radar_material
from radarsim_addon.blender.nodes.groups import KIND_PROPERTY
from radarsim_addon.blender.views import PathScene
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.tree_text import dump

pytestmark = pytest.mark.blender

SCENES = ("opaque", "panes", "rough facets")


def build(kind: str) -> None:
    """A rough floor and wall, and for "panes" two sheets before them."""
    rs.new_scene()
    ph.field_of_view(50)
    ph.radar_at((0, 0, 2))
    rough = ph.rough_metal()
    if kind == "rough facets":  # from two reflections on the world has the range encoding
        rough = nodes.make_material("Facets", 1e4, 1e4, 0.5, 0.5, penetrable=False)
    ph.quad("Floor", [(-30, -5, 0), (30, -5, 0), (30, 10, 0), (-30, 10, 0)], rough)
    ph.quad("Wall", [(-30, 10, 0), (30, 10, 0), (30, 10, 30), (-30, 10, 30)], rough)
    if kind == "panes":
        sheet = ph.bare_sheet(1.8, 0.0, 0.5)
        for y in (4.0, 5.0):
            ph.quad("Pane", [(-4, y, 0.1), (3, y, 0.1), (3, y, 4), (-4, y, 4)], sheet)


def measured(folder: Path, code: str, orders: int) -> ph.PathRun:
    options = {
        "max_reflections": orders,
        "range_encoding": code,
        "mirror_images": 0,
        "max_unfollowed_fraction": 0.0,
    }
    return ph.run_paths(folder, width_px=48, height_px=48, options=options)


@pytest.mark.parametrize("orders", [2, 3])
@pytest.mark.parametrize("code", ["materials", "world"])
@pytest.mark.parametrize("kind", SCENES)
def test_the_paths_are_those_of_the_transmitters_colours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, code: str, orders: int
) -> None:
    """Bit by bit but for where the vertex is: there within the errors of the colours."""
    build(kind)
    marked = measured(tmp_path / "marked", code, orders)
    monkeypatch.setattr(
        PathScene, "vertex_marks", property(lambda _: False, lambda *_: None), raising=False
    )
    plain = measured(tmp_path / "plain", code, orders)
    rows, expected = marked.table(), plain.table()
    assert marked.record().renders < plain.record().renders
    later = expected["order"] > 1
    assert later.sum() > 300
    assert expected["transparent_depth"][later].max() >= (2 if kind == "panes" else 0)
    names = rows.names
    placed = {"first_scatterer_m", "last_scatterer_m", "last_surface_point", "first_surface_point"}
    placed |= {"direction"}  # to the first vertex, where it was computed from the last one
    if kind != "panes":  # lengths from vertices
        placed |= {"length_m", "length_sigma_m"}
    # A length is that of the encoding where the vertices are too far off: on 4.5 in a few rows.
    encoded, expected_encoded = (
        np.count_nonzero(some["flags"] & PathFlag.ENCODED_LENGTH) for some in (rows, expected)
    )
    assert encoded <= expected_encoded <= encoded + 5
    for some in (rows, expected):
        some["flags"] &= ~np.uint16(PathFlag.ENCODED_LENGTH)
    for name in set(names) - placed:
        np.testing.assert_array_equal(rows[name], expected[name], err_msg=name)
    for name in placed & set(names):
        np.testing.assert_array_equal(rows[name][~later], expected[name][~later])
    off_m = np.linalg.norm(rows["last_scatterer_m"] - expected["last_scatterer_m"], axis=1)
    known = later & np.isfinite(expected["last_scatterer_m"][:, 0])
    assert known.sum() == later.sum()
    assert off_m[known].max() < 1e-3
    last_m = rows["last_scatterer_m"][later]
    on = np.minimum(np.abs(last_m[:, 2]), np.abs(last_m[:, 1] - 10))
    if kind == "panes":
        on = np.minimum(on, np.minimum(np.abs(last_m[:, 1] - 4), np.abs(last_m[:, 1] - 5)))
    assert on.max() < 3e-5
    # A small error of the colours moves a vertex far along a floor at grazing incidence; the
    # colours of the transmitter err more in 4.5.
    np.testing.assert_allclose(rows["length_m"], expected["length_m"], rtol=1e-5)
    np.testing.assert_allclose(rows["direction"], expected["direction"], atol=1e-5)


def test_the_scene_comes_back(tmp_path: Path) -> None:
    """Node groups, light groups, and how lights are sampled; an error leaves nothing either."""
    build("panes")
    layer = bpy.context.scene.view_layers[0]
    layer.lightgroups.add(name="mine")
    bpy.data.objects["Wall"].lightgroup = "mine"
    material = bpy.data.objects["Wall"].active_material
    material.cycles.emission_sampling = "AUTO"

    def state() -> list[object]:
        groups = [dump(tree) for tree in bpy.data.node_groups]
        objects = [(item.name, item.lightgroup) for item in bpy.data.objects]
        lit = [group.name for group in layer.lightgroups]
        sampled = [(one.name, one.cycles.emission_sampling) for one in bpy.data.materials]
        return [groups, objects, lit, sampled, layer.active_lightgroup_index]

    before = state()
    job = ph.job_for(tmp_path / "run", width_px=8, height_px=8, options={"max_reflections": 2})
    with job:
        assert state() != before
    assert job.unrestored == []
    assert state() == before
    with ph.job_for(tmp_path / "one", width_px=8, height_px=8) as job:
        # one reflection: surfaces that shine would be shaded for nothing
        assert [dump(tree) for tree in bpy.data.node_groups] == before[0]


def test_a_file_that_was_saved_in_a_run_has_the_light_once(tmp_path: Path) -> None:
    build("opaque")
    with ph.job_for(tmp_path / "run", width_px=8, height_px=8, options={"max_reflections": 2}):
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "during.blend"), copy=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "during.blend"))
    trees = (tree for tree in bpy.data.node_groups if tree.users)  # its name may have a number
    tree = next(tree for tree in trees if tree.get(KIND_PROPERTY) == radar_material.KIND)
    once = len(tree.nodes)
    job = ph.job_for(tmp_path / "again", width_px=8, height_px=8, options={"max_reflections": 2})
    with job:
        assert len(tree.nodes) == once
    assert job.unrestored == []
