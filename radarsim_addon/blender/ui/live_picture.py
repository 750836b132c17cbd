# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the lines, texts and colours of the live preview are, in pixels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import NDArray

from ...arrays import Int32, Real, Single
from ...messages import Message
from .fields import tr
from .small_drawings import FINE, cell_edges, draw_curve, nice_ticks, resample_max, viridis

#: Decibels from the top of the profile to its bottom, and over all colours.
SPAN_DB = 60.0
#: Sizes at scale 1 [px]: widths of the axes and of their surroundings, heights of both axes.
_WIDTH, _PROFILE, _MAP = 360, 120, 150
_LEFT, _RIGHT, _GAP, _LINE, _PAD, _STRIP = 56, 26, 30, 16, 10, 10
#: Smallest scale at which the picture is drawn.
_LEAST_SCALE = 0.6

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

    fields, arrays: contents of the draft's message. lines: text above the axes. corner: right and
    bottom edge [px]. scale: scale of the display.
    """
    unit = scale
    resolved = arrays["velocity_mps"].size > 1
    right, bottom = corner
    width, height = _panel_size(resolved, len(lines))
    panel = Box(right - width * unit, bottom, right, bottom + height * unit)
    left, low = panel.left + _LEFT * unit, bottom + (_GAP + _PAD) * unit
    image = Box(left, low, left + _WIDTH * unit, low + (_MAP if resolved else 0) * unit)
    start = image.top + 2 * _GAP * unit if resolved else low
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
    for value in nice_ticks(*ends_m, 8):
        x = _between(value, *ends_m, left, image.right)
        grid += [(x, profile.bottom), (x, profile.top)]
        texts.append(Text(x, start - 15 * unit, number_text(value), "centre", False))
    label_y = start - 30 * unit
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


def _panel_size(resolved: bool, lines: int) -> tuple[int, int]:
    """Return the width and the height of the whole picture at scale 1 [px]."""
    height = _PROFILE + 2 * _GAP + (_MAP + 2 * _GAP if resolved else 0) + _LINE * lines + _PAD
    return _LEFT + _WIDTH + _RIGHT + _STRIP, height


def fitting_scale(scale: float, room_px: tuple[float, float], resolved: bool, lines: int) -> float:
    """Return the scale at which a picture fits into a space, at most the scale of the display.

    It is 0 if the picture would be too small to read.
    """
    width, height = _panel_size(resolved, lines)
    found = min(scale, room_px[0] / width, room_px[1] / height)
    return found if found >= _LEAST_SCALE else 0.0


def top_level_db(power_w: float) -> float:
    """Return the level of the upper edge for a peak of this power: a multiple of 5 dB above it."""
    return 5.0 * math.ceil((10 * math.log10(power_w) + 1) / 5) if power_w > 0 else 0.0


def number_text(value: float) -> str:
    """Return a number of an axis; its minus is as wide as a plus."""
    return f"{value + 0.0:.6g}".replace("-", "\u2212")


def _between(value: Any, low: float, high: float, first: float, last: float) -> Any:
    """Return the place of a value on an axis, by linear interpolation between two values and their
    places.
    """
    return first + (value - low) / (high - low) * (last - first)


def _curve(
    range_m: Real, power: Real, top_db: float, ends_m: tuple[float, float], box: Box
) -> Real:
    """Return the points of the profile, at most one per pixel: the strongest of the
    ranges in it.
    """
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
    """Return dashes across the axes at the level of the noise; none if the level is
    below the axes.
    """
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
    """Return the mark at the peak. The text above the axes gives the numbers of this peak."""
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
    """Add the colours of the map and its axes: range upwards, range rate to the right."""
    box, texts = picture.map, picture.texts
    ends_m, ends_mps = cell_edges(arrays["range_m"]), cell_edges(arrays["velocity_mps"])
    for value in nice_ticks(*ends_m, 4):
        y = _between(value, *ends_m, box.bottom, box.top)
        grid += [(box.left - 4 * unit, y), (box.left, y)]
        texts.append(Text(box.left - 6 * unit, y - 4 * unit, number_text(value), "right", False))
    for value in nice_ticks(*ends_mps, 8):
        x = _between(value, *ends_mps, box.left, box.right)
        grid += [(x, box.bottom - 4 * unit), (x, box.bottom)]
        texts.append(Text(x, box.bottom - 15 * unit, number_text(value), "centre", False))
    left, y = picture.panel.left + _PAD * unit, box.top + 8 * unit
    texts.append(Text(left, y, tr("Range [m]"), bright=False))
    label, y = tr("Range rate [m/s], receding: positive"), box.bottom - 30 * unit
    texts.append(Text((box.left + box.right) / 2, y, label, "centre", False))
    power = resample_max(resample_max(arrays["map_w"].T, _MAP, 0), _WIDTH, 1)
    picture.colours = level_colours(power, top_db)


def level_colours(power: Real, top_db: float) -> Single:
    """Return the colours of powers, (..., 4), from viridis over `SPAN_DB` below `top_db`.

    The levels have steps of 1 dB, because equal neighbours are drawn as one rectangle.
    """
    floor = 10 ** ((top_db - SPAN_DB) / 10)
    level_db = 10 * np.log10(np.maximum(power, floor))
    place = np.round(np.clip(level_db - top_db + SPAN_DB, 0.0, SPAN_DB)) / SPAN_DB
    table = viridis()
    colours = table[np.round(place * (len(table) - 1)).astype(np.intp)]
    return np.concatenate([colours, np.ones((*colours.shape[:-1], 1))], axis=-1, dtype=np.float32)


# -------------------------------------------------------------------------------------------------
# The picture of the live preview as rectangles of one colour each. Does not import bpy.
#
# Blender's own window draws such rectangles all the time. What draws images, or lines with smooth
# edges, is compiled when it is used first, which takes 30 to 80 ms of the window's thread.
# -------------------------------------------------------------------------------------------------


BACK = (0.07, 0.07, 0.07, 0.86)
_GRID, _CURVE, _PEAK = (1.0, 1.0, 1.0, 0.13), (0.34, 0.71, 0.91, 1.0), (0.90, 0.62, 0.0, 1.0)
_GRIP = (1.0, 1.0, 1.0, 0.5)
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
    """Return all rectangles of a picture, without its texts. The last ones are in front."""
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
        parts.append(_curve_quads(picture.curve, picture.profile, scale))
    if picture.mark is not None:
        parts.append(_ring(picture.mark, scale))
    left, top, grip = picture.panel.left, picture.panel.top, GRIP_PX * scale
    corner = [(left, top), (left + grip, top), (left, top - grip), (left, top)]
    parts.append(_lines(np.array(corner), _GRIP, 2 * scale))
    return _joined(parts)


def filled(box: Box, colour: tuple[float, ...]) -> Quads:
    """Return a rectangle."""
    return pixels(np.array([[colour]], dtype=np.float32), box)


def pixels(colours: Single, box: Box) -> Quads:
    """Return an image (rows, columns, 4), bottom row first, as rectangles.

    Equal neighbours in a row become one rectangle. Transparent pixels are left out.
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


