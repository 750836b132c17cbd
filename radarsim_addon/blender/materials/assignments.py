# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that are assigned to the rendered objects.

A material may be in a slot of the mesh or of the object, or be set by Geometry Nodes. The object
may be linked, overridden, or a member of an instanced collection that is in no scene. The slots of
an evaluated object hold all of these.
"""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

from ..state import Snapshot, take_snapshot

#: Object types whose surface Cycles shades by material slots.
SURFACE_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD"}


class MaterialAssignment(NamedTuple):
    """An object with the materials of its slots.

    Attributes
    ----------
    item : bpy.types.Object
        The original object.
    materials
        Original materials by slot; None for an empty slot.
    """

    item: Any
    materials: tuple[Any, ...]


#: Those of a snapshot, hidden ones too, once they were asked for.
_of_snapshots: WeakKeyDictionary[Snapshot, list[MaterialAssignment]] = WeakKeyDictionary()


def assigned_materials(depsgraph: Any) -> list[MaterialAssignment]:
    """Return the materials of each rendered object with a surface.

    Members of instanced collections are included.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    list of MaterialAssignment
        One per object, in the order of the depsgraph.
    """
    snapshot = take_snapshot(depsgraph)
    if snapshot not in _of_snapshots:
        found: dict[Any, MaterialAssignment] = {}
        for shape in snapshot.shapes:
            original = shape.original
            if original.type in SURFACE_TYPES and original not in found:
                found[original] = MaterialAssignment(original, shape.materials)
        _of_snapshots[snapshot] = list(found.values())
    return [one for one in _of_snapshots[snapshot] if not one.item.hide_render]


def has_no_faces(item: Any) -> bool:
    """Return whether an object is a mesh of points or edges alone, as those that carry instances.

    Parameters
    ----------
    item : bpy.types.Object
        Original; modifiers may add faces.

    Returns
    -------
    bool
    """
    return bool(item.type == "MESH" and not item.modifiers and not len(item.data.polygons))


def slot_materials(item: Any) -> tuple[Any, ...]:
    """Return the original materials in the slots of an object; None for an empty slot.

    Parameters
    ----------
    item : bpy.types.Object
        If evaluated, the materials that Geometry Nodes set are included.

    Returns
    -------
    tuple of bpy.types.Material or None
        One per slot.
    """
    return tuple(
        None if slot.material is None else slot.material.original for slot in item.material_slots
    )
