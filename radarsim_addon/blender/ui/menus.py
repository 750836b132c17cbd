# SPDX-License-Identifier: GPL-3.0-or-later
"""Where users of Blender look for things: Add > Radar, the menu Radar, F3, and a workspace.

F3 finds what is in a menu.
"""

from __future__ import annotations

from typing import Any

import bpy

from .fields import RadarPanel, may_write
from .picture_images import show_images, split_view
from .result_pictures import KINDS

WORKSPACE = "Radar"
#: Pictures of the workspace, from above.
_PICTURES = ("MAP", "PROFILE")


class RADARSIM_OT_workspace(bpy.types.Operator):
    """Open the workspace Radar: map and profile beside the scene. It is added to this file"""

    bl_idname = "radarsim.workspace"
    bl_label = "Radar Workspace"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.window is not None and not bpy.app.background

    def execute(self, context: bpy.types.Context) -> set[str]:
        workspace = bpy.data.workspaces.get(WORKSPACE)
        if workspace is not None:
            context.window.workspace = workspace
            return {"FINISHED"}
        bpy.ops.workspace.duplicate()
        steps, window = iter((_arrange, _open_tab)), context.window
        bpy.app.timers.register(may_write(lambda: next(steps)(window)), first_interval=0.1)
        return {"FINISHED"}


def _arrange(window: bpy.types.Window) -> float | None:
    """Put pictures next to the scene, once the window has changed to the new workspace."""
    window.workspace.name = WORKSPACE
    images = [bpy.data.images.get(KINDS[kind].image) for kind in _PICTURES]
    shown = [image for image in images if image is not None]
    with bpy.context.temp_override(window=window):
        if shown:
            show_images(bpy.context, shown)
        else:
            split_view(bpy.context, len(_PICTURES))
    for area in _views(window):
        area.spaces.active.show_region_ui = True
    return 0.3


def _open_tab(window: bpy.types.Window) -> float | None:
    """Choose the tab Radar, once the sidebars have their width."""
    for area in _views(window):
        for region in area.regions:
            if region.type == "UI":
                region.active_panel_category = RadarPanel.bl_category
                area.tag_redraw()
    return None


def _views(window: bpy.types.Window) -> list[Any]:
    return [area for area in window.screen.areas if area.type == "VIEW_3D"]


class RADARSIM_MT_presets(bpy.types.Menu):
    bl_label = "Radar"
    bl_idname = "RADARSIM_MT_presets"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.operator_context = "EXEC_REGION_WIN"
        self.layout.operator_enum("radarsim.setup_rig", "preset")


class RADARSIM_MT_radar(bpy.types.Menu):
    bl_label = "Radar"
    bl_idname = "RADARSIM_MT_radar"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.menu("RADARSIM_MT_presets", text="Set Up Radar", icon="OUTLINER_OB_CAMERA")
        layout.operator("radarsim.check_scene", icon="VIEWZOOM")
        layout.operator("radarsim.suggest_materials", icon="MATERIAL")
        layout.separator()
        layout.operator("radarsim.measure_and_show", icon="RENDER_ANIMATION")
        layout.operator("radarsim.render_frames")
        layout.operator("radarsim.process_last_run", icon="GRAPH")
        layout.operator("radarsim.stop_run", icon="CANCEL")
        layout.separator()
        layout.operator("radarsim.workspace", icon="WORKSPACE")
        layout.operator("radarsim.coverage", icon="IPO_SINE")
        layout.operator("radarsim.open_output", icon="FILE_FOLDER")
        layout.operator("radarsim.add_asset_library", icon="ASSET_MANAGER")


def draw_in_add(self: Any, context: bpy.types.Context) -> None:
    self.layout.menu("RADARSIM_MT_presets", icon="OUTLINER_OB_CAMERA")


def draw_in_header(self: Any, context: bpy.types.Context) -> None:
    if context.mode == "OBJECT":
        self.layout.menu("RADARSIM_MT_radar")


def show_menus() -> None:
    """Add the menus; a second call changes nothing."""
    hide_menus()
    bpy.types.VIEW3D_MT_add.append(draw_in_add)
    bpy.types.VIEW3D_MT_editor_menus.append(draw_in_header)


def hide_menus() -> None:
    """Take them back; a second call changes nothing."""
    bpy.types.VIEW3D_MT_add.remove(draw_in_add)
    bpy.types.VIEW3D_MT_editor_menus.remove(draw_in_header)


CLASSES: tuple[type, ...] = (RADARSIM_OT_workspace, RADARSIM_MT_presets, RADARSIM_MT_radar)
