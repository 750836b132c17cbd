# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel of physical inputs in the Material tab, and the operator that brings them."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path
from typing import Any

import bpy
import bpy.utils.previews
import numpy as np
from numpy.typing import NDArray

from ...arrays import Mask, Real, Single
from ...errors import RadarSimError, SceneError
from ...physics.clutter import CLUTTER_TABLE
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.materials import TABLE
from ...signal.scene import RoughSurface
from ..materials import (
    clutter_of,
    fluctuation_of,
    media_beyond_their_band,
    read_surface,
)
from ..materials import physical_materials as pm
from ..materials.physical_materials import ASSETS, limits_of
from ..nodes.groups import group_input
from ..nodes.physical_material import CLUTTER_ROW
from ..nodes.radar_material import EXTINCTION, INDEX
from ..rig_settings import MATERIAL_PROPERTY, beyond_band, carrier_hz, choose_medium
from .fields import draw_findings, reported, tr, wrapped
from .small_drawings import FINE, draw_curve, nice_ticks, text_mask

# -------------------------------------------------------------------------------------------------
# Plot of sigma0 against grazing angle for a panel, drawn by numpy. Does not import bpy.
# -------------------------------------------------------------------------------------------------


#: Size of the picture and its margins [px]: an icon is as wide as it is high.
SIDE = 320
LEFT, RIGHT, TOP, BOTTOM = 48, 14, 12, 30
#: Grazing angles at the ends of its axis, which is logarithmic [degrees].
LEAST_DEG, MOST_DEG = 0.1, 90.0
#: Most decibels from the top to the bottom.
_SPAN_DB = 100.0
_BACK, _VALID, _GRID, _INK = 0.13, 0.24, 0.36, 0.88
#: Colours of the curves, HH and VV.
COLOURS = (0.38, 0.66, 1.0), (1.0, 0.62, 0.22)


def plot_angles_rad() -> Real:
    """Return the grazing angles of the columns of the plot, (columns,) [rad]."""
    return np.radians(np.geomspace(LEAST_DEG, MOST_DEG, SIDE - LEFT - RIGHT))


