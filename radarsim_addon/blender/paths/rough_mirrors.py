# SPDX-License-Identifier: GPL-3.0-or-later
"""Slightly rough mirrors that the receiver sees: what is left of their image."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from ...array_types import Real
from ...physics.mirrors import coherent_reflection
from ...signal.paths import PathRows
from ...vectors import are_finite, dots, norms
from ..materials import clutter_of, mirror_of, scattered_lobe_of
from ..motion import Bodies
from .hit_points import HitPoints, Normals
from .surface_lobes import is_mirrored


class RoughMirrors:
    """Leaves the coherent part of what the receiver sees in slightly rough mirrors.

    `hits` finds normals; rows have the numbers of `bodies`.
    """

    def __init__(self, hits: HitPoints, bodies: Bodies, wavelength_m: float) -> None:
        self._hits, self._wavelength_m = hits, wavelength_m
        materials = [tuple(shape.materials) for shape in bodies.snapshot.shapes]
        height_m, lobe = cache(_rms_height_m), cache(scattered_lobe_of)
        heights_m = np.array([height_m(every) for every in materials], dtype=np.float64)
        #: By the body's number, from 1: RMS height, 0 for other surfaces [m]; and whether a lobe
        #: has the rest of the power.
        self._heights_m = np.append(0.0, heights_m[bodies.shape])
        scatters = np.array([any(map(lobe, every)) for every in materials], dtype=bool)
        self._scatters = np.append(False, scatters[bodies.shape])
        self._any = bool(self._heights_m.any())

    def keep_coherent(self, rows: PathRows, found: Normals, origins_m: Real) -> None:
        """Multiply powers of labelled, refined rows with the normals that refining met.

        Rays start at `origins_m`, (n, 3).

        With more than two reflections it is unknown whether the mirror has scattered or mirrored:
        both are in such rows as if nothing were taken from the image, so their sum is reduced.
        """
        if not self._any:
            return
        seen = (self._heights_m[rows["first_body"]] > 0) & (rows["order"] > 1)
        chosen = np.flatnonzero(seen & are_finite(rows["first_scatterer_m"]))
        mine = rows[chosen]
        bodies, first_m, along = mine["first_body"], mine["first_scatterer_m"], mine["direction"]
        known = found.all()[0][chosen]
        normals = self._hits.normals(bodies, origins_m[chosen], first_m, known)
        sine = np.abs(dots(normals, along))
        factor = coherent_reflection(self._heights_m[bodies], sine, self._wavelength_m) ** 2
        lobe, two = self._scatters[bodies], mine["order"] == 2
        onward = mine["last_scatterer_m"] - first_m
        with np.errstate(invalid="ignore"):
            onward = onward / norms(onward)[:, None]
            sines = -dots(normals, along), dots(normals, onward)
            mirrored = is_mirrored(sines, -along, onward)
        factor[lobe & two & ~mirrored] = 1.0
        factor[lobe & ~two] = 1 / (2 - factor[lobe & ~two])
        rows["power_w"][chosen] *= np.where(np.isfinite(factor), factor, 1.0)


def _rms_height_m(materials: Sequence[Any]) -> float:
    """RMS height that all of a body's materials have as mirrors without another lobe; else 0."""
    mirrors = [None if clutter_of(one) else mirror_of(one) for one in materials]
    known = {0.0 if one is None or one.share < 1 else one.rms_height_m for one in mirrors}
    return known.pop() if len(known) == 1 else 0.0
