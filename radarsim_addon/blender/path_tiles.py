# SPDX-License-Identifier: GPL-3.0-or-later
"""Where to spend rays: the field of view split into tiles, the uncertain ones into finer ones.

Each tile is measured with several sub-pixel shifts of its grid; they are replicates, so their
scatter is the tile's own error. What counts is the *relative* error of each range bin and of each
object's power: a faint far target matters as much as strong near ground. No bpy.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..signal.pathtable import FLAG_NO_CODE, PathRows
from .path_scene import ViewWindow

Real = NDArray[np.float64]

#: Variance of the number of grid points in a convex shape of n of them on average, over sqrt(n): a
#: randomly shifted grid misses or gains points along the edge alone, whose length goes as sqrt(n)
#: (Kendall 1948: 0.0728 of the perimeter in grid steps, 4 sqrt(n) for a square).
_EDGE_VARIANCE = 0.29
#: Cells this far below the strongest one do not drive refinement [power ratio].
FAINTEST = 1e-8
#: Steps of the additive recurrence (Roberts' R2 sequence): 1/g and 1/g^2, g^3 = g + 1.
_R2 = (0.7548776662466927, 0.5698402909980532)


def shift_px(index: int) -> tuple[float, float]:
    """Sub-pixel shift number `index`, each between -1/2 and 1/2 of a pixel: a low-discrepancy
    sequence that starts off the pixel centre (a ray exactly on the shared edge of two triangles
    counts both)."""
    u = (0.5 + _R2[0] * (index + 1)) % 1.0 - 0.5
    v = (0.5 + _R2[1] * (index + 1)) % 1.0 - 0.5
    return u, v


def view_seed(seed: int, window: ViewWindow, shift: int) -> int:
    """Cycles' seed for one view: by where it looks and by its shift, not by the tiles' order."""
    edges = (window.left, window.right, window.bottom, window.top)
    key = struct.pack("<qq4d", seed, shift, *edges)
    return int.from_bytes(hashlib.blake2b(key, digest_size=4).digest(), "little") >> 1


def split_frame(frame: ViewWindow, most_px: int) -> list[ViewWindow]:
    """The frame in tiles of at most `most_px` pixels a side, without gap or overlap."""
    rows, cols = (_even_edges(n, most_px) for n in (frame.height_px, frame.width_px))
    return [
        part_of(frame, left, right, top, bottom)
        for top, bottom in itertools.pairwise(rows)
        for left, right in itertools.pairwise(cols)
    ]


def _even_edges(count: int, most: int) -> list[int]:
    """Edges of the fewest pieces of at most `most`, alike in size: slivers cost a render each."""
    pieces = -(-count // most)
    return [count * piece // pieces for piece in range(pieces + 1)]


def part_of(frame: ViewWindow, left: int, right: int, top: int, bottom: int) -> ViewWindow:
    """Columns left to right and rows top to bottom (exclusive) of a view, same pixels."""
    du = (frame.right - frame.left) / frame.width_px
    dv = (frame.top - frame.bottom) / frame.height_px
    return ViewWindow(
        frame.left + left * du,
        frame.left + right * du,
        frame.top - bottom * dv,
        frame.top - top * dv,
        right - left,
        bottom - top,
    )


def quarters(tile: ViewWindow) -> list[ViewWindow]:
    """Four tiles that cover the tile with pixels of half the pitch."""
    double = ViewWindow(
        tile.left, tile.right, tile.bottom, tile.top, 2 * tile.width_px, 2 * tile.height_px
    )
    w, h = tile.width_px, tile.height_px
    return [part_of(double, left, left + w, top, top + h) for top in (0, h) for left in (0, w)]


@dataclass
class CellPowers:
    """Powers of one tile by cell (range bins, then objects): mean over the shifts and its variance.

    `cells` are the numbers of those that hold power; `variance` is of the mean.
    """

    cells: NDArray[np.int64]
    mean: Real
    variance: Real


@dataclass
class CellGrid:
    """Numbers cells: range bins first, then objects."""

    bin_m: float
    bins: int

    @property
    def first_object(self) -> int:
        """Number of object 0, the unknown one; the cell before it is all beyond the bins."""
        return self.bins + 1

    def powers(self, shifts: Sequence[PathRows]) -> CellPowers:
        """Cell powers of one tile from its shifts (each row's power is already its share)."""
        count = len(shifts)
        size = self.first_object
        objects = max((int(rows["object"].max(initial=0)) for rows in shifts), default=0)
        total = np.zeros((count, size + objects + 1))
        for number, rows in enumerate(shifts):
            known = rows["flags"] & FLAG_NO_CODE == 0
            place = np.clip(rows["length_m"] / 2 / self.bin_m, 0, self.bins).astype(np.int64)
            power = rows["power_w"] * count
            total[number, :size] = np.bincount(place[known], power[known], minlength=size)
            total[number, size:] = np.bincount(rows["object"], power, minlength=objects + 1)
        mean = total.mean(axis=0)
        cells = np.flatnonzero(mean)
        if count > 1:
            variance = total[:, cells].var(axis=0, ddof=1) / count
        else:
            variance = mean[cells] ** 2
        known_object = cells > size
        hits = np.zeros(objects + 1)
        for rows in shifts:
            hits += np.bincount(rows["object"], minlength=objects + 1) / count
        hits = hits[cells[known_object] - size]
        # A few shifts may happen to agree on an object of a few pixels.
        least = (mean[cells[known_object]] / hits) ** 2 * _EDGE_VARIANCE * np.sqrt(hits) / count
        variance[known_object] = np.maximum(variance[known_object], least)
        return CellPowers(cells, mean[cells], variance)


@dataclass
class ErrorBudget:
    """Sums the cells of all tiles, and says which tiles the error comes from.

    first_object is the number of the first cell that is an object; None where all are range bins.
    by says which of them count: "both", "ranges" or "objects".
    """

    first_object: int | None = None
    by: str = "both"
    powers: dict[int, CellPowers] = field(default_factory=dict)

    def totals(self) -> tuple[Real, Real]:
        """Mean and variance of every cell over all tiles."""
        size = 1 + max((int(p.cells.max(initial=0)) for p in self.powers.values()), default=0)
        mean, variance = np.zeros(size), np.zeros(size)
        for part in self.powers.values():
            mean[part.cells] += part.mean
            variance[part.cells] += part.variance
        return mean, variance

    def relative_error(self) -> float:
        """Relative standard error of the cells: half of it from range bins, half from objects.

        Range bins weigh by the root of their power: between all alike (noise in empty ranges
        would rule) and by power (only the strongest would count). All objects weigh the same, so
        that a small target counts as much as the ground it stands on.
        """
        mean, variance = self.totals()
        return math.sqrt(float(np.sum(variance * self._weights(mean))))

    def _weights(self, mean: Real) -> Real:
        """Weight of each cell's variance in the squared relative error."""
        number = np.arange(mean.size)
        first = mean.size if self.first_object is None else self.first_object
        strong = mean > FAINTEST * mean.max(initial=0.0)
        # The first object is the unknown one.
        bins, objects = strong & (number < first), strong & (number > first)
        weight = np.zeros_like(mean)
        counted = {"ranges": (bins,), "objects": (objects,)}.get(self.by, (bins, objects))
        groups = [group for group in counted if group.any()]
        for group in groups:
            importance = np.sqrt(mean[group]) if group is bins else np.ones(int(group.sum()))
            weight[group] = importance / importance.sum() / mean[group] ** 2 / len(groups)
        return weight

    def worst(self, tiles: Iterable[int], share: float) -> list[int]:
        """Tiles that carry `share` of the squared error, worst first."""
        weight = self._weights(self.totals()[0])
        score = {
            tile: float(np.sum(self.powers[tile].variance * weight[self.powers[tile].cells]))
            for tile in tiles
            if tile in self.powers
        }
        total = sum(score.values())
        chosen, carried = [], 0.0
        for tile in sorted(score, key=lambda t: (-score[t], t)):
            if carried >= share * total or score[tile] <= 0:
                break
            chosen.append(tile)
            carried += score[tile]
        return chosen
