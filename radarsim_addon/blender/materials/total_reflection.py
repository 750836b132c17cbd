# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that waves leave otherwise than straight rays do, and what this costs.

Cycles follows straight rays through interiors. `total_reflections` starts rays from the antennas at
points spread over each object with an interior, refracts them by Snell's law (`_bent`) and looks
where they arrive: if n sin(angle) > 1 there, the power that Cycles lets out is in truth reflected.
The fraction is that of the power that enters, with the absorption on the shorter of the bent and
the straight way. Small convex bodies (`layers.convex_parts`) are done at once by the planes of
their faces, others by rays. Objects whose faces stand for walls are also asked how much enters by
one face and leaves by another across it: a corner.

`straight_interiors` names simple Radar Materials, in which waves are not refracted, and
`average_in_a_row` tells where several walls each take the mean of both polarisations, whose product
differs from the mean at the end of the way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from functools import cache
from typing import Any, NamedTuple

import bpy
import numpy as np

from ...arrays import Indices, Mask, Real, crosses, dots, norms
from ...findings import Finding, finding, finding_about
from ...physics.fresnel import excess_path_m, slab_power
from ...signal.scene import ConvexBodies, Mesh, RayMesh, Surface
from ..nodes import attributes
from ..state import Snapshot
from .layers import convex_parts, thinnest
from .physical_materials import assigned_materials
from .surfaces import surfaces_of

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
#: Times the least difference of two ways within the sizes that Blender takes, still far above 1.
_FAR_BELOW = 1e200
#: Normal where there is no layer.
_NO_LAYER = np.full(3, np.nan)


class _Body(NamedTuple):
    """What a ray meets inside an object; of several objects: one of each per ray."""

    #: Index of refraction.
    refraction: float | Real
    #: Absorption of power [1 / Blender unit].
    per_unit: float | Real
    #: Normal of the layer that straight rays are absorbed across, (3,); NaN without.
    layer: Real
    #: Way that absorbs, at most [Blender units].
    at_most: float | Real


def total_reflections(
    snapshot: Snapshot,
    antennas: Sequence[Sequence[float]],
    wavelength: float,
    extinction_length: float,
) -> list[Finding]:
    """Return findings on objects that waves enter and cannot leave at the faces where they arrive.

    `antennas` are (3,) each. `wavelength` applies to physical Radar Materials, `extinction_length`
    to simple ones [Blender units]. Layer normals must be set. At most two `total-reflection`
    result, one as information and one as a caution, with the indices of the objects and the
    fractions of power. The same holds for `wall-corners`, on objects whose faces absorb and delay.
    """
    snapshot, inside_of = snapshot, cache(_inside)
    surfaces = surfaces_of(snapshot)
    places = list(dict.fromkeys(map(tuple, antennas)))  # one, where both are there
    bodies: dict[Any, _Body] = {}
    for item, materials in assigned_materials(snapshot):
        entered = [surface for surface in surfaces.of(materials) if surface.has_interior]
        if item.type == "MESH" and entered:
            mediums = [inside_of(surface, wavelength, extinction_length) for surface in entered]
            bodies[item] = _body(snapshot, item, mediums)
    fractions = dict.fromkeys(bodies, 0.0)
    bending = {item for item, body in bodies.items() if body.refraction > 1}
    for part in convex_parts(snapshot):
        if bending.intersection(part.items):
            of_part = _reflected_in_convex(part, [bodies[item] for item in part.items], places)
            fractions.update(zip(part.items, of_part.tolist(), strict=True))
            bending.difference_update(part.items)
    by_corners = dict.fromkeys(bodies, 0.0)
    for item in bending:
        mesh, matrix = snapshot.mesh_of(item), snapshot.matrix_of(item)
        if mesh is not None and len(mesh.sides):
            found = _reflected(mesh, matrix, bodies[item], places)
            fractions[item], by_corners[item] = found
    return [
        *_said(fractions, bodies, lambda found: finding_about("total-reflection", found)),
        *_said(by_corners, bodies, lambda found: finding_about("wall-corners", found)),
    ]


def _said(
    fractions: dict[Any, float], bodies: dict[Any, _Body], about: Callable[[Any], Finding]
) -> list[Finding]:
    """Return findings about objects, but not about those whose fractions are small even when added
    up.
    """
    found = sorted((fraction, item.name_full, item) for item, fraction in fractions.items())
    # what is not said stays below this in the sum: waves may pass all of them
    unsaid = np.cumsum([fraction for fraction, _, _ in found])
    information: dict[str, dict[str, float]] = {}
    caution: dict[str, dict[str, float]] = {}
    for fraction, name, item in found[int((unsaid <= _LEAST_FRACTION).sum()) :]:
        named = caution if fraction > _DANGER else information
        named[name] = {"fraction": fraction, "index": float(bodies[item].refraction)}
    said = [about(information).as_information()] if information else []
    return said + ([about(caution)] if caution else [])


