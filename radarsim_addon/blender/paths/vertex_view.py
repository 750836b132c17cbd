# SPDX-License-Identifier: GPL-3.0-or-later
"""Which vertices of paths over mirrors the receiver sees directly, too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...array_types import Mask, Real
from ...contract import ReceiverRecord
from ...signal.paths import PathRows
from ...vectors import dots
from .hit_points import HitPoints
from .obstacles import Obstacles
from .same_point import in_view


@dataclass(frozen=True)
class VertexView:
    """What a receiver at `receiver_m` sees of last vertices."""

    hits: HitPoints
    obstacles: Obstacles
    receiver: ReceiverRecord
    receiver_m: Real

    def sees(self, rows: PathRows, from_m: Real) -> Mask:
        """Return whether a pixel sees last vertices, on the side from which `from_m`, (3,) or
        (n, 3), does, (n,).
        """
        last_m = rows["last_scatterer_m"]
        found = in_view(last_m, self.receiver)
        chosen = np.flatnonzero(found)
        from_m = np.broadcast_to(from_m, last_m.shape)
        found[chosen] = self._visible(rows[chosen], from_m[chosen])
        return found

    def _visible(self, rows: PathRows, from_m: Real) -> Mask:
        """Whether nothing hides last vertices, and they face the receiver as they do `from_m`."""
        last_m = rows["last_scatterer_m"]
        ends_m = np.broadcast_to(self.receiver_m, last_m.shape)
        normals = self.hits.normals(rows["last_body"], from_m, last_m)
        seen = dots(normals, from_m - last_m) * dots(normals, ends_m - last_m) > 0
        blocked, through = self.obstacles.block(last_m, ends_m, rows["last_body"])
        return np.asarray(seen & ~blocked & ~through)