def _curve_quads(points: Real, box: Box, scale: float) -> Quads:
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
    """Return a colour where a line covers pixels, and nothing elsewhere, (rows, columns, 4)."""
    found = np.empty((*cover.shape, 4), dtype=np.float32)
    found[..., :3], found[..., 3] = colour[:3], np.round(cover * _COVERS) / _COVERS
    return found


# -------------------------------------------------------------------------------------------------
# Draws the live preview into a corner of a 3D view.
# -------------------------------------------------------------------------------------------------


_BRIGHT, _DIM = (1.0, 1.0, 1.0, 1.0), (0.82, 0.82, 0.82, 1.0)
_FONT_PX, _MARGIN_PX = 11, 12
#: Length of the lines that mark the corner by which the picture is resized, at scale 1 [px].
GRIP_PX = 14
#: Largest part of the display's scale.
_LARGEST = 3.0
#: The last draft as rectangles, by what they were made from: views are drawn all the time.
_last: dict[str, Any] = {}


def draw_live(context: bpy.types.Context, draft: Message | None, lines: list[str]) -> None:
    """Draw a draft and its lines of text. Without a draft, draw the lines only."""
    scale, corner = _free_corner(context)
    gpu.state.blend_set("ALPHA")
    if draft is not None:
        panel, scale = place_live(context, draft, len(lines))
        corner = panel.right, panel.bottom
    blf.size(0, _FONT_PX * scale)
    if draft is None:
        width = max(blf.dimensions(0, line)[0] for line in lines) + 20 * scale
        box = Box(
            corner[0] - width, corner[1], corner[0], corner[1] + (16 * len(lines) + 10) * scale
        )
        _draw(_batch(filled(box, BACK)))
        for row, line in enumerate(lines):
            y = box.top - 16 * (row + 1) * scale
            _write(line, box.left + 10 * scale, y, _BRIGHT if row == 0 else _DIM)
    elif scale:
        picture = _picture(draft, lines, corner, scale)
        _draw(_last["batch"])
        for text in picture.texts:
            width = blf.dimensions(0, text.text)[0]
            x = text.x - {"left": 0.0, "centre": 0.5, "right": 1.0}[text.anchor] * width
            _write(text.text, x, text.y, _BRIGHT if text.bright else _DIM)
    gpu.state.blend_set("NONE")


def forget_drawing() -> None:
    """Free the rectangles of the last draft, and put the next one into the corner."""
    _last.clear()
    vars(placement).update(vars(Placement()))


