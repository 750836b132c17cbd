# SPDX-License-Identifier: GPL-3.0-or-later
"""Plot of sigma0 against grazing angle for a panel, drawn by numpy. Does not import bpy."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...array_types import Mask, Real, Single
from .pictures import nice_ticks, text_mask
from .smooth_lines import FINE, draw_curve

#: Size of the picture and its margins [px]: an icon is as wide as it is high.
SIDE = 320
LEFT, RIGHT, TOP, BOTTOM = 48, 14, 12, 30
#: Grazing angles at the ends of its axis, which is logarithmic [degrees].
LEAST_DEG, MOST_DEG = 0.1, 90.0
#: Most decibels from the top to the bottom.
_SPAN_DB = 100.0
_BACK, _VALID, _GRID, _INK = 0.13, 0.24, 0.36, 0.88
#: Colours of the curves, HH and VV.
COLOURS = (0.38, 0.66, 1.0), (1.0, 0.62, 0.22)


def plot_angles_rad() -> Real:
    """Return the grazing angles of the columns of the plot, (columns,) [rad]."""
    return np.radians(np.geomspace(LEAST_DEG, MOST_DEG, SIDE - LEFT - RIGHT))


def draw_sigma0(levels_db: Real, valid: Mask) -> Single:
    """Draw sigma0 of HH and VV at `plot_angles_rad`.

    Parameters
    ----------
    levels_db
        (2, columns) [dB].
    valid
        Columns at which the model holds: the rest stays dark, (columns,).

    Returns
    -------
    ndarray
        RGBA from 0 to 1, (SIDE, SIDE, 4), top row first.
    """
    canvas = np.full((SIDE, SIDE, 4), _BACK, dtype=np.float32)
    canvas[..., 3] = 1.0
    area = canvas[TOP : SIDE - BOTTOM, LEFT : SIDE - RIGHT, :3]
    rows, columns = area.shape[:2]
    area[:, valid] = _VALID
    top_db = 10.0 * math.ceil(float(levels_db.max()) / 10)
    least_db = max(float(levels_db.min()), top_db - _SPAN_DB)
    bottom_db = min(10.0 * math.floor(least_db / 10), top_db - 10)

    def row(level_db: Real) -> Real:
        clipped = np.clip(level_db, bottom_db, top_db)
        return np.asarray((top_db - clipped) / (top_db - bottom_db) * (rows - 1))

    for level_db in nice_ticks(bottom_db, top_db, 5):
        place = round(float(row(np.array(level_db))))
        area[place] = _GRID
        mask = text_mask(f"{level_db:g}".replace("-", "\u2212"))
        _put(canvas, mask, LEFT - 6 - mask.shape[1], TOP + place - mask.shape[0] // 2)
    for angle_deg in (0.1, 1.0, 10.0, MOST_DEG):
        part = math.log(angle_deg / LEAST_DEG) / math.log(MOST_DEG / LEAST_DEG)
        place = round(part * (columns - 1))
        area[:, place] = _GRID
        mask = text_mask(f"{angle_deg:g}\u00b0")
        _put(canvas, mask, LEFT + place - mask.shape[1] // 2, SIDE - BOTTOM + 5)
    for levels, colour in zip(levels_db, COLOURS, strict=True):
        at = (np.arange(columns * FINE) + 0.5) / FINE - 0.5
        draw_curve(area, np.interp(at, np.arange(columns), row(levels)) + 0.5, colour)
    return canvas


def _put(canvas: Single, mask: NDArray[np.float32], left: int, top: int) -> None:
    """Blend a line of text, as far as it is inside."""
    left, top = min(max(left, 0), SIDE - mask.shape[1]), min(max(top, 0), SIDE - mask.shape[0])
    part = canvas[top : top + mask.shape[0], left : left + mask.shape[1], :3]
    part += mask[..., None] * (_INK - part)
