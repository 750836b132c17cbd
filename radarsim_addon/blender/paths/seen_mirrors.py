# SPDX-License-Identifier: GPL-3.0-or-later
"""Mirrors that the receiver sees: what their image has of the wave.

Cycles follows a ray over a mirror with the power of both polarisations behind it, as at a smooth
surface. The receiver takes the polarisation of the run, and of a slightly rough mirror the coherent
part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from ...array_types import Real
from ...physics.mirrors import MirrorMaterial, coherent_reflection
from ...signal.paths import PathRows
from ...vectors import are_finite, dots, norms
from ..materials import clutter_of, mirror_of, scattered_lobe_of
from ..motion import Bodies
from .hit_points import HitPoints, Normals
from .surface_lobes import is_mirrored


class SeenMirrors:
    """Corrects the power of what the receiver sees in mirrors.

    `hits` finds normals; rows have the numbers of `bodies`.
    """

    def __init__(
        self, hits: HitPoints, bodies: Bodies, polarisation: str, wavelength_m: float
    ) -> None:
        self._hits, self._wavelength_m = hits, wavelength_m
        self._polarisation = polarisation
        materials = [tuple(shape.materials) for shape in bodies.snapshot.shapes]
        mirror, lobe = cache(_mirror), cache(scattered_lobe_of)
        found = [mirror(every) for every in materials]
        self._mirrors = list(dict.fromkeys(one for one in found if one is not None))
        numbers = np.array([-1 if one is None else self._mirrors.index(one) for one in found], int)
        heights_m = np.array([_rms_height_m(one) for one in found])
        #: By the body's number, from 1: number of the mirror, -1 for others; RMS height, 0 for
        #: other surfaces [m]; and whether a lobe has the rest of the power.
        self._numbers = np.append(-1, numbers[bodies.shape])
        self._heights_m = np.append(0.0, heights_m[bodies.shape])
        scatters = np.array([any(map(lobe, every)) for every in materials], dtype=bool)
        self._scatters = np.append(False, scatters[bodies.shape])

    def correct(self, rows: PathRows, found: Normals, origins_m: Real) -> None:
        """Multiply powers of labelled, refined rows with the normals that refining met.

        Rays start at `origins_m`, (n, 3).

        With more than two reflections it is unknown whether the mirror has scattered or mirrored:
        both are in such rows as if nothing were taken from the image, so their sum is reduced. They
        keep the power of both polarisations, because the next mirror may turn the wave back.
        """
        if not self._mirrors:
            return
        seen = (self._numbers[rows["first_body"]] >= 0) & (rows["order"] > 1)
        chosen = np.flatnonzero(seen & are_finite(rows["first_scatterer_m"]))
        if not chosen.size:
            return
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
        for number, mirror in enumerate(self._mirrors):
            here = np.flatnonzero(two & mirrored & (self._numbers[bodies] == number))
            wave = along[here], normals[here], self._polarisation
            rendered = np.maximum(mirror.rendered_power(*wave), np.finfo(float).tiny)
            smooth = replace(mirror, rms_height_m=0.0)
            factor[here] *= smooth.reflection(*wave, self._wavelength_m).power / rendered
        rows["power_w"][chosen] *= np.where(np.isfinite(factor), factor, 1.0)


def _mirror(materials: Sequence[Any]) -> MirrorMaterial | None:
    """What all of a body's materials are as mirrors without another lobe; else None."""
    known = {None if clutter_of(one) else mirror_of(one) for one in materials}
    return known.pop() if len(known) == 1 else None


def _rms_height_m(mirror: MirrorMaterial | None) -> float:
    return 0.0 if mirror is None or mirror.share < 1 else mirror.rms_height_m
