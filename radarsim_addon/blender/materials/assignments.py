# SPDX-License-Identifier: GPL-3.0-or-later
"""Which materials the rendered objects wear, wherever these come from.

A material may be in a slot of the mesh or of the object, be set by geometry nodes, and the object
may be linked, overridden, or a member of an instanced collection that is in no scene. An evaluated
object's slots hold all of these.
"""

from __future__ import annotations

from typing import Any, NamedTuple

#: Object types whose surface Cycles shades by material slots.
SURFACE_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD"}


class MaterialAssignment(NamedTuple):
    """An original object and its original materials; None for an empty slot."""

    item: Any
    materials: tuple[Any, ...]


def assigned_materials(depsgraph: Any) -> list[MaterialAssignment]:
    """What each rendered object with a surface wears, members of instanced collections included.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.
    """
    found: dict[int, MaterialAssignment] = {}
    for instance in depsgraph.object_instances:
        evaluated = instance.object
        original = evaluated.original
        if original.type not in SURFACE_TYPES or original.hide_render:
            continue
        if original.as_pointer() not in found:
            found[original.as_pointer()] = MaterialAssignment(original, slot_materials(evaluated))
    return list(found.values())


def slot_materials(item: Any) -> tuple[Any, ...]:
    """Original materials in an object's slots; geometry nodes' too where it is evaluated."""
    return tuple(
        None if slot.material is None else slot.material.original for slot in item.material_slots
    )
