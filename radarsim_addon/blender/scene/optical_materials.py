# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of ordinary scenes, made for light: which radar materials they stand for."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..materials import assigned_materials
from ..materials.library import READY, suggest_material
from ..nodes import is_radar_material
from ..state import read_numbers

#: Thickness of a pane that is modelled as an open mesh [m].
_PANE_M = 4e-3


def suggest_materials(depsgraph: Any) -> dict[Any, str | None]:
    """Return the optical materials of the rendered objects, each with a ready material.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    dict
        By material the key of `READY` for its name, else for that of an object with it, else None.
    """
    owners: dict[Any, list[str]] = {}
    for item, materials in assigned_materials(depsgraph):
        for material in materials:
            if material is not None and not is_radar_material(material):
                owners.setdefault(material, []).append(item.name)
    return {
        material: suggest_material(material.name, *names)
        for material, names in sorted(owners.items(), key=lambda pair: pair[0].name)
    }


def replace_material(material: Any, ready: str, carrier_hz: float, depsgraph: Any) -> Any:
    """Put a ready radar material in the place of an optical one, which stays in the file.

    Waves enter where all objects with the material are closed and have no other. Else it is
    opaque, and glass a thin sheet.

    Parameters
    ----------
    material : bpy.types.Material
    ready
        Key of `READY`.
    carrier_hz
        Carrier for the first evaluation [Hz].
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    bpy.types.Material
    """
    asset = READY[ready]
    closed = all(
        set(one.materials) == {material} and _is_closed(one.item.evaluated_get(depsgraph))
        for one in assigned_materials(depsgraph)
        if material in one.materials
    )
    options: dict[str, Any] = {} if closed else {"penetrable": False}
    if asset.medium == "glass" and not closed:
        options = {"sheet_thickness_m": _PANE_M}
    made = asset.material(f"{material.name} ({ready})", carrier_hz, **options)
    made.diffuse_color = material.diffuse_color
    material.user_remap(made)
    material.use_fake_user = True
    return made


def _is_closed(item: Any) -> bool:
    """Whether every edge of an evaluated mesh joins two faces."""
    if item.type != "MESH" or not len(item.data.polygons):
        return False
    edges = read_numbers(item.data.loops, "edge_index", dtype=np.int32).ravel()
    return bool(np.all(np.bincount(edges, minlength=len(item.data.edges)) == 2))
