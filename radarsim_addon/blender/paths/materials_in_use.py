# SPDX-License-Identifier: GPL-3.0-or-later
"""What the materials of a scene decide: how paths are encoded, which objects may be silent."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import bpy

from ...findings import Finding, finding
from ..materials import (
    SURFACE_TYPES,
    assigned_materials,
    foreign_objects,
    has_no_faces,
    has_rough_facets,
    is_rough,
)
from ..nodes import is_radar_material
from ..scene import is_hidden_at_times
from ..state import evaluated_depsgraph


def _assigned(view_layer: Any) -> set[Any]:
    """Materials of evaluated objects: what geometry nodes set shows in these alone."""
    assigned = assigned_materials(evaluated_depsgraph(view_layer))
    return {m for one in assigned for m in one.materials if m is not None}


def holds_foreign_materials(view_layer: Any) -> bool:
    """Whether something that can echo has another material than the Radar Material."""
    depsgraph = evaluated_depsgraph(view_layer)
    if next(foreign_objects(depsgraph, is_radar_material), None) is not None:
        return True
    evaluated = {one.item for one in assigned_materials(depsgraph) if _renders_alike(one.item)}
    shown = [
        one
        for one in bpy.data.objects
        if one.type in SURFACE_TYPES
        and one not in evaluated
        and not has_no_faces(one)
        and (not one.hide_render or is_hidden_at_times(one))
    ]
    slots = [tuple(slot.material for slot in item.material_slots) or (None,) for item in shown]
    return not all(is_radar_material(material) for of_one in slots for material in of_one)


def _renders_alike(item: Any) -> bool:
    """Whether the viewport has the same modifiers as renders, so that its mesh decides."""
    return all(one.show_viewport == one.show_render for one in item.modifiers)


def holds_rough_facets(view_layer: Any) -> bool:
    """Whether something that can echo has facets that round by channel if materials encode."""
    return any(has_rough_facets(material) for material in _assigned(view_layer))


def by_surface(item: Finding, images: Collection[str] = ()) -> list[Finding]:
    """Tell silent objects that are rough from mirrors, but for mirrors that have `images`."""
    if item.code != "object-without-echo":
        return [item]
    named = (one for one in bpy.data.objects if one.name_full in item.subjects)
    rough = {one.name_full for one in named if is_rough(one)}
    others = [name for name in item.subjects if name not in rough and name not in images]
    found = [finding("rough-object-without-echo", *sorted(rough))] if rough else []
    return found + ([finding("object-without-echo", *others)] if others else [])