def _inside(surface: Surface, wavelength: float, extinction_length: float) -> tuple[float, float]:
    """Return the index of a material, at least 1, and its absorption of power [1 /
    Blender unit].
    """
    per = wavelength if surface.is_entered else extinction_length
    return max(1.0, surface.index.real), 4 * math.pi * surface.index.imag / per


def _body(
    snapshot: Snapshot, item: bpy.types.Object, mediums: Sequence[tuple[float, float]]
) -> _Body:
    """Return the interior of an object: the largest index of its materials, and the least
    absorption.
    """
    indices, absorptions = zip(*mediums, strict=True)
    shell = attributes.OBJECT_SHELL_THICKNESS in item
    at_most = thinnest(snapshot, item) if shell else math.inf
    layer = _NO_LAYER
    given = item.get(attributes.OBJECT_LAYER_NORMAL)
    if given is not None and np.any(given) and not shell:
        linear = snapshot.matrix_of(item)[:3, :3]
        layer = np.array(given, dtype=np.float64) @ np.linalg.pinv(linear)
        layer /= np.linalg.norm(layer)
    return _Body(max(indices), min(absorptions), layer, at_most)


def _reflected(
    mesh: Mesh, matrix: Real, body: _Body, antennas: Sequence[Sequence[float]]
) -> tuple[float, float]:
    """Return two fractions of the power that enters an object.

    The first arrives at faces where it is totally reflected, although straight rays leave there.
    The second leaves by a face perpendicular to the face where it entered, in objects whose faces
    stand for walls. Echoes that pass the object both ways are absorbed once more, and so is the
    power that stays inside.
    """
    points, corners = mesh.vertices @ matrix[:3, :3].T, mesh.triangles
    if np.linalg.det(matrix[:3, :3]) < 0:
        corners = corners[:, ::-1]
    starts, normals, areas = _starts(points[corners])
    rays = RayMesh(points, corners)
    entering, reflected, by_corners = 0.0, 0.0, 0.0
    for place in antennas:
        antenna = np.asarray(place) - matrix[:3, 3]
        ray = starts - antenna
        ray /= norms(ray)[:, None]
        cosine = -np.sum(ray * normals, axis=1)
        enters = cosine > 0
        ray, outward, start = ray[enters], normals[enters], starts[enters]
        # what enters a house enters its inner walls, too
        first = ~rays.blocked(antenna, start)
        met, lost = _lost(body, ray, cosine[enters], outward, start, rays)
        seen = areas[enters] * cosine[enters]
        entering += float(seen[first & met].sum())
        reflected += float(np.sum(seen * lost))
        if np.isfinite(body.at_most):
            by_corners += float(seen @ _cut(body, ray, cosine[enters], outward, start, rays))
    entering = max(entering, 1e-300)
    return min(reflected / entering, 1.0), min(by_corners / entering, 1.0)


def _reflected_in_convex(
    part: ConvexBodies, bodies: Sequence[_Body], antennas: Sequence[Sequence[float]]
) -> Real:
    """Return the first fraction of `_reflected` for each of some convex bodies, (n,)."""
    weights = _spread(part.heights.shape[1])
    columns = [np.array(column) for column in zip(*bodies, strict=True)]
    entering, reflected = np.zeros(len(bodies)), np.zeros(len(bodies))
    for place in antennas:
        away = np.asarray(place) - part.origin
        # of the rays through a triangle all enter, or none
        of, side = np.nonzero(np.einsum("ntx,nx->nt", part.normals, away) > part.heights)
        outward = part.normals[of, side]
        start = part.triangles[of, side].transpose(0, 2, 1) @ weights.T
        ray = start - away[of, :, None]
        ray /= np.sqrt(np.einsum("nxm,nxm->nm", ray, ray))[:, None]
        cosine = -(outward[:, None] @ ray)[:, 0]
        each = _Body(*(column[of, None] for column in columns))
        lost = _lost_in_convex(part, of, each, ray, cosine, outward, start)
        seen = part.areas[of, side][:, None] / len(weights) * cosine
        entering += np.bincount(of, seen.sum(axis=1), len(bodies))
        reflected += np.bincount(of, (seen * lost).sum(axis=1), len(bodies))
    return np.minimum(reflected / np.where(entering > 0, entering, 1.0), 1.0)


