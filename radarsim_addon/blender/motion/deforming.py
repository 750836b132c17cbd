# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that deform during a burst: their scatterers move with faces of the evaluated mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from mathutils.bvhtree import BVHTree
from mathutils.kdtree import KDTree
from numpy.typing import NDArray

from ...array_types import Real, Single
from ...signal.paths import PathRows
from ..materials import SURFACE_TYPES
from ..scene import distance_from_box
from ..state import evaluated_mesh, read_numbers, read_triangles
from .bodies import Bodies, Part

#: Types of parents that deform their children.
_DEFORMING_PARENTS = {"ARMATURE", "LATTICE", "CURVE", "KEY"}


#: Column of the scatterer: columns of its body and surface point.
_COLUMNS = {
    "last_scatterer_m": ("last_body", "last_surface_point"),
    "first_scatterer_m": ("first_body", "first_surface_point"),
}


def may_deform(item: Any) -> bool:
    """Return whether an object's surface can change other than by its matrix."""
    if item.type not in SURFACE_TYPES:
        return False
    if item.type != "MESH" or item.modifiers or item.parent_type in _DEFORMING_PARENTS:
        return True
    return item.data is not None and item.data.shape_keys is not None


def vertex_positions(item: Any, depsgraph: Any) -> Single:
    """Return the vertices of the evaluated mesh, or the points of hair curves and point clouds, own
    axes, shape (n, 3), Blender units.
    """
    evaluated = item.evaluated_get(depsgraph)
    with evaluated_mesh(evaluated) as mesh:
        if mesh is not None:
            return read_numbers(mesh.vertices, "co", 3)
    held = getattr(evaluated.data, "attributes", {}).get("position")
    if held is None:
        return np.empty((0, 3), dtype=np.float32)
    return read_numbers(held.data, "vector", 3)


class DeformingSurface:
    """Mesh or points of one object at the frame's time, and the vertices that paths need."""

    def __init__(self, item: Any, depsgraph: Any, metres_per_unit: float) -> None:
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
        self._nearest = self._finder(mesh is None)
        self.count = len(self._vertices)
        #: Vertices that surface points use: index in the mesh to index in the series.
        self.needed: dict[int, int] = {}

    def _finder(self, points: bool) -> Callable[[Sequence[float]], int | None]:
        """Return a function that finds the triangle, or point, that is nearest to a place."""
        if not points:
            tree = BVHTree.FromPolygons(self._vertices.tolist(), self.triangles.tolist())
            return lambda place: tree.find_nearest(place)[2]
        balanced = KDTree(len(self._vertices))
        for number, point in enumerate(self._vertices.tolist()):
            balanced.insert(point, number)
        balanced.balance()
        return lambda place: balanced.find(place)[1]

    def attach(self, local_m: Real) -> tuple[NDArray[np.int32], Real]:
        """Return vertices (n, 3) and weights (n, 3) of the nearest surface points to (n, 3) [m]."""
        faces = np.zeros(len(local_m), dtype=np.intp)
        points = local_m / self._units
        for row, point in enumerate(points):
            face = self._nearest(tuple(point))
            faces[row] = 0 if face is None else face
        corners = self.triangles[faces]
        weights = barycentric(points, self._vertices[corners])
        in_series = [
            [self.needed.setdefault(vertex, len(self.needed)) for vertex in face]
            for face in corners.tolist()
        ]
        return np.array(in_series, dtype=np.int32).reshape(-1, 3), weights

    def sample(self, depsgraph: Any) -> Single | None:
        """Return the needed vertices at the depsgraph's time [m]; None if their number changed."""
        positions = vertex_positions(self.item, depsgraph)
        if len(positions) != self.count:
            return None
        needed = np.fromiter(self.needed, dtype=np.intp, count=len(self.needed))
        return positions[needed] * np.float32(self._units)


def barycentric(points: Real, corners: Real) -> Real:
    """Return weights, (n, 3), of points (n, 3) projected on triangles (n, 3, 3); their sum is 1."""
    edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    arm = points - corners[:, 0]
    d11 = np.sum(edge_1 * edge_1, axis=-1)
    d12 = np.sum(edge_1 * edge_2, axis=-1)
    d22 = np.sum(edge_2 * edge_2, axis=-1)
    d1, d2 = np.sum(arm * edge_1, axis=-1), np.sum(arm * edge_2, axis=-1)
    area = d11 * d22 - d12**2
    safe = np.where(area > 0, area, 1.0)
    second = np.where(area > 0, (d22 * d1 - d12 * d2) / safe, 0.0)
    third = np.where(area > 0, (d11 * d2 - d12 * d1) / safe, 0.0)
    return np.stack([1 - second - third, second, third], axis=-1)


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
