# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the lines, texts and colours of the live preview are, in pixels."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real, Single
from .pictures import cell_edges, nice_ticks, resample_max, viridis
from .translations import tr

#: Decibels from the top of the profile to its bottom, and over all colours.
SPAN_DB = 60.0
#: Sizes at scale 1 [px]: widths of the axes and of their surroundings, heights of both axes.
_WIDTH, _PROFILE, _MAP = 360, 120, 120
_LEFT, _RIGHT, _GAP, _LINE, _PAD, _STRIP = 56, 26, 30, 16, 10, 10
#: Least width and height of the axes at which the picture is drawn.
_LEAST = 120

Anchor = Literal["left", "centre", "right"]


class Text(NamedTuple):
    """A line of text; x, y: its baseline [px]."""

    x: float
    y: float
    text: str
    anchor: Anchor = "left"
    bright: bool = True


class Box(NamedTuple):
    """A rectangle [px]."""

    left: float
    bottom: float
    right: float
    top: float


@dataclass
class LivePicture:
    """What is drawn.

    panel, map: the whole picture, and the map in it. strip: the colours of the profile's levels.
    grid: ends of pieces of lines, (2 n, 2). curve: (m, 2). mark: the peak. colours: of the map,
    RGBA, bottom row first; None without one. noise: ends of the dashes at its level, (2 n, 2).
    """

    panel: Box
    profile: Box
    map: Box
    strip: Box
    grid: Real
    curve: Real
    noise: Real
    mark: tuple[float, float] | None
    colours: Single | None
    texts: list[Text] = field(default_factory=list)


def lay_out_draft(
    fields: Mapping[str, Any],
    arrays: Mapping[str, NDArray[Any]],
    lines: Sequence[str],
    corner: tuple[float, float],
    scale: float,
) -> LivePicture:
    """Return the picture of a draft.

    fields, arrays: of the draft's message. lines: of text above the axes. corner: right and bottom
    end [px]. scale: of the display.
    """
    unit = scale
    resolved = arrays["velocity_mps"].size > 1
    right, bottom = corner
    height = _PROFILE + 2 * _GAP + (_MAP + _GAP if resolved else 0) + _LINE * len(lines) + _PAD
    panel = Box(
        right - (_LEFT + _WIDTH + _RIGHT + _STRIP) * unit, bottom, right, bottom + height * unit
    )
    left, low = panel.left + _LEFT * unit, bottom + (_GAP + _PAD) * unit
    image = Box(left, low, left + _WIDTH * unit, low + (_MAP if resolved else 0) * unit)
    start = image.top + _GAP * unit if resolved else low
    profile = Box(left, start, image.right, start + _PROFILE * unit)
    strip = Box(profile.right + 6 * unit, start, profile.right + (6 + _STRIP) * unit, profile.top)
    range_m, power = arrays["range_m"], arrays["profile_w"]
    peak = int(np.argmax(power)) if power.size else 0
    top_db = top_level_db(float(power[peak]) if power.size else 0.0)
    ends_m = cell_edges(range_m)
    none = np.zeros((0, 2))
    picture = LivePicture(panel, profile, image, strip, none, none, none, None, None)
    texts, grid = picture.texts, []
    for row, line in enumerate(lines):
        y = panel.top - _LINE * (row + 1) * unit
        texts.append(Text(panel.left + _PAD * unit, y, line, bright=row == 0))
    for value in nice_ticks(top_db - SPAN_DB, top_db, 6):
        y = _between(value, top_db - SPAN_DB, top_db, profile.bottom, profile.top)
        grid += [(profile.left, y), (profile.right, y)]
        texts.append(Text(left - 6 * unit, y - 4 * unit, number_text(value), "right", False))
    texts.append(
        Text(panel.left + _PAD * unit, profile.top + 8 * unit, tr("Power [dBW]"), bright=False)
    )
    below = image if resolved else profile
    for value in nice_ticks(*ends_m, 8):
        x = _between(value, *ends_m, left, image.right)
        grid += [(x, profile.bottom), (x, profile.top)]
        if resolved:
            grid += [(x, image.bottom - 4 * unit), (x, image.bottom)]
        texts.append(Text(x, below.bottom - 15 * unit, number_text(value), "centre", False))
    label_y = below.bottom - 30 * unit
    texts.append(Text((left + image.right) / 2, label_y, tr("Range [m]"), "centre", False))
    if power.size and power[peak] > 0:
        picture.curve = _curve(range_m, power, top_db, ends_m, profile)
        picture.mark = _peak_mark(picture, range_m[peak], float(power[peak]), top_db, ends_m, unit)
    else:
        texts.append(Text((left + profile.right) / 2, start + 50 * unit, tr("no echo"), "centre"))
    picture.noise = _dashes(float(fields["noise_w"]), top_db, profile, unit)
    if resolved:
        _add_map(picture, grid, arrays, top_db, unit)
    picture.grid = np.array(grid, dtype=np.float64).reshape(-1, 2)
    return picture


