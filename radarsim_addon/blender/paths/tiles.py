# SPDX-License-Identifier: GPL-3.0-or-later
"""The field of view as a partition: tiles, and tiles of finer pixels that replace parts of them.

Every pixel of every tile is either the tile's own or belongs to finer tiles that cover it exactly,
so the view has no gap and no overlap whatever was refined. Does not import bpy.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...array_types import Mask
from ..views import ViewWindow

#: Pixels up to which a tile is not worth cutting.
_WHOLE_UP_TO_PX = 1 << 13
#: How far, in pixels, an area may reach over a pixel's edge without taking the next one: rounding.
_EDGE = 1e-6


@dataclass(frozen=True)
class Area:
    """A rectangle in the view, by its edges; stretch is as in `ViewWindow`."""

    left: float
    right: float
    bottom: float
    top: float
    stretch: float = 1.0

    @property
    def shorter(self) -> float:
        """Its shorter side, true length."""
        return min((self.right - self.left) * self.stretch, self.top - self.bottom)


@dataclass(frozen=True)
class Tile:
    """A window with pixels of one size.

    level is how often the frame's pixels were halved (rounded up); own says which of its pixels
    are the tile's, (height, width), None for all of them: finer tiles stand for the others.
    """

    window: ViewWindow
    level: int = 0
    own: Mask | None = None

    def own_pixels(self) -> int:
        """Number of its own pixels."""
        if self.own is None:
            return self.window.width_px * self.window.height_px
        return int(np.count_nonzero(self.own))

    def finer(
        self, left: int, right: int, top: int, bottom: int, across: int, down: int | None = None
    ) -> Tile:
        """Return columns left to right and rows top to bottom (exclusive) with finer pixels.

        Each pixel is cut `across` times, and `down` times if that is another number.
        """
        down = across if down is None else down
        part = _part_of(self.window, left, right, top, bottom)
        window = dataclasses.replace(
            part, width_px=part.width_px * across, height_px=part.height_px * down
        )
        own = None
        if self.own is not None:
            chosen = self.own[top:bottom, left:right]
            if not chosen.all():
                own = chosen.repeat(down, axis=0).repeat(across, axis=1)
        return Tile(window, self.level + math.ceil(math.log2(max(across, down))), own)

    def split(self, most_px: int) -> list[Tile]:
        """Return tiles of at most `most_px` pixels a side, alike in size, that cover this one.

        Those without pixels of their own are left out.
        """
        rows, cols = (
            _even_edges(n, most_px) for n in (self.window.height_px, self.window.width_px)
        )
        parts = [
            self.finer(left, right, top, bottom, 1)
            for top, bottom in itertools.pairwise(rows)
            for left, right in itertools.pairwise(cols)
        ]
        return [part for part in parts if part.own_pixels()]

    def halved(self) -> list[Tile]:
        """Return tiles with pixels of half the pitch that cover this one.

        They are four, less those without pixels of their own; one where that is still small,
        because a render costs some milliseconds whatever its size.
        """
        w, h = self.window.width_px, self.window.height_px
        double = self.finer(0, w, 0, h, 2)
        if 4 * w * h <= _WHOLE_UP_TO_PX:
            return [double]
        parts = [double.finer(left, left + w, top, top + h, 1) for top in (0, h) for left in (0, w)]
        return [part for part in parts if part.own_pixels()]


def _part_of(frame: ViewWindow, left: int, right: int, top: int, bottom: int) -> ViewWindow:
    """Columns left to right and rows top to bottom (exclusive) of a view, same pixels."""
    du, dv = frame.step_u, frame.step_v
    # Edges that are the frame's are so to the bit.
    return ViewWindow(
        frame.left + left * du,
        frame.right if right == frame.width_px else frame.left + right * du,
        frame.bottom if bottom == frame.height_px else frame.top - bottom * dv,
        frame.top - top * dv,
        right - left,
        bottom - top,
        frame.sphere,
    )


def lay_in(
    tiles: Sequence[Tile], area: Area, pitch: float, most_px: int, finest: float, most_level: int
) -> list[Tile]:
    """Put finer tiles over an area: what lies in it is taken from the tiles there, by whole pixels.

    `pitch` is the largest true pixel pitch wanted there (near a pole it takes fewer cuts of
    longitude than of latitude), `finest` the least; tiles that are as fine stay. The new tiles, of
    at most `most_px` a side and `most_level` halvings, are the last of the partition.
    """
    kept, laid = [], []
    for tile in tiles:
        window = tile.window
        du, dv = window.step_u, window.step_v
        across, down = (
            min(
                math.ceil(step / pitch * (1 - 1e-9)),
                max(math.floor(step / finest * (1 + 1e-9)), 1),
                1 << max(most_level - tile.level, 0),
            )
            for step in (du * area.stretch, dv)
        )
        left = max(math.floor((area.left - window.left) / du + _EDGE), 0)
        right = min(math.ceil((area.right - window.left) / du - _EDGE), window.width_px)
        top = max(math.floor((window.top - area.top) / dv + _EDGE), 0)
        bottom = min(math.ceil((window.top - area.bottom) / dv - _EDGE), window.height_px)
        if max(across, down) < 2 or left >= right or top >= bottom:
            kept.append(tile)
            continue
        laid += tile.finer(left, right, top, bottom, across, down).split(most_px)
        shape = (window.height_px, window.width_px)
        own = np.ones(shape, dtype=bool) if tile.own is None else tile.own.copy()
        own[top:bottom, left:right] = False
        rest = Tile(window, tile.level, own)
        if rest.own_pixels():
            kept.append(rest)
    return kept + laid


def _even_edges(count: int, most: int) -> list[int]:
    """Edges of the fewest pieces of at most `most`, alike in size: slivers cost a render each."""
    pieces = -(-count // most)
    return [count * piece // pieces for piece in range(pieces + 1)]
