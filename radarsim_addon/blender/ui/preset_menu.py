# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar presets in Blender's own menu: those of radarsim, and those that the user saved."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from ..plan import DEFAULT_PRESET, PRESETS, radar_preset
from ..rig_settings import apply_preset, load_preset, read_preset, save_preset
from ..scene import active_radar
from .fields import RadarPanel, active_group
from .shown_findings import reported

#: Folder below Blender's `presets`.
_FOLDER = "radarsim"


def preset_choice(description: str) -> Any:
    """Return a property that names one of radarsim's presets."""
    return bpy.props.EnumProperty(
        name="Preset",
        items=tuple((name, item.label, item.description) for name, item in PRESETS.items()),
        default=DEFAULT_PRESET,
        description=description,
    )


class _OnRadar(bpy.types.Operator):
    """An operator on the active radar."""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return active_group(context.scene) is not None


class RADARSIM_OT_apply_preset(_OnRadar):
    """Replace waveform, antennas, link budget, range limits and field of view of the radar"""

    bl_idname = "radarsim.apply_preset"
    bl_label = "Apply Radar Preset"
    bl_options = {"REGISTER", "UNDO"}

    preset: preset_choice("Radar that the active one becomes")

    @classmethod
    def description(cls, context: Any, properties: Any) -> str:
        return radar_preset(properties.preset).description

    def execute(self, context: Any) -> set[str]:
        with reported(self):
            apply_preset(context.scene, active_radar(context.scene), radar_preset(self.preset))
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_OT_load_preset(_OnRadar):
    """Make the active radar the one that was saved"""

    bl_idname = "radarsim.load_preset"
    bl_label = "Load Radar Preset"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(
        name="File", subtype="FILE_PATH", description="File of a saved radar"
    )

    def execute(self, context: Any) -> set[str]:
        with reported(self):
            preset = load_preset(Path(self.filepath))
            apply_preset(context.scene, active_radar(context.scene), preset)
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_OT_save_preset(AddPresetBase, _OnRadar):
    """Save the active radar as a preset, or remove a saved one"""

    bl_idname = "radarsim.save_preset"
    bl_label = "Save Radar Preset"
    bl_options = {"REGISTER"}

    preset_menu = "RADARSIM_PT_presets"
    preset_subdir = _FOLDER

    def add(self, context: Any, filepath: str) -> None:
        """Write the file; Blender's preset system chose its name."""
        radar = active_radar(context.scene)
        save_preset(Path(filepath), read_preset(context.scene, radar, self.name))


class RADARSIM_PT_presets(PresetPanel, RadarPanel, bpy.types.Panel):
    bl_label = "Radar Presets"
    bl_idname = "RADARSIM_PT_presets"
    bl_options = {"INSTANCED"}
    preset_subdir = _FOLDER
    preset_operator = "radarsim.load_preset"
    preset_add_operator = "radarsim.save_preset"

    def draw(self, context: Any) -> None:
        column = self.layout.column(align=True)
        column.emboss = "PULLDOWN_MENU"
        for name, preset in PRESETS.items():
            button = column.operator("radarsim.apply_preset", text=preset.label)
            button.preset = name
        self.layout.separator()
        if bpy.utils.preset_paths(_FOLDER):
            PresetPanel.draw(self, context)
            return
        # Nobody has saved a radar yet: Blender's own menu would name a missing path.
        name = context.window_manager.preset_name
        row = self.layout.row(align=True)
        row.prop(context.window_manager, "preset_name", text="")
        row.operator("radarsim.save_preset", text="", icon="ADD").name = name


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_apply_preset,
    RADARSIM_OT_load_preset,
    RADARSIM_OT_save_preset,
    RADARSIM_PT_presets,
)