def top_level_db(power_w: float) -> float:
    """Return the level of the upper edge for a peak of this power: a multiple of 5 dB above it."""
    return 5.0 * math.ceil((10 * math.log10(power_w) + 1) / 5) if power_w > 0 else 0.0


def number_text(value: float) -> str:
    """Return a number of an axis; its minus is as wide as a plus."""
    return f"{value + 0.0:.6g}".replace("-", "\u2212")


def _between(value: Any, low: float, high: float, first: float, last: float) -> Any:
    """Where a value between two others is, between two places."""
    return first + (value - low) / (high - low) * (last - first)


def _curve(
    range_m: Real, power: Real, top_db: float, ends_m: tuple[float, float], box: Box
) -> Real:
    """Points of the profile: one per pixel at most, the strongest of its ranges."""
    columns = min(max(round(box.right - box.left), 2), range_m.size)
    level_db = np.full(power.shape, top_db - SPAN_DB)
    np.log10(power, out=level_db, where=power > 0)
    level_db = np.where(power > 0, 10 * level_db, top_db - SPAN_DB)
    shown = np.clip(resample_max(level_db, columns, 0), top_db - SPAN_DB, top_db)
    middle_m = range_m[(np.arange(columns) * 2 + 1) * range_m.size // (2 * columns)]
    x = _between(middle_m, *ends_m, box.left, box.right)
    y = _between(shown, top_db - SPAN_DB, top_db, box.bottom, box.top)
    return np.stack([x, y], axis=1)


def _dashes(noise_w: float, top_db: float, box: Box, unit: float) -> Real:
    """Dashes across the axes at the level of the noise; none where it is below them."""
    level_db = 10 * math.log10(noise_w) if noise_w > 0 else -math.inf
    if not top_db - SPAN_DB < level_db < top_db:
        return np.zeros((0, 2))
    y = _between(level_db, top_db - SPAN_DB, top_db, box.bottom, box.top)
    starts = np.arange(box.left, box.right - 4 * unit, 8 * unit)
    ends = np.stack([starts, starts + 4 * unit], axis=1).ravel()
    return np.stack([ends, np.full(ends.size, y)], axis=1)


def _peak_mark(
    picture: LivePicture,
    range_m: float,
    power_w: float,
    top_db: float,
    ends_m: tuple[float, float],
    unit: float,
) -> tuple[float, float]:
    """The place of the peak, whose numbers are written above the axes."""
    box, level_db = picture.profile, 10 * math.log10(power_w)
    x = _between(range_m, *ends_m, box.left, box.right)
    y = _between(level_db, top_db - SPAN_DB, top_db, box.bottom, box.top)
    level = number_text(float(f"{level_db:.1f}"))
    text = tr("strongest: {range_m:.4g} m, {level} dBW", range_m=range_m, level=level)
    picture.texts.append(Text(box.right, box.top + 8 * unit, text, "right"))
    return x, y


def _add_map(
    picture: LivePicture,
    grid: list[tuple[float, float]],
    arrays: Mapping[str, NDArray[Any]],
    top_db: float,
    unit: float,
) -> None:
    """The map's colours and the axis of its range rates."""
    box, rates = picture.map, arrays["velocity_mps"]
    ends = cell_edges(rates)
    for value in nice_ticks(*ends, 4):
        y = _between(value, *ends, box.bottom, box.top)
        grid += [(box.left - 4 * unit, y), (box.left, y)]
        picture.texts.append(
            Text(box.left - 6 * unit, y - 4 * unit, number_text(value), "right", False)
        )
    label = tr("Range rate [m/s], receding: positive")
    picture.texts.append(
        Text(picture.panel.left + _PAD * unit, box.top + 8 * unit, label, bright=False)
    )
    power = resample_max(resample_max(arrays["map_w"], _MAP, 0), _WIDTH, 1)
    picture.colours = level_colours(power, top_db)


def level_colours(power: Real, top_db: float) -> Single:
    """Return the colours of powers, (..., 4): those of viridis over `SPAN_DB` below `top_db`.

    In steps of 1 dB: equal neighbours are drawn as one.
    """
    floor = 10 ** ((top_db - SPAN_DB) / 10)
    level_db = 10 * np.log10(np.maximum(power, floor))
    place = np.round(np.clip(level_db - top_db + SPAN_DB, 0.0, SPAN_DB)) / SPAN_DB
    table = viridis()
    colours = table[np.round(place * (len(table) - 1)).astype(np.intp)]
    return np.concatenate([colours, np.ones((*colours.shape[:-1], 1))], axis=-1, dtype=np.float32)
