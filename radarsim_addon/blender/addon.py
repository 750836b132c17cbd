# SPDX-License-Identifier: GPL-3.0-or-later
"""Registration of all that the add-on brings: settings, operators, panels, file handler."""

from __future__ import annotations

import bpy

from ..processes import own_folder, remove_abandoned_folders
from . import rig_settings
from .headless.session import session_folder
from .state import follow_evaluations, ignore_evaluations
from .ui import (
    fields,
    live_gizmo,
    live_preview,
    material_panel,
    measuring,
    menus,
    operators,
    overlays,
    panels,
    picture_images,
    result_files,
    results_panel,
    scene_panel,
)
from .ui import link_budget_panel as system_panel

#: Every class besides the settings, in the order of registration, which is that of the panels.
CLASSES: tuple[type, ...] = (
    *operators.CLASSES,
    *operators.COVERAGE_CLASSES,
    *panels.CLASSES,
    *results_panel.CLASSES,
    *results_panel.PICKING_CLASSES,
    *result_files.CLASSES,
    *scene_panel.FIX_CLASSES,
    *scene_panel.NAME_CLASSES,
    *panels.RADAR_CLASSES,
    *system_panel.CLASSES,
    *overlays.CLASSES,
    panels.RADARSIM_PT_waveform,
    *scene_panel.CLASSES,
    *panels.RUN_CLASSES,
    *material_panel.CLASSES,
    *material_panel.CLUTTER_CLASSES,
    *material_panel.ASSET_CLASSES,
    *menus.CLASSES,
    *live_gizmo.CLASSES,
)


def register() -> None:
    """Register settings, operators and panels; a second call changes nothing.

    Temporary folders of sessions that have crashed are removed.
    """
    fields.register_translations()
    rig_settings.register()
    own = session_folder()
    if own is not None:
        own_folder(own)
    remove_abandoned_folders()
    follow_evaluations()
    results_panel.register_results()
    live_preview.register_live()
    for item in CLASSES:
        if not _is_registered(item):
            bpy.utils.register_class(item)
    overlays.show_overlays()
    picture_images.follow_zoom()
    results_panel.follow_clicks()
    menus.show_menus()


def _is_registered(kind: type) -> bool:
    return "bl_rna" in vars(kind)  # gizmos have no is_registered


def unregister() -> None:
    """Take all of it back. A second call changes nothing."""
    measuring.end_runs()
    live_preview.unregister_live()
    menus.hide_menus()
    results_panel.ignore_clicks()
    picture_images.stop_drawing()
    overlays.hide_overlays()
    material_panel.forget_plots()
    for item in reversed(CLASSES):
        if _is_registered(item):
            bpy.utils.unregister_class(item)
    results_panel.unregister_results()
    ignore_evaluations()
    rig_settings.unregister()
    fields.unregister_translations()
