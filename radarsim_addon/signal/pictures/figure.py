# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the results. matplotlib is imported when the first one is made, and never pyplot.

Each function returns a matplotlib Figure: a notebook shows it, :func:`save_figure` writes it.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import io
from pathlib import Path
from typing import Any

from ...atomic_files import replaced
from ...errors import MissingDependencyError


def has_matplotlib() -> bool:
    """Whether pictures can be made."""
    return importlib.util.find_spec("matplotlib") is not None


def new_figure(width_in: float, height_in: float) -> Any:
    """An empty figure that belongs to nobody's pyplot.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    """
    if not has_matplotlib():
        raise MissingDependencyError(
            "matplotlib is not installed; it draws the pictures. Install it with "
            "'pip install matplotlib', or process without plots."
        )
    # A Figure of its own: no window system, no state shared with the caller's pyplot.
    figure = _figure_class()(figsize=(width_in, height_in), layout="constrained")
    importlib.import_module("matplotlib.backends.backend_agg").FigureCanvasAgg(figure)
    return figure


@functools.cache
def _figure_class() -> Any:
    """matplotlib's Figure that a notebook shows by itself, without pyplot."""

    def as_png(figure: Any) -> bytes:
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=100)
        return stream.getvalue()

    base = importlib.import_module("matplotlib.figure").Figure
    return type("Figure", (base,), {"_repr_png_": as_png})


def save_figure(figure: Any, path: str | Path, dpi: int = 120) -> Path:
    """Write a figure as PNG under a temporary name, then rename."""
    path = Path(path)
    with replaced(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png")
    return path
