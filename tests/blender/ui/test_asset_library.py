# SPDX-License-Identifier: GPL-3.0-or-later
"""The materials in the Asset Browser: what the shipped file holds, and how Blender gets it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import addon
from radarsim_addon.blender.materials import physical_materials as pm
from radarsim_addon.blender.materials.physical_materials import ASSETS
from radarsim_addon.blender.nodes import groups
from radarsim_addon.blender.ui import material_panel as al
from radarsim_addon.errors import SceneError
from radarsim_addon.signal.scene import RoughSurface

pytestmark = pytest.mark.blender


@pytest.fixture(autouse=True)
def empty_file() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def test_blender_lists_every_asset() -> None:
    with bpy.data.libraries.load(str(al.BLEND), assets_only=True) as (found, _):
        assert sorted(found.materials) == sorted(asset.name for asset in ASSETS)
    assert al.BLEND.stat().st_size < 2e6


def test_appended_materials_are_whole() -> None:
    """Medium, surface, catalogue, description and a preview with a picture in it."""
    with bpy.data.libraries.load(str(al.BLEND)) as (found, wanted):
        wanted.materials = found.materials
    pictures = []
    for asset in ASSETS:
        material = bpy.data.materials[asset.name]
        assert pm.is_physical(material)
        assert pm.medium_of(material) == pm.Medium(asset.medium, asset.parameters)
        surface = pm.rough_surface_of(material)
        assert surface == RoughSurface(asset.rms_height_m, asset.correlation_length_m)
        assert material.asset_data.catalog_id == al.CATALOGUE_IDS[asset.catalogue]
        assert material.asset_data.description == asset.description
        assert tuple(material.preview.image_size) == (96, 96)
        pixels = np.empty(96 * 96 * 4, dtype=np.float32)
        material.preview.image_pixels_float.foreach_get(pixels)
        assert pixels.reshape(-1, 4)[:, :3].std() > 0.05, asset.name
        pictures.append(pixels)
        pm.update_material(material, 9.6e9)  # it follows the carrier
    assert len(bpy.data.node_groups) == 1
    (group,) = groups.find_groups("radar_physical")
    assert groups.group_version(group) == groups.DEFINITIONS["radar_physical"].version, (
        "the group has changed: run scripts/make_asset_library.py"
    )
    assert len({picture.tobytes() for picture in pictures}) > 10


def test_catalogue_file() -> None:
    assert al.CATALOGUES.read_text(encoding="utf-8") == al.catalogue_text()
    lines = [line for line in al.catalogue_text().splitlines() if line[:1] not in ("#", "")]
    assert lines[0] == "VERSION 1"
    assert {line.split(":")[0] for line in lines[1:]} == set(al.CATALOGUE_IDS.values())


def test_library_is_added_to_the_preferences_once() -> None:
    preferences = bpy.context.preferences
    before = len(preferences.filepaths.asset_libraries)
    library = al.add_library(preferences)
    try:
        assert (library.name, Path(library.path)) == (al.LIBRARY_NAME, al.FOLDER)
        assert library.import_method in ("APPEND_REUSE", "APPEND")
        al.add_library(preferences)
        assert len(preferences.filepaths.asset_libraries) == before + 1
    finally:
        preferences.filepaths.asset_libraries.remove(library)


def test_the_library_goes_with_the_extension_and_comes_back_with_its_update() -> None:
    """Uninstalling ends the extension; an update starts another one in the same session."""

    def names() -> list[str]:
        return [one.name for one in bpy.context.preferences.filepaths.asset_libraries]

    before = names()
    addon.register()
    try:
        assert names() == before  # nobody has asked for it
        assert bpy.ops.radarsim.add_asset_library() == {"FINISHED"}
        assert names() == [*before, al.LIBRARY_NAME]
        addon.unregister()
        assert names() == before
        addon.register()
        assert names() == [*before, al.LIBRARY_NAME]
    finally:
        addon.unregister()
        bpy.app.driver_namespace.pop(al._REMOVED, None)
    assert names() == before


def test_a_missing_file_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(al, "BLEND", tmp_path / "none.blend")
    with pytest.raises(SceneError, match=r"none\.blend is missing.*make_asset_library"):
        al.add_library(bpy.context.preferences)
