# SPDX-License-Identifier: GPL-3.0-or-later
"""Rms height and correlation length of surfaces, as materials carry them in custom properties."""

from __future__ import annotations

from typing import Any

from .assignments import slot_materials
from .physical_materials import CORRELATION_LENGTH, RMS_HEIGHT


def roughness_of(item: Any) -> tuple[float | None, float | None]:
    """Rms height and correlation length [m] of the first material that has a height; else None.

    Parameters
    ----------
    item : bpy.types.Object
        Evaluated: materials that geometry nodes set count, too.
    """
    for material in slot_materials(item):
        if material is None:
            continue
        height_m = float(material.get(RMS_HEIGHT, 0.0))
        if height_m > 0:
            return height_m, float(material.get(CORRELATION_LENGTH, 0.0)) or None
    return None, None
