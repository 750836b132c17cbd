# SPDX-License-Identifier: GPL-3.0-or-later
"""Which materials of a scene decide on how its paths are encoded."""

from __future__ import annotations

from typing import Any

import bpy

from ..materials import SURFACE_TYPES, assigned_materials, has_no_faces, has_rough_facets
from ..nodes import is_radar_material
from ..scene import is_hidden_at_times
from ..state import evaluated_depsgraph


def _assigned(view_layer: Any) -> set[Any]:
    """Materials of evaluated objects: what geometry nodes set shows in these alone."""
    assigned = assigned_materials(evaluated_depsgraph(view_layer))
    return {m for one in assigned for m in one.materials if m is not None}


def holds_foreign_materials(view_layer: Any) -> bool:
    """Whether something that can echo has another material than the Radar Material."""
    shown = [
        one
        for one in bpy.data.objects
        if one.type in SURFACE_TYPES
        and not has_no_faces(one)
        and (not one.hide_render or is_hidden_at_times(one))
    ]
    slots = [tuple(slot.material for slot in item.material_slots) or (None,) for item in shown]
    materials = {material for of_one in slots for material in of_one} | _assigned(view_layer)
    return not all(is_radar_material(material) for material in materials)


def holds_rough_facets(view_layer: Any) -> bool:
    """Whether something that can echo has facets that round by channel if materials encode."""
    return any(has_rough_facets(material) for material in _assigned(view_layer))
