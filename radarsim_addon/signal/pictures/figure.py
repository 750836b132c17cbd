# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of the results. matplotlib is imported with the first one, and pyplot never.

Each function returns a matplotlib Figure: a notebook shows it, :func:`save_figure` writes it.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...atomic_files import replaced
from ...errors import MissingDependencyError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Pixels per inch of files.
DPI = 120


def has_matplotlib() -> bool:
    """Whether matplotlib is installed.

    Returns
    -------
    bool
        True if pictures can be drawn.
    """
    return importlib.util.find_spec("matplotlib") is not None


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure that does not belong to pyplot.

    Parameters
    ----------
    width_in, height_in
        Size [inches].

    Returns
    -------
    matplotlib.figure.Figure
        With constrained layout and an Agg canvas.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    """
    if not has_matplotlib():
        raise MissingDependencyError(
            "matplotlib is not installed, so no pictures can be drawn. Install it with "
            "'pip install matplotlib', or process without plots."
        )
    # A Figure of its own: no window system, no state shared with the caller's pyplot.
    figure = _figure_class()(figsize=(width_in, height_in), layout="constrained")
    importlib.import_module("matplotlib.backends.backend_agg").FigureCanvasAgg(figure)
    return figure


@functools.cache
def _figure_class() -> type[Figure]:
    """Return a subclass of matplotlib's Figure that a notebook shows without pyplot."""

    def as_png(figure: Figure) -> bytes:
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=100)
        return stream.getvalue()

    base = importlib.import_module("matplotlib.figure").Figure
    return type("Figure", (base,), {"_repr_png_": as_png})


def scale_on_top(axis: Axes, factor: float, label: str) -> None:
    """Draw a second scale at the top of axes: the numbers of the lower one times `factor`."""
    upper = axis.secondary_xaxis(
        "top", functions=(lambda x: np.multiply(x, factor), lambda x: np.divide(x, factor))
    )
    upper.ticklabel_format(axis="x", useOffset=False)
    upper.set_xlabel(label)


def lay_out(figure: Figure) -> None:
    """Give all axes their places, once: what is drawn later leaves them there.

    The layout takes as long as all drawing, and would else be found again with each drawing.
    """
    for axes in figure.axes:
        for spine in axes.spines.values():
            # no further out than the ticks and their texts, which it would have made again
            spine.set_in_layout(False)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")


def save_figure(figure: Figure, path: str | Path, dpi: int = DPI) -> Path:
    """Write a figure as PNG under a temporary name, then rename it.

    Parameters
    ----------
    figure
        Figure to write.
    path
        File to write; its folder must exist.
    dpi
        Pixels per inch.

    Returns
    -------
    Path
        The file.
    """
    path = Path(path)
    lay_out(figure)
    with replaced(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png")
    return path
