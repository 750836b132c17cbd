# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects, instances and meshes as Blender evaluates them at one moment. Does not import bpy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real

#: Identifies an instance among those of its object: the instancer's name, then Blender's numbers.
#: Empty for the object itself.
Key = tuple[Any, ...]

#: Types of objects of which Blender makes meshes; it refuses hair curves and point clouds.
_MESHED = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


class EvaluatedObject(NamedTuple):
    """One object, or one instance of it, in Blender units.

    Blender reuses the data of instances: read what you need before the next object.

    Attributes
    ----------
    evaluated, original, instancer : bpy.types.Object
        `instancer` is the original object that makes the instance; None for the object itself.
    key
        Identifies the instance among those of its object; empty for the object itself.
    matrix_world : mathutils.Matrix
        4x4.
    visible
        Whether Blender draws the object itself, and not only its instances.
    """

    evaluated: Any
    original: Any
    instancer: Any
    key: Key
    matrix_world: Any
    visible: bool

    @property
    def label(self) -> str:
        """Name of the object, with its instancer: ``instancer/object``."""
        name: str = self.original.name_full
        instancer = name if self.instancer is None else self.instancer.name_full
        return name if instancer == name else f"{instancer}/{name}"

    @property
    def matrix(self) -> Real:
        """World matrix in float64, shape (4, 4)."""
        return np.array(self.matrix_world, dtype=np.float64)

    @property
    def box(self) -> Real:
        """Corners of the bounding box in the object's own axes, shape (8, 3)."""
        return np.array([tuple(corner) for corner in self.evaluated.bound_box], dtype=np.float64)


def evaluated_depsgraph(view_layer: Any) -> Any:
    """Return the depsgraph of a view layer.

    Parameters
    ----------
    view_layer : bpy.types.ViewLayer

    Returns
    -------
    bpy.types.Depsgraph
        Up to date.
    """
    view_layer.update()
    return view_layer.depsgraph


def evaluated_objects(depsgraph: Any) -> Iterator[EvaluatedObject]:
    """Yield all objects and instances of a depsgraph in Blender's order.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Yields
    ------
    EvaluatedObject
        Valid until the next one.
    """
    for item in depsgraph.object_instances:
        instancer = item.parent.original if item.is_instance else None
        yield EvaluatedObject(
            item.object,
            item.object.original,
            instancer,
            () if instancer is None else (instancer.name_full, *item.persistent_id),
            item.matrix_world,
            item.show_self,
        )


class evaluated_mesh:
    """Provide the mesh of an evaluated object during a context; None without a surface.

    Parameters
    ----------
    evaluated : bpy.types.Object
        Of any type.
    """

    __slots__ = ("_evaluated", "_made")

    def __init__(self, evaluated: Any) -> None:
        self._evaluated = evaluated
        self._made: Any = None

    def __enter__(self) -> Any:
        evaluated = self._evaluated
        kind = evaluated.type
        if kind not in _MESHED:
            return None
        if kind == "MESH" and evaluated.mode == "OBJECT" and not evaluated.modifiers:
            return evaluated.data  # what Blender would copy
        self._made = evaluated.to_mesh()
        return self._made

    def __exit__(self, *_: object) -> None:
        if self._made is not None:
            self._evaluated.to_mesh_clear()


def read_numbers(
    items: Any, name: str, width: int = 1, dtype: type[np.generic] = np.float32
) -> NDArray[Any]:
    """Return a property of all elements of a mesh.

    Parameters
    ----------
    items : bpy.types.bpy_prop_collection
        For example the vertices of a mesh.
    name
        Property.
    width
        Numbers per element.
    dtype
        Type in which Blender stores the property.

    Returns
    -------
    ndarray
        Shape (elements, width).
    """
    values = np.empty(len(items) * width, dtype=dtype)
    items.foreach_get(name, values)
    return values.reshape(-1, width)


def read_triangles(mesh: Any) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the vertices and triangles of a mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh

    Returns
    -------
    ndarray, ndarray
        Vertices (n, 3), object axes, Blender units, and vertex indices (m, 3).
    """
    mesh.calc_loop_triangles()
    triangles = read_numbers(mesh.loop_triangles, "vertices", 3, np.int32)
    return read_numbers(mesh.vertices, "co", 3), triangles
