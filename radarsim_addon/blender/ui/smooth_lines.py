# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves with smooth edges, and pictures in another size, by numpy. Does not import bpy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...array_types import Indices, Real, Single

#: Places per column at which a curve's coverage of the column's pixels is computed.
FINE = 8
#: Rows of a picture that get another size at once: as many as the processor's cache holds.
_BLOCK_ROWS = 16


def draw_curve(area: Single, rows: Real, colour: Sequence[float], width_px: float = 2.5) -> None:
    """Blend a line into a picture; each pixel gets the fraction of it that the line covers.

    Parameters
    ----------
    area
        Picture that is changed, (height, width, 3).
    rows
        Distance of the line from the upper edge at `FINE` places per column, evenly spaced from
        left to right, (FINE * width,) [px].
    colour
        sRGB from 0 to 1.
    width_px
        Width of the line: of the disc that is drawn at each of its points [px].
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


def resized(picture: Single, width: int, height: int) -> Single:
    """Return a picture in another size: means over its pixels if smaller, else in between them."""
    old_height, old_width, channels = picture.shape
    if (height, width) == (old_height, old_width):
        return picture
    found = np.empty((height, width, channels), dtype=np.float32)
    down, across = _weights(old_height, height), _weights(old_width, width)
    for first in range(0, height, _BLOCK_ROWS):
        rows = slice(first, first + _BLOCK_ROWS)
        lines = _weighted(picture, [(old[rows], weight[rows]) for old, weight in down], 0)
        found[rows] = _weighted(lines, across, 1)
    return found


def _weights(count: int, size: int) -> list[tuple[Indices, Single]]:
    """Old pixels of each new one, and their weights: a mean, or linear if the picture grows."""
    step = count / size
    if step > 1:  # overlaps of the new pixel with the old ones
        low = np.arange(size) * step
        old = low.astype(np.intp) + np.arange(int(step) + 2)[:, None]
        weight = np.clip(np.minimum(old + 1, low + step) - np.maximum(old, low), 0, 1) / step
    else:
        low = np.clip((np.arange(size) + 0.5) * step - 0.5, 0, count - 1)
        old = low.astype(np.intp) + np.arange(2)[:, None]
        weight = 1 - np.abs(old - low)
    old, weight = np.minimum(old, count - 1), weight.astype(np.float32)
    return [(o, w) for o, w in zip(old, weight, strict=True) if w.any()]


def _weighted(picture: Single, weights: Sequence[tuple[Indices, Single]], axis: int) -> Single:
    """Weighted sum of a picture's rows or columns."""
    shape = (-1, 1) if axis else (-1, 1, 1)
    parts = (picture.take(old, axis) * weight.reshape(shape) for old, weight in weights)
    found = next(parts)
    for part in parts:
        found += part
    return found
