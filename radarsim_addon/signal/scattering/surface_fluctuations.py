# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture and velocities of the scatterers of surfaces whose clutter fluctuates.

Both belong to the surface, as its scatterers do (:mod:`.surface_speckle`): texture is a field in
the object's own coordinates, and a scatterer keeps its velocity from frame to frame.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...array_types import Real
from ...contract import FluctuationRecord
from ...physics.clutter_statistics import clutter_velocities, texture
from ..paths import AnyRows
from .random_phases import hash_step, uniform
from .surface_cells import Cells, SurfaceCells

#: Tells these draws from those of places and heights.
_DRAWS = np.uint64(0xD1B54A32D192ED03)


def grazing_cosines(rows: AnyRows) -> Real:
    """Cosines of the grazing angles of rows on surfaces with motion of their own, (n,).

    Surfaces of clutter's models are level: the grazing angle is the ray's elevation.
    """
    return np.asarray(np.sqrt(np.maximum(1 - rows["direction"][:, 2] ** 2, 0.0)))


class SurfaceFluctuations:
    """Draws texture and velocities; `surfaces` goes by the number of the object, from 1."""

    def __init__(
        self,
        cells: SurfaceCells,
        surfaces: Mapping[int, FluctuationRecord],
        seed: int,
        wavelength_m: float,
    ) -> None:
        self._cells, self._surfaces = cells, surfaces
        self._seed, self._wavelength_m = seed, wavelength_m

    def __bool__(self) -> bool:
        return bool(self._surfaces)

    def of_vertex(self, rows: AnyRows, cells: Cells, first: bool) -> tuple[Real, Real]:
        """Factors on the power, and velocities along the line of sight [m/s], of the cells of a
        vertex of rows, (n,) each; 1 and 0 at surfaces that do not fluctuate.
        """
        factors, rates_mps = np.ones(rows.size), np.zeros(rows.size)
        objects = rows["first_object" if first else "last_object"]
        counts = (rows["order"] > 1) if first else np.ones(rows.size, dtype=bool)
        own_m = self._cells.local_m(cells)
        draw = hash_step(cells.state ^ _DRAWS)
        draws = uniform(draw), uniform(hash_step(draw))
        cosine = grazing_cosines(rows)
        for number, surface in self._surfaces.items():
            mine = np.flatnonzero((objects == number) & counts)
            if not mine.size:
                continue
            factors[mine] = texture(
                own_m[mine],
                surface.texture,
                surface.texture_shape,
                surface.texture_length_m,
                self._seed + number,
            )
            rates_mps[mine] = clutter_velocities(
                surface.motion,
                surface.motion_speed_mps,
                surface.motion_fraction,
                (draws[0][mine], draws[1][mine]),
                cosine[mine],
                self._wavelength_m,
            )
        return factors, rates_mps
