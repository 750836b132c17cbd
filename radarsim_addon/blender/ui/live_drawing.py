# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the live preview into a corner of a 3D view."""

from __future__ import annotations

import functools
from typing import Any

import blf
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...signal.draft import Message
from .live_picture import SPAN_DB, Box, LivePicture, lay_out_draft, level_colours

_BACK = (0.07, 0.07, 0.07, 0.86)
_GRID, _CURVE, _PEAK = (1.0, 1.0, 1.0, 0.13), (0.34, 0.71, 0.91, 1.0), (0.90, 0.62, 0.0, 1.0)
_BRIGHT, _DIM = (1.0, 1.0, 1.0, 1.0), (0.82, 0.82, 0.82, 1.0)
_FONT_PX, _MARGIN_PX = 11, 12
_TWO_TRIANGLES = ((0, 1, 2), (0, 2, 3))
#: Parts of the picture. The first drawing of each compiles what draws it, and takes long: one part
#: more is drawn each time.
_PARTS = 4
#: Rows of the strip of colours.
_STRIP_ROWS = 64
#: The last draft as a texture, by what it was drawn from: views are drawn all the time.
_last: dict[str, Any] = {}


def draw_live(context: Any, draft: Message | None, lines: list[str]) -> None:
    """Draw a draft and its lines of text; without one the lines alone."""
    scale = float(context.preferences.system.ui_scale)
    corner = (context.region.width - _sidebar_px(context) - _MARGIN_PX * scale, _MARGIN_PX * scale)
    gpu.state.blend_set("ALPHA")
    blf.size(0, _FONT_PX * scale)
    if draft is None:
        width = max(blf.dimensions(0, line)[0] for line in lines) + 20 * scale
        box = Box(
            corner[0] - width, corner[1], corner[0], corner[1] + (16 * len(lines) + 10) * scale
        )
        _fill(box, _BACK)
        for row, line in enumerate(lines):
            y = box.top - 16 * (row + 1) * scale
            _write(line, box.left + 10 * scale, y, _BRIGHT if row == 0 else _DIM)
    else:
        picture = _picture(draft, lines, corner, scale)
        if picture.panel.left > 0:
            _draw(picture, scale)
    gpu.state.blend_set("NONE")


def forget_drawing() -> None:
    """Free the texture of the last draft."""
    _last.clear()


def is_drawn_in_part() -> bool:
    """Whether the next drawing adds a part that this one left out."""
    return bool(_last.get("parts", _PARTS) < _PARTS)


def _sidebar_px(context: Any) -> int:
    """Width of the sidebar where it lies over the view."""
    if not context.preferences.system.use_region_overlap:
        return 0
    return sum(region.width for region in context.area.regions if region.type == "UI")


def _picture(
    draft: Message, lines: list[str], corner: tuple[float, float], scale: float
) -> LivePicture:
    key = (draft.fields["number"], draft.fields["level"], tuple(lines), corner, scale)
    if _last.get("key") != key:
        picture = lay_out_draft(draft.fields, draft.arrays, lines, corner, scale)
        strip = level_colours(10 ** (np.linspace(-SPAN_DB, 0, _STRIP_ROWS) / 10)[:, None], 0.0)
        _last.update(key=key, picture=picture, map=_texture(picture.colours), strip=_texture(strip))
    found: LivePicture = _last["picture"]
    return found


def _texture(colours: Any) -> Any:
    if colours is None:
        return None
    rows, columns = colours.shape[:2]
    # the frame buffer encodes what shaders of images write, which is linear
    values = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    values = np.ascontiguousarray(values, dtype=np.float32).ravel()
    data = gpu.types.Buffer("FLOAT", values.size, values)
    return gpu.types.GPUTexture((columns, rows), format="RGBA16F", data=data)


def _draw(picture: LivePicture, scale: float) -> None:
    parts = _last["parts"] = min(_last.get("parts", 0) + 1, _PARTS)
    _fill(picture.panel, _BACK)
    if parts > 1:
        for name, box in (("map", picture.map), ("strip", picture.strip)):
            if _last[name] is not None:
                _put(_last[name], box)
    if parts > 2:
        _draw_lines(picture, scale)
    if parts > 3:
        for text in picture.texts:
            width = blf.dimensions(0, text.text)[0]
            x = text.x - {"left": 0.0, "centre": 0.5, "right": 1.0}[text.anchor] * width
            _write(text.text, x, text.y, _BRIGHT if text.bright else _DIM)


def _draw_lines(picture: LivePicture, scale: float) -> None:
    _lines(picture.grid, _GRID, "LINES", scale)
    if len(picture.noise):
        _lines(picture.noise, _PEAK, "LINES", 1.2 * scale)
    if len(picture.curve):
        _lines(picture.curve, _CURVE, "LINE_STRIP", 1.6 * scale)
    if picture.mark is not None:
        angle = np.linspace(0, 2 * np.pi, 25)
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1) * 4 * scale + picture.mark
        _lines(ring, _PEAK, "LINE_STRIP", 1.4 * scale)


def _write(text: str, x: float, y: float, colour: tuple[float, ...]) -> None:
    blf.color(0, *colour)
    blf.position(0, x, y, 0)
    blf.draw(0, text)


@functools.cache
def _shader(name: str) -> Any:
    return gpu.shader.from_builtin(name)


def _corners(box: Box) -> list[tuple[float, float]]:
    return [
        (box.left, box.bottom), (box.right, box.bottom), (box.right, box.top), (box.left, box.top),
    ]  # fmt: skip


def _fill(box: Box, colour: tuple[float, ...]) -> None:
    shader = _shader("UNIFORM_COLOR")
    batch = batch_for_shader(shader, "TRIS", {"pos": _corners(box)}, indices=_TWO_TRIANGLES)
    shader.uniform_float("color", colour)
    batch.draw(shader)


def _put(texture: Any, box: Box) -> None:
    shader = _shader("IMAGE")
    places = [(0, 0), (1, 0), (1, 1), (0, 1)]
    values = {"pos": _corners(box), "texCoord": places}
    batch = batch_for_shader(shader, "TRIS", values, indices=_TWO_TRIANGLES)
    shader.uniform_sampler("image", texture)
    batch.draw(shader)


def _lines(points: Any, colour: tuple[float, ...], kind: str, width_px: float) -> None:
    shader = _shader("POLYLINE_UNIFORM_COLOR")
    places = np.column_stack([points, np.zeros(len(points))]).astype(np.float32)
    batch = batch_for_shader(shader, kind, {"pos": places})
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", width_px)
    shader.uniform_float("color", colour)
    batch.draw(shader)
