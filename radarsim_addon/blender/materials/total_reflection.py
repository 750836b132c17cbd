# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects in which waves meet a face beyond the critical angle, which straight rays do not know."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ...array_types import Int32, Real
from ...findings import Finding, finding
from ..nodes.group_search import group_input
from ..nodes.materials import has_interior
from ..nodes.physical_material import INDEX
from ..state import evaluated_mesh, read_triangles
from .assignments import assigned_materials

#: Rays that are followed into an object, about, and triangles on which they begin, at most.
_RAYS = 1000
_TRIANGLES = 500
#: Fraction of the entering waves above which an object is named: 0.02 dB, as walls are known to;
#: and above which it is a caution: 0.2 dB. Rims of walls cause up to a hundredth, facets of round
#: objects a few (sphere of 128 segments: 0.012 at an index of 2.3).
_LEAST_FRACTION, _DANGER = 0.005, 0.05
#: Distance from a face at which a ray begins, relative to the size of the object.
_OFF_FACE = 1e-6
#: Triangles up to which all planes of a convex mesh are compared with each ray.
_FEW_TRIANGLES = 64


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
    found = []
    is_inside = cache(has_interior)
    places = list(dict.fromkeys(map(tuple, antennas)))  # one, where both are there
    for item, materials in assigned_materials(depsgraph):
        entered = [material for material in materials if is_inside(material)]
        if item.type != "MESH" or not entered:
            continue
        sockets = [group_input(material, INDEX) for material in entered]
        index = max((float(s.default_value) for s in sockets if s is not None), default=1.0)
        fraction = 0.0 if index <= 1 else _reflected(item, depsgraph, index, places)
        if fraction > _LEAST_FRACTION:
            said = finding("total-reflection", item.name, fraction=fraction, index=index)
            found.append(said if fraction > _DANGER else said.as_information())
    return found


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
    starts, normals, areas = _starts(points[corners])
    inside = _OFF_FACE * float(np.ptp(points, axis=0).max())
    arrive = _arrivals(points, corners)
    entering, reflected = 0.0, 0.0
    for place in antennas:
        ray = starts - (np.asarray(place) - matrix[:3, 3])
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        cosine = -np.sum(ray * normals, axis=1)
        enters = cosine > 0
        ray, cosine, outward = ray[enters], cosine[enters], normals[enters]
        bent = np.sqrt(1 - (1 - cosine**2) / index**2)
        onward = ray / index + (cosine / index - bent)[:, None] * outward
        exit_cosine = arrive(starts[enters] - inside * outward, onward)
        met = np.isfinite(exit_cosine)
        seen = areas[enters] * cosine
        sine = np.sqrt(np.maximum(0.0, 1 - exit_cosine**2))
        entering += float(seen[met].sum())
        reflected += float(seen[met & (index * sine > 1)].sum())
    return reflected / entering if entering else 0.0


def _arrivals(points: Real, corners: Int32) -> Callable[[Real, Real], Real]:
    """Return a function that gives the cosine to the normal where rays (n, 3) from inside arrive.

    (n,); NaN where the mesh is open.
    """
    planes = _convex_planes(points, corners) if len(corners) <= _FEW_TRIANGLES else None
    if planes is None:
        tree = BVHTree.FromPolygons(points.tolist(), corners.tolist())

        def cast(starts: Real, onward: Real) -> Real:
            pairs = zip(starts.tolist(), onward.tolist(), strict=True)
            met = (tree.ray_cast(Vector(start), Vector(along))[1] for start, along in pairs)
            normals = np.array([(np.nan,) * 3 if one is None else tuple(one) for one in met])
            return np.asarray(np.sum(normals.reshape(-1, 3) * onward, axis=1))

        return cast
    normals, heights = planes

    def leave(starts: Real, onward: Real) -> Real:
        cosines = onward @ normals.T
        with np.errstate(divide="ignore", invalid="ignore"):
            way = np.where(cosines > 0, (heights - starts @ normals.T) / cosines, np.inf)
        return np.asarray(cosines[np.arange(len(way)), way.argmin(axis=1)])

    return leave


def _convex_planes(points: Real, corners: Int32) -> tuple[Real, Real] | None:
    """Unit normals (n, 3) and heights (n,) of the faces of a closed convex mesh, else None."""
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    there, back = (edges.astype(np.int64) @ pair for pair in ((len(points), 1), (1, len(points))))
    there.sort()
    if np.any(there[1:] == there[:-1]) or not np.array_equal(there, np.sort(back)):
        return None
    a, b, c = (points[corner] for corner in corners.T)
    outward = np.cross(b - a, c - a)
    length = np.linalg.norm(outward, axis=1)
    if not np.all(length > 0):
        return None
    normals = outward / length[:, None]
    heights = np.einsum("ni,ni->n", normals, a)
    beyond = points @ normals.T - heights
    if beyond.max() > _OFF_FACE * float(np.ptp(points, axis=0).max()):
        return None
    return normals, heights


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
