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
from ...findings import Finding, finding, finding_about
from ..nodes import attributes
from ..nodes.group_search import group_input, group_node
from ..nodes.groups import KIND_PROPERTY
from ..nodes.materials import has_interior
from ..nodes.physical_material import EXTINCTION, KIND
from ..nodes.sheet import KIND as SHEET_KIND
from ..state import SettingsRestorer, evaluated_mesh
from .assignments import assigned_materials
from .convex_bodies import convex_parts, least_depths
from .layer_faces import LAYER_SHARE, MIN_PLATE_FRACTION, LayerFaces
from .wall_faces import WallFaces, depths_behind, find_walls
from .wall_modifier import store_thickness

#: Two-way absorption that Cycles can represent [dB]. For an echo of 1 W/(m^2 sr) without the wall,
#: measured power and range are correct up to 360 dB, and the range is lost from 372 dB. Blender up
#: to 4.5 returns zero from 122 dB.
MAX_LOSS_DB = 350.0
MAX_LOSS_DB_4_5 = 120.0
#: Two-way absorption that the two faces of a wall can hold in place of its volume [dB]: Cycles
#: drops what passes a face with less than 1e-5.
FACES_LOSS_DB = 100.0
#: Maximum fraction of the walls of a layer that lie across another direction.
_MOST_ACROSS = 0.01
#: Minimum fraction of the surface of an object that consists of walls: the rest are rims.
_WALL_SHARE = 0.75


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
    items = [one.item for one in assigned_materials(depsgraph) if any(map(entered, one.materials))]
    faces = LayerFaces.read(items, depsgraph)
    given = [item.get(attributes.OBJECT_LAYER_NORMAL) for item in items]
    own = np.array([one is not None for one in given], dtype=bool)
    normals = faces.layer_normals()
    for row in np.flatnonzero(own).tolist():
        normals[row] = given[row] if np.any(given[row]) else np.nan
    low, high = faces.planes(normals, MIN_PLATE_FRACTION)
    massive = {item for bodies in convex_parts(depsgraph) for item in bodies.without_walls()}
    for row, (item, thickness) in enumerate(zip(items, (high - low).tolist(), strict=True)):
        normal = None if np.isnan(normals[row, 0]) else normals[row]
        if own[row]:
            _set_thickness(recorder, item, thickness)
        elif normal is None or math.isnan(thickness):
            walls = None if item in massive else find_walls(item, depsgraph)
            known = _set_what_is_found(recorder, item, depsgraph, normal, walls)
            others += [] if known else [item.name_full]
        else:
            _set_layer(recorder, item, normal, thickness)
        if _is_told(item):  # Cycles reads custom properties again only after a tag
            item.update_tag(refresh={"OBJECT"})
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


def _is_told(item: Any) -> bool:
    """Whether an object has a custom property that the shaders of walls read."""
    return attributes.OBJECT_LAYER_NORMAL in item or attributes.OBJECT_SHELL_THICKNESS in item


def _set_what_is_found(
    recorder: SettingsRestorer,
    item: Any,
    depsgraph: Any,
    normal: Real | None,
    walls: WallFaces | None,
) -> bool:
    """Set what an object that is no single plate says of its walls; returns whether these are all
    right.
    """
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
        _set_layer(recorder, item, normal, math.nan)
    return normal is not None and not several


def _set_layer(recorder: SettingsRestorer, item: Any, normal: Real, thickness: float) -> None:
    recorder.set_item(item, attributes.OBJECT_LAYER_NORMAL, [float(x) for x in normal])
    _set_thickness(recorder, item, thickness)


def _set_thickness(recorder: SettingsRestorer, item: Any, thickness: float) -> None:
    """Set the thickness of a plate, NaN for others, unless the user has."""
    if attributes.OBJECT_LAYER_THICKNESS not in item and not math.isnan(thickness):
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
    is_inside, input_of = cache(is_entered), cache(group_input)
    depths = least_depths(depsgraph)
    losses = {}
    for item, materials in assigned_materials(depsgraph):
        entered = [material for material in materials if is_inside(material)]
        if item.type != "MESH" or not entered:
            continue
        sockets = [input_of(material, EXTINCTION) for material in entered]
        kappa = max((float(s.default_value) for s in sockets if s is not None), default=0.0)
        if kappa > 0:
            depth = depths[item] if item in depths else thinnest(item, depsgraph)
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
        One ``absorption-below-float32`` for information and one as a caution, if any, with the
        losses of their objects and the limits [dB].
    """
    key = attributes.OBJECT_SHELL_THICKNESS
    information: dict[str, dict[str, float]] = {}
    caution: dict[str, dict[str, float]] = {}
    shells = {item.name_full for item in bpy.data.objects if key in item}
    for name, loss_db in losses_db.items():
        limit_db = MAX_LOSS_DB if bpy.app.version >= (5, 0, 0) else MAX_LOSS_DB_4_5
        if name in shells:
            limit_db = FACES_LOSS_DB
        if loss_db > limit_db:
            # no radar receives what is behind so much
            named = information if loss_db > MAX_LOSS_DB else caution
            named[name] = {"loss_db": loss_db, "limit_db": limit_db}
    said = []
    if information:
        said.append(finding_about("absorption-below-float32", information).as_information())
    if caution:
        said.append(finding_about("absorption-below-float32", caution))
    return said
