# SPDX-License-Identifier: GPL-3.0-or-later
"""Find meshes that are shaded smooth across sharp edges, as imported buildings often are.

Blender then bends normals over whole faces, and reflection, Fresnel's equations and walls follow
normals. Walls have sharp edges during a run; others are named.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...findings import Finding, finding
from ..materials import assigned_materials, is_entered, sharpen_edges
from ..nodes import attributes
from ..state import SettingsRestorer, evaluated_mesh, read_numbers, take_snapshot

#: Angle between a normal and its face from which on it counts: spheres of 12 segments stay below.
_OFF_DEG = 25.0
#: Fraction of the surface with such normals above which an object is named.
_LEAST_FRACTION = 0.05
#: Angle between the faces at an edge above which walls are no curved surface: cylinders of 10
#: segments stay below, oriels are above.
_EDGE_DEG = 40.0


def sharpen_walls(recorder: SettingsRestorer, depsgraph: Any) -> None:
    """Let the normals of walls that are shaded smooth end at their edges, until restored.

    Parameters
    ----------
    recorder
        Records the changes.
    depsgraph : bpy.types.Depsgraph
        Up to date; walls are set for the run.
    """
    known = attributes.OBJECT_LAYER_NORMAL, attributes.OBJECT_SHELL_THICKNESS
    assigned = assigned_materials(depsgraph)
    walls = [
        one.item
        for one in assigned
        if any(name in one.item and np.any(one.item[name]) for name in known)
        and any(map(is_entered, one.materials))
    ]
    of_walls = set(walls)
    others = {one.item.data for one in assigned if one.item not in of_walls}
    for item in walls:
        if item.library is not None and item.data in others:  # whose normals stay
            continue
        with evaluated_mesh(item.evaluated_get(depsgraph)) as mesh:
            bent = 0.0 if mesh is None else _bent(mesh)
        if bent > 0:
            sharpen_edges(recorder, item, _EDGE_DEG)


def check_normals(depsgraph: Any) -> list[Finding]:
    """Find the rendered meshes whose normals are far from those of their faces.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    list of Finding
        One ``smooth-across-edges`` with all of them, if any.
    """
    snapshot = take_snapshot(depsgraph)
    found: dict[str, float] = {}
    for shape in snapshot.shapes:
        if shape.kind != "MESH" or shape.original.hide_render:
            continue
        with snapshot.mesh(shape) as mesh:
            fraction = 0.0 if mesh is None else _bent(mesh)
        if fraction > _LEAST_FRACTION:
            found[shape.original.name_full] = fraction
    if not found:
        return []
    fraction = max(found.values())
    return [finding("smooth-across-edges", *found, fraction=fraction, angle_deg=_OFF_DEG)]


def _bent(mesh: Any) -> float:
    """Return the fraction of a mesh's surface with normals that are far from its faces'."""
    if not len(mesh.polygons) or mesh.normals_domain == "FACE":
        return 0.0
    sides = read_numbers(mesh.polygons, "loop_total", dtype=np.int32).ravel()
    across = np.repeat(read_numbers(mesh.polygons, "normal", 3), sides, axis=0)
    area = np.repeat(read_numbers(mesh.polygons, "area").ravel() / sides, sides)
    cosine = np.einsum("nx,nx->n", read_numbers(mesh.corner_normals, "vector", 3), across)
    off = (cosine < math.cos(math.radians(_OFF_DEG))) & (area > 0)
    return float(area[off].sum() / max(area.sum(), 1e-300))
