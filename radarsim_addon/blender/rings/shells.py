# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a perspective view in which surfaces at given ranges can be seen. Does not import bpy.

All points are in the receiver's axes, so that u = x / -z and v = y / -z.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ... import contract
from ...array_types import Indices, Mask, Real
from ..views import Region, ViewWindow

#: A surface in several rings is cut until its parts are this fraction of the view.
_VIEW_PART = 1 / 128
#: Cuts in halves after which a part stands for the whole view: it touches the receiver.
_MOST_CUTS = 20
#: Parts above which the whole view is rendered.
_MOST_PARTS = 1 << 21
#: Rounding of ranges in Cycles, relative to the largest coordinate, with a wide margin.
_ROUNDING = 1e-5
#: Pixels around a surface that are rendered too.
_MARGIN_PX = 2
#: Where each of four parts of a triangle has its corners: weights of the triangle's corners.
_QUARTERS = np.array(
    [
        [[2, 0, 0], [1, 1, 0], [1, 0, 1]],
        [[0, 2, 0], [0, 1, 1], [1, 1, 0]],
        [[0, 0, 2], [1, 0, 1], [0, 1, 1]],
        [[1, 1, 0], [0, 1, 1], [1, 0, 1]],
    ]
) / 2  # fmt: skip


class Shells:
    """Bounds of what a view shows in rings of ranges from the transmitter.

    Parameters
    ----------
    view
        Edges of the view, tangents, and its pixels.
    transmitter_m
        Its place, (3,) [m].
    edges_m
        Edges of the n rings, (n + 1,) [m].
    reach_m
        Largest coordinate in the scene, for rounding [m].
    """

    def __init__(
        self, view: ViewWindow, transmitter_m: Real, edges_m: Sequence[float], reach_m: float
    ) -> None:
        self._view, self._source = view, transmitter_m
        self._edges = np.asarray(edges_m, dtype=np.float64)
        self._slack = _ROUNDING * reach_m
        rings = len(self._edges) - 1
        #: Left, right, bottom, top of each ring; empty where left is above right.
        self._bounds = np.tile([np.inf, -np.inf, np.inf, -np.inf], (rings, 1))

    def take(self, parts: Real) -> Mask:
        """Take the convex hulls of some points, (m, p, 3) [m], where they need no cut.

        Returns which were not taken: they may be seen in a ring, and are large. (m,)
        """
        first, last = self._rings(parts)
        open_parts = (first <= last) & self._in_view(parts)
        depth = -parts[..., 2]
        front = open_parts & (depth.min(axis=1) > 0)
        u, v = (parts[front][..., axis] / depth[front] for axis in (0, 1))
        box = np.stack([u.min(axis=1), u.max(axis=1), v.min(axis=1), v.max(axis=1)], axis=1)
        view = self._view
        small = (box[:, 1] - box[:, 0] <= (view.right - view.left) * _VIEW_PART) & (
            box[:, 3] - box[:, 2] <= (view.top - view.bottom) * _VIEW_PART
        )
        first, last = first[front], last[front]
        fine = small | (first == last)
        self._add(first[fine], last[fine], box[fine])
        open_parts[np.flatnonzero(front)[fine]] = False
        return open_parts

    def take_triangles(self, triangles: Real) -> bool:
        """Take triangles, (m, 3, 3) [m], cut as often as they need it.

        Returns whether they could be; else the view holds too many.
        """
        for _ in range(_MOST_CUTS):
            triangles = triangles[self.take(triangles)]
            if not len(triangles):
                return True
            if len(triangles) > _MOST_PARTS:
                return False
            triangles = np.einsum("qij,mjk->mqik", _QUARTERS, triangles).reshape(-1, 3, 3)
        first, last = self._rings(triangles)
        view = self._view
        whole = (view.left, view.right, view.bottom, view.top)
        self._add(first, last, np.broadcast_to(whole, (len(first), 4)))
        return True

    def regions(self) -> list[Region]:
        """Return the pixels of each ring; one pixel where nothing can be seen."""
        return [self._region(bounds) for bounds in self._bounds.tolist()]

    def _region(self, bounds: list[float]) -> Region:
        view = self._view
        left, right, bottom, top = bounds
        left, right = ((u - view.left) / view.step_u for u in (left, right))
        top, bottom = ((view.top - v) / view.step_v for v in (top, bottom))
        ends = []
        for low, high, count in ((left, right, view.width_px), (top, bottom, view.height_px)):
            low, high = max(low - _MARGIN_PX, 0.0), min(high + _MARGIN_PX, float(count))
            if not low < high:
                return Region(0, 1, 0, 1)
            ends += [int(low), int(np.ceil(high))]
        return Region(*ends)

    def _rings(self, parts: Real) -> tuple[Indices, Indices]:
        """First and last ring that each part may reach into."""
        points = parts - self._source
        centre = points.mean(axis=1)
        radius = np.linalg.norm(points - centre[:, None], axis=2).max(axis=1)
        height = _heights(points)
        # a disc around the centre, or a ball where the points lie in no plane
        across = np.sqrt(np.maximum(np.einsum("ij,ij->i", centre, centre) - height**2, 0.0))
        nearest = np.hypot(height, np.maximum(across - radius, 0.0)) - self._slack
        farthest = np.linalg.norm(points, axis=2).max(axis=1) + self._slack
        rings = len(self._edges) - 1
        first = np.searchsorted(self._edges, nearest, side="right") - 1
        last = np.searchsorted(self._edges, farthest, side="right") - 1
        # wholly nearer or farther than all rings: none
        return np.maximum(first, 0), np.minimum(last, rings - 1)

    def _in_view(self, parts: Real) -> Mask:
        """Whether no side of the view, widened by the margin, has all of a part outside."""
        view, (x, y, z) = self._view, np.moveaxis(parts, 2, 0)
        du, dv = _MARGIN_PX * view.step_u, _MARGIN_PX * view.step_v
        sides = (
            -z,
            x + z * (view.left - du),
            -(x + z * (view.right + du)),
            y + z * (view.bottom - dv),
            -(y + z * (view.top + dv)),
        )
        seen = np.ones(len(parts), dtype=bool)
        for inside in sides:
            seen &= inside.max(axis=1) > 0
        return seen

    def _add(self, first: Indices, last: Indices, box: Real) -> None:
        """Widen the bounds of rings first to last by a box of each part, (m, 4)."""
        for step in range(int((last - first).max(initial=-1)) + 1):
            reached = first + step <= last
            ring = (first + step)[reached]
            for column, widen in enumerate((np.minimum, np.maximum) * 2):
                widen.at(self._bounds[:, column], ring, box[reached, column])


def _heights(points: Real) -> Real:
    """Distance of the planes of triangles from the origin, (m,); 0 for other parts, (m, p, 3)."""
    if points.shape[1] != 3:
        return np.zeros(len(points))
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    size = np.linalg.norm(normal, axis=1)
    height = np.abs(np.einsum("ij,ij->i", normal, points[:, 0]))
    return np.asarray(np.divide(height, size, out=np.zeros(len(points)), where=size > 0))


def axes_of(receiver: contract.ReceiverRecord) -> tuple[Real, Real]:
    """Return the place of a receiver, (3,) [m], and its axes as columns, (3, 3)."""
    pose = np.array(receiver.matrix_world, dtype=np.float64)
    return pose[:3, 3], pose[:3, :3]
