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

from ...array_types import Real
from ...findings import Finding, finding
from ..nodes import attributes
from ..nodes.group_search import group_input, group_node
from ..nodes.groups import KIND_PROPERTY
from ..nodes.materials import has_interior
from ..nodes.physical_material import EXTINCTION, KIND
from ..nodes.sheet import KIND as SHEET_KIND
from ..state import SettingsRestorer, evaluated_mesh, read_numbers
from .assignments import assigned_materials
from .wall_faces import PARALLEL, depths_behind, find_walls
from .wall_modifier import store_thickness

#: Minimum fraction of an object's surface with one pair of opposite normals for a layer.
LAYER_SHARE = 0.6
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
#: Maximum fraction of the walls of a layer that lie across another direction.
_MOST_ACROSS = 0.01
#: Minimum fraction of the surface of an object that consists of walls: the rest are rims.
_WALL_SHARE = 0.75


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
    keys = np.round(directions / PARALLEL).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    by_cell = np.bincount(inverse.ravel(), areas, len(first))
    for cell in np.argsort(-by_cell)[:_CANDIDATES]:
        near = np.abs(np.abs(directions @ directions[first[cell]]) - 1) < PARALLEL**2 / 2
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
    along = np.abs(faces["normal"] @ unit) > 1 - PARALLEL**2 / 2
    height = (faces["center"] @ unit)[along]
    area = faces["area"][along, 0]
    if not area.sum() > 0:
        return None
    low, high = float(height.min()), float(height.max())
    if not high > low:
        return None
    outer = np.abs(2 * (height - low) / (high - low) - 1) > 1 - 2 * _IN_PLANE
    return (low, high) if area[outer].sum() >= least_fraction * area.sum() else None


def rim_fraction(item: Any, depsgraph: Any, normal: Real) -> float:
    """Return the fraction of a layer's surface that is not across its normal (own axes)."""
    faces = _faces(item, depsgraph, normal=3, area=1)
    if faces is None:
        return 0.0
    linear = np.array(item.evaluated_get(depsgraph).matrix_world.to_3x3(), dtype=np.float64)
    to_world = np.linalg.inv(linear)
    vectors, across = faces["normal"] * faces["area"] @ to_world, normal @ to_world
    areas = np.linalg.norm(vectors, axis=1)
    rim = np.abs(vectors @ across) < (1 - PARALLEL**2 / 2) * areas * np.linalg.norm(across)
    return float(areas[rim].sum() / max(areas.sum(), 1e-300))


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
    others: list[str] = []
    entered = cache(is_entered)
    for item, materials in assigned_materials(depsgraph):
        if not any(map(entered, materials)):
            continue
        given = item.get(attributes.OBJECT_LAYER_NORMAL)
        if given is None:
            known = _set_what_is_found(recorder, item, depsgraph)
            others += [] if known else [item.name_full]
        elif np.any(given):
            normal = np.array(given, dtype=np.float64)
            _set_thickness(recorder, item, object_layer_thickness(item, depsgraph, normal))
        item.update_tag()
    if not others:
        return []
    return [
        finding(
            "not-a-layer",
            *others,
            least_fraction=LAYER_SHARE,
            least_walls=_WALL_SHARE,
            property=attributes.OBJECT_LAYER_NORMAL,
        )
    ]


def _set_what_is_found(recorder: SettingsRestorer, item: Any, depsgraph: Any) -> bool:
    """Set what an object says of its walls; returns whether these are all right."""
    normal = object_layer_normal(item, depsgraph)
    thickness = None if normal is None else object_layer_thickness(item, depsgraph, normal)
    walls = None if thickness else find_walls(item, depsgraph)
    several = walls is not None and bool(walls.wall.any())
    if walls is not None and several and normal is not None:
        linear = np.array(item.evaluated_get(depsgraph).matrix_world.to_3x3(), dtype=np.float64)
        across = normal @ np.linalg.inv(linear)
        several = walls.across(across / np.linalg.norm(across)) > _MOST_ACROSS
    if walls is not None and several and walls.share >= _WALL_SHARE:
        one = walls.one_thickness
        if one is None and store_thickness(recorder, item, walls.thickness):
            one = float(np.median(walls.thickness[walls.wall]))
        if one is not None:
            recorder.set_item(item, attributes.OBJECT_SHELL_THICKNESS, one)
            return True
    if normal is not None:
        recorder.set_item(item, attributes.OBJECT_LAYER_NORMAL, [float(x) for x in normal])
        _set_thickness(recorder, item, thickness)
    return normal is not None and not several


def _set_thickness(recorder: SettingsRestorer, item: Any, thickness: float | None) -> None:
    if attributes.OBJECT_LAYER_THICKNESS not in item and thickness is not None:
        recorder.set_item(item, attributes.OBJECT_LAYER_THICKNESS, thickness)


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


def thinnest(item: Any, depsgraph: Any) -> float:
    """Return the least depth behind a face of an object, across it, in Blender units.

    Tried are the largest faces; 0 for a mesh that is open behind all of them.
    """
    evaluated = item.evaluated_get(depsgraph)
    linear = np.array(evaluated.matrix_world.to_3x3(), dtype=np.float64)
    with evaluated_mesh(evaluated) as mesh:
        if mesh is None or not len(mesh.polygons):
            return 0.0
        depth = depths_behind(mesh, linear).depth
    return float(np.nanmin(depth)) if np.isfinite(depth).any() else 0.0


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
        Absorption [dB] by object's full name.
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
            nepers = 2 * 4 * math.pi * kappa / wavelength * depth
            losses[item.name_full] = nepers * 10 / math.log(10)
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
    found, key = [], attributes.OBJECT_SHELL_THICKNESS
    shells = {item.name_full for item in bpy.data.objects if key in item}
    for name, loss_db in losses_db.items():
        limit_db = MAX_LOSS_DB if bpy.app.version >= (5, 0, 0) else MAX_LOSS_DB_4_5
        if name in shells:
            limit_db = FACES_LOSS_DB
        if loss_db > limit_db:
            said = finding("absorption-below-float32", name, loss_db=loss_db, limit_db=limit_db)
            # no radar receives what is behind so much
            found.append(said.as_information() if loss_db > MAX_LOSS_DB else said)
    return found
