# SPDX-License-Identifier: GPL-3.0-or-later
"""Where paths go: their vertices and directions, for what depends on them.

Antenna patterns depend on the directions at both antennas, speckle on the place on the surface,
motion on the objects that the paths touch.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...array_types import Int32, Real
from ..motion import PathImages, Rows
from .columns import select_columns


@dataclass(frozen=True)
class PathGeometry:
    """Geometry of n paths at the frame's time t, in world space; NaN where unknown.

    Attributes
    ----------
    order, transparent_depth
        Reflections, and transparent surfaces passed on the receiver's side, (n,).
    first_scatterer_m, last_scatterer_m
        First and last scatterer, equal at order 1, (n, 3) [m].
    direction
        From the receiver towards the first scatterer, unit vectors, (n, 3).
    first_object, last_object
        Numbers in the frame's list of objects, from 1; 0: unknown, (n,).
    images
        Images of the antennas over which the paths go; None: none.
    """

    order: Int32
    transparent_depth: Int32
    first_scatterer_m: Real
    last_scatterer_m: Real
    direction: Real
    first_object: Int32
    last_object: Int32
    images: PathImages | None = None

    def select(self, rows: Rows) -> PathGeometry:
        """Return the geometry of some rows: mask (n,), row numbers (m,) or slice."""
        return select_columns(self, rows)
