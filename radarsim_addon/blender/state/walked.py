# SPDX-License-Identifier: GPL-3.0-or-later
"""What one walk through all objects and instances has found. Does not import bpy."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...array_types import Indices, Real


@dataclass(frozen=True, eq=False)
class Walked:
    """What one walk has found; what follows from it is computed once.

    Attributes
    ----------
    shape
        Index of each one's shape, (n,).
    boxes
        Corners of the shapes' bounding boxes, (shapes, 8, 3).
    matrices
        World matrices, (n, 4, 4).
    """

    shape: Indices
    boxes: Real
    matrices: Real

    @cached_property
    def corners(self) -> Real:
        """Corners of the bounding boxes in world space, shape (n, 8, 3)."""
        return box_corners(self.boxes[self.shape], self.matrices)

    @cached_property
    def spheres(self) -> Real:
        """Centres of the boxes in world space, and distances of their corners, (n, 4)."""
        return box_spheres(self.corners)

    @cached_property
    def largest(self) -> Real:
        """Largest size of a number in each matrix, (n,); NaN where one is NaN."""
        return np.asarray(np.abs(self.matrices).max(axis=(1, 2), initial=0.0))


def box_corners(boxes: Real, matrices: Real) -> Real:
    """Return the corners of boxes (n, 8, 3) of these matrices (n, 4, 4) in world space."""
    return np.asarray(boxes @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3])


def box_spheres(corners: Real) -> Real:
    """Return the centres of boxes, of which these are the corners, and the radii, (n, 4)."""
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1, initial=0.0)
    return np.column_stack([centre, radius])
