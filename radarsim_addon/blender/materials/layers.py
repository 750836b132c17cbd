# SPDX-License-Identifier: GPL-3.0-or-later
"""Find objects that are plane-parallel layers, and the direction of their faces.

A wave that crosses a layer at an angle is refracted. Absorption and delay inside depend on the
angle to the faces of the layer (see :mod:`.nodes.physical_material`). A shader does not know these
faces inside an object, so the object has their normal as a custom property.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from ...array_types import Mask, Real
from ...findings import Finding, finding
from ..nodes import attributes
from ..nodes.group_search import group_input, group_node
from ..nodes.groups import KIND_PROPERTY
from ..nodes.materials import has_interior
from ..nodes.physical_material import EXTINCTION, KIND
from ..nodes.sheet import KIND as SHEET_KIND
from ..state import SettingsRestorer, evaluated_mesh, read_numbers
from .assignments import assigned_materials

#: Minimum fraction of an object's surface with one pair of opposite normals for a layer.
LAYER_SHARE = 0.6
#: Maximum difference of the unit normals of parallel faces.
_PARALLEL = 0.02
#: Two-way absorption that Cycles can represent [dB]. For an echo of 1 W/(m^2 sr) without the wall,
#: measured power and range are correct up to 360 dB, and the range is lost from 372 dB. Blender up
#: to 4.5 returns zero from 122 dB.
MAX_LOSS_DB = 350.0
MAX_LOSS_DB_4_5 = 120.0
#: Two-way absorption that the two faces of a wall can hold in place of its volume [dB]: Cycles
#: drops what passes a face with less than 1e-5.
FACES_LOSS_DB = 100.0
#: Minimum fraction of a layer's faces in its two outermost planes for a single plate.
MIN_PLATE_FRACTION = 0.9
#: The same where nothing but the rim may be elsewhere.
_ALL = 1 - 1e-6
#: Tolerance of these planes, relative to their distance.
_IN_PLANE = 1e-3
#: Number of directions, by area, that are tried.
_CANDIDATES = 8
#: Maximum number of faces behind which the depth is measured.
_MOST_DEPTHS = 500
#: Maximum thickness of the walls of a shell, relative to the smallest dimension of the object, and
#: maximum relative difference of their thicknesses.
_THIN = 0.1
_ONE_THICKNESS = 0.01
#: Distance from a face at which its ray begins, relative to the size of the object.
_OFF_FACE = 1e-6


def layer_normal(normals: Real, areas: Real) -> Real | None:
    """Return the normal (3,) of the parallel faces that form most of a surface; None without such.

    `normals` are unit normals of the faces, (n, 3); `areas` their areas, (n,).
    """
    total = float(areas.sum())
    if not total > 0:
        return None
    # Opposite normals are one direction; rounding makes almost equal ones equal.
    sign = np.where(normals[np.arange(len(normals)), np.abs(normals).argmax(axis=1)] < 0, -1.0, 1.0)
    directions = normals * sign[:, None]
    keys = np.round(directions / _PARALLEL).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    by_cell = np.bincount(inverse.ravel(), areas, len(first))
    for cell in np.argsort(-by_cell)[:_CANDIDATES]:
        near = np.abs(np.abs(directions @ directions[first[cell]]) - 1) < _PARALLEL**2 / 2
        if areas[near].sum() >= LAYER_SHARE * total:
            # The rule above can give almost equal directions opposite signs.
            flip = np.sign(directions[near] @ directions[first[cell]])
            mean = (directions[near] * (flip * areas[near])[:, None]).sum(axis=0)
            return np.asarray(mean / np.linalg.norm(mean), dtype=np.float64)
    return None


def _faces(item: Any, depsgraph: Any, **widths: int) -> dict[str, Real] | None:
    """Return properties of an evaluated object's polygons, (faces, width); None without faces."""
    with evaluated_mesh(item.evaluated_get(depsgraph)) as mesh:
        if mesh is None or not len(mesh.polygons):
            return None
        return {
            name: read_numbers(mesh.polygons, name, width).astype(np.float64)
            for name, width in widths.items()
        }


def object_layer_normal(item: Any, depsgraph: Any) -> Real | None:
    """Return the layer normal of an evaluated object in its own axes; None if it is no layer."""
    faces = _faces(item, depsgraph, normal=3, area=1)
    if faces is None:
        return None
    normals, areas = faces["normal"], faces["area"]
    linear = np.array(item.evaluated_get(depsgraph).matrix_world.to_3x3(), dtype=np.float64)
    if abs(np.linalg.det(linear)) < 1e-30:
        return None
    # Area vectors under a linear map: det(A) A^-T.
    vectors = (normals * areas) @ np.linalg.inv(linear)
    lengths = np.linalg.norm(vectors, axis=1)
    kept = lengths > 0
    world = layer_normal(vectors[kept] / lengths[kept, None], lengths[kept])
    if world is None:
        return None
    # In the object's own axes, so that the normal rotates with it.
    local = linear.T @ world
    return np.asarray(local / np.linalg.norm(local), dtype=np.float64)


