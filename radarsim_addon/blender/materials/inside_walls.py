# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies inside walls: other parts of the same mesh, and other objects at a moment of a run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
from mathutils.bvhtree import BVHTree

from ...array_types import Mask, Real
from ...findings import Finding, finding
from ...vectors import norms
from ..nodes import attributes
from ..nodes.group_search import group_input
from ..nodes.materials import has_interior
from ..nodes.physical_material import INDEX
from ..state import Snapshot, evaluated_mesh, read_triangles, take_snapshot
from .assignments import SURFACE_TYPES, assigned_materials

#: Fraction of a surface inside another part of its mesh, and inside a wall, that is named.
_LEAST_BURIED, _LEAST_INSIDE = 0.005, 0.1
#: Error of spreading from which on an antenna in a medium is named [dB].
_LEAST_DB = 0.02
#: Triangles of an object that are looked at, the largest ones.
_TRIANGLES = 500
#: Points of an object that may lie in a wall, at most.
_POINTS = 64
#: Distance from a face at which a ray begins, relative to the size of the object.
_OFF_FACE = 1e-5
#: Faces that a ray may pass, at most.
_MOST_FACES = 64


def overlapping_shells(depsgraph: Any) -> list[Finding]:
    """Find meshes with an interior that consist of parts which reach into one another.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    list of Finding
        One ``shells-overlap`` per object.
    """
    found = []
    is_inside = cache(has_interior)
    for item, materials in assigned_materials(depsgraph):
        if item.type != "MESH" or not any(map(is_inside, materials)):
            continue
        with evaluated_mesh(item.evaluated_get(depsgraph)) as mesh:
            # a box, or less, has no parts
            if mesh is None or len(mesh.polygons) <= 6:
                continue
            vertices, corners = read_triangles(mesh)
        fraction = _buried(vertices.astype(np.float64), corners)
        if fraction > _LEAST_BURIED:
            found.append(finding("shells-overlap", item.name, fraction=fraction))
    return found


def _buried(points: Real, corners: Any) -> float:
    """Fraction of a surface whose outer side is inside another part of the mesh."""
    tree = BVHTree.FromPolygons(points.tolist(), corners.tolist())
    place, outward, area = _largest(points[corners])
    off = _OFF_FACE * float(np.ptp(points, axis=0).max(initial=0.0))
    buried = np.zeros(len(area), dtype=bool)
    rays = zip((place + off * outward).tolist(), outward.tolist(), strict=True)
    for row, (start, ray) in enumerate(rays):
        _, normal, _, _ = tree.ray_cast(start, ray)
        buried[row] = normal is not None and normal.dot(ray) > 0
    return float(area[buried].sum() / max(area.sum(), 1e-300))


