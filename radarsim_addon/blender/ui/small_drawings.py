# SPDX-License-Identifier: GPL-3.0-or-later
"""Small drawings by numpy in Blender's own panels and views: curves, colours, ticks, letters.

Does not import bpy. Pictures of results are matplotlib's, see `picture_images`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Real, Single

#: Places per column at which a curve's coverage of the column's pixels is computed.
FINE = 8
_Values = TypeVar("_Values", np.float64, np.uint16)


def draw_curve(area: Single, rows: Real, colour: Sequence[float], width_px: float = 2.5) -> None:
    """Blend a line into a picture (height, width, 3) by the fraction of each pixel that it covers.

    rows: distance of the line from the upper edge at `FINE` places per column, from left to right,
    (FINE * width,) [px]. The line is a disc of `width_px` at each of its points.
    """
    height, width = area.shape[:2]
    radius = width_px / 2
    # At each place from the highest to the lowest point of the discs around: without gaps, however
    # steep the curve is.
    top, bottom = rows - radius, rows + radius
    for step in range(1, int(radius * FINE) + 1):
        reach = float(np.sqrt(radius**2 - (step / FINE) ** 2))
        for to, of in ((np.s_[step:], np.s_[:-step]), (np.s_[:-step], np.s_[step:])):
            top[to] = np.minimum(top[to], rows[of] - reach)
            bottom[to] = np.maximum(bottom[to], rows[of] + reach)
    first, last = max(int(top.min()), 0), min(int(bottom.max()) + 1, height)
    edges = np.arange(first, last, dtype=np.float32)[:, None]
    cover = np.zeros((last - first, width), dtype=np.float32)
    for at in range(FINE):
        over = np.minimum(bottom[at::FINE].astype(np.float32), edges + 1)
        over -= np.maximum(top[at::FINE].astype(np.float32), edges)
        cover += np.clip(over, 0.0, 1.0, out=over)
    part = area[first:last]
    part += (cover / FINE)[..., None] * (np.asarray(colour, dtype=np.float32) - part)


@functools.cache
def _atlas() -> dict[str, NDArray[np.float32]]:
    """Coverage of each character, (height, width), from 0 to 1; viridis, (256, 3), as "viridis"."""
    with np.load(Path(__file__).with_name("font_atlas.npz"), allow_pickle=False) as data:
        letters = {
            chr(code): glyph[:, :advance].astype(np.float32) / 255
            for code, advance, glyph in zip(
                data["codes"], data["advances"], data["glyphs"], strict=True
            )
        }
        return letters | {"viridis": data["viridis"].astype(np.float32) / 255}


def viridis() -> Single:
    """Return the colour table, from low to high, (256, 3), from 0 to 1."""
    return _atlas()["viridis"]


def text_mask(text: str) -> NDArray[np.float32]:
    """Return the coverage of a line of text, shape (height, width); '?' for unknown characters."""
    atlas = _atlas()
    parts = [atlas.get(letter, atlas["?"]) for letter in text]
    if not parts:
        return np.zeros((atlas["?"].shape[0], 0), dtype=np.float32)
    return np.concatenate(parts, axis=1)


def nice_ticks(low: float, high: float, about: int) -> list[float]:
    """Return about so many multiples of 1, 2 or 5 times a power of ten between two limits, both
    included.
    """
    if not high > low:
        return [low]
    raw = (high - low) / max(about, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= raw * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [index * step for index in range(first, last + 1)]


def resample_max(values: NDArray[_Values], size: int, axis: int) -> NDArray[_Values]:
    """Resample an axis to `size` values; each is the maximum of its range, so peaks remain."""
    count = values.shape[axis]
    if count <= size:
        return np.asarray(values.take(np.arange(size) * count // size, axis))
    starts = np.arange(size) * count // size
    return np.asarray(np.maximum.reduceat(values, starts, axis=axis))


def cell_edges(axis: Real) -> tuple[float, float]:
    """Return the outer edges of evenly spaced cells with these centres."""
    half = 0.5 * abs(float(axis[-1] - axis[0])) / max(axis.size - 1, 1) or 0.5
    return float(axis.min()) - half, float(axis.max()) + half