def object_layer_thickness(item: Any, depsgraph: Any, normal: Real) -> float | None:
    """Return the distance of a layer's two faces in the object's units; None with more faces."""
    planes = two_planes(item, depsgraph, normal, MIN_PLATE_FRACTION)
    return None if planes is None else planes[1] - planes[0]


def two_planes(
    item: Any, depsgraph: Any, normal: Real, least_fraction: float = _ALL
) -> tuple[float, float] | None:
    """Return the places of a layer's outermost faces along its normal, in the object's units.

    None unless this fraction of the faces across the normal lies in these two planes.
    """
    faces = _faces(item, depsgraph, normal=3, center=3, area=1)
    if faces is None:
        return None
    unit = normal / np.linalg.norm(normal)
    along = np.abs(faces["normal"] @ unit) > 1 - _PARALLEL**2 / 2
    height = (faces["center"] @ unit)[along]
    area = faces["area"][along, 0]
    if not area.sum() > 0:
        return None
    low, high = float(height.min()), float(height.max())
    if not high > low:
        return None
    outer = np.abs(2 * (height - low) / (high - low) - 1) > 1 - 2 * _IN_PLANE
    return (low, high) if area[outer].sum() >= least_fraction * area.sum() else None


def set_layer_normals(recorder: SettingsRestorer, depsgraph: Any) -> list[Finding]:
    """Set what is known of the walls of each object with a penetrable physical material.

    Normal and thickness of a layer; or the common thickness of walls in several directions.

    Linked objects are changed in memory. Properties that the user has set do not change; a normal
    of [0, 0, 0] means that the object is no layer.

    Parameters
    ----------
    recorder
        Records the changes.
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    list of Finding
        Names the objects that are no layers.
    """
    others = []
    entered = cache(is_entered)
    for item, materials in assigned_materials(depsgraph):
        if not any(map(entered, materials)):
            continue
        given = item.get(attributes.OBJECT_LAYER_NORMAL)
        normal = None if given is None else np.array(given, dtype=np.float64)
        thickness = None
        if normal is None:
            normal = object_layer_normal(item, depsgraph)
            if normal is not None:
                thickness = object_layer_thickness(item, depsgraph, normal)
            shell = None if thickness else shell_thickness(item, depsgraph)
            if shell is not None:
                recorder.set_item(item, attributes.OBJECT_SHELL_THICKNESS, shell)
                item.update_tag()
                continue
            if normal is None:
                others.append(item.name)
                continue
            recorder.set_item(item, attributes.OBJECT_LAYER_NORMAL, [float(x) for x in normal])
        elif np.any(normal):
            thickness = object_layer_thickness(item, depsgraph, normal)
        if attributes.OBJECT_LAYER_THICKNESS not in item and thickness is not None:
            recorder.set_item(item, attributes.OBJECT_LAYER_THICKNESS, thickness)
        item.update_tag()
    if not others:
        return []
    return [
        finding(
            "not-a-layer",
            *others,
            least_fraction=LAYER_SHARE,
            property=attributes.OBJECT_LAYER_NORMAL,
        )
    ]


def is_entered(material: Any) -> bool:
    """Return whether waves enter objects of a physical material: its Volume is connected.

    Parameters
    ----------
    material : bpy.types.Material or None

    Returns
    -------
    bool
        False for None and for materials without the physical group.
    """
    node = group_node(material)
    return node is not None and node.node_tree.get(KIND_PROPERTY) == KIND and has_interior(material)


def passes_by_polarisation(material: Any) -> bool:
    """Return whether waves pass a material by Fresnel's equations for each polarisation.

    Parameters
    ----------
    material : bpy.types.Material or None

    Returns
    -------
    bool
        True for thin panes, and for physical materials with an interior.
    """
    node = group_node(material)
    sheet = node is not None and node.node_tree.get(KIND_PROPERTY) == SHEET_KIND
    return sheet or is_entered(material)


def delays(material: Any) -> bool:
    """Return whether waves that pass a material are delayed: by its interior, or as thin panes.

    Parameters
    ----------
    material : bpy.types.Material or None

    Returns
    -------
    bool
        False for None.
    """
    return has_interior(material) or passes_by_polarisation(material)


