# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves with smooth edges, and pictures in another size, by numpy. Does not import bpy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...array_types import Real, Single

#: Places per column at which a curve's coverage of the column's pixels is computed.
FINE = 8


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
    for axis, size in ((0, height), (1, width)):
        if size != picture.shape[axis]:
            picture = _resized_axis(picture, size, axis)
    return picture


def _resized_axis(picture: Single, size: int, axis: int) -> Single:
    """Mean over each new pixel, or linear between two old ones if the picture grows."""
    count = picture.shape[axis]
    step = count / size
    if step > 1:
        low = np.arange(size) * step
        first, parts = low.astype(np.intp), int(step) + 2
    else:
        low = np.clip((np.arange(size) + 0.5) * step - 0.5, 0, count - 1)
        first, parts = low.astype(np.intp), 2
    found = np.zeros(np.insert(np.delete(picture.shape, axis), axis, size), dtype=np.float32)
    for part in range(parts):
        old = first + part
        if step > 1:  # overlap of the new pixel with this old one
            weight = np.clip(np.minimum(old + 1, low + step) - np.maximum(old, low), 0, 1) / step
        else:
            weight = 1 - np.abs(old - low)
        shape = [-1 if one == axis else 1 for one in range(3)]
        values = picture.take(np.minimum(old, count - 1), axis)
        found += values * weight.astype(np.float32).reshape(shape)
    return found
