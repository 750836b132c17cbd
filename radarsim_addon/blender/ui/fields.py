# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels are made of: their place, settings by their names, sentences."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from ...errors import ConfigError, SceneError
from ...options import Declared
from ..rig_settings import RADAR_PROPERTY, RADAR_SETTINGS, Settings
from ..scene import active_radar

#: Letters of a line that a narrow sidebar holds.
_NARROW = 40


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


def split(layout: Any) -> Any:
    """Return a layout with names on the left and values on the right, without keyframe buttons."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def draw_number(layout: Any, name: str, text: str, icon: str = "NONE") -> None:
    """Draw a derived number like a field: its name on the left, its value on the right."""
    parts = layout.split(factor=0.4)
    names = parts.row()
    names.alignment = "RIGHT"
    names.label(text=name)
    parts.label(text=text, icon=icon, translate=False)


def misfit(group: Any, item: Declared) -> str:
    """Return why the value of a setting cannot be, as a measurement says it; "" where it can."""
    try:
        item.check(getattr(Settings(group, {item.name: item}), item.name))
    except ConfigError as error:
        return str(error)
    return ""


def shown_at_field(group: Any, wrong: str) -> bool:
    """Return whether a field of the panels already shows an error of the settings."""
    shown = group is not None and wrong != ""
    return shown and any(misfit(group, item) == wrong for item in RADAR_SETTINGS.values())


def _draw_quantity(layout: Any, group: Any, item: Declared) -> None:
    """Draw a number with its unit behind it: in brackets after the name a sidebar cuts it off."""
    parts = layout.split(factor=0.4)
    names = parts.row()
    names.alignment = "RIGHT"
    names.label(text=item.shown_label.removesuffix(f" [{item.shown_unit}]"))
    fields = parts.split(factor=0.68, align=True)
    fields.prop(group, item.shown_name, text="")
    fields.label(text=item.shown_unit, translate=False)


def draw_state(panel: Any, text: str) -> None:
    """Draw a panel's state at the right end of its header."""
    row = panel.layout.row()
    row.active = False  # less bright than the panel's name
    row.label(text=text)


def draw_fields(
    layout: Any,
    group: Any,
    settings: Mapping[str, Declared],
    *names: str,
    after: Mapping[str, Sequence[tuple[str, str]]] = MappingProxyType({}),
) -> None:
    """Draw settings one below the other; one that may be None with the switch that sets it.

    after: derived numbers (name, value) below a setting, by the name of the setting.
    """
    column = layout.column()
    for name in names or settings:
        item = settings[name]
        if not item.of.window:
            continue
        if item.optional:
            column.prop(group, f"use_{name}")
            if not getattr(group, f"use_{name}"):
                continue
        wrong = misfit(group, item)
        field = column.column() if wrong else column
        if wrong:  # a file, a script or an animation may set what the field would not take
            field.alert = True
        if item.shown_unit:
            _draw_quantity(field, group, item)
        else:
            field.prop(group, item.shown_name)
        if wrong:
            for line in textwrap.wrap(wrong, _NARROW):
                field.label(text=line, translate=False)
        for label, text in after.get(name, ()):
            draw_number(column, label, text)


def wrapped(context: Any, layout: Any, text: str, icon: str) -> None:
    """Draw a sentence over as many lines as the sidebar's width needs."""
    letters = max(16, int(context.region.width / (7 * context.preferences.system.ui_scale)) - 4)
    column = layout.column(align=True)
    for index, line in enumerate(textwrap.wrap(text, letters)):
        column.label(text=line, icon=icon if index == 0 else "BLANK1")
