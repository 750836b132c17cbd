# SPDX-License-Identifier: GPL-3.0-or-later
"""Which paths have a reverse: those between two scatterers that are no mirrors."""

from __future__ import annotations

from functools import cache, cached_property
from typing import Any

import numpy as np

from ...array_types import Mask, Real
from ...signal.paths import PathFlag, PathRows
from ...vectors import are_finite, dots, norms
from ..materials import is_mirror_like
from ..motion import Bodies
from .hit_points import HitPoints, Normals
from .surface_lobes import is_mirrored


class ReverseMarks:
    """Marks rows whose reverse is a path of its own.

    Rays end at scatterers that are no mirrors, because the transmitter is a point. So a path has a
    reverse if it has not been mirrored at its first scatterer. (A mirror there, and images on the
    way to the transmitter, are cared for by :mod:`.mirror_paths`.) `hits` finds normals; rows have
    the numbers of `bodies`.
    """

    def __init__(self, hits: HitPoints, bodies: Bodies) -> None:
        self._hits, self._bodies = hits, bodies

    @cached_property
    def _by_body(self) -> tuple[Mask, Mask]:
        """By the body's number, from 1; 0 is unknown: whether it may mirror, and whether its
        normals are not those of its faces. Only paths of several reflections ask.
        """
        sharp, bodies = cache(is_mirror_like), self._bodies
        shapes = bodies.snapshot.shapes
        mirrors = np.array([any(map(sharp, shape.materials)) for shape in shapes], dtype=bool)
        rounded = np.zeros(len(shapes), dtype=bool)
        for number in np.flatnonzero(mirrors).tolist():
            with bodies.snapshot.mesh(shapes[number]) as mesh:
                rounded[number] = is_smooth_shaded(mesh)
        unknown = mirrors.any()
        return np.append(unknown, mirrors[bodies.shape]), np.append(unknown, rounded[bodies.shape])

    def mark(self, rows: PathRows, found: Normals, origins_m: Real) -> None:
        """Set the flag of labelled, refined rows with the normals that refining met.

        Rays start at `origins_m`, (n, 3).
        """
        several = np.flatnonzero(rows["order"] > 1)
        if not several.size:
            return
        mine = rows[several]
        may_mirror, rounded = self._by_body
        ranged = mine["flags"] & PathFlag.NO_RANGE == 0
        mirrors = may_mirror[mine["first_body"]]
        marked = ranged & ~mirrors
        known = ranged & mirrors & (mine["order"] == 2) & ~rounded[mine["first_body"]]
        chosen = np.flatnonzero(known & are_finite(mine["first_scatterer_m"]))
        if chosen.size:
            mine, number = mine[chosen], several[chosen]
            first_m, along = mine["first_scatterer_m"], mine["direction"]
            onward = mine["last_scatterer_m"] - first_m
            normals = self._hits.normals(
                mine["first_body"], origins_m[number], first_m, found.all()[0][number]
            )
            with np.errstate(invalid="ignore"):
                onward /= norms(onward)[:, None]
                sines = -dots(normals, along), dots(normals, onward)
                away = is_mirrored(sines, -along, onward)
            marked[chosen] = ~away & are_finite(normals) & are_finite(onward)
        rows["flags"][several[marked]] |= np.uint16(PathFlag.HAS_REVERSE)


def is_smooth_shaded(mesh: Any) -> bool:
    """Whether a mesh, or None, has faces whose normals are not those of their planes."""
    if mesh is None or not len(mesh.polygons):
        return False
    smooth = np.zeros(len(mesh.polygons), dtype=bool)
    mesh.polygons.foreach_get("use_smooth", smooth)
    return bool(smooth.any())
