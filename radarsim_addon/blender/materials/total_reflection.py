# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that waves leave otherwise than straight rays do: totally reflected, or by a corner."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ...array_types import Int32, Real
from ...findings import Finding, finding
from ...vectors import crosses, dots, norms
from ..nodes import attributes
from ..nodes.group_search import group_input
from ..nodes.materials import has_interior
from ..nodes.physical_material import EXTINCTION, INDEX
from ..state import evaluated_mesh, read_triangles
from .assignments import assigned_materials
from .layers import is_entered, thinnest

#: Rays that are followed into an object, about, and triangles on which they begin, at most.
_RAYS = 1000
_TRIANGLES = 500
#: Fraction of the entering waves that objects without a name may have together: 0.02 dB, as walls
#: are known to; and that above which one is a caution: 0.2 dB. Rims of walls cause up to a
#: hundredth, facets of round objects a few (sphere of 128 segments: 0.012 at an index of 2.3).
_LEAST_FRACTION, _DANGER = 0.005, 0.05
#: Largest cosine between the faces by which a ray enters and leaves a corner where walls meet: up
#: to 40 degrees a wall may be round.
_CORNER = math.cos(math.radians(40.0))
#: Distance from a face at which a ray begins, relative to the size of the object.
_OFF_FACE = 1e-6
#: Triangles up to which all planes of a convex mesh are compared with each ray.
_FEW_TRIANGLES = 64


class _Body(NamedTuple):
    """What a ray meets inside an object.

    `refraction` is the index, `per_unit` the absorption of power [1 / Blender unit]. Straight rays
    are absorbed as by the way across the `layer` with this normal, (3,), or as by `at_most` of a
    way [Blender units].
    """

    refraction: float
    per_unit: float
    layer: Real | None
    at_most: float


class _Fractions(NamedTuple):
    """Parts of the power that enters an object."""

    reflected: float = 0.0
    by_corners: float = 0.0


def total_reflections(
    depsgraph: Any,
    antennas: Sequence[Sequence[float]],
    wavelength: float,
    extinction_length: float,
) -> list[Finding]:
    """Find the objects that waves from the antennas enter and cannot leave where they arrive.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date; layer normals are set.
    antennas
        Positions of receiver and transmitter, (3,) each [Blender units].
    wavelength, extinction_length
        Of physical and of simple Radar Materials [Blender units].

    Returns
    -------
    list of Finding
        One ``total-reflection`` per object, and one ``wall-corners`` per object whose faces absorb
        and delay, with its index and fraction.
    """
    found: list[tuple[_Fractions, float, str]] = []
    is_inside, inside_of = cache(has_interior), cache(_inside)
    places = list(dict.fromkeys(map(tuple, antennas)))  # one, where both are there
    for item, materials in assigned_materials(depsgraph):
        entered = [material for material in materials if is_inside(material)]
        if item.type != "MESH" or not entered:
            continue
        mediums = [inside_of(material, wavelength, extinction_length) for material in entered]
        body = _body(item, depsgraph, mediums)
        passing = body.refraction > 1
        parts = _fractions(item, depsgraph, body, places) if passing else _Fractions()
        found.append((parts, body.refraction, item.name_full))
    reflected = [(one.reflected, index, name) for one, index, name in found]
    by_corners = [(one.by_corners, index, name) for one, index, name in found]
    said = [
        finding("total-reflection", name, fraction=fraction, index=index)
        for fraction, index, name in _largest(reflected)
    ]
    said += [
        finding("wall-corners", name, fraction=fraction, index=index)
        for fraction, index, name in _largest(by_corners)
    ]
    return [one if one.numbers["fraction"] > _DANGER else one.as_information() for one in said]


def _largest(found: list[tuple[float, float, str]]) -> list[tuple[float, float, str]]:
    """All but the smallest fractions, which waves that pass all of the objects may lose in sum."""
    found.sort()
    unsaid = np.cumsum([fraction for fraction, _, _ in found])
    return found[int((unsaid <= _LEAST_FRACTION).sum()) :]


def _inside(material: Any, wavelength: float, extinction_length: float) -> tuple[float, float]:
    """Index of a material, 1 at least, and its absorption of power [1 / Blender unit]."""
    socket, kappa = (group_input(material, name) for name in (INDEX, EXTINCTION))
    per = wavelength if is_entered(material) else extinction_length
    absorption = 0.0 if kappa is None else 4 * math.pi * float(kappa.default_value) / per
    return max(1.0, 1.0 if socket is None else float(socket.default_value)), absorption


def _body(item: Any, depsgraph: Any, mediums: Sequence[tuple[float, float]]) -> _Body:
    """What rays meet in an object: the greatest index of its materials, the least absorption."""
    indices, absorptions = zip(*mediums, strict=True)
    shell = attributes.OBJECT_SHELL_THICKNESS in item
    at_most = thinnest(item, depsgraph) if shell else math.inf
    layer = None
    given = item.get(attributes.OBJECT_LAYER_NORMAL)
    if given is not None and np.any(given) and not shell:
        linear = np.array(item.evaluated_get(depsgraph).matrix_world.to_3x3(), dtype=np.float64)
        layer = np.array(given, dtype=np.float64) @ np.linalg.pinv(linear)
        layer /= np.linalg.norm(layer)
    return _Body(max(indices), min(absorptions), layer, at_most)


