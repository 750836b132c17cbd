# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that deform during a burst: their scatterers move with faces of the evaluated mesh.

`may_deform` and, from samples, `vertex_positions` tell which surfaces do. Faces can only be
followed if vertices stay the same points of the surface: `surface_points` recognises these by the
places of the undeformed mesh, which modifiers interpolate (`marked_points`). `Deformations`
attaches each scatterer to the nearest triangle of a `DeformingSurface`, by barycentric weights, and
numbers the surface points of paths.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Real, Single
from ...signal.paths import PathRows
from ...signal.scene import RayMesh, barycentric
from ..materials import SURFACE_TYPES
from ..scene import distance_from_box
from ..state import evaluated_mesh, read_numbers, read_triangles
from .bodies import Bodies, Part

#: Types of parents that deform their children.
_DEFORMING_PARENTS = {"ARMATURE", "LATTICE", "CURVE", "KEY"}
#: Types of objects without faces.
_OF_POINTS = {"CURVES", "POINTCLOUD"}
#: Modifiers that keep each vertex on the same point of the surface, whatever changes.
_KEEP_POINTS = {
    *("ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE", "MESH_DEFORM"),
    *("SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH", "LAPLACIANSMOOTH", "WARP"),
    *("SURFACE_DEFORM", "WAVE", "CLOTH", "SOFT_BODY", "COLLISION", "MESH_CACHE", "SURFACE"),
    *("SUBSURF", "MULTIRES", "SOLIDIFY", "ARRAY", "MIRROR", "SCREW", "TRIANGULATE", "EDGE_SPLIT"),
    *("NORMAL_EDIT", "WEIGHTED_NORMAL", "UV_PROJECT", "UV_WARP", "DATA_TRANSFER"),
    *("VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY", "PARTICLE_SYSTEM"),
}
#: Modifiers that do not move a mesh without being animated themselves.
_KEEP_SHAPE = {
    *("SUBSURF", "MULTIRES", "SOLIDIFY", "ARRAY", "MIRROR", "SCREW", "TRIANGULATE", "EDGE_SPLIT"),
    *("BEVEL", "WELD", "REMESH", "DECIMATE", "NORMAL_EDIT", "WEIGHTED_NORMAL"),
}
#: Nodes that put vertices on the edges of a grid that does not move with the surface.
_ON_GRID_NODES = {"GeometryNodeVolumeToMesh", "GeometryNodeGridToMesh"}
#: Attribute of meshes by which their points are recognised after all modifiers, while it is there.
_MARKS = "radarsim_point"
#: Part of the deformation by which vertices may slide along the surface.
_MAX_SLIDE = 0.02
#: Steps of float32 by which marks of one point may differ.
_ROUNDED = 16
#: Number of places at which the distance from another surface is taken.
_PLACES = 512
#: Column of the scatterer: columns of its body and surface point.
_COLUMNS = {
    "last_scatterer_m": ("last_body", "last_surface_point"),
    "first_scatterer_m": ("first_body", "first_surface_point"),
}


class Deformations:
    """All deforming surfaces of a frame, and the surface points of paths on them."""

    def __init__(self, surfaces: dict[str, DeformingSurface], metres_per_unit: float) -> None:
        self.surfaces = surfaces
        self._units = metres_per_unit
        self.body: list[NDArray[np.int32]] = []
        self.vertices: list[NDArray[np.int32]] = []
        self.weights: list[Real] = []
        self._numbered = 0

    @property
    def any(self) -> bool:
        """Whether a surface deforms."""
        return bool(self.surfaces)

    def attach(self, rows: PathRows, bodies: Bodies) -> None:
        """Assign scatterers to faces; call it for all rows before `number`."""
        for points, mine, part in self._ends(rows, bodies):
            local, _ = distance_from_box(part.instance, np.array(rows[points][mine]))
            vertices, weights = self.surfaces[part.name].attach(local)
            self.body.append(np.full(mine.size, rows[_COLUMNS[points][0]][mine[0]]))
            self.vertices.append(vertices)
            self.weights.append(weights)

    def number(self, rows: PathRows, bodies: Bodies) -> None:
        """Fill in the numbers of surface points, for the same rows and order as `attach`."""
        for points, mine, _ in self._ends(rows, bodies):
            rows[_COLUMNS[points][1]][mine] = self._numbered + 1 + np.arange(mine.size)
            self._numbered += mine.size
        one = rows["order"] == 1
        rows["first_surface_point"][one] = rows["last_surface_point"][one]

    def _ends(self, rows: PathRows, bodies: Bodies) -> Iterator[tuple[str, NDArray[np.intp], Part]]:
        """Yield rows on deforming surfaces, by end of the path and body."""
        for points, (column, _) in _COLUMNS.items():
            wanted = np.arange(rows.size)
            if points == "first_scatterer_m":  # at order 1 both ends are the same
                wanted = np.flatnonzero(rows["order"] > 1)
            numbers = rows[column][wanted]
            for number in np.unique(numbers).tolist():
                if number and bodies[number - 1].name in self.surfaces:
                    yield points, wanted[numbers == number], bodies[number - 1]


