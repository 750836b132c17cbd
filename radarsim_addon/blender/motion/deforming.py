# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that deform during a burst: their scatterers move with faces of the evaluated mesh.

`may_deform` and, from samples, `vertex_positions` tell which surfaces do. Faces can only be
followed if vertices stay the same points of the surface: `surface_points` recognises these by the
places of the undeformed mesh, which modifiers interpolate (`marked_points`). `Deformations`
attaches each scatterer to the nearest triangle of a `DeformingSurface`, by barycentric weights, and
numbers the surface points of paths.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Real, Single
from ...signal.paths import PathRows
from ...signal.scene import RayMesh, barycentric
from ..materials import SURFACE_TYPES
from ..nodes.shader_trees import trees_within
from ..scene import distance_from_box
from ..state import Snapshot, SurfacePoints, vertex_positions
from .bodies import Bodies, Part

#: Types of parents that deform their children.
_DEFORMING_PARENTS = {"ARMATURE", "LATTICE", "CURVE", "KEY"}
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
        """Whether there are deforming surfaces."""
        return bool(self.surfaces)

    def attach(self, rows: PathRows, bodies: Bodies) -> None:
        """Assign scatterers to faces. Call this for all rows before `number`."""
        for points, mine, part in self._ends(rows, bodies):
            local, _ = distance_from_box(part.instance, np.array(rows[points][mine]))
            vertices, weights = self.surfaces[part.name].attach(local)
            self.body.append(np.full(mine.size, rows[_COLUMNS[points][0]][mine[0]]))
            self.vertices.append(vertices)
            self.weights.append(weights)

    def number(self, rows: PathRows, bodies: Bodies) -> None:
        """Fill in the numbers of surface points. Call this for the same rows, in the same order, as
        `attach`.
        """
        for points, mine, _ in self._ends(rows, bodies):
            rows[_COLUMNS[points][1]][mine] = self._numbered + 1 + np.arange(mine.size)
            self._numbered += mine.size
        one = rows["order"] == 1
        rows["first_surface_point"][one] = rows["last_surface_point"][one]

    def _ends(self, rows: PathRows, bodies: Bodies) -> Iterator[tuple[str, NDArray[np.intp], Part]]:
        """Yield the rows whose scatterers are on a deforming surface, for each end of the path and
        each body.
        """
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

    def __init__(self, item: bpy.types.Object, snapshot: Snapshot, metres_per_unit: float) -> None:
        self.item = item
        self._units = metres_per_unit
        mesh = snapshot.mesh_of(item)
        if mesh is not None:
            self._rays, self.triangles, self._vertices = mesh.rays, mesh.triangles, mesh.vertices
        else:  # each point is a triangle of its own
            self._vertices = vertex_positions(snapshot.evaluated(item)).astype(np.float64)
            self.triangles = np.repeat(
                np.arange(len(self._vertices), dtype=np.int32)[:, None], 3, axis=1
            )
            self._rays = RayMesh(self._vertices, self.triangles)
        self.count = len(self._vertices)
        #: Vertices that surface points use: index in the mesh to index in the series.
        self.needed: dict[int, int] = {}

    @property
    def rounding_m(self) -> float:
        """Distance from the surface that float32 alone can cause [m]."""
        largest = np.abs(self._vertices).max(initial=1e-30)
        return _ROUNDED * float(np.spacing(np.float32(largest))) * self._units

    def apart_m(self, later: DeformingSurface, scale: float) -> float:
        """Return the largest distance between this surface and a later one of the same object [m].

        `scale` is the scale of the object's axes.
        """
        some = self.triangles[:: 1 + len(self.triangles) // _PLACES]
        places = self._vertices[some].mean(axis=1)
        if len(later.triangles):
            apart = float(later._rays.near(places)[1].max(initial=0.0))
        else:
            apart = float(np.linalg.norm(np.ptp(places, axis=0))) if len(places) else 0.0
        return apart * scale * self._units

    def attach(self, local_m: Real) -> tuple[NDArray[np.int32], Real]:
        """Return the vertices (n, 3) and weights (n, 3) of the surface points nearest to points (n,
        3) [m].
        """
        points = local_m / self._units
        corners = self.triangles[np.maximum(self._rays.near(points)[0], 0)]
        weights = barycentric(points, self._vertices[corners])
        in_series = [
            [self.needed.setdefault(vertex, len(self.needed)) for vertex in face]
            for face in corners.tolist()
        ]
        return np.array(in_series, dtype=np.int32).reshape(-1, 3), weights

    def sample(self, snapshot: Snapshot) -> Single | None:
        """Return the needed vertices at the moment of a snapshot [m]; None if their number has
        changed.
        """
        positions = vertex_positions(snapshot.evaluated(self.item))
        if len(positions) != self.count:
            return None
        needed = np.fromiter(self.needed, dtype=np.intp, count=len(self.needed))
        return positions[needed] * np.float32(self._units)


def may_deform(item: bpy.types.Object) -> bool:
    """Return whether the surface of an object can change in other ways than by its matrix."""
    if item.type not in SURFACE_TYPES:
        return False
    if item.type != "MESH" or item.modifiers or item.parent_type in _DEFORMING_PARENTS:
        return True
    return item.data is not None and item.data.shape_keys is not None


def may_change_points(item: bpy.types.Object) -> bool:
    """Return whether the vertices of an object may not stay the same points of its surface."""
    if item.type in ("META", "CURVE", "SURFACE", "FONT"):
        return True
    return any(
        modifier.type not in _KEEP_POINTS
        or (modifier.type == "MIRROR" and any(modifier.use_bisect_axis))
        for modifier in item.modifiers
        if modifier.show_viewport or modifier.show_render
    )


def is_cut(item: bpy.types.Object) -> bool:
    """Return whether Boolean modifiers cut an object. Then faces may stay the same while vertices
    slide.
    """
    return any(
        modifier.type == "BOOLEAN" and (modifier.show_viewport or modifier.show_render)
        for modifier in item.modifiers
    )


def is_on_grid(item: bpy.types.Object) -> bool:
    """Return whether the vertices of an object are on a grid that does not follow its surface.

    This is so for metaballs, and for meshes that a Remesh modifier or node makes after a modifier
    that may deform.
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
    return any(
        node.bl_idname in _ON_GRID_NODES and not node.mute
        for inner in trees_within(tree, muted=False)
        for node in inner.nodes
    )


def are_same_points(one: SurfacePoints, other: SurfacePoints, *, on_grid: bool) -> bool:
    """Return whether the vertices of a mesh are the same points of its surface at two times.

    `on_grid` is what `is_on_grid` returns for the object.
    """
    if one.places.shape != other.places.shape or one.ends != other.ends:
        return False
    moved = float(np.abs(one.places - other.places).max(initial=0.0))
    if on_grid:
        return moved <= _ROUNDED * float(np.spacing(np.abs(one.places).max(initial=1e-30)))
    if one.marks is None or other.marks is None or not one.marks.any():
        return np.array_equal(one.corners, other.corners)
    slid = float(np.abs(one.marks - other.marks).max())
    return slid <= max(_ROUNDED * float(np.spacing(one.marks.max())), _MAX_SLIDE * moved)
