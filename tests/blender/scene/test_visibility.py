# SPDX-License-Identifier: GPL-3.0-or-later
"""What is rendered is in the labels, whatever the viewport shows, and that is as before after."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import contract
from radarsim_addon.typed_json import read_record
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def into_collection(item: Any, name: str) -> Any:
    """Move an object to a collection of its own; returns its layer collection."""
    collection = bpy.data.collections.new(name)
    scene = bpy.context.scene
    scene.collection.children.link(collection)
    scene.collection.objects.unlink(item)
    collection.objects.link(item)
    return bpy.context.view_layer.layer_collection.children[name]


def hide(item: Any, how: str) -> None:
    """One of Blender's ways to hide an object."""
    if how == "screen":
        item.hide_viewport = True
    elif how == "eye":
        item.hide_set(True)
    elif how == "render":
        item.hide_render = True
    else:
        layer = into_collection(item, how)
        if how == "collection eye":
            layer.hide_viewport = True
        elif how == "collection screen":
            layer.collection.hide_viewport = True
        elif how == "collection render":
            layer.collection.hide_render = True
        elif how == "excluded":
            layer.exclude = True


HIDDEN_ONLY = ("screen", "eye", "collection eye", "collection screen")
NOT_RENDERED = ("render", "collection render", "excluded")


def state() -> dict[str, Any]:
    """What hides things, everywhere."""
    bpy.context.view_layer.update()
    layers = bpy.context.view_layer.layer_collection.children
    return {
        "objects": {o.name: (o.hide_viewport, o.hide_render) for o in bpy.data.objects},
        "eyes": {o.name: o.hide_get() for o in bpy.context.view_layer.objects},
        "layers": {c.name: (c.hide_viewport, c.exclude) for c in layers},
        "collections": {c.name: (c.hide_viewport, c.hide_render) for c in bpy.data.collections},
    }


@pytest.mark.parametrize("how", [*HIDDEN_ONLY, *NOT_RENDERED])
def test_labels_are_what_is_rendered(how: str, tmp_path: Path) -> None:
    """Extent, labels, objects and range rates of a plate that is hidden in one way or another."""
    rs.new_scene()
    ph.field_of_view(40)
    near, far = rs.add_plate(10, 1), rs.add_plate(20, 12)
    near.name, far.name = "Near", "Far"
    rs.move_steadily(far, (0.0, 3.0, 0.0))
    bpy.context.scene.frame_set(1)
    hide(far, how)
    before = state()
    run = ph.run_paths(tmp_path, snapshots=2, width_px=16, height_px=16)
    assert state() == before
    found = read_record(
        tmp_path / contract.frame_dir(1) / contract.GROUND_TRUTH_FILE, contract.GroundTruthRecord
    )
    labels = {item.name: item for item in found.objects}
    rows = run.table()
    mine = rows[rows["length_m"] > 30]
    if how in NOT_RENDERED:
        assert set(labels) == {"Near"}
        assert mine.size == 0
        return
    assert set(labels) == {"Near", "Far"}
    assert labels["Far"].nearest_range_m == pytest.approx(20, rel=1e-6)
    assert labels["Far"].range_rate_mps == pytest.approx(3, rel=1e-4)
    assert mine.size > 100
    assert np.all(mine["last_object"] == run.record().objects.index("Far") + 1)
    radial = 3 * mine["direction"][:, 1]
    np.testing.assert_allclose(mine["range_rate_mps"], radial, rtol=1e-3)


def plate_that_recedes() -> Any:
    rs.new_scene()
    ph.field_of_view(4.0)
    plate = rs.add_plate(20.0, 1.0)
    rs.move_steadily(plate, (0, 5, 0))
    return plate


@pytest.mark.parametrize("how", ["screen", "collection screen"])
def test_members_of_instances_move_whatever_the_viewport_shows(tmp_path: Path, how: str) -> None:
    """A collection that is nowhere in the scene, shown by an instance alone."""
    plate = plate_that_recedes()
    outer, inner = (bpy.data.collections.new(name) for name in ("Outer", "Inner"))
    outer.children.link(inner)
    inner.objects.link(plate)
    bpy.context.scene.collection.objects.unlink(plate)
    rs.instance_of(outer)
    hidden = plate if how == "screen" else inner
    hidden.hide_viewport = True
    rows = ph.run_paths(tmp_path / "run", width_px=16, height_px=16).table()
    assert rows.size > 100
    np.testing.assert_allclose(rows["range_rate_mps"], 5.0, rtol=1e-3)
    assert hidden.hide_viewport


@pytest.mark.parametrize("display", [{"display_percentage": 5}, {"display_method": "NONE"}])
def test_particles_that_the_viewport_leaves_out_move(
    tmp_path: Path, display: dict[str, Any]
) -> None:
    """Leaves on a plate that recedes, most of which Blender shows in renders alone."""
    plate = plate_that_recedes()
    leaf = rs.add_plate(-5.0, 0.05)
    settings = plate.modifiers.new("Leaves", "PARTICLE_SYSTEM").particle_system.settings
    settings.type, settings.count, settings.hair_length = "HAIR", 40, 1.0
    settings.use_advanced_hair, settings.particle_size = True, 1.0
    settings.render_type, settings.instance_object = "OBJECT", leaf
    for name, value in display.items():
        setattr(settings, name, value)
    plate.show_instancer_for_render = False
    rows = ph.run_paths(tmp_path / "run", width_px=16, height_px=16).table()
    assert rows.size > 10
    np.testing.assert_allclose(rows["range_rate_mps"], 5.0, rtol=1e-3)
    for name, value in display.items():
        assert getattr(settings, name) == value


@pytest.mark.parametrize("hidden", [False, True])
def test_a_background_set_is_measured_as_the_scene_itself(tmp_path: Path, hidden: bool) -> None:
    """The same table of paths, although the scene has only the radar: place, speed and power."""
    tables = []
    for own in (True, False):
        scene = rs.new_scene()
        plate = rs.add_plate(20, 2)
        rs.move_steadily(plate, (0.0, 3.0, 0.0))
        if not own:
            behind = bpy.data.scenes.new("Set")
            scene.collection.objects.unlink(plate)
            behind.collection.objects.link(plate)
            if hidden:
                plate.hide_set(True, view_layer=behind.view_layers[0])
            scene.background_set = behind
        tables.append(ph.run_paths(tmp_path / str(own), width_px=8, height_px=8).table())
    assert tables[0].size
    assert tables[0].equals(tables[1])