def _depths(item: Any, depsgraph: Any) -> tuple[Real, Real, Mask]:
    """Return what is behind the largest faces of an object, across them, n of each.

    Areas of the faces and depths [Blender units; the mesh may be open behind some: left out], and
    whether the face behind is parallel.
    """
    evaluated = item.evaluated_get(depsgraph)
    nothing = np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool)
    with evaluated_mesh(evaluated) as mesh:
        if mesh is None or not len(mesh.polygons):
            return nothing
        linear = np.array(evaluated.matrix_world.to_3x3(), dtype=np.float64)
        points = read_numbers(mesh.vertices, "co", 3).astype(np.float64) @ linear.T
        areas = read_numbers(mesh.polygons, "area", 1).ravel().astype(np.float64)
        corners = [tuple(face.vertices) for face in mesh.polygons]
    tree = BVHTree.FromPolygons(points.tolist(), corners)
    size = float(np.ptp(points, axis=0).max())
    found = []
    for face in np.argsort(-areas)[:_MOST_DEPTHS]:
        around = points[list(corners[face])]
        inward = np.cross(around[2] - around[1], around[1] - around[0])
        length = np.linalg.norm(inward) * np.copysign(1.0, np.linalg.det(linear))
        start = around.mean(axis=0) + _OFF_FACE * size * inward / length
        _, normal, _, depth = tree.ray_cast(start, inward / length)
        if depth is not None:
            across = abs(np.dot(normal, inward / length))
            found.append((areas[face], depth, across > 1 - _PARALLEL**2 / 2))
    if not found:
        return nothing
    area, depth, parallel = zip(*found, strict=True)
    return np.array(area), np.array(depth), np.array(parallel)


def thinnest(item: Any, depsgraph: Any) -> float:
    """Return the least depth behind a face of an object, across it, in Blender units.

    Tried are the largest faces; 0 for a mesh that is open behind all of them.
    """
    depths = _depths(item, depsgraph)[1]
    return float(depths.min()) if depths.size else 0.0


def shell_thickness(item: Any, depsgraph: Any) -> float | None:
    """Return the thickness of an object's walls in its own units; None unless all have the same.

    A hollow room, or walls in several directions. Walls are thin against the object.
    """
    areas, depths, parallel = _depths(item, depsgraph)
    linear = np.array(item.evaluated_get(depsgraph).matrix_world.to_3x3(), dtype=np.float64)
    scales = np.linalg.svd(linear, compute_uv=False)
    if not parallel.any() or np.ptp(scales) > _ONE_THICKNESS * scales.max():
        return None
    order = np.argsort(depths[parallel])
    below = np.cumsum(areas[parallel][order])
    thickness = float(depths[parallel][order][np.searchsorted(below, below[-1] / 2)])
    alike = parallel & (np.abs(depths - thickness) <= _ONE_THICKNESS * thickness)
    size = np.array(item.evaluated_get(depsgraph).dimensions).min()
    thin = thickness <= _THIN * size
    if not thin or areas[alike].sum() < MIN_PLATE_FRACTION * areas.sum():
        return None
    return float(thickness / scales.mean())


def interior_losses_db(wavelength: float, depsgraph: Any) -> dict[str, float]:
    """Return the two-way absorption of objects of physical materials, across where they are thin.

    Parameters
    ----------
    wavelength
        Wavelength in Blender units.
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    dict of str to float
        Absorption [dB] by object's name.
    """
    is_inside = cache(is_entered)
    losses = {}
    for item, materials in assigned_materials(depsgraph):
        entered = [material for material in materials if is_inside(material)]
        if item.type != "MESH" or not entered:
            continue
        sockets = [group_input(material, EXTINCTION) for material in entered]
        kappa = max((float(s.default_value) for s in sockets if s is not None), default=0.0)
        if kappa > 0:
            depth = thinnest(item, depsgraph)
            losses[item.name] = 2 * 4 * math.pi * kappa / wavelength * depth * 10 / math.log(10)
    return losses


def beyond_float32(losses_db: dict[str, float]) -> list[Finding]:
    """Find objects whose absorption leaves nothing that a render can hold.

    Parameters
    ----------
    losses_db
        From `interior_losses_db`.

    Returns
    -------
    list of Finding
        One ``absorption-below-float32`` per object, with its loss and the limit [dB].
    """
    found = []
    for name, loss_db in losses_db.items():
        limit_db = MAX_LOSS_DB if bpy.app.version >= (5, 0, 0) else MAX_LOSS_DB_4_5
        if attributes.OBJECT_SHELL_THICKNESS in bpy.data.objects[name]:
            limit_db = FACES_LOSS_DB
        if loss_db > limit_db:
            said = finding("absorption-below-float32", name, loss_db=loss_db, limit_db=limit_db)
            # no radar receives what is behind so much
            found.append(said.as_information() if loss_db > MAX_LOSS_DB else said)
    return found
