# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects of simple Radar Materials, in which waves are not refracted, and what that costs."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from ...findings import Finding, finding
from ...physics.slab import excess_path_m
from ..nodes.group_search import group_input
from ..nodes.materials import has_interior
from ..nodes.radar_material import INDEX
from .assignments import assigned_materials
from .layers import is_entered, thinnest


def straight_interiors(depsgraph: Any, metres_per_unit: float) -> list[Finding]:
    """Find objects that waves cross at the delay of the straight line, whatever its angle.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date, materials at the carrier.
    metres_per_unit
        Length of a Blender unit [m].

    Returns
    -------
    list of Finding
        One ``interior-not-refracted`` with all of them, if any, and what the one with the largest
        error adds to an echo behind it at two angles.
    """
    simple = cache(lambda material: has_interior(material) and not is_entered(material))
    worst: dict[str, tuple[float, float]] = {}
    for item, materials in assigned_materials(depsgraph):
        sockets = [group_input(material, INDEX) for material in materials if simple(material)]
        index = max((float(s.default_value) for s in sockets if s is not None), default=1.0)
        if item.type != "MESH" or index <= 1:
            continue
        depth_m = thinnest(item, depsgraph) * metres_per_unit
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
    """What a straight line through a layer and back is longer than the refracted wave [m]."""
    cosine = math.cos(math.radians(angle_deg))
    return 2 * ((index - 1) * depth_m / cosine - float(excess_path_m(index, depth_m, cosine)))