def draw_sigma0(levels_db: Real, valid: Mask) -> Single:
    """Draw sigma0 of HH and VV, (2, columns) [dB], at `plot_angles_rad`; columns at which the model
    does not hold stay dark. Return RGBA from 0 to 1, (SIDE, SIDE, 4), top row first.
    """
    canvas = np.full((SIDE, SIDE, 4), _BACK, dtype=np.float32)
    canvas[..., 3] = 1.0
    area = canvas[TOP : SIDE - BOTTOM, LEFT : SIDE - RIGHT, :3]
    rows, columns = area.shape[:2]
    area[:, valid] = _VALID
    top_db = 10.0 * math.ceil(float(levels_db.max()) / 10)
    least_db = max(float(levels_db.min()), top_db - _SPAN_DB)
    bottom_db = min(10.0 * math.floor(least_db / 10), top_db - 10)

    def row(level_db: Real) -> Real:
        clipped = np.clip(level_db, bottom_db, top_db)
        return np.asarray((top_db - clipped) / (top_db - bottom_db) * (rows - 1))

    for level_db in nice_ticks(bottom_db, top_db, 5):
        place = round(float(row(np.array(level_db))))
        area[place] = _GRID
        mask = text_mask(f"{level_db:g}".replace("-", "\u2212"))
        _put(canvas, mask, LEFT - 6 - mask.shape[1], TOP + place - mask.shape[0] // 2)
    for angle_deg in (0.1, 1.0, 10.0, MOST_DEG):
        part = math.log(angle_deg / LEAST_DEG) / math.log(MOST_DEG / LEAST_DEG)
        place = round(part * (columns - 1))
        area[:, place] = _GRID
        mask = text_mask(f"{angle_deg:g}\u00b0")
        _put(canvas, mask, LEFT + place - mask.shape[1] // 2, SIDE - BOTTOM + 5)
    for levels, colour in zip(levels_db, COLOURS, strict=True):
        at = (np.arange(columns * FINE) + 0.5) / FINE - 0.5
        draw_curve(area, np.interp(at, np.arange(columns), row(levels)) + 0.5, colour)
    return canvas


def _put(canvas: Single, mask: NDArray[np.float32], left: int, top: int) -> None:
    """Blend a line of text, as far as it is inside."""
    left, top = min(max(left, 0), SIDE - mask.shape[1]), min(max(top, 0), SIDE - mask.shape[0])
    part = canvas[top : top + mask.shape[0], left : left + mask.shape[1], :3]
    part += mask[..., None] * (_INK - part)


# -------------------------------------------------------------------------------------------------
# Panel of a material's clutter in the Material tab: model, its sigma0, texture and motion.
#
# The plot of sigma0 is a preview image of Blender's, made again only when what it shows has
# changed.
# -------------------------------------------------------------------------------------------------


#: Grazing angles at which the panel gives sigma0 [degrees].
_SHOWN_DEG = (0.3, 1.0, 3.0, 10.0, 30.0, 60.0)
_SIDES = ("horizontal", "vertical")
#: Plots that are kept.
_MOST_PLOTS = 16
_plots: Any = None


class RADARSIM_PT_material_clutter(bpy.types.Panel):
    bl_label = "Clutter"
    bl_idname = "RADARSIM_PT_material_clutter"
    bl_parent_id = "RADARSIM_PT_material_physical"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return group_input(getattr(context, "material", None), CLUTTER_ROW) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, material = self.layout, context.material
        layout.use_property_split = True
        settings = getattr(material, MATERIAL_PROPERTY)
        layout.prop(settings, "clutter")
        try:
            self._draw_model(context, layout, material, settings)
            self._draw_fluctuation(layout, settings)
            fluctuation_of([material])
        except RadarSimError as error:
            wrapped(context, layout, str(error), "ERROR")

    def _draw_model(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        material: bpy.types.Material,
        settings: Any,
    ) -> None:
        clutter = clutter_of(material)
        if clutter is None:
            return
        if clutter.name == CLUTTER_TABLE:
            layout.prop(settings, "clutter_path")
        model, carrier = clutter.model, carrier_hz(context.scene)
        for parameter in model.parameters:
            layout.prop(settings, f"clutter_{parameter.name}")
        wrapped(context, layout, model.source, "NONE")
        grazing_rad = np.radians(_SHOWN_DEG)
        valid = model.is_valid(carrier, grazing_rad)
        levels = [clutter.sigma0_db(carrier, grazing_rad, side) for side in _SIDES]
        column = layout.column(align=True)
        text = tr("sigma0 [dB] at {ghz:.6g} GHz, HH and VV", ghz=carrier / 1e9)
        column.label(text=text)
        # as wide as the panel, in units of a button's height
        units = context.region.width / (20 * context.preferences.system.ui_scale) - 2
        column.template_icon(icon_value=_plot(clutter, carrier), scale=min(max(units, 6.0), 16.0))
        column.label(text="HH blue, VV orange; light: grazing angles of the model")
        for angle, in_range, horizontal, vertical in zip(_SHOWN_DEG, valid, *levels, strict=True):
            text = f"{angle:g}\u00b0:  {horizontal:.1f}   {vertical:.1f}"
            if not in_range:
                text += "  " + tr("(outside the model)")
            column.label(text=text, icon="NONE" if in_range else "ERROR")

    def _draw_fluctuation(self, layout: bpy.types.UILayout, settings: Any) -> None:
        layout.prop(settings, "texture")
        if settings.texture != "none":
            layout.prop(settings, "texture_shape")
            layout.prop(settings, "texture_length_m")
        layout.prop(settings, "clutter_motion")
        if settings.clutter_motion != "none":
            layout.prop(settings, "motion_speed_mps")
        if settings.clutter_motion in ("exponential", "sea"):
            layout.prop(settings, "motion_fraction")


def _plot(clutter: Any, carrier: float) -> int:
    """Icon of the plot of a model at a carrier [Hz]."""
    global _plots
    if _plots is None:
        _plots = bpy.utils.previews.new()
    key = f"{clutter.key} {carrier!r}"
    if key not in _plots:
        if len(_plots) >= _MOST_PLOTS:
            _plots.clear()
        angles_rad = plot_angles_rad()
        levels_db = np.array([clutter.sigma0_db(carrier, angles_rad, side) for side in _SIDES])
        picture = draw_sigma0(levels_db, clutter.model.is_valid(carrier, angles_rad))
        preview = _plots.new(key)
        preview.image_size = (SIDE, SIDE)
        preview.image_pixels_float.foreach_set(np.ascontiguousarray(picture[::-1]).ravel())
    return int(_plots[key].icon_id)


def forget_plots() -> None:
    """Free the plots that the panel has drawn."""
    global _plots
    if _plots is not None:
        bpy.utils.previews.remove(_plots)
        _plots = None


CLUTTER_CLASSES: tuple[type, ...] = (RADARSIM_PT_material_clutter,)


class RADARSIM_OT_make_physical(bpy.types.Operator):
    """Replace the material's nodes by the Radar Material of physical inputs"""

    bl_idname = "radarsim.make_physical"
    bl_label = "Use Physical Inputs"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        material = getattr(context, "material", None)
        return material is not None and material.library is None and not material.is_grease_pencil

    def execute(self, context: bpy.types.Context) -> set[str]:
        material = context.material
        try:
            if pm.MEDIUM not in material:
                choose_medium(material, "concrete")
            pm.make_physical(material)
            scene = context.scene
            pm.update_material(material, carrier_hz(scene), beyond_band(scene))
        except RadarSimError as error:
            self.report({"WARNING"}, str(error))
        return {"FINISHED"}


class RADARSIM_PT_material_physical(bpy.types.Panel):
    bl_label = "Radar"
    bl_idname = "RADARSIM_PT_material_physical"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "material"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return getattr(context, "material", None) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, material = self.layout, context.material
        layout.use_property_split = True
        settings = getattr(material, MATERIAL_PROPERTY)
        if not pm.is_physical(material):
            layout.operator("radarsim.make_physical", icon="MATERIAL")
        else:
            self._draw_medium(context, layout, material, settings)
        column = layout.column()
        column.prop(settings, "rms_height_mm")
        column.prop(settings, "correlation_length_mm")
        column.prop(settings, "rms_slope")
        column.prop(settings, "lobe_exponent")
        if pm.is_physical(material):
            layout.prop(settings, "sheet_thickness_mm")
        self._draw_surface(context, layout, material)

    def _draw_medium(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        material: bpy.types.Material,
        settings: Any,
    ) -> None:
        carrier, policy = carrier_hz(context.scene), beyond_band(context.scene)
        layout.prop(settings, "medium")
        try:
            medium = pm.medium_of(material)
            if medium is None:
                layout.label(text="Choose a medium, or set the group's inputs", icon="INFO")
                return
            if medium.name == TABLE:
                layout.prop(settings, "path")
            column = layout.column()
            for parameter in medium.model.parameters:
                column.prop(settings, parameter.name)
            wrapped(context, layout, f"{medium.model.source} ({medium.model.edition})", "NONE")
            values = pm.inputs_at(material, carrier, policy)
            draw_findings(context, layout, media_beyond_their_band(carrier, policy, [material]))
        except RadarSimError as error:
            wrapped(context, layout, str(error), "ERROR")
            return
        index = f"{values[INDEX]:.5g} + j{values[EXTINCTION]:.4g}"
        text = tr("n = {index} at {ghz:.6g} GHz", index=index, ghz=carrier / 1e9)
        layout.label(text=text)
        if read_surface(material).is_entered and values[EXTINCTION] > 0:
            depth_m = SPEED_OF_LIGHT_MPS / carrier / (4 * math.pi * values[EXTINCTION])
            text = tr("Penetration depth (power to 1/e) {metres:.3g} m", metres=depth_m)
            layout.label(text=text)

    def _draw_surface(
        self, context: bpy.types.Context, layout: bpy.types.UILayout, material: bpy.types.Material
    ) -> None:
        surface = read_surface(material)
        try:
            surface.scattered_lobe()
            if surface.rough == RoughSurface():
                return
            layout.label(text=tr("Rms slope {slope:.4g}", slope=surface.rough.slope))
            draw_findings(context, layout, limits_of(material, carrier_hz(context.scene)))
        except RadarSimError as error:
            wrapped(context, layout, str(error), "ERROR")


CLASSES: tuple[type, ...] = (RADARSIM_OT_make_physical, RADARSIM_PT_material_physical)


# -------------------------------------------------------------------------------------------------
# Radar materials in Blender's Asset Browser: contents and registration of the library.
#
# ``scripts/make_asset_library.py`` makes the library, a .blend with previews in the package, from
# `ASSETS`. Materials are appended on use, and follow the scene's carrier then.
# -------------------------------------------------------------------------------------------------


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


def add_library(preferences: bpy.types.Preferences) -> Any:
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


def remove_library(preferences: bpy.types.Preferences) -> bool:
    """Remove the library's entry from the `preferences`; return whether there was one."""
    libraries = preferences.filepaths.asset_libraries
    found = [one for one in libraries if Path(bpy.path.abspath(one.path)) == FOLDER]
    for library in found:
        libraries.remove(library)
    return bool(found)


#: Set in the namespace of drivers, which outlives the add-on, from its end to its next start.
_REMOVED = "radarsim_library_removed"


class RADARSIM_OT_add_asset_library(bpy.types.Operator):
    """Add radarsim's materials to the Asset Browser, as the library Radar Materials"""

    bl_idname = "radarsim.add_asset_library"
    bl_label = "Add Radar Materials Library"
    bl_options = {"REGISTER"}

    @classmethod
    def register(cls) -> None:
        """Add the library again that `unregister` has removed: the extension was updated."""
        if bpy.app.driver_namespace.pop(_REMOVED, False):
            with contextlib.suppress(RadarSimError):
                add_library(bpy.context.preferences)

    @classmethod
    def unregister(cls) -> None:
        """Remove the library, whose folder may be removed next."""
        if remove_library(bpy.context.preferences):
            bpy.app.driver_namespace[_REMOVED] = True

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            library = add_library(context.preferences)
            # The file may contain materials of the library from another carrier.
            pm.refresh_materials(carrier_hz(context.scene), beyond_band(context.scene))
            self.report({"INFO"}, f"Asset Browser > {library.name}: {len(ASSETS)} materials")
            return {"FINISHED"}
        return {"CANCELLED"}


ASSET_CLASSES: tuple[type, ...] = (RADARSIM_OT_add_asset_library,)
