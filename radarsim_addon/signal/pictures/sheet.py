# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures whose axes are drawn once for many pictures: of frames with the same axes.

Axes with their ticks and texts take longer to make, to lay out and to draw than what differs from
frame to frame. A sheet is laid out with texts of its own, so that a picture does not depend on
those drawn before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...atomic_files import replaced
from ...png import png_bytes
from .figure import DPI, lay_out

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

#: Text as high as any, in place of one that changes.
TALL_TEXT = "[(|g"


class Sheet:
    """A figure that is laid out and drawn once, but for what changes.

    Parameters
    ----------
    figure
        The figure; nothing but `changing` will change in it.
    changing
        What changes, in the order in which it is drawn.
    """

    def __init__(self, figure: Figure, changing: Sequence[Artist], dpi: int = DPI) -> None:
        figure.set_dpi(dpi)
        lay_out(figure)
        self._figure, self._changing = figure, changing
        canvas: Any = figure.canvas
        children = [child for part in (figure, *figure.axes) for child in part.get_children()]
        # The labels of an axis are no children: animated or not, it draws them. A title that is
        # not visible would lose its place.
        labels = [artist for artist in changing if artist not in children]
        for artist in changing:
            artist.set_animated(True)
        for label in labels:
            label.set_visible(False)
        canvas.draw()
        for label in labels:
            label.set_visible(True)
        self._canvas, self._empty = canvas, canvas.copy_from_bbox(figure.bbox)
        self._still = set(self._children())

    def _children(self) -> list[Artist]:
        """All but those of axes that change themselves."""
        still = [axes for axes in self._figure.axes if axes not in self._changing]
        return [child for part in (self._figure, *still) for child in part.get_children()]

    def picture(self) -> NDArray[np.uint8]:
        """Draw what has changed and what was added, and remove that; (height, width, 3)."""
        added = [child for child in self._children() if child not in self._still]
        self._canvas.restore_region(self._empty)
        renderer = self._canvas.get_renderer()
        for artist in (*self._changing, *sorted(added, key=lambda child: child.get_zorder())):
            artist.draw(renderer)
        pixels = np.array(self._canvas.buffer_rgba())[..., :3]
        for artist in added:
            artist.remove()
        return pixels


def save_picture(pixels: NDArray[np.uint8], path: Path) -> Path:
    """Write a picture (height, width, 3) as PNG; return the file."""
    with replaced(path) as temporary:
        temporary.write_bytes(png_bytes(pixels, DPI))
    return path
