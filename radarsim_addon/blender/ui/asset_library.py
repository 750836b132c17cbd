# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar materials in Blender's Asset Browser: contents and registration of the library.

``scripts/make_asset_library.py`` makes the library, a .blend with previews in the package, from
`ASSETS`. Materials are appended on use, and follow the scene's carrier then.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ...errors import SceneError
from ..materials import physical_materials as pm
from ..materials.library import ASSETS
from ..rig_settings import beyond_band, carrier_hz
from .shown_findings import reported

FOLDER = Path(__file__).resolve().parents[1] / "assets"
BLEND = FOLDER / "radar_materials.blend"
CATALOGUES = FOLDER / "blender_assets.cats.txt"
LIBRARY_NAME = "Radar Materials"

#: Catalogue identifiers. They must not change, because users' files refer to them.
CATALOGUE_IDS = {
    "Radar/Building": "5c7c2f0e-6d0b-4f5e-9a53-0d2f7d1b6a01",
    "Radar/Ground": "5c7c2f0e-6d0b-4f5e-9a53-0d2f7d1b6a02",
    "Radar/Water": "5c7c2f0e-6d0b-4f5e-9a53-0d2f7d1b6a03",
    "Radar/Metal": "5c7c2f0e-6d0b-4f5e-9a53-0d2f7d1b6a04",
}
#: Carrier of the materials in the library file [Hz].
MADE_AT_HZ = 5.3e9


def make_assets() -> list[Any]:
    """Make the library's materials in the current file, marked as assets, without previews."""
    made = []
    for asset in ASSETS:
        material = asset.material(asset.name, MADE_AT_HZ)
        material.asset_mark()
        data = material.asset_data
        data.catalog_id = CATALOGUE_IDS[asset.catalogue]
        data.description = asset.description
        data.author = "radarsim"
        data.license = "GPL-3.0-or-later"
        for tag in ("radar", asset.medium):
            data.tags.new(tag)
        made.append(material)
    return made


def catalogue_text() -> str:
    """Return the contents of Blender's catalogue file."""
    header = (
        "# This is an Asset Catalog Definition file for Blender.\n"
        "#\n"
        "# Other comments will be ignored; empty lines too.\n\n"
        "VERSION 1\n\n"
    )
    return header + "".join(
        f"{identifier}:{path}:{path.replace('/', '-')}\n"
        for path, identifier in CATALOGUE_IDS.items()
    )


def add_library(preferences: Any) -> Any:
    """Register the library in the `preferences`, return its entry; again: nothing changes."""
    if not BLEND.is_file():
        raise SceneError(
            f"{BLEND} is missing, because the installation is incomplete. Install radarsim again, "
            "or make the file with scripts/make_asset_library.py."
        )
    libraries = preferences.filepaths.asset_libraries
    for library in libraries:
        if Path(bpy.path.abspath(library.path)) == FOLDER:
            return library
    # An update of the extension can move the library, so update its entry.
    for library in libraries:
        if library.name == LIBRARY_NAME:
            library.path = str(FOLDER)
            return library
    library = libraries.new(name=LIBRARY_NAME, directory=str(FOLDER))
    if library is None:  # some versions return nothing
        library = libraries[len(libraries) - 1]
    # Users can edit appended materials; linked ones follow the carrier, too.
    try:
        library.import_method = "APPEND_REUSE"
    except TypeError:  # Blender 5 offers to link, append or pack
        library.import_method = "APPEND"
    return library


class RADARSIM_OT_add_asset_library(bpy.types.Operator):
    """Add radarsim's materials to the Asset Browser, as the library Radar Materials"""

    bl_idname = "radarsim.add_asset_library"
    bl_label = "Add Radar Materials Library"
    bl_options = {"REGISTER"}

    def execute(self, context: Any) -> set[str]:
        with reported(self):
            library = add_library(context.preferences)
            # The file may contain materials of the library from another carrier.
            pm.refresh_materials(carrier_hz(context.scene), beyond_band(context.scene))
            self.report({"INFO"}, f"Asset Browser > {library.name}: {len(ASSETS)} materials")
            return {"FINISHED"}
        return {"CANCELLED"}


CLASSES: tuple[type, ...] = (RADARSIM_OT_add_asset_library,)
