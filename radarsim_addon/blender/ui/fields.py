# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels are made of: their place, settings by their names, sentences."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

from ...errors import SceneError
from ...options import Declared
from ..rig_settings import RADAR_PROPERTY
from ..scene import active_radar


def active_group(scene: Any) -> Any:
    """Return the properties of the scene's active radar; None without one."""
    try:
        return getattr(active_radar(scene), RADAR_PROPERTY)
    except SceneError:
        return None


class RadarPanel:
    """A panel of the sidebar tab."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Radar"


class ActiveRadarPanel(RadarPanel):
    """A panel of the sidebar tab about the active radar."""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return active_group(context.scene) is not None


def draw_fields(layout: Any, group: Any, settings: Mapping[str, Declared], *names: str) -> None:
    """Draw settings one below the other; one that may be None with the switch that sets it."""
    column = layout.column(align=True)
    for name in names or settings:
        item = settings[name]
        if not item.of.window:
            continue
        if item.optional:
            column.prop(group, f"use_{name}")
            if not getattr(group, f"use_{name}"):
                continue
        column.prop(group, item.shown_name)


def wrapped(context: Any, layout: Any, text: str, icon: str) -> None:
    """Draw a sentence over as many lines as the sidebar's width needs."""
    letters = max(16, int(context.region.width / (7 * context.preferences.system.ui_scale)) - 4)
    column = layout.column(align=True)
    for index, line in enumerate(textwrap.wrap(text, letters)):
        column.label(text=line, icon=icon if index == 0 else "BLANK1")
