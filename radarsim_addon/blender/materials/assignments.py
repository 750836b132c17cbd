# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that are assigned to the rendered objects.

A material may be in a slot of the mesh or of the object, or be set by Geometry Nodes. The object
may be linked, overridden, or a member of an instanced collection that is in no scene. The slots of
an evaluated object hold all of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import starmap
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ..state import Shape, Snapshot, read_numbers, take_snapshot

#: Object types whose surface Cycles shades by material slots.
SURFACE_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD"}


class MaterialAssignment(NamedTuple):
    """An object with the materials of its slots.

    Attributes
    ----------
    item : bpy.types.Object
        The original object.
    materials
        Original materials by slot, then those of instances that it makes; None for an empty slot.
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
        # Instances that Geometry Nodes make have slots of their own. They come after the object's,
        # whose places stay.
        found: dict[Any, tuple[Any, ...]] = {}
        for shape in snapshot.shapes:
            if shape.original.type in SURFACE_TYPES:
                known = found.setdefault(shape.original, shape.materials)
                more = (one for one in shape.materials if one and one not in known)
                found[shape.original] = (*known, *dict.fromkeys(more))
        _of_snapshots[snapshot] = list(starmap(MaterialAssignment, found.items()))
    return [one for one in _of_snapshots[snapshot] if not one.item.hide_render]


def foreign_objects(depsgraph: Any, is_known: Callable[[Any], bool]) -> Iterator[Any]:
    """Yield rendered objects with faces of a material that is not known, or of none (None).

    Faces decide, not slots: an object that only holds instances has none, and Set Material of
    Geometry Nodes leaves an empty slot that no face uses.
    """
    snapshot = take_snapshot(depsgraph)
    for shape in snapshot.shapes:
        original, slots = shape.original, shape.materials or (None,)
        if original.type not in SURFACE_TYPES or original.hide_render or all(map(is_known, slots)):
            continue
        if not all(is_known(slots[index]) for index in _used_slots(snapshot, shape, len(slots))):
            yield original


def _used_slots(snapshot: Snapshot, shape: Shape, count: int) -> list[int]:
    """Return the slots that faces use; all of hair curves and point clouds, which have no mesh."""
    if shape.kind in {"CURVES", "POINTCLOUD"}:
        return list(range(count))
    with snapshot.mesh(shape) as mesh:
        polygons = () if mesh is None else mesh.polygons
        found = read_numbers(polygons, "material_index", dtype=np.int32) if polygons else ()
    used: list[int] = np.unique(np.clip(found, 0, count - 1)).astype(int).tolist()
    return used


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