def _fractions(
    item: Any, depsgraph: Any, body: _Body, antennas: Sequence[Sequence[float]]
) -> _Fractions:
    """Parts of the entering power that arrive where they are totally reflected, or seem to leave,
    and that leave by a face across the one where they entered, if faces stand for walls.

    Echoes through an object on both their ways are absorbed once more, and so is what stays inside.
    """
    evaluated = item.evaluated_get(depsgraph)
    with evaluated_mesh(evaluated) as mesh:
        if mesh is None or not len(mesh.polygons):
            return _Fractions()
        vertices, corners = read_triangles(mesh)
    matrix = np.array(evaluated.matrix_world, dtype=np.float64)
    # About the object's origin: the tree is in float32.
    points = vertices.astype(np.float64) @ matrix[:3, :3].T
    if np.linalg.det(matrix[:3, :3]) < 0:
        corners = corners[:, ::-1]
    starts, normals, areas = _starts(points[corners])
    inside = _OFF_FACE * float(np.ptp(points, axis=0).max())
    planes = _convex_planes(points, corners) if len(corners) <= _FEW_TRIANGLES else None
    arrive = _arrivals(points, corners, planes)
    entering, reflected, by_corners = 0.0, 0.0, 0.0
    for place in antennas:
        ray = starts - (np.asarray(place) - matrix[:3, 3])
        distance = norms(ray)
        ray /= distance[:, None]
        cosine = -np.sum(ray * normals, axis=1)
        enters = cosine > 0
        ray, cosine, outward = ray[enters], cosine[enters], normals[enters]
        first = np.ones(len(ray), dtype=bool)  # what enters a house enters its inner walls, too
        if planes is None:
            back = arrive(starts[enters] + inside * outward, -ray)[1]
            first = ~(back < distance[enters])
        bent = np.sqrt(1 - (1 - cosine**2) / body.refraction**2)
        onward = ray / body.refraction + (cosine / body.refraction - bent)[:, None] * outward
        begin = starts[enters] - inside * outward
        met, way = arrive(begin, onward)
        out = dots(met, onward)
        seen = areas[enters] * cosine
        entering += float(seen[first & np.isfinite(out)].sum())
        beyond = body.refraction * np.sqrt(np.maximum(0.0, 1 - out**2)) > 1  # false where it is NaN
        straight = arrive(begin[beyond], ray[beyond])[1]
        if body.layer is not None:
            straight = straight * np.abs(ray[beyond] @ body.layer)
        least = np.minimum(np.fmin(way[beyond], straight), body.at_most)
        reflected += float(np.sum(seen[beyond] * np.exp(-body.per_unit * least)))
        if math.isfinite(body.at_most):
            corner = ~beyond & (np.abs(dots(met, outward)) < _CORNER)
            least = np.minimum(way[corner], body.at_most)
            by_corners += float(np.sum(seen[corner] * np.exp(-body.per_unit * least)))
    entering = max(entering, 1e-300)
    return _Fractions(min(reflected / entering, 1.0), min(by_corners / entering, 1.0))


def _arrivals(
    points: Real, corners: Int32, planes: tuple[Real, Real] | None
) -> Callable[[Real, Real], tuple[Real, Real]]:
    """Return a function that follows rays (n, 3) from inside to where they arrive.

    It gives the normals there, (n, 3), and the lengths of the ways, (n,); NaN where the mesh is
    open. `planes` are those of a convex mesh.
    """
    if planes is None:
        tree = BVHTree.FromPolygons(points.tolist(), corners.tolist())

        def cast(starts: Real, onward: Real) -> tuple[Real, Real]:
            pairs = zip(starts.tolist(), onward.tolist(), strict=True)
            met = (tree.ray_cast(Vector(start), Vector(along)) for start, along in pairs)
            rows = [(np.nan,) * 4 if way is None else (*normal, way) for _, normal, _, way in met]
            found = np.array(rows, dtype=np.float64).reshape(-1, 4)
            return found[:, :3], found[:, 3]

        return cast
    normals, heights = planes

    def leave(starts: Real, onward: Real) -> tuple[Real, Real]:
        cosines = onward @ normals.T
        with np.errstate(divide="ignore", invalid="ignore"):
            way = np.where(cosines > 0, (heights - starts @ normals.T) / cosines, np.inf)
        first = way.argmin(axis=1)
        return normals[first], way[np.arange(len(way)), first]

    return leave


def _convex_planes(points: Real, corners: Int32) -> tuple[Real, Real] | None:
    """Unit normals (n, 3) and heights (n,) of the faces of a closed convex mesh, else None."""
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    there, back = (edges.astype(np.int64) @ pair for pair in ((len(points), 1), (1, len(points))))
    there.sort()
    if np.any(there[1:] == there[:-1]) or not np.array_equal(there, np.sort(back)):
        return None
    a, b, c = (points[corner] for corner in corners.T)
    outward = crosses(b - a, c - a)
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
    across = crosses(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
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
