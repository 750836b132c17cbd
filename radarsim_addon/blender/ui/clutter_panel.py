# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel of a material's clutter in the Material tab: model, its sigma0, texture and motion.

The plot of sigma0 is a preview image of Blender's, made again only when what it shows has changed.
"""

from __future__ import annotations

from typing import Any

import bpy
import bpy.utils.previews
import numpy as np

from ...errors import RadarSimError
from ...physics.clutter import CLUTTER_TABLE
from ..materials import clutter_key, clutter_of, fluctuation_of
from ..nodes.clutter_lobe import CLUTTER_ROW
from ..nodes.group_search import group_input
from ..rig_settings import MATERIAL_PROPERTY, carrier_hz
from .fields import wrapped
from .sigma0_plot import SIDE, draw_sigma0, plot_angles_rad
from .translations import tr

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
    def poll(cls, context: Any) -> bool:
        return group_input(getattr(context, "material", None), CLUTTER_ROW) is not None

    def draw(self, context: Any) -> None:
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

    def _draw_model(self, context: Any, layout: Any, material: Any, settings: Any) -> None:
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

    def _draw_fluctuation(self, layout: Any, settings: Any) -> None:
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
    key = f"{clutter_key(clutter)} {carrier!r}"
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


CLASSES: tuple[type, ...] = (RADARSIM_PT_material_clutter,)