def _lost_in_convex(
    part: ConvexBodies,
    of: Indices,
    body: _Body,
    ray: Real,
    cosine: Real,
    outward: Real,
    begin: Real,
) -> Real:
    """Return the second result of `_lost` for rays that enter convex bodies, (k, m).

    The rays (k, 3, m) enter the bodies `of` (k,) at faces with the normals `outward` (k, 3).
    """
    index, across = np.asarray(body.refraction), part.across(of)
    per_height = part.per_height(of, begin)
    # along the ray, over the index, and along the normal, as in `_bent`
    onward = np.empty((len(of), 4, ray.shape[2]))
    np.divide(ray, index[..., None], out=onward[:, :3])
    onward[:, 3] = cosine / index - np.sqrt(1 - (1 - cosine**2) / index**2)
    toward = np.concatenate([across, across @ outward[..., None]], axis=2) @ onward
    per_way = toward * per_height
    first = per_way.max(axis=1)
    # the cosine at the plane that comes first: those of the others go far below -1
    per_way -= first[:, None]
    per_way *= _FAR_BELOW
    per_way += toward
    out = per_way.max(axis=1)
    beyond = index * np.sqrt(np.maximum(0.0, 1 - out**2)) > 1
    per_height *= across @ onward[:, :3]
    straight = 1 / (index * per_height.max(axis=1))
    if not np.isnan(body.layer).all():
        slant = np.abs(np.asarray(body.layer) @ ray)[:, 0]
        straight *= np.where(np.isnan(slant), 1.0, slant)
    least = np.minimum(np.fmin(1 / first, straight), body.at_most)
    return np.where(beyond, np.exp(-body.per_unit * least), 0.0)


def _lost(
    body: _Body, ray: Real, cosine: Real, outward: Real, begin: Real, rays: RayMesh
) -> tuple[Mask, Real]:
    """Follow rays (n, 3) that enter a body at `begin`.

    Return whether each ray arrives at a face, and the fraction of its power that cannot leave
    there, (n,).
    """
    index = np.asarray(body.refraction)
    onward = _bent(index, ray, cosine, outward)
    normals, way = _met(rays, begin, onward)
    out = dots(normals, onward)
    with np.errstate(invalid="ignore"):
        beyond = index * np.sqrt(np.maximum(0.0, 1 - out**2)) > 1  # false where it is NaN
    across = np.abs(ray @ body.layer)
    straight = _met(rays, begin, ray)[1] * np.where(np.isnan(across), 1.0, across)
    least = np.minimum(np.fmin(way, straight), body.at_most)
    return np.isfinite(out), np.where(beyond, np.exp(-body.per_unit * least), 0.0)


def _bent(index: Real, ray: Real, cosine: Real, outward: Real) -> Real:
    """Return the directions of rays (..., 3) after refraction into a body."""
    bent = np.sqrt(1 - (1 - cosine**2) / index**2)
    return np.asarray(ray / index[..., None] + (cosine / index - bent)[..., None] * outward)


def _cut(body: _Body, ray: Real, cosine: Real, outward: Real, begin: Real, rays: RayMesh) -> Real:
    """Return the fraction of the power of rays (n, 3) that leaves a wall by a face perpendicular to
    the first one, (n,).
    """
    index = np.asarray(body.refraction)
    onward = _bent(index, ray, cosine, outward)
    normals, way = _met(rays, begin, onward)
    with np.errstate(invalid="ignore"):
        sine = np.sqrt(np.maximum(0.0, 1 - dots(normals, onward) ** 2))
        cut = (index * sine <= 1) & (np.abs(dots(normals, outward)) < _CORNER)
    return np.where(cut, np.exp(-body.per_unit * np.minimum(way, body.at_most)), 0.0)


def _met(rays: RayMesh, starts: Real, onward: Real) -> tuple[Real, Real]:
    """Follow rays (n, 3) from inside a mesh to the next face.

    Return the normals there, (n, 3), and the lengths of the rays, (n,); NaN if the mesh is open.
    """
    face, way = rays.first(starts, onward)
    return rays.normals_of(face), np.where(face >= 0, way, np.nan)


