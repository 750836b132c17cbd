# SPDX-License-Identifier: GPL-3.0-or-later
"""Plots that numpy draws, for use inside Blender, which has no matplotlib. Does not import bpy.

Pictures are sRGB values from 0 to 1, shape (height, width, 3), top row first.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real, Single

#: Size of the pictures, and margins around the axes for numbers and labels [px].
WIDTH, HEIGHT = 1200, 800
LEFT, RIGHT, TOP, BOTTOM = 110, 190, 95, 80
#: Decibels from the strongest value to the bottom of a plot.
SPAN_DB = 80.0
#: Strongest level of a coverage diagram, and what is below it in the picture [dB].
COVERAGE_TOP_DB, COVERAGE_SPAN_DB = 12.5, 52.5
_INK = (0.1, 0.1, 0.1)
_GRID = (0.85, 0.85, 0.85)
_LINE = (0.12, 0.33, 0.62)


@dataclass(frozen=True)
class _Atlas:
    """Coverage of each character, shape (height, width), from 0 to 1, and the colour table."""

    glyphs: dict[str, NDArray[np.float32]]
    viridis: NDArray[np.float32]
    height: int


@functools.cache
def _atlas() -> _Atlas:
    with np.load(Path(__file__).with_name("font_atlas.npz"), allow_pickle=False) as data:
        letters = {
            chr(code): glyph[:, :advance].astype(np.float32) / 255
            for code, advance, glyph in zip(
                data["codes"], data["advances"], data["glyphs"], strict=True
            )
        }
        height = int(data["glyphs"].shape[1])
        return _Atlas(letters, data["viridis"].astype(np.float32) / 255, height)


# -- elements --------------------------------------------------------------------------------------


def text_mask(text: str) -> NDArray[np.float32]:
    """Return the coverage of a line of text, shape (height, width); '?' for unknown characters."""
    atlas = _atlas()
    parts = [atlas.glyphs.get(letter, atlas.glyphs["?"]) for letter in text]
    if not parts:
        return np.zeros((atlas.height, 0), dtype=np.float32)
    return np.concatenate(parts, axis=1)


def _put_text(
    canvas: Single, text: str, x: float, y: float, anchor: float = 0.5, vertical: bool = False
) -> None:
    """Write a line of text.

    Parameters
    ----------
    canvas
        Picture that is changed.
    text
        One line.
    x, y
        Position across and along the line [px].
    anchor
        Fraction of the line before the position, from 0 (starts there) to 1 (ends there).
    vertical
        Write upwards, centred at `x`. Else to the right, centred at `y`.
    """
    mask = text_mask(text)
    if vertical:
        mask = np.rot90(mask)
        left, top = x - mask.shape[1] / 2, y - anchor * mask.shape[0]
    else:
        left, top = x - anchor * mask.shape[1], y - mask.shape[0] / 2
    _blend(canvas, mask, round(left), round(top))


def _blend(canvas: Single, mask: NDArray[np.float32], left: int, top: int) -> None:
    x0, y0 = max(left, 0), max(top, 0)
    x1 = min(left + mask.shape[1], canvas.shape[1])
    y1 = min(top + mask.shape[0], canvas.shape[0])
    if x1 <= x0 or y1 <= y0:
        return
    cover = mask[y0 - top : y1 - top, x0 - left : x1 - left, None]
    part = canvas[y0:y1, x0:x1]
    part[...] = part * (1 - cover) + np.array(_INK, dtype=np.float32) * cover


def nice_ticks(low: float, high: float, about: int) -> list[float]:
    """Return the multiples of 1, 2 or 5 times a power of ten between two limits, both included.

    Parameters
    ----------
    low, high
        Limits.
    about
        Approximate number of ticks.
    """
    if not high > low:
        return [low]
    raw = (high - low) / max(about, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= raw * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [index * step for index in range(first, last + 1)]


def _number(value: float) -> str:
    # Adding 0.0 changes -0.0 to 0.0. The Unicode minus sign is as wide as the plus.
    return f"{value + 0.0:.6g}".replace("-", "\u2212")


@dataclass(frozen=True)
class _Axes:
    """Limits of the plotting area."""

    x_low: float
    x_high: float
    y_low: float
    y_high: float

    def column(self, x: float) -> float:
        return LEFT + (x - self.x_low) / (self.x_high - self.x_low) * (WIDTH - LEFT - RIGHT - 1)

    def row(self, y: float) -> float:
        return HEIGHT - BOTTOM - 1 - (y - self.y_low) / (self.y_high - self.y_low) * _area_height()


def _area_height() -> int:
    return HEIGHT - TOP - BOTTOM - 1


def _blank() -> Single:
    return np.ones((HEIGHT, WIDTH, 3), dtype=np.float32)


def _frame(
    canvas: Single, axes: _Axes, x_label: str, y_label: str, title: str, x_ticks: bool = True
) -> None:
    """Draw the frame, ticks with numbers, labels and title around the plotting area."""
    right, bottom = WIDTH - RIGHT - 1, HEIGHT - BOTTOM - 1
    for row in (TOP, bottom):
        canvas[row, LEFT : right + 1] = _INK
    for column in (LEFT, right):
        canvas[TOP : bottom + 1, column] = _INK
    for value in nice_ticks(axes.x_low, axes.x_high, 8) if x_ticks else ():
        column = round(axes.column(value))
        canvas[bottom : bottom + 6, column] = _INK
        _put_text(canvas, _number(value), column, bottom + 19)
    for value in nice_ticks(axes.y_low, axes.y_high, 8):
        row = round(axes.row(value))
        canvas[row, LEFT - 5 : LEFT + 1] = _INK
        _put_text(canvas, _number(value), LEFT - 10, row, anchor=1.0)
    _put_text(canvas, x_label, (LEFT + right) / 2, HEIGHT - 28)
    _put_text(canvas, y_label, 22, (TOP + bottom) / 2, vertical=True)
    _put_text(canvas, title, LEFT, 22, anchor=0.0)


def resample_max(values: Real, size: int, axis: int) -> Real:
    """Resample an axis to `size` values; each is the maximum of its range, so peaks remain."""
    count = values.shape[axis]
    if count <= size:
        return np.asarray(np.take(values, np.arange(size) * count // size, axis=axis))
    starts = np.arange(size) * count // size
    return np.asarray(np.maximum.reduceat(values, starts, axis=axis))


# -- pictures --------------------------------------------------------------------------------------


def _limits(axis: Real) -> tuple[float, float]:
    """Return the outer edges of evenly spaced cells with these centres."""
    half = 0.5 * abs(float(axis[-1] - axis[0])) / max(axis.size - 1, 1) or 0.5
    return float(axis.min()) - half, float(axis.max()) + half


def draw_map(
    range_m: Real,
    doppler_hz: Real,
    power_db: Real,
    wavelength_m: float,
    title: str,
    unit: str = "dBW",
) -> Single:
    """Draw a range-Doppler map with axes in metres, hertz and metres per second, and a colour bar.

    Parameters
    ----------
    range_m
        Range of each column of `power_db`, ascending, shape (ranges,) [m].
    doppler_hz
        Doppler of each row, ascending, shape (dopplers,) [Hz].
    power_db
        Shape (dopplers, ranges) [dB].
    wavelength_m
        Wavelength at the carrier [m], for the axis of the range rate, -lambda f_D / 2.
    title
        First line.
    unit
        Unit of `power_db`; "dB" if powers are not in watts.
    """
    canvas = _blank()
    axes = _Axes(*_limits(doppler_hz), *_limits(range_m))
    top_db = float(power_db.max()) if power_db.size else 0.0
    empty = not np.isfinite(top_db) or top_db <= -299
    level = (
        np.zeros_like(power_db) if empty else np.clip((power_db - top_db) / SPAN_DB + 1, 0.0, 1.0)
    )
    rows, columns = HEIGHT - TOP - BOTTOM, WIDTH - LEFT - RIGHT
    cells = resample_max(resample_max(level.T[::-1], rows, 0), columns, 1)
    canvas[TOP : TOP + rows, LEFT : LEFT + columns] = _atlas().viridis[
        np.round(cells * 255).astype(np.intp)
    ]
    if doppler_hz.size > 1:
        _frame(canvas, axes, "Doppler [Hz] (receding: negative)", "Range [m]", title)
        _velocity_axis(canvas, axes, wavelength_m)
    else:
        _frame(canvas, axes, "One pulse: Doppler is not resolved", "Range [m]", title, False)
    _colour_bar(canvas, 0.0 if empty else top_db, f"Power [{unit}]")
    if empty:
        _put_text(canvas, "no echo", WIDTH - RIGHT / 2, HEIGHT - BOTTOM + 19)
    return canvas


def _velocity_axis(canvas: Single, axes: _Axes, wavelength_m: float) -> None:
    """Draw the range rate along the upper edge; it decreases from left to right."""
    low, high = -axes.x_high * wavelength_m / 2, -axes.x_low * wavelength_m / 2
    for value in nice_ticks(low, high, 8):
        column = round(axes.column(-2 * value / wavelength_m))
        canvas[TOP - 5 : TOP + 1, column] = _INK
        _put_text(canvas, _number(value), column, TOP - 18)
    limit_mps = (high - low) / 2  # rows are centred on 0 Hz, the outer ones not on the axis' ends
    label = f"Range rate [m/s] (receding: positive; folds at +-{limit_mps:.3g} m/s)"
    _put_text(canvas, label, (LEFT + WIDTH - RIGHT) / 2, TOP - 42)


def _colour_bar(canvas: Single, top_db: float, label: str, span_db: float = SPAN_DB) -> None:
    left, width = WIDTH - RIGHT + 30, 28
    rows = HEIGHT - TOP - BOTTOM
    table = _atlas().viridis[np.linspace(255, 0, rows).round().astype(np.intp)]
    canvas[TOP : TOP + rows, left : left + width] = table[:, None, :]
    for value in nice_ticks(top_db - span_db, top_db, 6):
        row = round(TOP + (top_db - value) / span_db * (rows - 1))
        canvas[row, left + width : left + width + 6] = _INK
        _put_text(canvas, _number(value), left + width + 10, row, anchor=0.0)
    _put_text(canvas, label, WIDTH - 22, TOP + rows / 2, vertical=True)


def draw_coverage(range_m: Real, height_m: Real, level_db: Real, title: str) -> Single:
    """Draw a coverage diagram: height against range, grey below the horizon.

    Parameters
    ----------
    range_m, height_m
        Ranges along the ground and heights, ascending, shapes (r,) and (h,) [m].
    level_db
        Pattern-propagation factor F^4, NaN below the horizon, shape (h, r) [dB].
    title
        First line.
    """
    canvas = _blank()
    rows, columns = HEIGHT - TOP - BOTTOM, WIDTH - LEFT - RIGHT
    row = np.linspace(height_m.size - 1, 0, rows).round().astype(np.intp)
    column = np.linspace(0, range_m.size - 1, columns).round().astype(np.intp)
    cells = level_db[np.ix_(row, column)]
    shown = np.clip((np.nan_to_num(cells) - COVERAGE_TOP_DB) / COVERAGE_SPAN_DB + 1, 0.0, 1.0)
    pixels = _atlas().viridis[np.round(shown * 255).astype(np.intp)]
    pixels[np.isnan(cells)] = _GRID
    canvas[TOP : TOP + rows, LEFT : LEFT + columns] = pixels
    axes = _Axes(*_limits(range_m), *_limits(height_m))
    _frame(canvas, axes, "Range along the ground [m]", "Height over the ground [m]", title)
    _colour_bar(canvas, COVERAGE_TOP_DB, "F^4 [dB over free space]", COVERAGE_SPAN_DB)
    return canvas


def draw_profile(range_m: Real, power: Real, title: str, unit: str = "dBW") -> Single:
    """Draw the expected power over range, in decibels.

    Parameters
    ----------
    range_m
        Ascending, shape (ranges,) [m].
    power
        Shape (ranges,) [W]; 0 without an echo.
    title
        First line.
    unit
        Unit of the decibels; "dB" if powers are not in watts.
    """
    canvas = _blank()
    peak = float(power.max()) if power.size else 0.0
    top_db = 5 * math.ceil((10 * math.log10(peak) + 1) / 5) if peak > 0 else 0.0
    bottom_db = top_db - SPAN_DB
    axes = _Axes(*_limits(range_m), bottom_db, top_db)
    for value in nice_ticks(bottom_db, top_db, 8):
        canvas[round(axes.row(value)), LEFT : WIDTH - RIGHT] = _GRID
    for value in nice_ticks(axes.x_low, axes.x_high, 8):
        canvas[TOP : HEIGHT - BOTTOM, round(axes.column(value))] = _GRID
    level_db = np.full(range_m.shape, bottom_db)
    np.log10(power, out=level_db, where=power > 0)
    level_db = np.where(power > 0, 10 * level_db, bottom_db)
    _curve(canvas, axes, np.clip(level_db, bottom_db, top_db))
    _frame(canvas, axes, "Range [m]", f"Expected power [{unit}]", title)
    if not peak > 0:
        _put_text(canvas, "no echo", (LEFT + WIDTH - RIGHT) / 2, (TOP + HEIGHT - BOTTOM) / 2)
    return canvas


def _curve(canvas: Single, axes: _Axes, level_db: Real) -> None:
    """Draw a line through evenly spaced values: in each column from the minimum to the maximum."""
    columns = WIDTH - LEFT - RIGHT
    fine = np.interp(
        np.linspace(0, level_db.size - 1, columns * 8), np.arange(level_db.size), level_db
    )
    if level_db.size > columns:  # keep peaks between the columns
        coarse = resample_max(level_db, columns, 0)
        fine = np.maximum(fine, np.repeat(coarse, 8))
    groups = fine.reshape(columns, 8)
    # Adjacent columns have a common value, so that steep slopes have no gaps.
    high = np.maximum(groups.max(axis=1), np.append(groups[1:, 0], groups[-1, -1]))
    low = np.minimum(groups.min(axis=1), np.append(groups[1:, 0], groups[-1, -1]))
    for column in range(columns):
        top, bottom = round(axes.row(high[column])), round(axes.row(low[column]))
        canvas[top : bottom + 2, LEFT + column] = _LINE
