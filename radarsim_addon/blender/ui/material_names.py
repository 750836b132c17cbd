# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar materials by the names of optical ones: suggestions in a list, and their assignment."""

from __future__ import annotations

from typing import Any

import bpy

from ..rig_settings import PROGRESS_PROPERTY, carrier_hz
from ..scene import replace_material, suggest_materials
from .shown_findings import reported


class RADARSIM_OT_suggest_materials(bpy.types.Operator):
    """List the scene's optical materials with radar materials that fit their names"""

    bl_idname = "radarsim.suggest_materials"
    bl_label = "Assign by Name..."
    bl_options = {"REGISTER"}

    def execute(self, context: Any) -> set[str]:
        found = suggest_materials(context.evaluated_depsgraph_get())
        rows = getattr(context.window_manager, PROGRESS_PROPERTY).suggestions
        rows.clear()
        for material, ready in found.items():
            row = rows.add()
            row.material, row.ready = material.name, ready or "KEEP"
        known = sum(ready is not None for ready in found.values())
        self.report({"INFO"}, f"Optical materials: {len(found)}, with a known name: {known}")
        return {"FINISHED"}


class RADARSIM_OT_apply_materials(bpy.types.Operator):
    """Put the radar materials of the list in place of the optical ones, which stay in the file"""

    bl_idname = "radarsim.apply_materials"
    bl_label = "Apply"
    bl_options = {"REGISTER", "UNDO"}

    discard: bpy.props.BoolProperty(
        name="Discard", description="Close the list and change nothing", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        return bool(getattr(context.window_manager, PROGRESS_PROPERTY).suggestions)

    def execute(self, context: Any) -> set[str]:
        rows = getattr(context.window_manager, PROGRESS_PROPERTY).suggestions
        with reported(self):
            for row in () if self.discard else rows:
                material = bpy.data.materials.get(row.material)
                if material is not None and row.ready != "KEEP":
                    depsgraph = context.evaluated_depsgraph_get()
                    replace_material(material, row.ready, carrier_hz(context.scene), depsgraph)
            rows.clear()
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_UL_suggestions(bpy.types.UIList):
    """Rows: optical material, radar material."""

    def draw_item(
        self, context: Any, layout: Any, data: Any, item: Any, icon: int, owner: Any, name: str
    ) -> None:
        row = layout.split(factor=0.5)
        row.label(text=item.material, icon="MATERIAL")
        row.prop(item, "ready", text="")


def draw_suggestions(context: Any, layout: Any) -> None:
    """Draw the button that lists suggestions, and the list where there is one."""
    state = getattr(context.window_manager, PROGRESS_PROPERTY)
    layout.operator("radarsim.suggest_materials", icon="VIEWZOOM")
    if len(state.suggestions):
        layout.template_list(
            "RADARSIM_UL_suggestions", "", state, "suggestions", state, "suggestion", rows=4
        )
        row = layout.row(align=True)
        row.operator("radarsim.apply_materials", icon="CHECKMARK").discard = False
        row.operator("radarsim.apply_materials", text="", icon="X").discard = True


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_suggest_materials,
    RADARSIM_OT_apply_materials,
    RADARSIM_UL_suggestions,
)
