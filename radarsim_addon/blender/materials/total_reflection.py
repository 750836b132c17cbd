# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects in which waves meet a face beyond the critical angle, which straight rays do not know."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ...array_types import Real
from ...findings import Finding, finding
from ..nodes.group_search import group_input
from ..nodes.materials import has_interior
from ..nodes.physical_material import INDEX
from ..state import evaluated_mesh, read_triangles
from .assignments import assigned_materials

#: Rays that are followed into an object, about, and triangles on which they begin, at most.
_RAYS = 1000
_TRIANGLES = 500
#: Fraction of the entering waves that objects without a name may have together: 0.02 dB, as walls
#: are known to; and that above which one is a caution: 0.2 dB. Rims of walls cause up to a
#: hundredth, facets of round objects a few (sphere of 128 segments: 0.012 at an index of 2.3).
_LEAST_FRACTION, _DANGER = 0.005, 0.05
#: Distance from a face at which a ray begins, relative to the size of the object.
_OFF_FACE = 1e-6


def total_reflections(depsgraph: Any, antennas: Sequence[Sequence[float]]) -> list[Finding]:
    """Find the objects that waves from the antennas enter and cannot leave where they arrive.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.
    antennas
        Positions of receiver and transmitter, (3,) each [Blender units].

    Returns
    -------
    list of Finding
        One ``total-reflection`` per object, with its index and fraction.
    """
    found: dict[str, tuple[float, float]] = {}
    is_inside = cache(has_interior)
    for item, materials in assigned_materials(depsgraph):
        entered = [material for material in materials if is_inside(material)]
        if item.type != "MESH" or not entered:
            continue
        sockets = [group_input(material, INDEX) for material in entered]
        index = max((float(s.default_value) for s in sockets if s is not None), default=1.0)
        fraction = 0.0 if index <= 1 else _reflected(item, depsgraph, index, antennas)
        found[item.name] = fraction, index
    # what is not said stays below this in the sum: waves may pass all of them
    unsaid = 0.0
    for name, (fraction, _) in sorted(found.items(), key=lambda one: one[1]):
        unsaid += fraction
        if unsaid <= _LEAST_FRACTION:
            del found[name]
    said = []
    for name, (fraction, index) in found.items():
        one = finding("total-reflection", name, fraction=fraction, index=index)
        said.append(one if fraction > _DANGER else one.as_information())
    return said


def _reflected(
    item: Any, depsgraph: Any, index: float, antennas: Sequence[Sequence[float]]
) -> float:
    """Fraction of the entering waves, by the area that they see, that total reflection meets."""
    evaluated = item.evaluated_get(depsgraph)
    with evaluated_mesh(evaluated) as mesh:
        if mesh is None or not len(mesh.polygons):
            return 0.0
        vertices, corners = read_triangles(mesh)
    matrix = np.array(evaluated.matrix_world, dtype=np.float64)
    # About the object's origin: the tree is in float32.
    points = vertices.astype(np.float64) @ matrix[:3, :3].T
    if np.linalg.det(matrix[:3, :3]) < 0:
        corners = corners[:, ::-1]
    tree = BVHTree.FromPolygons(points.tolist(), corners.tolist())
    starts, normals, areas = _starts(points[corners])
    inside = _OFF_FACE * float(np.ptp(points, axis=0).max())
    entering, reflected = 0.0, 0.0
    for place in antennas:
        ray = starts - (np.asarray(place) - matrix[:3, 3])
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        cosine = -np.sum(ray * normals, axis=1)
        bent = np.sqrt(1 - (1 - cosine**2) / index**2)
        onward = ray / index + (cosine / index - bent)[:, None] * normals
        for row in np.flatnonzero(cosine > 0):
            start = Vector(starts[row] - inside * normals[row])
            _, normal, _, _ = tree.ray_cast(start, Vector(onward[row]))
            if normal is None:
                continue
            seen = areas[row] * cosine[row]
            entering += seen
            sine = np.sqrt(max(0.0, 1 - float(np.dot(normal, onward[row])) ** 2))
            reflected += seen * (index * sine > 1)
    return float(reflected / entering) if entering else 0.0


def _starts(triangles: Real) -> tuple[Real, Real, Real]:
    """Return points spread over the largest triangles (n, 3, 3), their normals and areas."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    double = np.linalg.norm(across, axis=1)
    chosen = np.argsort(-double)[:_TRIANGLES]
    chosen = chosen[double[chosen] > 0]
    count = -(-_RAYS // max(len(chosen), 1))
    # The additive recurrence of the plastic number fills the triangle evenly.
    steps = (np.arange(count)[:, None] + 0.5) * (0.7548776662466927, 0.5698402909980532) % 1
    steps = np.where(steps.sum(axis=1, keepdims=True) > 1, 1 - steps, steps)
    weights = np.stack([1 - steps.sum(axis=1), *steps.T], axis=1)
    points = np.einsum("mk,nkx->nmx", weights, triangles[chosen]).reshape(-1, 3)
    normals = across[chosen] / double[chosen, None]
    return points, np.repeat(normals, count, axis=0), np.repeat(double[chosen] / count, count)
