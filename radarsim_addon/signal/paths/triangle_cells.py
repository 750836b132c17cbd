# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles by the cells of a grid that their boxes touch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Real

#: Factors that spread cells over buckets (Teschner et al. 2003), and one for parts.
_SPREAD, _SPREAD_PARTS = (73856093, 19349663, 83492791), 2654435761


class CellLevel:
    """Triangles of about one extent, by the cells that their boxes touch.

    Cells share buckets by chance: who takes candidates from them compares boxes.
    """

    def __init__(
        self, cell: float, low: Real, high: Real, part: Indices, triangles: Indices
    ) -> None:
        self.cell = cell
        bits = max(int(triangles.size).bit_length() + 2, 6)
        self._mask = (1 << bits) - 1
        first, last = (np.floor(corner.T / cell).astype(np.int64) for corner in (low, high))
        further = last > first
        buckets, owners = [], []
        for corner in np.ndindex(2, 2, 2):
            touched = np.flatnonzero(further[np.flatnonzero(corner)].all(axis=0))
            cells = first.take(touched, axis=1) + np.array(corner)[:, None]
            buckets.append(self._bucket(cells, part[touched]))
            owners.append(triangles[touched])
        owner = np.concatenate(owners)
        bucket = np.concatenate(buckets)
        self._starts = np.append(0, np.cumsum(np.bincount(bucket, minlength=1 << bits)))
        self._triangles = owner[sorted_places(bucket, 1 << bits)]

    def _bucket(self, cells: NDArray[np.int64], part: Indices) -> NDArray[np.int64]:
        """Number of the bucket of each cell, from (3, n), of a part."""
        x, y, z = (one * factor for one, factor in zip(cells, _SPREAD, strict=True))
        return np.asarray((x ^ y ^ z ^ (part * _SPREAD_PARTS)) & self._mask)

    def candidates(self, points: Real, part: Indices) -> tuple[Indices, Indices]:
        """Pairs of points and of triangles in the buckets of their cells, ordered by point."""
        bucket = self._bucket(np.floor(points.T / self.cell).astype(np.int64), part)
        starts = self._starts.take(bucket)
        count = self._starts.take(bucket + 1) - starts
        total = np.cumsum(count)
        number = np.arange(total[-1] if total.size else 0)
        number += np.repeat(starts - total + count, count)
        return np.repeat(np.arange(len(points)), count), self._triangles.take(number)


def sorted_places(bucket: NDArray[np.int64], count: int) -> Indices:
    """Return the stable order of bucket numbers below `count`, at most 2**32."""
    # numpy sorts 16 bits by counting, many times faster than more of them
    order = np.argsort(bucket.astype(np.uint16), kind="stable")
    if count > 1 << 16:
        order = order[np.argsort((bucket >> 16).astype(np.uint16)[order], kind="stable")]
    return np.asarray(order)
