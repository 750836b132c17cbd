# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel of physical inputs in the Material tab, and the operator that brings them."""

from __future__ import annotations

import math
from typing import Any

import bpy

from ...errors import RadarSimError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.materials import TABLE
from ..materials import is_entered, media_beyond_their_band, scattered_lobe_of
from ..materials import physical_materials as pm
from ..materials.material_limits import limits_of
from ..nodes.physical_material import EXTINCTION, INDEX
from ..rig_settings import MATERIAL_PROPERTY, beyond_band, carrier_hz, choose_medium
from .fields import wrapped
from .shown_findings import draw_findings
from .translations import tr


class RADARSIM_OT_make_physical(bpy.types.Operator):
    """Replace the material's nodes by the Radar Material of physical inputs"""

    bl_idname = "radarsim.make_physical"
    bl_label = "Use Physical Inputs"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        material = getattr(context, "material", None)
        return material is not None and material.library is None and not material.is_grease_pencil

    def execute(self, context: Any) -> set[str]:
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
    def poll(cls, context: Any) -> bool:
        return getattr(context, "material", None) is not None

    def draw(self, context: Any) -> None:
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

    def _draw_medium(self, context: Any, layout: Any, material: Any, settings: Any) -> None:
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
        if is_entered(material) and values[EXTINCTION] > 0:
            depth_m = SPEED_OF_LIGHT_MPS / carrier / (4 * math.pi * values[EXTINCTION])
            text = tr("Penetration depth (power to 1/e) {metres:.3g} m", metres=depth_m)
            layout.label(text=text)

    def _draw_surface(self, context: Any, layout: Any, material: Any) -> None:
        surface = pm.surface_of(material)
        try:
            scattered_lobe_of(material)
            if surface is None:
                return
            layout.label(text=tr("Rms slope {slope:.4g}", slope=surface.slope))
            draw_findings(context, layout, limits_of(material, carrier_hz(context.scene)))
        except RadarSimError as error:
            wrapped(context, layout, str(error), "ERROR")


CLASSES: tuple[type, ...] = (RADARSIM_OT_make_physical, RADARSIM_PT_material_physical)
