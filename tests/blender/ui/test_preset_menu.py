# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's preset menu of radars: what it lists, saves, loads and removes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest
from bl_ui.utils import PresetPanel

from radarsim_addon.blender.plan import PRESETS
from radarsim_addon.blender.rig_settings import settings
from radarsim_addon.blender.scene import active_radar
from radarsim_addon.blender.ui.panels import RADARSIM_PT_presets
from tests.blender import recording

OPERATORS = {"apply_preset", "load_preset", "save_preset"}


@pytest.fixture
def folder(addon: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Blender's folder of saved radars, in a place of the test."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.radarsim.setup_rig()
    monkeypatch.setattr(bpy.utils, "user_resource", lambda *a, path="", **k: made(tmp_path / path))
    monkeypatch.setattr(
        bpy.utils,
        "preset_paths",
        lambda subdir: [str(path) for path in tmp_path.glob(f"presets/{subdir}")],
    )
    yield tmp_path / "presets" / "radarsim"


def made(path: Path) -> str:
    path.mkdir(parents=True, exist_ok=True)
    return str(path)


class Menu(PresetPanel):
    """The panel, as far as it is asked."""

    preset_subdir = RADARSIM_PT_presets.preset_subdir
    preset_operator = RADARSIM_PT_presets.preset_operator
    preset_add_operator = RADARSIM_PT_presets.preset_add_operator
    bl_idname = RADARSIM_PT_presets.bl_idname

    def __init__(self) -> None:
        self.layout = recording.Layout()


def listed() -> dict[str, str]:
    """Operators by the labels of the menu's buttons."""
    menu = Menu()
    RADARSIM_PT_presets.draw(menu, bpy.context)
    return {button.text: button.operator for button in menu.layout.buttons if button.text}


def test_the_menu_lists_all_presets(folder: Path) -> None:
    found = listed()
    assert [label for label, name in found.items() if name == "radarsim.apply_preset"] == [
        item.label for item in PRESETS.values()
    ]


def test_a_radar_is_saved_loaded_and_removed(folder: Path) -> None:
    view = settings(active_radar(bpy.context.scene))
    view.carrier_hz = 76.123456789e9
    assert bpy.ops.radarsim.save_preset(name="My radar") == {"FINISHED"}
    assert [path.name for path in folder.iterdir()] == ["My_radar.py"]
    assert listed()["My radar"] == "radarsim.load_preset"
    assert bpy.ops.radarsim.apply_preset(preset="paper") == {"FINISHED"}
    assert view.carrier_hz == 5.3e9
    assert bpy.ops.radarsim.load_preset(filepath=str(folder / "My_radar.py")) == {"FINISHED"}
    assert view.carrier_hz == 76.123456789e9
    assert bpy.ops.radarsim.save_preset(name="My_radar", remove_name=True) == {"FINISHED"}
    assert not list(folder.iterdir())


def test_a_file_of_something_else_is_refused(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "render.py"
    path.write_text("import bpy\nbpy.context.scene.render.fps = 3\n", encoding="utf-8")
    with pytest.raises(RuntimeError, match="holds no radar"):
        bpy.ops.radarsim.load_preset(filepath=str(path))
    assert bpy.context.scene.render.fps != 3


def test_without_a_radar_the_operators_are_off(addon: Any) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert not any(getattr(bpy.ops.radarsim, name).poll() for name in OPERATORS)