@dataclass
class Placement:
    """Where the user has put the picture: to the left of the free corner and above it, in pixels at
    scale 1, and the part of the display's scale at which it is drawn.
    """

    left: float = 0.0
    up: float = 0.0
    size: float = 1.0


placement = Placement()


def place_live(context: bpy.types.Context, draft: Message, lines: int) -> tuple[Box, float]:
    """Return where a draft with so many lines of text is in a view [px], and its scale.

    It stays within the free part of the view. The scale is 0 if there is no room.
    """
    display, corner = _free_corner(context)
    room, resolved = _room_px(context, corner), draft.arrays["velocity_mps"].size > 1
    scale = fitting_scale(display * placement.size, room, resolved, lines)
    width, height = (scale * side for side in _panel_size(resolved, lines))
    right = corner[0] - min(max(placement.left * display, 0.0), room[0] - width)
    up = max(placement.up * display, _above_hud_px(context, right - width) - corner[1], 0.0)
    bottom = corner[1] + min(up, room[1] - height)
    return Box(right - width, bottom, right, bottom + height), scale


def drag_live(
    context: bpy.types.Context,
    start: Placement,
    panel: Box,
    by_px: tuple[float, float],
    resize: bool,
) -> None:
    """Move the picture, which was at `panel` when the user pressed the mouse, or its upper left
    corner.
    """
    display, (right, up) = float(context.preferences.system.ui_scale), by_px
    if resize:
        wider = (panel.right - panel.left - right) / (panel.right - panel.left)
        higher = (panel.top - panel.bottom + up) / (panel.top - panel.bottom)
        size = start.size * max(wider, higher)
        placement.size = min(max(size, _LEAST_SCALE / display), _LARGEST)
    else:
        corner = _free_corner(context)[1]
        placement.left = max(corner[0] - panel.right - right, 0.0) / display
        placement.up = max(panel.bottom + up - corner[1], 0.0) / display


def _free_corner(context: bpy.types.Context) -> tuple[float, tuple[float, float]]:
    """Return the scale of the display, and the lower right corner that nothing overlaps [px]."""
    scale = float(context.preferences.system.ui_scale)
    sidebar_px = _over_px(context, "width", "UI")
    return scale, (context.region.width - sidebar_px - _MARGIN_PX * scale, _MARGIN_PX * scale)


def _over_px(context: bpy.types.Context, side: str, *kinds: str) -> int:
    """Return the width or the height of the regions that overlap the view [px]."""
    if not context.preferences.system.use_region_overlap:
        return 0
    regions = (region for region in context.area.regions if region.type in kinds)
    return sum(getattr(region, side) for region in regions if min(region.width, region.height) > 1)


def _above_hud_px(context: bpy.types.Context, left: float) -> float:
    """Return the top of the settings of the last operator, which Blender shows in the lower left
    corner, if they reach beyond `left` [px].
    """
    if not context.preferences.system.use_region_overlap:
        return 0.0
    margin = _MARGIN_PX * context.preferences.system.ui_scale / 2
    found = [one for one in context.area.regions if one.type == "HUD"]
    return max(
        (
            one.y + one.height - context.region.y + margin
            for one in found
            if min(one.width, one.height) > 1 and one.x + one.width - context.region.x > left
        ),
        default=0.0,
    )


def _room_px(context: bpy.types.Context, corner: tuple[float, float]) -> tuple[float, float]:
    """Return the free width and height between the tools, the headers and the corner [px]."""
    above = _over_px(context, "height", "HEADER", "TOOL_HEADER")
    left = _over_px(context, "width", "TOOLS")
    return corner[0] - left, context.region.height - above - corner[1]


def _picture(
    draft: Message, lines: list[str], corner: tuple[float, float], scale: float
) -> LivePicture:
    key = (draft.fields["number"], draft.fields["level"], tuple(lines), corner, scale)
    if _last.get("key") != key:
        picture = lay_out_draft(draft.fields, draft.arrays, lines, corner, scale)
        _last.update(key=key, picture=picture, batch=_batch(picture_quads(picture, scale)))
    found: LivePicture = _last["picture"]
    return found


def _batch(quads: Quads) -> Any:
    """Rectangles as Blender draws them."""
    values = {"pos": quads.corners, "color": quads.colours}
    return batch_for_shader(_shader(), "TRIS", values, indices=quads.triangles)


def _draw(batch: Any) -> None:
    batch.draw(_shader())


def _shader() -> Any:
    """Return a shader that Blender's window uses already, so that nothing must be compiled."""
    return gpu.shader.from_builtin("FLAT_COLOR")


def _write(text: str, x: float, y: float, colour: tuple[float, ...]) -> None:
    blf.color(0, *colour)
    blf.position(0, x, y, 0)
    blf.draw(0, text)