class DeformingSurface:
    """Mesh or points of one object at the frame's time, and the vertices that paths need."""

    def __init__(
        self, item: bpy.types.Object, depsgraph: bpy.types.Depsgraph, metres_per_unit: float
    ) -> None:
        self.item = item
        self._units = metres_per_unit
        with evaluated_mesh(item.evaluated_get(depsgraph)) as mesh:
            if mesh is not None:
                positions, self.triangles = read_triangles(mesh)
        if mesh is None:  # each point is a triangle of its own
            positions = vertex_positions(item, depsgraph)
            self.triangles = np.repeat(
                np.arange(len(positions), dtype=np.int32)[:, None], 3, axis=1
            )
        self._vertices = positions.astype(np.float64)
        self._rays = RayMesh(self._vertices, self.triangles)
        self.count = len(self._vertices)
        #: Vertices that surface points use: index in the mesh to index in the series.
        self.needed: dict[int, int] = {}

    @property
    def rounding_m(self) -> float:
        """Steps of float32 that a distance from the surface may be off [m]."""
        largest = np.abs(self._vertices).max(initial=1e-30)
        return _ROUNDED * float(np.spacing(np.float32(largest))) * self._units

    def apart_m(self, later: DeformingSurface, scale: float) -> float:
        """Return how far places of this surface are from a later one of the object at most [m].

        `scale` is that of the object's axes.
        """
        some = self.triangles[:: 1 + len(self.triangles) // _PLACES]
        places = self._vertices[some].mean(axis=1)
        if len(later.triangles):
            apart = float(later._rays.near(places)[1].max(initial=0.0))
        else:
            apart = float(np.linalg.norm(np.ptp(places, axis=0))) if len(places) else 0.0
        return apart * scale * self._units

    def attach(self, local_m: Real) -> tuple[NDArray[np.int32], Real]:
        """Return vertices (n, 3) and weights (n, 3) of the nearest surface points to (n, 3) [m]."""
        points = local_m / self._units
        corners = self.triangles[np.maximum(self._rays.near(points)[0], 0)]
        weights = barycentric(points, self._vertices[corners])
        in_series = [
            [self.needed.setdefault(vertex, len(self.needed)) for vertex in face]
            for face in corners.tolist()
        ]
        return np.array(in_series, dtype=np.int32).reshape(-1, 3), weights

    def sample(self, depsgraph: bpy.types.Depsgraph) -> Single | None:
        """Return the needed vertices at the depsgraph's time [m]; None if their number changed."""
        positions = vertex_positions(self.item, depsgraph)
        if len(positions) != self.count:
            return None
        needed = np.fromiter(self.needed, dtype=np.intp, count=len(self.needed))
        return positions[needed] * np.float32(self._units)


def may_deform(item: bpy.types.Object) -> bool:
    """Return whether an object's surface can change other than by its matrix."""
    if item.type not in SURFACE_TYPES:
        return False
    if item.type != "MESH" or item.modifiers or item.parent_type in _DEFORMING_PARENTS:
        return True
    return item.data is not None and item.data.shape_keys is not None


def vertex_positions(item: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Single:
    """Return the vertices of the evaluated mesh, in its own axes, (n, 3), Blender units.

    Hair curves and point clouds have their points instead.
    """
    evaluated = item.evaluated_get(depsgraph)
    with evaluated_mesh(evaluated) as mesh:
        if mesh is not None:
            return read_numbers(mesh.vertices, "co", 3)
    held = getattr(evaluated.data, "attributes", {}).get("position")
    if held is None:
        return np.empty((0, 3), dtype=np.float32)
    return read_numbers(held.data, "vector", 3)


def may_change_points(item: bpy.types.Object) -> bool:
    """Return whether an object's vertices may become other points of its surface."""
    if item.type in ("META", "CURVE", "SURFACE", "FONT"):
        return True
    return any(
        modifier.type not in _KEEP_POINTS
        or (modifier.type == "MIRROR" and any(modifier.use_bisect_axis))
        for modifier in item.modifiers
        if modifier.show_viewport or modifier.show_render
    )


def is_cut(item: bpy.types.Object) -> bool:
    """Return whether Boolean modifiers cut an object: its faces may stay while vertices slide."""
    return any(
        modifier.type == "BOOLEAN" and (modifier.show_viewport or modifier.show_render)
        for modifier in item.modifiers
    )


def is_on_grid(item: bpy.types.Object) -> bool:
    """Return whether an object's vertices are on a grid, whatever moves.

    So are those of metaballs, and of meshes that Remesh modifiers or nodes make after what may
    deform.
    """
    moves = item.parent_type in _DEFORMING_PARENTS
    moves |= getattr(item.data, "shape_keys", None) is not None
    for modifier in item.modifiers:
        if not (modifier.show_viewport or modifier.show_render):
            continue
        if modifier.type == "NODES":  # they may also move what they remesh
            if _is_grid_tree(modifier.node_group):
                return True
        elif modifier.type == "REMESH" and moves:
            return True
        moves |= modifier.type not in _KEEP_SHAPE
    return bool(item.type == "META")


def _is_grid_tree(tree: bpy.types.NodeTree) -> bool:
    return tree is not None and any(
        node.bl_idname in _ON_GRID_NODES or _is_grid_tree(getattr(node, "node_tree", None))
        for node in tree.nodes
        if not node.mute
    )


@contextlib.contextmanager
def marked_points(items: Iterable[Any]) -> Iterator[None]:
    """Give the corners of the meshes of objects their places as an attribute, for a time.

    Modifiers interpolate attributes of corners where they make vertices.
    """
    meshes = {item.data: None for item in items if item.type == "MESH"}
    try:
        for mesh in meshes:
            if not mesh.loops or mesh.is_editmode:
                continue
            marks = mesh.attributes.new(_MARKS, "FLOAT_VECTOR", "CORNER")
            places = read_numbers(mesh.vertices, "co", 3)
            corners = read_numbers(mesh.loops, "vertex_index", 1, np.int32)[:, 0]
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
    corners: NDArray[np.int32]
    #: Marks of the vertices, (n, 3), if any modifier left them.
    marks: Single | None
    #: Ends of a curve's bevel.
    ends: tuple[float, ...]
    #: As `is_on_grid`.
    on_grid: bool


def surface_points(item: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> SurfacePoints:
    """Return what tells the vertices of an object at the depsgraph's time."""
    evaluated = item.evaluated_get(depsgraph)
    ends = tuple(getattr(evaluated.data, f"bevel_factor_{end}", 0.0) for end in ("start", "end"))
    with evaluated_mesh(evaluated) as mesh:
        if mesh is None:
            none = np.empty(0, dtype=np.int32)
            return SurfacePoints(vertex_positions(item, depsgraph), none, None, ends, False)
        places = read_numbers(mesh.vertices, "co", 3)
        corners = read_numbers(mesh.loops, "vertex_index", 1, np.int32)[:, 0]
        marks, held = None, mesh.attributes.get(_MARKS)
        if held is not None and held.domain in ("CORNER", "POINT"):
            marks = read_numbers(held.data, "vector", 3)
            if held.domain == "CORNER":
                of_corner, marks = marks, np.zeros_like(places)
                np.maximum.at(marks, corners, of_corner)
        return SurfacePoints(places, corners, marks, ends, is_on_grid(item))


def are_same_points(one: SurfacePoints, other: SurfacePoints) -> bool:
    """Return whether vertices are the same points of a surface at two times."""
    if one.places.shape != other.places.shape or one.ends != other.ends:
        return False
    moved = float(np.abs(one.places - other.places).max(initial=0.0))
    if one.on_grid:
        return moved <= _ROUNDED * float(np.spacing(np.abs(one.places).max(initial=1e-30)))
    if one.marks is None or other.marks is None or not one.marks.any():
        return np.array_equal(one.corners, other.corners)
    slid = float(np.abs(one.marks - other.marks).max())
    return slid <= max(_ROUNDED * float(np.spacing(one.marks.max())), _MAX_SLIDE * moved)


def points_within(depsgraph: bpy.types.Depsgraph, items: Iterable[Any]) -> dict[str, bytes]:
    """Return the points of hair and point clouds that nodes make within objects of other types.

    By the names of the objects. `items` are those that may have nodes.
    """
    found: dict[str, bytes] = {}
    if not any(modifier.type == "NODES" for item in items for modifier in item.modifiers):
        return found
    for one in depsgraph.object_instances:
        item = one.object
        if item.type not in _OF_POINTS or item.original.type in _OF_POINTS:
            continue
        held = item.data.attributes.get("position")
        if held is not None:
            points = read_numbers(held.data, "vector", 3).tobytes()
            found[item.name] = found.get(item.name, b"") + points
    return found