def _starts(triangles: Real) -> tuple[Real, Real, Real]:
    """Return points spread over the largest triangles (n, 3, 3), their normals and areas."""
    across = crosses(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    double = np.linalg.norm(across, axis=1)
    chosen = np.argsort(-double)[:_TRIANGLES]
    chosen = chosen[double[chosen] > 0]
    weights = _spread(len(chosen))
    count = len(weights)
    points = np.einsum("mk,nkx->nmx", weights, triangles[chosen]).reshape(-1, 3)
    normals = across[chosen] / double[chosen, None]
    return points, np.repeat(normals, count, axis=0), np.repeat(double[chosen] / count, count)


def _spread(triangles: int) -> Real:
    """Return points spread evenly over a triangle, in barycentric coordinates, (n, 3).

    The more triangles there are, the fewer points each one gets.
    """
    count = -(-_RAYS // max(triangles, 1))
    # The additive recurrence of the plastic number fills the triangle evenly.
    steps = (np.arange(count)[:, None] + 0.5) * (0.7548776662466927, 0.5698402909980532) % 1
    steps = np.where(steps.sum(axis=1, keepdims=True) > 1, 1 - steps, steps)
    return np.stack([1 - steps.sum(axis=1), *steps.T], axis=1)


def straight_interiors(snapshot: Snapshot, metres_per_unit: float) -> list[Finding]:
    """Return the finding on objects whose interior delays waves along the straight line at any
    angle.

    The finding `interior-not-refracted` names all of them. It gives the error of the path length
    behind the worst object at two angles.
    """
    surfaces = surfaces_of(snapshot)
    worst: dict[str, tuple[float, float]] = {}
    for item, materials in assigned_materials(snapshot):
        simple = (s for s in surfaces.of(materials) if s.has_interior and not s.is_entered)
        index = max((one.n for one in simple if one.n is not None), default=1.0)
        if item.type != "MESH" or index <= 1:
            continue
        depth_m = thinnest(snapshot, item) * metres_per_unit
        if depth_m > 0:
            worst[item.name_full] = (
                _too_long_m(index, depth_m, 60.0),
                _too_long_m(index, depth_m, 30.0),
            )
    if not worst:
        return []
    far_60_m, far_30_m = max(worst.values())
    return [
        finding("interior-not-refracted", *worst, too_long_30_m=far_30_m, too_long_60_m=far_60_m)
    ]


def _too_long_m(index: float, depth_m: float, angle_deg: float) -> float:
    """Return the error of a straight ray through a layer and back [m]: its length minus that of the
    refracted wave.
    """
    cosine = math.cos(math.radians(angle_deg))
    return 2 * ((index - 1) * depth_m / cosine - float(excess_path_m(index, depth_m, cosine)))


def averaging_objects(snapshot: Snapshot) -> dict[str, complex]:
    """Return the objects whose walls transmit the mean of both polarisations, by name, with the
    largest index of their materials.
    """
    found = {}
    surfaces = surfaces_of(snapshot)
    for item, materials in assigned_materials(snapshot):
        indices = [one.index for one in surfaces.of(materials) if one.passes_by_polarisation]
        if indices:
            found[item.name_full] = max(indices, key=abs)
    return found


def average_in_a_row(snapshot: Snapshot, objects: Collection[str]) -> bool:
    """Return whether waves may pass several walls of these objects, by name, one after the other.

    This is also true for one object that consists of several walls, or has several instances. The
    layer normals must be set.
    """
    shapes = [shape.original for shape in snapshot.shapes]
    ours = snapshot.of_shapes([item.name_full in objects for item in shapes])
    several = (
        attributes.OBJECT_SHELL_THICKNESS in item
        or (
            attributes.OBJECT_LAYER_NORMAL in item and attributes.OBJECT_LAYER_THICKNESS not in item
        )
        for item in shapes
        if item.name_full in objects
    )
    return int((ours & snapshot.layout.visible).sum()) > 1 or any(several)


def separate_averages(objects: dict[str, complex], paths: str) -> Finding:
    """Return the finding that radarsim averages the two polarisations at each wall separately.

    `objects` are those of `averaging_objects`, at least one. `paths` names the paths that pass
    several walls. The finding gives the error for two walls of the largest index.
    """
    index = max(objects.values(), key=abs)
    return finding(
        "walls-averaged-separately",
        *objects,
        paths=paths,
        loss_30_db=_loss_db(index, 30.0),
        loss_60_db=_loss_db(index, 60.0),
    )


def _loss_db(index: complex, angle_deg: float) -> float:
    """Return the ratio of two powers through two walls, both ways [dB].

    The first power is exact: both polarisations pass both walls, and the mean is taken at the end.
    The second power has a mean at each wall.
    """
    wall = slab_power(index, 1e-12, 1.0, math.cos(math.radians(angle_deg)), "single-pass")
    s, p = float(wall.transmitted_s), float(wall.transmitted_p)
    return 20 * math.log10((s**2 + p**2) / 2 / ((s + p) / 2) ** 2)
