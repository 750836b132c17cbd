# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers at points of a picture, and the texts that belong to them below it."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .figure import lay_out

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

#: Places of a number around its point [pt]; the first one that is free is used.
_OFFSETS_PT = tuple(
    (far * across, far * up)
    for far in (1, 2, 3)
    for across, up in ((9, 8), (-9, 8), (9, -8), (-9, -8), (0, 12), (0, -12), (13, 0), (-13, 0))
)
#: Half of the width and height of a number [pt].
_HALF_PT = 4.5


def number_points(
    figure: Figure,
    axis: Axes,
    points: Sequence[tuple[float, float]],
    texts: Sequence[str],
    *,
    colour: str = "white",
    back: str = "black",
    left: bool = False,
) -> list[Annotation]:
    """Number points of finished axes, in data coordinates, and list their texts below the figure.

    Returns the numbers, from "1". A number covers neither another one nor a point nor the legend as
    long as one of the places around its point is free; with `left` it tries the left of the point
    first.
    """
    if not points:
        return []
    from_bounds = importlib.import_module("matplotlib.transforms").Bbox.from_bounds
    list_texts(figure, texts)
    lay_out(figure)
    pixel = figure.dpi / 72
    frame = axis.get_window_extent().padded(-_HALF_PT * pixel)

    def box(x: float, y: float) -> Bbox:
        found: Bbox = from_bounds(x, y, 0, 0).padded(_HALF_PT * pixel)
        return found

    spots = [axis.transData.transform(point) for point in points]
    taken = [box(*spot) for spot in spots]
    if (legend := axis.get_legend()) is not None:
        taken.append(legend.get_window_extent())
    notes = []
    for number, (point, (x, y)) in enumerate(zip(points, spots, strict=True), start=1):
        offsets = [(-across if left else across, up) for across, up in _OFFSETS_PT]
        places = [(x + across * pixel, y + up * pixel) for across, up in offsets]
        costs = [
            (not frame.contains(*place), box(*place).count_overlaps(taken)) for place in places
        ]
        best = costs.index(min(costs))
        taken.append(box(*places[best]))
        note = axis.annotate(
            str(number), point, xytext=offsets[best], textcoords="offset points", ha="center",
            va="center", fontsize=8, color=colour,
            bbox={"boxstyle": "square,pad=0.1", "fc": back, "ec": "none", "alpha": 0.5},
            arrowprops={
                "arrowstyle": "-", "lw": 0.7, "color": colour, "shrinkA": 0, "shrinkB": 5
            },
        )  # fmt: skip
        note.set_in_layout(False)  # or the axes would shrink for it
        notes.append(note)
    return notes


def list_texts(figure: Figure, texts: Sequence[str]) -> Legend:
    """List numbered texts below the axes of a figure."""
    line = importlib.import_module("matplotlib.lines").Line2D
    handles = [
        line([], [], ls="", marker=f"${number}$", color="black", mew=0, label=text)
        for number, text in enumerate(texts, start=1)
    ]
    return figure.legend(
        handles=handles, loc="outside lower center", ncols=len(texts), fontsize=8, frameon=False,
        handletextpad=0.2,
    )  # fmt: skip
