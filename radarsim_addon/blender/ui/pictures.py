# SPDX-License-Identifier: GPL-3.0-or-later
"""Plots that numpy draws, for use inside Blender, which has no matplotlib. Does not import bpy.

Pictures are sRGB values from 0 to 1, shape (height, width, 3), top row first.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Real, Single

# -------------------------------------------------------------------------------------------------
# Curves with smooth edges, and pictures in another size, by numpy. Does not import bpy.
# -------------------------------------------------------------------------------------------------


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


#: Size of the pictures, and margins around the axes for numbers and labels [px].
WIDTH, HEIGHT = 1200, 800
LEFT, RIGHT, TOP, BOTTOM = 110, 190, 95, 80
#: Decibels from the strongest value to the bottom of a plot.
SPAN_DB = 80.0
_INK = (0.1, 0.1, 0.1)
_GRID = (0.85, 0.85, 0.85)
_LINE = (0.12, 0.33, 0.62)
_MARK = (0.90, 0.45, 0.0)
_CHOSEN = (1.0, 1.0, 1.0)
#: Levels up to this one stand for a power of 0 [dB].
_NOTHING_DB = -299.0
_Value = TypeVar("_Value", float, Real)
_Values = TypeVar("_Values", np.float64, np.uint16)


@dataclass(frozen=True)
class _Atlas:
    """Coverage of each character, shape (height, width), from 0 to 1; viridis, and the colour of
    unknown levels.
    """

    glyphs: dict[str, NDArray[np.float32]]
    shades: NDArray[np.float32]
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
        colours = data["viridis"].astype(np.float32) / 255
        unknown = np.array([_GRID], dtype=np.float32)
        return _Atlas(letters, np.concatenate([colours, unknown]), height)


def viridis() -> Single:
    """Return the colour table, from low to high, (256, 3), from 0 to 1."""
    return _atlas().shades[:-1]


def picture_palette() -> Single:
    """Return at most 256 colours that pictures consist of, (colours, 3), from 0 to 1."""
    greys = np.repeat(np.linspace(_INK[0], 1, 24)[:, None], 3, axis=1)
    shades = (_LINE, (0, 0.2, 0.4, 0.6, 0.8)), (_MARK, (0, 0.35, 0.7))
    lines = [colour + t * (1 - np.array(colour)) for colour, parts in shades for t in parts]
    return np.concatenate(
        [viridis()[np.linspace(0, 255, 224).round().astype(np.intp)], greys, lines]
    )


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
class Axes:
    """Limits of the plotting area."""

    x_low: float
    x_high: float
    y_low: float
    y_high: float

    def column(self, x: float) -> float:
        """Place of a value in the picture [px]."""
        return LEFT + (x - self.x_low) / (self.x_high - self.x_low) * (WIDTH - LEFT - RIGHT - 1)

    def row(self, y: _Value) -> _Value:
        """Place of a value, or of an array of them, in the picture [px]."""
        return HEIGHT - BOTTOM - 1 - (y - self.y_low) / (self.y_high - self.y_low) * _area_height()


def _area_height() -> int:
    return HEIGHT - TOP - BOTTOM - 1


def _blank() -> Single:
    return np.ones((HEIGHT, WIDTH, 3), dtype=np.float32)


def _frame(
    canvas: Single, axes: Axes, x_label: str, y_label: str, title: str, x_ticks: bool = True
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


def resample_max(values: NDArray[_Values], size: int, axis: int) -> NDArray[_Values]:
    """Resample an axis to `size` values; each is the maximum of its range, so peaks remain."""
    count = values.shape[axis]
    if count <= size:
        return np.asarray(values.take(np.arange(size) * count // size, axis))
    starts = np.arange(size) * count // size
    return np.asarray(np.maximum.reduceat(values, starts, axis=axis))


# -- pictures --------------------------------------------------------------------------------------


def cell_edges(axis: Real) -> tuple[float, float]:
    """Return the outer edges of evenly spaced cells with these centres."""
    half = 0.5 * abs(float(axis[-1] - axis[0])) / max(axis.size - 1, 1) or 0.5
    return float(axis.min()) - half, float(axis.max()) + half


class Mark(NamedTuple):
    """A place in a picture's axes that gets a ring."""

    x: float
    y: float
    chosen: bool = False


