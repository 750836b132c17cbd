# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels in a picture that neither cover one another nor what they name.

Each label looks for the cheapest of some hundred places around its point: near, within the axes,
off what is drawn. Places over another label or another labelled point, and those whose line to the
point would cross a label, are not taken. A label without a place is left out rather than printed
over others, so the most important come first.
"""

from __future__ import annotations

import functools
import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...array_types import Real

#: Distances of a label from its point [pt], and directions; the first are tried first among equals.
_DISTANCES_PT = (10.0, 18.0, 30.0, 45.0, 65.0, 90.0, 120.0, 155.0)
_DIRECTIONS = tuple(
    2 * math.pi * k / 16 for k in (0, 8, 1, 7, 15, 9, 2, 6, 14, 10, 3, 5, 13, 11, 4, 12)
)
#: What covering the picture costs at most, in points of distance.
_COVER_PT = 80.0
#: Around a labelled point, and around each box [pt].
_POINT_PT, _MARGIN_PT = 7.0, 3.0


@dataclass(frozen=True)
class Label:
    """Text and the point that it names, in the axes' data coordinates."""

    x: float
    y: float
    text: str


@dataclass(frozen=True)
class Box:
    """A rectangle on the canvas [px]."""

    left: float
    bottom: float
    right: float
    top: float

    def grown(self, margin: float) -> Box:
        """With a margin on all sides."""
        return Box(self.left - margin, self.bottom - margin, self.right + margin, self.top + margin)

    def overlaps(self, other: Box) -> bool:
        """Whether they share an area."""
        across = self.left < other.right and other.left < self.right
        return across and self.bottom < other.top and other.bottom < self.top

    def inside(self, other: Box) -> bool:
        """Whether it lies wholly within another one."""
        return (
            self.left >= other.left
            and self.right <= other.right
            and self.bottom >= other.bottom
            and self.top <= other.top
        )

    def crossed_by(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Whether a straight line runs through it (Liang and Barsky's clipping)."""
        first, last = 0.0, 1.0
        for origin, step, low, high in (
            (start[0], end[0] - start[0], self.left, self.right),
            (start[1], end[1] - start[1], self.bottom, self.top),
        ):
            if step == 0:
                if not low < origin < high:
                    return False
                continue
            ends = sorted(((low - origin) / step, (high - origin) / step))
            first, last = max(first, ends[0]), min(last, ends[1])
        return first < last


@functools.cache
def _text_class() -> Any:
    return importlib.import_module("matplotlib.text").Text


def label_box(note: Any) -> Box:
    """Where a label's letters stand, without its line."""
    extent = _text_class().get_window_extent(note, note.figure.canvas.get_renderer())
    return Box(extent.x0, extent.y0, extent.x1, extent.y1)


def place_labels(
    axis: Any,
    labels: Sequence[Label],
    *,
    colour: str = "white",
    back: str = "black",
    drawn: Real | None = None,
    half_cover: float = 40.0,
    fontsize: float = 8.0,
) -> list[Any]:
    """Write labels into finished axes, the first ones first; returns matplotlib's annotations.

    Parameters
    ----------
    axis
        Axes whose limits and other contents are final.
    labels
        Those whose point is outside the axes are left out.
    colour, back
        Of letters and line; of the half-transparent ground behind the letters.
    drawn
        What labels should rather not cover, in data coordinates, (points, 2).
    half_cover
        How many of these points under a label cost half of the most that covering costs.
    fontsize
        In points.
    """
    figure = axis.figure
    figure.draw_without_rendering()  # axes have their place only when the layout is done
    pixel = figure.dpi / 72
    extent = axis.get_window_extent()
    frame = Box(extent.x0, extent.y0, extent.x1, extent.y1).grown(-_MARGIN_PT * pixel)
    seen = np.zeros((0, 2)) if drawn is None else axis.transData.transform(drawn)
    spots = [tuple(axis.transData.transform((label.x, label.y))) for label in labels]
    wanted = [
        (label, spot)
        for label, spot in zip(labels, spots, strict=True)
        if extent.x0 - 1 <= spot[0] <= extent.x1 + 1 and extent.y0 - 1 <= spot[1] <= extent.y1 + 1
    ]
    points = [
        Box(spot[0], spot[1], spot[0], spot[1]).grown(_POINT_PT * pixel) for _, spot in wanted
    ]
    taken: list[Box] = []
    if (legend := axis.get_legend()) is not None:
        box = legend.get_window_extent()
        taken.append(Box(box.x0, box.y0, box.x1, box.y1))
    lines: list[tuple[tuple[float, float], tuple[float, float]]] = []
    notes = []
    for label, spot in wanted:
        note = axis.annotate(
            label.text,
            (label.x, label.y),
            xytext=(0, 0),
            textcoords="offset points",
            ha="left",
            va="bottom",
            fontsize=fontsize,
            color=colour,
            bbox={"boxstyle": "square,pad=0.15", "fc": back, "ec": "none", "alpha": 0.5},
            arrowprops={
                "arrowstyle": "-", "lw": 0.7, "color": colour, "shrinkA": 1, "shrinkB": 3.5,
            },
        )  # fmt: skip
        note.set_in_layout(False)  # or the axes would shrink for it
        size = label_box(note)
        box = _cheapest(
            spot, size.right - size.left, size.top - size.bottom, pixel, frame, [*taken, *points],
            taken, lines, seen, half_cover,
        )  # fmt: skip
        if box is None:
            note.remove()
            continue
        note.xyann = ((box.left - spot[0]) / pixel, (box.bottom - spot[1]) / pixel)
        taken.append(box.grown(_MARGIN_PT * pixel))
        lines.append((spot, _middle(box)))
        notes.append(note)
    return notes


def _middle(box: Box) -> tuple[float, float]:
    return (box.left + box.right) / 2, (box.bottom + box.top) / 2


def _cheapest(
    spot: tuple[float, float],
    width: float,
    height: float,
    pixel: float,
    frame: Box,
    solid: Sequence[Box],
    boxes: Sequence[Box],
    lines: Sequence[tuple[tuple[float, float], tuple[float, float]]],
    seen: Real,
    half_cover: float,
) -> Box | None:
    """The best place of one label around its point; None: there is none."""
    best, least = None, math.inf
    for distance in _DISTANCES_PT:
        if distance >= least:
            break
        for angle in _DIRECTIONS:
            x = spot[0] + math.cos(angle) * (distance * pixel + width / 2)
            y = spot[1] + math.sin(angle) * (distance * pixel + height / 2)
            box = Box(x - width / 2, y - height / 2, x + width / 2, y + height / 2)
            room = box.grown(_MARGIN_PT * pixel)
            if not box.inside(frame) or any(room.overlaps(other) for other in solid):
                continue
            if any(other.crossed_by(spot, (x, y)) for other in boxes):
                continue
            if any(room.crossed_by(*line) for line in lines):
                continue
            count = np.count_nonzero(
                (seen[:, 0] > box.left)
                & (seen[:, 0] < box.right)
                & (seen[:, 1] > box.bottom)
                & (seen[:, 1] < box.top)
            )
            cost = distance + _COVER_PT * count / (count + half_cover)
            if cost < least:
                best, least = box, cost
    return best
