# SPDX-License-Identifier: GPL-3.0-or-later
"""RMS height and correlation length of surfaces, from custom properties of materials."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..nodes.group_search import group_input
from ..nodes.physical_material import ROUGHNESS, SMOOTH_BELOW
from .assignments import slot_materials
from .physical_materials import CORRELATION_LENGTH, RMS_HEIGHT


def roughness_of(materials: Iterable[Any]) -> tuple[float | None, float | None]:
    """Return the roughness of the first of some materials that has an RMS height.

    Parameters
    ----------
    materials : iterable of bpy.types.Material or None
        Of an object, by slot.

    Returns
    -------
    rms_height_m, correlation_length_m : float or None
        [m]; None if unknown.
    """
    for material in materials:
        if material is None:
            continue
        height_m = float(material.get(RMS_HEIGHT, 0.0))
        if height_m > 0:
            return height_m, float(material.get(CORRELATION_LENGTH, 0.0)) or None
    return None, None


def is_rough(item: Any) -> bool:
    """Return whether all materials of an object are Radar Materials with a rough surface.

    Parameters
    ----------
    item : bpy.types.Object

    Returns
    -------
    bool
        False for an object without materials.
    """
    sockets = [group_input(material, ROUGHNESS) for material in slot_materials(item)]
    return bool(sockets) and all(
        socket is not None and socket.default_value > SMOOTH_BELOW for socket in sockets
    )
