# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels drawn without a window, on a layout that keeps and checks what it is given."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy

from radarsim_addon.blender import addon
from radarsim_addon.blender.ui import scene_reading
from radarsim_addon.blender.ui.fields import RadarPanel
from radarsim_addon.blender.ui.panels import RADARSIM_PT_render
from radarsim_addon.blender.ui.scene_panel import RADARSIM_PT_scene

#: All panels of the tab, in their order.
TAB: list[Any] = [
    item for item in addon.CLASSES
    if issubclass(item, RadarPanel) and item.bl_idname != "RADARSIM_PT_presets"  # type: ignore[attr-defined]
]  # fmt: skip


#: Those that show what was read of the scene.
_OF_THE_SCENE = {RADARSIM_PT_scene, RADARSIM_PT_render}


class Button:
    """What `layout.operator` returns: only properties that the operator has."""

    operator: str
    text: str
    known: set[str]
    values: dict[str, Any]

    def __init__(self, name: str, text: str) -> None:
        group, _, operator = name.partition(".")
        kind = getattr(getattr(bpy.ops, group), operator).get_rna_type()
        known = set(kind.properties.keys())
        self.__dict__.update(operator=name, text=text, known=known, values={})

    def __setattr__(self, name: str, value: Any) -> None:
        assert name in self.known, f"{self.operator} has no property {name!r}"
        self.values[name] = value


class Layout:
    """Records labels, buttons and fields; gives itself for all that is nested."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self.buttons: list[Button] = []
        self.fields: list[str] = []

    def label(self, *, text: str = "", icon: str = "NONE", translate: bool = True) -> None:
        self.texts.append(text)

    def operator(
        self, name: str, *, text: str | None = None, icon: str = "NONE", translate: bool = True
    ) -> Button:
        self.buttons.append(Button(name, text or ""))
        return self.buttons[-1]

    def prop(self, data: Any, name: str, *, text: str | None = None, **_: Any) -> None:
        assert name in data.bl_rna.properties, f"{data} has no property {name!r}"
        self.fields.append(name)

    def prop_enum(self, data: Any, name: str, value: str, **_: Any) -> None:
        assert value in data.bl_rna.properties[name].enum_items, value
        self.fields.append(f"{name}={value}")

    def menu(self, name: str, *, text: str | None = None, icon: str = "NONE") -> None:
        assert hasattr(bpy.types, name), name

    def popover(self, *, panel: str, **_: Any) -> None:
        assert hasattr(bpy.types, panel), panel

    def nested(self, *_: Any, **__: Any) -> Layout:
        return self

    row = column = box = split = grid_flow = column_flow = nested
    separator = template_list = progress = nested


def context(read: bool = True) -> Any:
    """What panels ask a context for, with a wide sidebar, once the scene was read."""
    given = SimpleNamespace(
        scene=bpy.context.scene,
        window_manager=bpy.context.window_manager,
        active_object=bpy.context.view_layer.objects.active,
        region=SimpleNamespace(width=2000),
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
        evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
    )
    if read:  # which evaluates the scene
        scene_reading.read_now(given)
    return given


def drawn(*panels: Any, closed: bool = False) -> Layout:
    """Headers and bodies of panels that would show, all on one layout.

    closed: without the bodies of panels that are closed until a user opens them.
    """
    layout, given = Layout(), context(not _OF_THE_SCENE.isdisjoint(panels))
    for panel in panels:
        if not getattr(panel, "poll", lambda _: True)(given):
            continue
        self = SimpleNamespace(layout=layout, bl_label=panel.bl_label)
        shut = closed and "DEFAULT_CLOSED" in getattr(panel, "bl_options", ())
        for name in ("draw_header", "draw_header_preset", *(() if shut else ("draw",))):
            if hasattr(panel, name):
                getattr(panel, name)(self, given)
    return layout
