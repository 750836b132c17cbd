# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of the live preview as rectangles of one colour each. Does not import bpy.

Blender's own window draws such rectangles all the time. What draws images, or lines with smooth
edges, is compiled when it is used first, which takes 30 to 80 ms of the window's thread.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...array_types import Int32, Real, Single
from .live_picture import SPAN_DB, Box, LivePicture, level_colours
from .smooth_lines import FINE, draw_curve

BACK = (0.07, 0.07, 0.07, 0.86)
_GRID, _CURVE, _PEAK = (1.0, 1.0, 1.0, 0.13), (0.34, 0.71, 0.91, 1.0), (0.90, 0.62, 0.0, 1.0)
#: Widths of the curve and of the ring, and the ring's radius, at scale 1 [px].
_CURVE_PX, _RING_PX, _RADIUS_PX = 1.6, 1.4, 4.0
#: Steps of what a line covers of a pixel.
_COVERS = 16
#: Rows of the strip of colours.
_STRIP_ROWS = 60


class Quads(NamedTuple):
    """Rectangles: corners (4 n, 2) [px], their colours (4 n, 4), corners of triangles (2 n, 3)."""

    corners: Single
    colours: Single
    triangles: Int32


def picture_quads(picture: LivePicture, scale: float) -> Quads:
    """Return all of a picture but its texts, what is in front last."""
    strip = level_colours(10 ** (np.linspace(-SPAN_DB, 0, _STRIP_ROWS) / 10)[:, None], 0.0)
    parts = [
        filled(picture.panel, BACK),
        pixels(strip, picture.strip),
        _lines(picture.grid, _GRID, scale),
        _lines(picture.noise, _PEAK, 1.2 * scale),
    ]
    if picture.colours is not None:
        parts.append(pixels(picture.colours, picture.map))
    if len(picture.curve):
        parts.append(_curve(picture.curve, picture.profile, scale))
    if picture.mark is not None:
        parts.append(_ring(picture.mark, scale))
    return _joined(parts)


def filled(box: Box, colour: tuple[float, ...]) -> Quads:
    """Return a rectangle."""
    return pixels(np.array([[colour]], dtype=np.float32), box)


def pixels(colours: Single, box: Box) -> Quads:
    """Return an image (rows, columns, 4), bottom row first: equal neighbours in a row are one.

    What is transparent is left out.
    """
    rows, columns = colours.shape[:2]
    edges = np.ones((rows, columns + 1), dtype=np.bool_)
    edges[:, 1:-1] = (colours[:, 1:] != colours[:, :-1]).any(axis=-1)
    row, first = np.nonzero(edges[:, :-1])
    last = np.nonzero(edges[:, 1:])[1] + 1
    seen = colours[row, first, 3] > 0
    row, first, last = row[seen], first[seen], last[seen]
    wide, high = (box.right - box.left) / columns, (box.top - box.bottom) / rows
    left, right = box.left + wide * first, box.left + wide * last
    low, top = box.bottom + high * row, box.bottom + high * (row + 1)
    corners = np.stack([left, low, right, low, right, top, left, top], axis=1)
    return _quads(corners, colours[row, first])


def _quads(corners: Real, colours: NDArray[np.floating]) -> Quads:
    """Rectangles of their corners (n, 8) and colours (n, 4)."""
    triangles = 4 * np.arange(len(corners))[:, None] + [0, 1, 2, 0, 2, 3]
    return Quads(
        corners.reshape(-1, 2).astype(np.float32),
        np.repeat(colours, 4, axis=0).astype(np.float32),
        triangles.reshape(-1, 3).astype(np.int32),
    )


def _joined(parts: Iterable[Quads]) -> Quads:
    """All rectangles in their order."""
    corners, colours, triangles = zip(*parts, strict=True)
    starts = np.cumsum([0, *(len(one) for one in corners[:-1])])
    shifted = [one + start for one, start in zip(triangles, starts, strict=True)]
    return Quads(
        np.concatenate(corners),
        np.concatenate(colours),
        np.concatenate(shifted).astype(np.int32),
    )


def _lines(ends: Real, colour: tuple[float, ...], width_px: float) -> Quads:
    """Lines along the axes between pairs of ends, (2 n, 2)."""
    first, last = ends[0::2], ends[1::2]
    along = (last != first) * 1.0
    aside = along[:, ::-1] * width_px / 2
    low, top = np.minimum(first, last) - aside, np.maximum(first, last) + aside
    corners = np.stack(
        [low[:, 0], low[:, 1], top[:, 0], low[:, 1], top[:, 0], top[:, 1], low[:, 0], top[:, 1]],
        axis=1,
    )
    return _quads(corners, np.tile(colour, (len(corners), 1)))


def _curve(points: Real, box: Box, scale: float) -> Quads:
    """A curve with smooth edges."""
    columns, rows = round(box.right - box.left), round(box.top - box.bottom)
    cover = np.zeros((rows, columns, 1), dtype=np.float32)
    at = box.left + (np.arange(columns * FINE) + 0.5) / FINE
    draw_curve(cover, box.top - np.interp(at, *points.T), (1.0,), _CURVE_PX * scale)
    return pixels(_covered(cover[::-1, :, 0], _CURVE), box)


def _ring(centre: tuple[float, float], scale: float) -> Quads:
    """A ring with smooth edges."""
    half = int(np.ceil((_RADIUS_PX + _RING_PX) * scale))
    left, low = round(centre[0]) - half, round(centre[1]) - half
    box = Box(left, low, left + 2 * half, low + 2 * half)
    middles = np.arange(2 * half) + 0.5
    away = np.hypot(left + middles - centre[0], (low + middles - centre[1])[:, None])
    cover = np.clip((_RING_PX * scale + 1) / 2 - np.abs(away - _RADIUS_PX * scale), 0, 1)
    return pixels(_covered(cover, _PEAK), box)


def _covered(cover: NDArray[np.floating], colour: tuple[float, ...]) -> Single:
    """A colour where a line covers pixels, (rows, columns, 4)."""
    found = np.empty((*cover.shape, 4), dtype=np.float32)
    found[..., :3], found[..., 3] = colour[:3], np.round(cover * _COVERS) / _COVERS
    return found
