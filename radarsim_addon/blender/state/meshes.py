# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of evaluated objects, read into arrays.

Attributes are copied as they are in memory, which takes a hundredth of the time in which Blender
looks up properties one by one. All that is read is read at once, because the next evaluation may
free it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Int32, Single
from ...signal.scene import Mesh

#: Types of objects of which Blender makes meshes; it refuses hair curves and point clouds.
MESHED = {"MESH", "CURVE", "SURFACE", "META", "FONT"}
#: Types of objects without faces.
OF_POINTS = {"CURVES", "POINTCLOUD"}
#: Attribute of meshes by which their points are recognised after all modifiers, while it is there.
_MARKS = "radarsim_point"


class evaluated_mesh:
    """Provide the mesh of an evaluated object during a context; None without a surface."""

    __slots__ = ("_evaluated", "_made")

    def __init__(self, evaluated: bpy.types.Object) -> None:
        self._evaluated = evaluated
        self._made: bpy.types.Mesh | None = None

    def __enter__(self) -> bpy.types.Mesh | None:
        evaluated = self._evaluated
        kind = evaluated.type
        if kind not in MESHED:
            return None
        if kind == "MESH" and evaluated.mode == "OBJECT" and not evaluated.modifiers:
            data: bpy.types.Mesh = evaluated.data  # what Blender would copy
            return data
        self._made = evaluated.to_mesh()
        return self._made

    def __exit__(self, *_: object) -> None:
        if self._made is not None:
            self._evaluated.to_mesh_clear()


def read_numbers(
    items: Any,
    name: str,
    width: int = 1,
    dtype: type[np.generic] = np.float32,
    count: int | None = None,
) -> NDArray[Any]:
    """Return a property of all elements of a collection, such as the vertices of a mesh, (elements,
    width).

    `dtype` is the type in which Blender stores it. Give `count` if counting the elements takes
    long.
    """
    values = np.empty((len(items) if count is None else count) * width, dtype=dtype)
    items.foreach_get(name, values)
    return values.reshape(-1, width)


def _attribute(mesh: bpy.types.Mesh, name: str) -> Int32 | None:
    held = mesh.attributes.get(name)
    return None if held is None else read_numbers(held.data, "value", dtype=np.int32)[:, 0]


def read_points(mesh: bpy.types.Mesh) -> Single:
    """Return the vertices of a mesh in its own axes, (n, 3)."""
    held = mesh.attributes.get("position")
    if held is None:
        return np.empty((0, 3), dtype=np.float32)
    return read_numbers(held.data, "vector", 3)


def mesh_counts(mesh: bpy.types.Mesh) -> tuple[int, int, int, int]:
    """Return the numbers of vertices, edges, corners of polygons, and polygons."""
    return len(mesh.vertices), len(mesh.edges), len(mesh.loops), len(mesh.polygons)


def read_mesh(mesh: bpy.types.Mesh) -> Mesh:
    """Return a mesh as arrays that do not need Blender."""
    polygons = len(mesh.polygons)
    points = read_points(mesh).astype(np.float64)
    if not polygons:
        none = np.empty(0, dtype=np.int32)
        return Mesh(points, none, none, none, none)
    corners, edges = (_attribute(mesh, f".corner_{name}") for name in ("vert", "edge"))
    assert corners is not None and edges is not None  # of each mesh that has polygons
    starts = read_numbers(mesh.polygons, "loop_start", dtype=np.int32)[:, 0]
    cut = None
    if np.diff(starts, append=len(corners)).max() > 4:
        mesh.calc_loop_triangles()
        cut = read_numbers(mesh.loop_triangles, "loops", 3, np.int32)
    slots = _attribute(mesh, "material_index")
    if slots is None:
        slots = np.zeros(polygons, dtype=np.int32)
    shading = None
    if mesh.normals_domain != "FACE":
        shading = read_numbers(mesh.corner_normals, "vector", 3).astype(np.float64)
    return Mesh(points, starts, corners, edges, slots, shading, cut)


# -- deforming surfaces ----------------------------------------------------------------------------


def vertex_positions(evaluated: bpy.types.Object) -> Single:
    """Return the vertices of an evaluated mesh in its own axes, (n, 3) [Blender units].

    For hair curves and point clouds, these are their points.
    """
    with evaluated_mesh(evaluated) as mesh:
        if mesh is not None:
            return read_points(mesh)
    return points_of(evaluated)


def points_of(evaluated: bpy.types.Object) -> Single:
    """Return the points of hair curves or of a point cloud, (n, 3); none for other objects."""
    held = getattr(evaluated.data, "attributes", {}).get("position")
    if held is None:
        return np.empty((0, 3), dtype=np.float32)
    return read_numbers(held.data, "vector", 3)


@contextlib.contextmanager
def marked_points(items: Iterable[bpy.types.Object]) -> Iterator[None]:
    """Store the places of mesh corners as an attribute, for the time of a `with` block.

    Modifiers that make new vertices interpolate this attribute.
    """
    meshes = {item.data: None for item in items if item.type == "MESH"}
    try:
        for mesh in meshes:
            if not mesh.loops or mesh.is_editmode:
                continue
            marks = mesh.attributes.new(_MARKS, "FLOAT_VECTOR", "CORNER")
            places, corners = read_points(mesh), _attribute(mesh, ".corner_vert")
            # At least 1: geometry that other objects bring has 0.
            marks.data.foreach_set("vector", (places - places.min(axis=0) + 1)[corners].ravel())
        yield
    finally:
        for mesh in meshes:
            marks = mesh.attributes.get(_MARKS)
            if marks is not None:
                mesh.attributes.remove(marks)


class SurfacePoints(NamedTuple):
    """What tells the vertices of an evaluated mesh, while `marked_points`."""

    #: Vertices, (n, 3).
    places: Single
    #: Vertices of the corners of all faces.
    corners: Int32
    #: Marks of the vertices, (n, 3), if any modifier left them.
    marks: Single | None = None
    #: Ends of a curve's bevel.
    ends: tuple[float, ...] = ()


def surface_points(evaluated: bpy.types.Object) -> SurfacePoints:
    """Return what identifies the vertices of an evaluated object as points of its surface."""
    ends = tuple(getattr(evaluated.data, f"bevel_factor_{end}", 0.0) for end in ("start", "end"))
    with evaluated_mesh(evaluated) as mesh:
        if mesh is None:
            return SurfacePoints(points_of(evaluated), np.empty(0, dtype=np.int32), None, ends)
        places, corners = read_points(mesh), _attribute(mesh, ".corner_vert")
        if corners is None:
            corners = np.empty(0, dtype=np.int32)
        marks, held = None, mesh.attributes.get(_MARKS)
        if held is not None and held.domain in ("CORNER", "POINT"):
            marks = read_numbers(held.data, "vector", 3)
            if held.domain == "CORNER":
                of_corner, marks = marks, np.zeros_like(places)
                np.maximum.at(marks, corners, of_corner)
        return SurfacePoints(places, corners, marks, ends)
