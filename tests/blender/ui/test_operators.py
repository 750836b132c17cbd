# SPDX-License-Identifier: GPL-3.0-or-later
"""Registration, operators, settings, pictures; runs to their end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.addon import CLASSES
from radarsim_addon.blender.ui import menus, scene_panel
from radarsim_addon.blender.ui.result_pictures import HEIGHT, KINDS, WIDTH
from tests.blender import radar_scenes as rs
from tests.blender import recording

pytestmark = pytest.mark.blender


@pytest.fixture
def scene(addon: Any) -> Any:
    return rs.ring_scene()


def registered() -> set[str]:
    """All that the add-on shows to Blender."""
    found = {name for name in dir(bpy.types) if "radarsim" in name.lower()}
    found |= {f"ops.{name}" for name in dir(bpy.ops.radarsim)}
    for owner in (bpy.types.Object, bpy.types.WindowManager):
        if hasattr(owner, "radarsim"):
            found.add(f"{owner.__name__}.radarsim")
    return found


def test_registering_twice_and_unregistering(bpy: Any) -> None:
    import radarsim_addon

    radarsim_addon.unregister()  # whatever tests of other files left
    before = registered()
    radarsim_addon.register()
    once = registered()
    assert {"Object.radarsim", "WindowManager.radarsim", "ops.render_frames"} <= once
    assert "RADARSIM_PT_render" in once
    radarsim_addon.register()
    assert registered() == once
    radarsim_addon.unregister()
    assert registered() == before
    radarsim_addon.unregister()
    radarsim_addon.register()
    assert registered() == once
    radarsim_addon.unregister()
    assert registered() == before


def test_every_class_has_a_description_and_every_setting_a_tooltip(addon: Any) -> None:
    operators: list[Any] = [item for item in CLASSES if issubclass(item, bpy.types.Operator)]
    assert all(item.__doc__ and item.bl_label for item in operators)
    assert len(recording.TAB) > 8
    assert all(item.bl_category == "Radar" for item in recording.TAB)
    groups = (
        bpy.types.Object.bl_rna.properties["radarsim"].fixed_type,
        bpy.types.WindowManager.bl_rna.properties["radarsim"].fixed_type,
        bpy.types.WindowManager.bl_rna.properties["radarsim_results"].fixed_type,
        bpy.types.Object.bl_rna.properties["radarsim"].fixed_type.properties["receiver"].fixed_type,
    )
    for group in groups:
        for prop in group.properties:
            if prop.identifier not in ("rna_type", "name"):
                assert prop.description, prop.identifier


def test_render_and_process_operators(
    scene: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    rs.radar().output_folder = str(tmp_path)
    assert bpy.ops.radarsim.render_frames() == {"FINISHED"}
    assert "6/6 renders, 100 %" in capfd.readouterr().out
    assert len(list(tmp_path.rglob("ring_*.exr"))) == 6
    assert bpy.ops.radarsim.process_last_run() == {"FINISHED"}
    for kind in (KINDS["MAP"], KINDS["PROFILE"]):
        image = bpy.data.images[kind.image]
        assert tuple(image.size) == (WIDTH, HEIGHT)
        assert image.packed_file is not None
        pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        assert pixels.min() < 0.2 < 0.9 < pixels.max()
    first = (tmp_path / "run.json").stat().st_mtime_ns
    assert bpy.ops.radarsim.measure_and_show() == {"FINISHED"}
    assert (tmp_path / "run.json").stat().st_mtime_ns > first
    assert sum(image.name.startswith("Radar ") for image in bpy.data.images) == 2


def test_menus_have_all_that_a_user_looks_for(addon: Any) -> None:
    """F3 finds what is in a menu. Registered twice, each menu is there once."""
    addon.register()
    for menu, function in (
        (bpy.types.VIEW3D_MT_add, menus.draw_in_add),
        (bpy.types.VIEW3D_MT_editor_menus, menus.draw_in_header),
    ):
        assert menu._dyn_ui_initialize().count(function) == 1
    drawn = recording.drawn(menus.RADARSIM_MT_radar)
    found = {button.operator for button in drawn.buttons}
    assert found >= {f"radarsim.{name}" for name in ("measure_and_show", "render_frames")}
    addon.unregister()
    assert menus.draw_in_add not in bpy.types.VIEW3D_MT_add._dyn_ui_initialize()


def test_operators_report_named_errors(scene: Any, tmp_path: Path) -> None:
    """In the background an error report is raised as RuntimeError with its text."""
    rs.radar().output_folder = str(tmp_path / "none" / "run")
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.radarsim.render_frames()
    with pytest.raises(RuntimeError, match="contains no run"):
        bpy.ops.radarsim.process_last_run()
    with pytest.raises(RuntimeError, match="does not exist yet"):
        bpy.ops.radarsim.open_output()
    rs.radar().output_folder = str(tmp_path)
    rs.radar().snapshot_interval_ms = 0.0
    with pytest.raises(RuntimeError, match=r"Snapshot interval is 0\.0 s"):
        bpy.ops.radarsim.render_frames()


def test_set_up_and_assign_operators(addon: Any) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.cursor.location = (1, 2, 3)
    assert bpy.ops.radarsim.setup_rig() == {"FINISHED"}
    empty = bpy.data.objects["Radar"]
    assert tuple(empty.location) == (1, 2, 3)
    assert bpy.context.selected_objects == [empty]
    bpy.ops.mesh.primitive_cube_add()
    assert bpy.ops.radarsim.assign_material(preset="metal") == {"FINISHED"}
    assert scene_panel.echoes(bpy.context.object)
