# SPDX-License-Identifier: GPL-3.0-or-later
"""Largest range rates of objects between moments of the animation, before anything is rendered."""

from __future__ import annotations

import numpy as np

from ...array_types import Real
from .ground_truth import Boxes

#: Corners of a bounding box, in Blender's order, whose mean is the centre of a face.
_FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 4, 5), (2, 3, 6, 7), (0, 3, 4, 7), (1, 2, 5, 6))


def _ranges_m(corners: Real, antennas: tuple[Real, Real], metres_per_unit: float) -> Real:
    """Return half the path lengths by way of the centres of faces, and of boxes, (n, 7) [m]."""
    faces = corners[:, _FACES].mean(axis=2)
    points = np.concatenate([faces, corners.mean(axis=1, keepdims=True)], axis=1)
    lengths = sum(np.linalg.norm(points - antenna, axis=2) for antenna in antennas)
    return np.asarray(lengths * metres_per_unit / 2)


class ClosingSpeeds:
    """Largest |range rate| of every object over the moments of a run.

    It is that of the centres of the faces of its bounding box, a mean between two moments: exact
    for what moves steadily without turning, and that of the rim for a wheel that turns little.

    Parameters
    ----------
    metres_per_unit
        Metres per Blender unit.
    """

    def __init__(self, metres_per_unit: float) -> None:
        self._units = metres_per_unit
        #: Largest |range rate| by the label of the object [m/s].
        self.by_object: dict[str, float] = {}

    def add(
        self,
        before: tuple[Boxes, tuple[Real, Real]],
        after: tuple[Boxes, tuple[Real, Real]],
        interval_s: float,
    ) -> None:
        """Add two moments, each with its boxes and the places of the antennas."""
        common = before[0].pairs(after[0])
        if all(map(np.array_equal, before[1], after[1])):  # then only what moves has a rate
            then, now = (
                boxes.snapshot.corners[rows]
                for rows, (boxes, _) in zip(common, (before, after), strict=True)
            )
            moving = (then != now).any(axis=(1, 2))
            common = common[0][moving], common[1][moving]
        if not common[0].size or not interval_s > 0:
            return
        first_m, last_m = (
            _ranges_m(boxes.snapshot.corners[rows], antennas, self._units)
            for rows, (boxes, antennas) in zip(common, (before, after), strict=True)
        )
        rates_mps = np.abs(last_m - first_m).max(axis=1) / interval_s
        for row, rate_mps in zip(common[0].tolist(), rates_mps.tolist(), strict=True):
            label = before[0].snapshot.label(row)
            self.by_object[label] = max(rate_mps, self.by_object.get(label, 0.0))
