# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows that come out of renders, with what Cycles does not tell: bodies, exact vertices, powers.

Does not import bpy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...array_types import Real
from ...signal.paths import PathRows
from ..motion import BurstMotion
from ..views import ViewWindow
from .clutter_weights import ClutterWeights
from .hit_points import HitPoints

#: Pixels of views whose rows are treated together.
_PIXELS_TOGETHER = 1 << 15


def views_together(window: ViewWindow) -> int:
    """Return of how many views of a window the rows are treated together: of few rows numpy is all
    overhead, and many do not stay in the processor's cache.

    Parameters
    ----------
    window
        Of a tile.

    Returns
    -------
    int
        1 at least.
    """
    return max(_PIXELS_TOGETHER // (window.width_px * window.height_px), 1)


@dataclass(frozen=True)
class RowFinisher:
    """Labels and corrects rows of one radar frame."""

    motion: BurstMotion
    hits: HitPoints
    clutter: ClutterWeights

    def finish(self, views: Sequence[tuple[PathRows, Real]], transmitter_m: Real) -> list[PathRows]:
        """Return the rows of views with bodies, vertices, lengths and powers.

        Parameters
        ----------
        views
            Rows of each, (n,), which may be changed, and where their rays start, (3,) or (n, 3)
            [m]. Where rays of one view start at one place, those of all do.
        transmitter_m
            Place of the transmitter or of its image, (3,) [m].

        Returns
        -------
        list of ndarray
            Rows of each view, (n,).
        """
        rows_of, origins_m = zip(*views, strict=True)
        if len(views) == 1:
            rows, origin_m = views[0]
        else:
            rows = np.concatenate(rows_of)
            one_place = origins_m[0].ndim == 1
            origin_m = origins_m[0] if one_place else np.concatenate(origins_m)
        self.motion.label(rows)
        normals = self.hits.refine(rows, origin_m, transmitter_m)
        self.clutter.apply(rows, normals, origin_m, transmitter_m)
        return np.split(rows, np.cumsum([one.size for one in rows_of[:-1]], dtype=np.intp))
