# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths via a narrow and a wide lobe: both directions from the one that Cycles samples well.

Cycles draws the ray from a path's first scatterer by the lobe there, and evaluates the last lobe
towards the transmitter. So few rays find a path that ends at the narrow lobe, and each has a large
power. With the antennas in one place, the reverse path begins at that lobe, has the same power, and
is sampled well. Both directions are taken from the rows of this reverse path: the rows, and copies
with both scatterers exchanged. Where a scatterer is outside the field of view, the table has no
reverse path, and the row stays as it is.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ...array_types import Mask
from ...signal.paths import PathFlag, PathRows, has_images
from ...vectors import are_finite, norms
from ..materials import reciprocal_lobe
from ..motion import Bodies
from ..nodes.group_search import group_node
from ..nodes.materials import lets_nothing_through
from .reverse_marks import is_smooth_shaded
from .same_point import in_view
from .view_tracer import ViewTracer

#: Widths of two lobes differ where one is so many times as wide as the other.
_WIDER = 2.0
#: Distance of the antennas that is none, in wavelengths.
_TOGETHER = 1e-3
#: Columns of the first scatterer; those of the last are called likewise.
_ENDS = ("scatterer_m", "body", "object", "surface_point")


class BetterDirection:
    """Replaces rows that end at a narrow lobe. `bodies` are those whose numbers rows have."""

    def __init__(self, bodies: Bodies, wavelength_m: float) -> None:
        self._together_m = _TOGETHER * wavelength_m
        width, shapes = cache(reciprocal_lobe), bodies.snapshot.shapes
        met = {material for shape in shapes for material in shape.materials}
        #: Whether rays pass through no surface, where both directions could be different rows.
        self._opaque = all(
            lets_nothing_through(one) if group_node(one) else width(one) > 0 for one in met
        )
        widths = np.array([min(map(width, shape.materials), default=0.0) for shape in shapes])
        several = np.array([len(set(shape.materials)) > 1 for shape in shapes], dtype=bool)
        widths[several] = 0.0
        for number in np.flatnonzero((widths > 0) & np.isfinite(widths)).tolist():
            with bodies.snapshot.mesh(shapes[number]) as mesh:
                if is_smooth_shaded(mesh):  # normals of light and of faces differ
                    widths[number] = 0.0
        #: Widths of lobes by the body's number, from 1; 0: unknown.
        self._widths = np.append(0.0, widths[bodies.shape])

    def in_better_direction(self, rows: PathRows, tracer: ViewTracer) -> PathRows:
        """Return rows of a tile replicate with both directions of pairs from the one that is
        sampled well; the rows themselves where there is none, or objects are not opaque.
        """
        receiver = tracer.receiver
        place_m = np.asarray(receiver.matrix_world, dtype=np.float64)[:3, 3]
        apart_m = float(np.linalg.norm(tracer.transmitter_m - place_m))
        parallel = receiver.kind == "orthographic"
        if parallel or apart_m > self._together_m or not self._opaque:
            return rows
        first, last = (self._widths.take(rows[name]) for name in ("first_body", "last_body"))
        both = self._usable(rows) & (first > 0) & (last > 0)
        poor = np.flatnonzero(both & (first >= _WIDER * last))
        good = np.flatnonzero(both & (last >= _WIDER * first))
        poor, good = (
            some[in_view(rows["last_scatterer_m"][some], receiver)] for some in (poor, good)
        )
        if not poor.size + good.size:
            return rows
        back = rows[good]
        for name in _ENDS:
            back[f"first_{name}"], back[f"last_{name}"] = (
                rows[f"{end}_{name}"][good] for end in ("last", "first")
            )
        along = back["first_scatterer_m"] - place_m
        back["direction"] = along / norms(along)[:, None]
        return np.concatenate([np.delete(rows, poor), back])

    def _usable(self, rows: PathRows) -> Mask:
        """Rows of two reflections whose reverse is a path of its own, with known vertices."""
        found = (rows["order"] == 2) & (rows["transparent_depth"] == 0)
        found &= rows["flags"] & (PathFlag.HAS_REVERSE | PathFlag.NO_RANGE) == PathFlag.HAS_REVERSE
        for name in ("first_scatterer_m", "last_scatterer_m"):
            found &= are_finite(rows[name])
        if has_images(rows):
            for name in ("transmitter_image", "receiver_image", "mirrors"):
                found &= rows[name] == 0
        return np.asarray(found)
