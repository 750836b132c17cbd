# SPDX-License-Identifier: GPL-3.0-or-later
"""Thin panes that are modelled with both of their sides, so that they count twice."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from ...findings import Finding, finding
from ..state import evaluated_mesh
from .assignments import assigned_materials
from .physical_materials import SHEET_THICKNESS, is_sheet
from .wall_faces import depths_behind

#: Distance of two sides, in thicknesses of the pane, within which they are those of one pane.
_NEAR = 10.0
#: Fraction of the surface with another side from which on an object is named.
_LEAST_FRACTION = 0.1


def doubled_panes(depsgraph: Any, metres_per_unit: float) -> list[Finding]:
    """Find objects whose thin sheets have another face of the object right behind them.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.
    metres_per_unit
        Length of a Blender unit [m].

    Returns
    -------
    list of Finding
        One ``pane-counts-twice`` with all of them, if any.
    """
    named, is_pane = [], cache(is_sheet)
    for item, materials in assigned_materials(depsgraph):
        sheets = [m for m in materials if m is not None and is_pane(m)]
        if item.type != "MESH" or not sheets:
            continue
        evaluated = item.evaluated_get(depsgraph)
        linear = np.array(evaluated.matrix_world.to_3x3(), dtype=np.float64)
        with evaluated_mesh(evaluated) as mesh:
            if mesh is None or not len(mesh.polygons):
                continue
            depths = depths_behind(mesh, linear)
        thickness_m = max(float(m.get(SHEET_THICKNESS, 0.0)) for m in sheets)
        with np.errstate(invalid="ignore"):
            near = depths.parallel & (depths.depth * metres_per_unit <= _NEAR * thickness_m)
        if depths.area[near].sum() > _LEAST_FRACTION * depths.area.sum():
            named.append(item.name)
    return [finding("pane-counts-twice", *named)] if named else []
