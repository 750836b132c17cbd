# SPDX-License-Identifier: GPL-3.0-or-later
"""Where paths go: their vertices and directions, for what depends on them.

Antenna patterns ask for directions at both antennas, speckle for the place on the surface, motion
for the objects that are touched.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real


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
    """

    order: NDArray[np.int32]
    transparent_depth: NDArray[np.int32]
    first_scatterer_m: Real
    last_scatterer_m: Real
    direction: Real
    first_object: NDArray[np.int32]
    last_object: NDArray[np.int32]

    def select(self, rows: NDArray[np.bool_] | NDArray[np.intp] | slice) -> PathGeometry:
        """Geometry of these rows alone."""
        return PathGeometry(
            **{f.name: getattr(self, f.name)[rows] for f in dataclasses.fields(self)}
        )


def join_geometry(parts: Sequence[PathGeometry]) -> PathGeometry:
    """One table of several."""
    return PathGeometry(
        **{
            f.name: np.concatenate([getattr(part, f.name) for part in parts])
            for f in dataclasses.fields(PathGeometry)
        }
    )