def draw_map(
    range_m: Real,
    doppler_hz: Real,
    power_db: Real,
    wavelength_m: float,
    title: str,
    unit: str = "dBW",
    span_db: float = SPAN_DB,
    marks: Sequence[Mark] = (),
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
    span_db
        Decibels from the strongest cell to the lowest colour.
    marks
        Rings at (Doppler, range).
    """
    axes = Axes(*cell_edges(doppler_hz), *cell_edges(range_m))
    resolved = doppler_hz.size > 1
    label = (
        "Doppler [Hz] (receding: negative)" if resolved else "One pulse: Doppler is not resolved"
    )
    texts = (label, "Range [m]", title)
    canvas = draw_levels(axes, power_db.T, texts, f"Power [{unit}]", span_db, resolved)
    if resolved:
        _velocity_axis(canvas, axes, wavelength_m)
    draw_marks(canvas, axes, marks)
    return canvas


def draw_levels(
    axes: Axes,
    level_db: Real,
    texts: tuple[str, str, str],
    label: str,
    span_db: float = SPAN_DB,
    x_ticks: bool = True,
    highest_db: float | None = None,
) -> Single:
    """Draw levels as colours, with axes and a colour bar; the strongest of joined cells counts.

    level_db: (y, x), both ascending; NaN is grey. texts: of the x axis, the y axis and the title.
    label: of the colour bar. highest_db: level of the brightest colour; None: the strongest cell.
    """
    canvas = _blank()
    known = level_db[np.isfinite(level_db)]
    top_db = float(known.max(initial=-np.inf)) if highest_db is None else highest_db
    empty = not known.size or top_db <= _NOTHING_DB
    rows, columns = HEIGHT - TOP - BOTTOM, WIDTH - LEFT - RIGHT
    # shades before cells are joined or repeated: of few cells, and the strongest has the highest
    level = np.zeros_like(level_db) if empty else np.clip((level_db - top_db) / span_db + 1, 0, 1)
    shades = np.where(np.isnan(level_db), len(viridis()), np.round(level * (len(viridis()) - 1)))
    cells = resample_max(resample_max(shades.astype(np.uint16)[::-1], rows, 0), columns, 1)
    canvas[TOP : TOP + rows, LEFT : LEFT + columns] = _atlas().shades.take(cells, 0)
    _frame(canvas, axes, *texts, x_ticks)
    _colour_bar(canvas, 0.0 if empty else top_db, label, span_db)
    if empty:
        _put_text(canvas, "no echo", WIDTH - RIGHT / 2, HEIGHT - BOTTOM + 19)
    return canvas


def draw_marks(canvas: Single, axes: Axes, marks: Sequence[Mark]) -> None:
    """Draw rings with smooth edges at places within the axes; the chosen one is larger."""
    for mark in sorted(marks, key=lambda one: one.chosen):
        if not (axes.x_low <= mark.x <= axes.x_high and axes.y_low <= mark.y <= axes.y_high):
            continue
        x, y = axes.column(mark.x), axes.row(mark.y)
        radius, colour = (13.0, _CHOSEN) if mark.chosen else (8.0, _MARK)
        top, left = max(round(y - radius) - 3, 0), max(round(x - radius) - 3, 0)
        part = canvas[top : round(y + radius) + 4, left : round(x + radius) + 4]
        down, across = np.indices(part.shape[:2])
        away = np.abs(np.hypot(across + left - x, down + top - y) - radius)
        cover = np.clip(2.0 - away, 0.0, 1.0)[..., None]
        part[...] = part * (1 - cover) + np.array(colour, dtype=np.float32) * cover


def _velocity_axis(canvas: Single, axes: Axes, wavelength_m: float) -> None:
    """Draw the range rate along the upper edge; it decreases from left to right."""
    low, high = -axes.x_high * wavelength_m / 2, -axes.x_low * wavelength_m / 2
    for value in nice_ticks(low, high, 8):
        column = round(axes.column(-2 * value / wavelength_m))
        canvas[TOP - 5 : TOP + 1, column] = _INK
        _put_text(canvas, _number(value), column, TOP - 18)
    # The outer rows are not centred on the ends of the axis, so take half of its length.
    limit_mps = (high - low) / 2
    label = f"Range rate [m/s] (receding: positive; folds at +-{limit_mps:.3g} m/s)"
    _put_text(canvas, label, (LEFT + WIDTH - RIGHT) / 2, TOP - 42)


def _colour_bar(canvas: Single, top_db: float, label: str, span_db: float) -> None:
    left, width = WIDTH - RIGHT + 30, 28
    rows = HEIGHT - TOP - BOTTOM
    table = viridis()[np.linspace(255, 0, rows).round().astype(np.intp)]
    canvas[TOP : TOP + rows, left : left + width] = table[:, None, :]
    for value in nice_ticks(top_db - span_db, top_db, 6):
        row = round(TOP + (top_db - value) / span_db * (rows - 1))
        canvas[row, left + width : left + width + 6] = _INK
        _put_text(canvas, _number(value), left + width + 10, row, anchor=0.0)
    _put_text(canvas, label, WIDTH - 22, TOP + rows / 2, vertical=True)


def draw_profile(
    range_m: Real,
    power: Real,
    title: str,
    unit: str = "dBW",
    span_db: float = SPAN_DB,
    marked_m: float | None = None,
) -> Single:
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
    span_db
        Decibels from the top of the plot to its bottom.
    marked_m
        Range of a vertical line; None: none.
    """
    canvas = _blank()
    peak = float(power.max()) if power.size else 0.0
    top_db = 5 * math.ceil((10 * math.log10(peak) + 1) / 5) if peak > 0 else 0.0
    bottom_db = top_db - span_db
    axes = Axes(*cell_edges(range_m), bottom_db, top_db)
    for value in nice_ticks(bottom_db, top_db, 8):
        canvas[round(axes.row(value)), LEFT : WIDTH - RIGHT] = _GRID
    for value in nice_ticks(axes.x_low, axes.x_high, 8):
        canvas[TOP : HEIGHT - BOTTOM, round(axes.column(value))] = _GRID
    if marked_m is not None and axes.x_low <= marked_m <= axes.x_high:
        column = round(axes.column(marked_m))
        canvas[TOP : HEIGHT - BOTTOM, column : column + 2] = _MARK
    level_db = np.full(range_m.shape, bottom_db)
    np.log10(power, out=level_db, where=power > 0)
    level_db = np.where(power > 0, 10 * level_db, bottom_db)
    _curve(canvas, axes, np.clip(level_db, bottom_db, top_db))
    _frame(canvas, axes, "Range [m]", f"Expected power [{unit}]", title)
    if not peak > 0:
        _put_text(canvas, "no echo", (LEFT + WIDTH - RIGHT) / 2, (TOP + HEIGHT - BOTTOM) / 2)
    return canvas


def _curve(canvas: Single, axes: Axes, level_db: Real) -> None:
    """Draw a line through evenly spaced values; of more values than columns the peaks remain."""
    columns = WIDTH - LEFT - RIGHT
    if level_db.size > columns:
        level_db = resample_max(level_db, columns, 0)
    # Limits of the axes are at the centres of the outer pixels, values amid their cells.
    cell_px = (columns - 1) / level_db.size
    at_px = 0.5 + cell_px * (np.arange(level_db.size) + 0.5)
    rows = axes.row(level_db) + 0.5 - TOP
    fine_px = (np.arange(columns * FINE) + 0.5) / FINE
    area = canvas[TOP : HEIGHT - BOTTOM, LEFT : WIDTH - RIGHT]
    draw_curve(area, np.interp(fine_px, at_px, rows), _LINE)
