# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the live preview into a corner of a 3D view."""

from __future__ import annotations

from typing import Any

import blf
import gpu
from gpu_extras.batch import batch_for_shader

from ...signal.draft import Message
from .live_picture import Box, LivePicture, lay_out_draft
from .live_quads import BACK, Quads, filled, picture_quads

_BRIGHT, _DIM = (1.0, 1.0, 1.0, 1.0), (0.82, 0.82, 0.82, 1.0)
_FONT_PX, _MARGIN_PX = 11, 12
#: The last draft as rectangles, by what they were made from: views are drawn all the time.
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
        _draw(_batch(filled(box, BACK)))
        for row, line in enumerate(lines):
            y = box.top - 16 * (row + 1) * scale
            _write(line, box.left + 10 * scale, y, _BRIGHT if row == 0 else _DIM)
    else:
        picture = _picture(draft, lines, corner, scale)
        if picture.panel.left > 0:
            _draw(_last["batch"])
            for text in picture.texts:
                width = blf.dimensions(0, text.text)[0]
                x = text.x - {"left": 0.0, "centre": 0.5, "right": 1.0}[text.anchor] * width
                _write(text.text, x, text.y, _BRIGHT if text.bright else _DIM)
    gpu.state.blend_set("NONE")


def forget_drawing() -> None:
    """Free the rectangles of the last draft."""
    _last.clear()


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
    """One that Blender's own window uses, so that nothing is compiled."""
    return gpu.shader.from_builtin("FLAT_COLOR")


def _write(text: str, x: float, y: float, colour: tuple[float, ...]) -> None:
    blf.color(0, *colour)
    blf.position(0, x, y, 0)
    blf.draw(0, text)
