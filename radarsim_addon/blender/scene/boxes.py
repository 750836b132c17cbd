# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounding boxes of surfaces at one moment, and how far they reach. Does not import bpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...array_types import Indices, Real
from ..plan import Extent
from ..state import Snapshot

#: What centres, radii and distances of boxes may be off by rounding, relative to coordinates.
_MARGIN = 1e-12


@dataclass(frozen=True)
class Boxes:
    """Bounding boxes of surfaces: rows of a snapshot, and corners in the world, (n, 8, 3)."""

    snapshot: Snapshot
    rows: Indices

    @property
    def corners(self) -> Real:
        """Corners in world space [Blender units]."""
        return self.snapshot.corners_of(self.rows)

    def spheres(self, *places: Real) -> tuple[Real, Real]:
        """Return centres (n, 3) and radii (n,) of spheres around them [Blender units].

        The radii have a margin for the rounding of distances from the origin and from `places`.
        """
        spheres = self.snapshot.spheres[self.rows]
        largest = np.abs([spheres.max(initial=0.0), spheres.min(initial=0.0), *np.ravel(places)])
        return spheres[:, :3], spheres[:, 3] + _MARGIN * largest.max()

    def labels(self) -> tuple[list[str], Indices]:
        """Return the labels of the surfaces, each once, and the number of each surface's, (n,)."""
        layout = self.snapshot.layout
        pairs = layout.shape[self.rows] * (len(layout.instancers) + 1) + layout.instancer[self.rows]
        _, first, inverse = np.unique(pairs, return_index=True, return_inverse=True)
        names = [self.snapshot.label(row) for row in self.rows[first].tolist()]
        numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
        return list(numbers), np.array([numbers[name] for name in names], dtype=np.intp)[inverse]

    def pairs(self, later: Boxes) -> tuple[Indices, Indices]:
        """Return the rows of what is in both, here and there."""
        if self.snapshot.layout is later.snapshot.layout:
            if np.array_equal(self.rows, later.rows):
                return self.rows, self.rows
            both = np.intersect1d(self.rows, later.rows, assume_unique=True)
            return both, both
        there = {(later.snapshot.label(r), later.snapshot.layout.key(r)): r for r in later.rows}
        found = [
            (row, there[key])
            for row in self.rows
            if (key := (self.snapshot.label(row), self.snapshot.layout.key(row))) in there
        ]
        first, second = np.array(found, dtype=np.intp).reshape(-1, 2).T
        return first, second


def extent_of_boxes(boxes: Boxes, antennas: tuple[Real, Real], metres_per_unit: float) -> Extent:
    """Return `scene_extent` from boxes, and the places of receiver and transmitter."""
    receiver, transmitter = antennas
    baseline_m = float(np.linalg.norm(receiver - transmitter)) * metres_per_unit
    if not boxes.rows.size:
        return Extent(baseline_m=baseline_m)
    centre, radius = boxes.spheres(receiver, transmitter)

    def corners(middle: Real) -> Real:
        """Corners, (m, 3), of the boxes whose farthest one may be the farthest of all.

        `middle` is how far their centres are, in the same sense.
        """
        far = middle + radius >= middle.max()
        return boxes.snapshot.corners_of(boxes.rows[far]).reshape(-1, 3)

    def farthest_m(origin: Real) -> float:
        away = np.linalg.norm(centre - origin, axis=1)
        return float(np.linalg.norm(corners(away) - origin, axis=1).max()) * metres_per_unit

    span = [
        corners(middle)[:, axis].max() - corners(-middle)[:, axis].min()
        for axis, middle in enumerate(centre.T)
    ]
    return Extent(
        from_emitter_m=farthest_m(transmitter),
        from_receiver_m=farthest_m(receiver),
        baseline_m=baseline_m,
        diameter_m=float(np.linalg.norm(span)) * metres_per_unit,
    )
