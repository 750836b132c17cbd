# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of meshes whose polygons have three or four corners, as Blender cuts them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...array_types import Indices, Int32, Mask, Single
from ...vectors import crosses, dots
from .scene import DraftMesh


@dataclass(frozen=True)
class DraftPolygons:
    """A mesh in its own axes, Blender units, as Blender stores it: quick to read.

    Attributes
    ----------
    points
        Vertices, (v, 3).
    corners
        Vertex of each corner, polygon after polygon, (c,).
    starts
        First corner of each polygon, (p,), which has three or four of them.
    slots
        Material slot of each polygon, (p,); empty: the first one for all.
    normals
        Shading normals of the corners, (c, 3); empty where the mesh is flat.
    """

    points: Single
    corners: Int32
    starts: Int32
    slots: Int32
    normals: Single

    def triangulated(self) -> DraftMesh:
        """Return the mesh as triangles; quads are cut from their first corner to their third.

        One that has a corner inwards is cut from its second corner to its fourth.
        """
        starts = self.starts.astype(np.intp)
        sides = np.diff(np.append(starts, self.corners.size))
        quads = np.flatnonzero(sides == 4)
        places = starts[quads][:, None] + np.arange(4)
        places = np.where(self._bent(places)[:, None], np.roll(places, -1, axis=1), places)
        whole = np.flatnonzero(sides == 3)
        polygon = np.concatenate([whole, quads, quads])
        corner = np.concatenate(
            [starts[whole][:, None] + np.arange(3), places[:, [0, 1, 2]], places[:, [0, 2, 3]]]
        )
        slots = self.slots[polygon] if self.slots.size else np.zeros(polygon.size, dtype=np.int32)
        normals = self.normals[corner] if self.normals.size else np.zeros((0, 3, 3), np.float32)
        return DraftMesh(self.points, self.corners[corner], slots, normals)

    def _bent(self, places: Indices) -> Mask:
        """Whether a quad's second and fourth corner lie on one side of the line between others."""
        first, second, third, fourth = self.points[self.corners[places]].transpose(1, 0, 2)
        along = third - first
        return np.asarray(dots(crosses(second - first, along), crosses(fourth - first, along)) > 0)
