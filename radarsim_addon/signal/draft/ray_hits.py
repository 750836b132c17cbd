# SPDX-License-Identifier: GPL-3.0-or-later
"""The first triangle that each ray of a perspective view meets, by projection.

All rays begin at one point. A triangle with corners a, b, c is met by the direction d where
d . (b x c), d . (c x a) and d . (a x b) have one sign; these three are proportional to the weights
of the corners, and no triangle needs to be cut at the plane of the view. Only pixels within the
projected box of a triangle are tried. Nothing is built in advance, so a scene that moves or deforms
costs no more than one that does not.

View axes are Blender's: x to the right, y up, looking along -z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...array_types import Indices, Mask, Real
from ...vectors import crosses, dots

#: Triangles, and pairs of triangle and pixel, that are tried at once: a few megabytes.
_TRIANGLES, _PAIRS = 1 << 15, 1 << 17


@dataclass(frozen=True)
class ViewGrid:
    """Pixels of a perspective view.

    Attributes
    ----------
    left, right, bottom, top
        Edges at distance 1.
    columns, rows
        Number of pixels across and up; row 0 is the top one.
    """

    left: float
    right: float
    bottom: float
    top: float
    columns: int
    rows: int

    def places(self, column: Indices, row: Indices) -> tuple[Real, Real]:
        """Return x and y of the centres of pixels at distance 1, (n,) each."""
        across = (self.right - self.left) / self.columns
        down = (self.top - self.bottom) / self.rows
        x, y = self.left + (column + 0.5) * across, self.top - (row + 0.5) * down
        return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)


@dataclass(frozen=True)
class FirstHits:
    """The first triangle along n rays that meet one.

    Attributes
    ----------
    pixel
        row * columns + column, ascending, (n,).
    triangle
        Number of the triangle, (n,).
    weights
        Of its corners, adding up to 1, (n, 3).
    distance
        Along -z of the view, (n,).
    """

    pixel: Indices
    triangle: Indices
    weights: Real
    distance: Real


def first_hits(points: Real, triangles: Indices, grid: ViewGrid) -> FirstHits:
    """Return the first triangle along each ray, seen from either side.

    Parameters
    ----------
    points
        Corners in view axes, (points, 3).
    triangles
        Numbers of corners, (triangles, 3).
    grid
        Pixels, one ray each through its centre.

    Returns
    -------
    FirstHits
    """
    pixels = grid.columns * grid.rows
    nearest = np.full(pixels, np.inf)
    triangle = np.full(pixels, -1, dtype=np.intp)
    weights = np.zeros((pixels, 3))
    ahead = -points[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        projected = points[:, 0] / ahead, points[:, 1] / ahead
    for start in range(0, len(triangles), _TRIANGLES):
        part = triangles[start : start + _TRIANGLES]
        boxes = _boxes(part, ahead, projected, grid)
        kept = np.flatnonzero((boxes[1] > 0) & (boxes[3] > 0))
        boxes = boxes[:, kept]
        counts = boxes[1] * boxes[3]
        ends = np.cumsum(counts)
        first = 0
        while first < kept.size:
            before = ends[first] - counts[first]
            last = max(int(np.searchsorted(ends, before + _PAIRS, side="right")), first + 1)
            some = kept[first:last]
            corners = points[part[some]]
            pixel, number, weight, distance = _tried(corners, boxes[:, first:last], grid)
            np.minimum.at(nearest, pixel, distance)
            won = nearest[pixel] == distance
            triangle[pixel[won]] = start + some[number[won]]
            weights[pixel[won]] = weight[won]
            first = last
    seen = np.flatnonzero(triangle >= 0)
    return FirstHits(seen, triangle[seen], weights[seen], nearest[seen])


def _boxes(
    triangles: Indices, ahead: Real, projected: tuple[Real, Real], grid: ViewGrid
) -> Indices:
    """First column, columns, first row and rows of the pixels that triangles may cover, (4, n)."""
    distance = [ahead[triangles[:, corner]] for corner in range(3)]
    in_front = np.minimum(np.minimum(distance[0], distance[1]), distance[2]) > 0
    behind = np.maximum(np.maximum(distance[0], distance[1]), distance[2]) <= 0
    found = np.empty((4, len(triangles)), dtype=np.intp)
    limits = (
        (projected[0], grid.left, (grid.right - grid.left) / grid.columns, grid.columns),
        (projected[1], grid.top, (grid.bottom - grid.top) / grid.rows, grid.rows),
    )
    for axis, (place, origin, step, count) in enumerate(limits):
        with np.errstate(invalid="ignore"):
            at = (place - origin) / step - 0.5
            ends = [at[triangles[:, corner]] for corner in range(3)]
            low = np.minimum(np.minimum(ends[0], ends[1]), ends[2])
            high = np.maximum(np.maximum(ends[0], ends[1]), ends[2])
        # one that reaches behind the view may cover any pixel
        low = np.where(in_front, np.clip(np.ceil(low), 0, count), 0)
        high = np.where(in_front, np.clip(np.floor(high), -1, count - 1), count - 1)
        found[2 * axis] = low
        found[2 * axis + 1] = np.where(behind, 0, np.maximum(high - low + 1, 0))
    return found


def _tried(corners: Real, boxes: Indices, grid: ViewGrid) -> tuple[Indices, Indices, Real, Real]:
    """Pixels of triangles (n, 3, 3), their triangles' numbers, weights and distances."""
    columns = boxes[1]
    counts = columns * boxes[3]
    number = np.repeat(np.arange(counts.size), counts)
    place = np.arange(number.size) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = np.divmod(place, columns[number])
    row, column = row + boxes[2][number], column + boxes[0][number]
    x, y = grid.places(column, row)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normals = [crosses(b, c), crosses(c, a), crosses(a, b)]
    volume = dots(a, normals[0])
    side = np.sign(volume)
    parts = []
    inside: Mask = side[number] != 0
    for normal in normals:
        p, q, r = (normal * side[:, None])[number].T
        parts.append(p * x + q * y - r)
        inside &= parts[-1] >= 0
    total = parts[0] + parts[1] + parts[2]
    inside &= total > 0
    number, total = number[inside], total[inside]
    weights = np.stack([part[inside] / total for part in parts], axis=1)
    pixel = (row * grid.columns + column)[inside]
    return pixel, number, weights, np.abs(volume)[number] / total