def _largest(triangles: Real) -> tuple[Real, Real, Real]:
    """Return middles, unit normals and areas of the largest triangles (n, 3, 3)."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    double = norms(across)
    chosen = np.argsort(-double, kind="stable")[:_TRIANGLES]
    chosen = chosen[double[chosen] > 0]
    return triangles[chosen].mean(axis=1), across[chosen] / double[chosen, None], double[chosen] / 2


def found_inside(depsgraph: Any, antennas: Sequence[Real]) -> list[Finding]:
    """Find what is inside the material of walls and other interiors, in the evaluated frame.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date; materials and walls are set for the run.
    antennas
        Positions of receiver and transmitter, (3,) each [Blender units].

    Returns
    -------
    list of Finding
        One ``inside-a-wall`` that names each object and antenna with its wall, of the walls whose
        absorption and delay are applied where a ray crosses a face. One ``antenna-in-medium`` per
        object that holds an antenna, with its index and what spreading is off by at most.
    """
    snapshot, places = take_snapshot(depsgraph), np.asarray(antennas, dtype=np.float64)
    low, high = snapshot.corners.min(axis=1), snapshot.corners.max(axis=1)
    found = []
    if names := list(_in_walls(snapshot, places, low, high)):
        found.append(finding("inside-a-wall", *names))
    within = ((places[:, None] > low) & (places[:, None] < high)).all(axis=2).any(axis=0)
    for row in np.flatnonzero(within & snapshot.layout.visible).tolist():
        shape = snapshot.shapes[snapshot.layout.shape[row]]
        entered = [one for one in shape.materials if has_interior(one)]
        if not entered or shape.kind != "MESH" or not _is_surface(shape):
            continue
        count = int(np.sum(_Wall(snapshot, row).holds(places)))
        sockets = [group_input(material, INDEX) for material in entered]
        index = max((float(s.default_value) for s in sockets if s is not None), default=1.0)
        if count and abs(power_db := 20 * count * math.log10(index)) > _LEAST_DB:
            label = snapshot.label(row)
            found.append(finding("antenna-in-medium", label, index=index, power_db=power_db))
    return found


def _in_walls(snapshot: Snapshot, antennas: Real, low: Real, high: Real) -> dict[str, None]:
    """Objects and antennas inside walls that absorb at their faces, each with its wall."""
    visible = snapshot.layout.visible
    walls = np.flatnonzero(visible & snapshot.of_shapes([_at_faces(s) for s in snapshot.shapes]))
    shown = visible & snapshot.of_shapes([_is_surface(shape) for shape in snapshot.shapes])
    names: dict[str, None] = {}
    for row in walls.tolist():
        wall = _Wall(snapshot, row)
        if np.any(wall.holds(antennas)):
            names[f"the radar in {snapshot.label(row)}"] = None
        for other, points in _near(snapshot, row, shown, low, high):
            if np.mean(wall.holds(points)) > _LEAST_INSIDE:
                names[f"{snapshot.label(other)} in {snapshot.label(row)}"] = None
    return names


def _is_surface(shape: Any) -> bool:
    return shape.original.type in SURFACE_TYPES and not shape.original.hide_render


def _at_faces(shape: Any) -> bool:
    item = shape.original
    there = attributes.OBJECT_SHELL_THICKNESS in item or attributes.OBJECT_LAYER_AT_FACES in item
    return there and _is_surface(shape)


def _near(
    snapshot: Snapshot, row: int, shown: Mask, low: Real, high: Real
) -> Iterator[tuple[int, Real]]:
    """Rows of objects whose box meets that of a row, and points of their surfaces, (n, 3)."""
    meets = np.all((low <= high[row]) & (high >= low[row]), axis=1)
    for other in np.flatnonzero(meets & shown).tolist():
        if other == row:
            continue
        with snapshot.mesh(snapshot.shapes[snapshot.layout.shape[other]]) as mesh:
            if mesh is None or not len(mesh.polygons):
                continue
            vertices, corners = read_triangles(mesh)
        matrix = snapshot.matrix(other)
        points = (vertices @ matrix[:3, :3].T + matrix[:3, 3])[corners].mean(axis=1)
        yield other, points[:: -(-len(points) // _POINTS)]


class _Wall:
    """The mesh of an object or instance, about its own place: the tree is in float32."""

    def __init__(self, snapshot: Snapshot, row: int) -> None:
        matrix = snapshot.matrix(row)
        with snapshot.mesh(snapshot.shapes[snapshot.layout.shape[row]]) as mesh:
            vertices, corners = read_triangles(mesh)
        points = vertices @ matrix[:3, :3].T
        self._place = matrix[:3, 3]
        self._low, self._high = points.min(axis=0), points.max(axis=0)
        self._step = 1e-6 * float(np.ptp(points, axis=0).max())
        self._tree = BVHTree.FromPolygons(points.tolist(), corners.tolist())

    def holds(self, points: Real) -> Any:
        """Whether points (n, 3) are inside: a ray from each passes an odd number of faces."""
        points = points - self._place
        inside = np.all((points > self._low) & (points < self._high), axis=1)
        ray = np.array([0.3713907, 0.5570860, 0.7427814])  # along no edge
        for row in np.flatnonzero(inside):
            start, count = points[row], 0
            while count < _MOST_FACES:
                hit, _, _, _ = self._tree.ray_cast(start.tolist(), ray.tolist())
                if hit is None:
                    break
                start, count = np.array(hit) + self._step * ray, count + 1
            inside[row] = count % 2 == 1
        return inside
