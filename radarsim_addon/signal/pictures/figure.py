# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared parts of all figures. matplotlib is imported with the first one, and pyplot never.

Numbers for people have no "-0.0", as many digits as the cells support, km for long ranges; stored
values are never rounded. Cells beyond the resolution of a screen are joined, and the strongest
counts: a picture with more rows than pixels would omit rows, and with them targets of one row.

Axes with their ticks and texts take longer to make, to lay out and to draw than what differs from
frame to frame. A `Sheet` is laid out with texts of its own, so that a picture does not depend on
those drawn before it.
"""

from __future__ import annotations

import functools
import importlib
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arrays import Real
from ...atomic_files import replaced
from ...movie_file import png_bytes

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.legend import Legend
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox


#: Most cells along an axis of a picture of levels; more are joined.
MOST_CELLS = 640
#: Maximum number of decimals: float64 holds no more of a range of metres.
_MOST_DIGITS = 12
#: Pixels per inch of files.
DPI = 120
#: Text as high as any, in place of one that changes.
TALL_TEXT = "[(|g"
#: Places of a number around its point [pt]; the first one that is free is used.
_OFFSETS_PT = tuple(
    (far * across, far * up)
    for far in (1, 2, 3)
    for across, up in ((9, 8), (-9, 8), (9, -8), (-9, -8), (0, 12), (0, -12), (13, 0), (-13, 0))
)
#: Half of the width and height of a number [pt].
_HALF_PT = 4.5


@dataclass(frozen=True)
class Unit:
    """Symbol of a unit such as "km", and its size in SI units."""

    name: str
    size: float


def fixed(value: float, decimals: int, *, signed: bool = False) -> str:
    """Return a number with `decimals` decimals; zero has no sign, `signed` gives positive ones a
    plus.
    """
    text = f"{value:{'+' if signed else ''}z.{decimals}f}"
    # the option z takes the minus from zero, not the plus
    return text[1:] if text.startswith("+") and not float(text) else text


def decimals_for(step: float) -> int:
    """Return the number of decimals that shows a tenth of a step; 0 if it is not finite or
    positive.
    """
    if not (math.isfinite(step) and step > 0):
        return 0
    return min(max(math.ceil(1 - math.log10(step) - 1e-9), 0), _MOST_DIGITS)


def cell_width(centres: ArrayLike) -> float:
    """Return the distance between the evenly spaced cells of an axis; 0 for a single cell."""
    values = np.asarray(centres, dtype=np.float64)
    return float(abs(values[1] - values[0])) if values.size > 1 else 0.0


def _chosen(units: tuple[tuple[float, Unit], ...], largest: float) -> Unit:
    for least, unit in units:
        if abs(largest) >= least:
            return unit
    return units[-1][1]


def range_unit(largest_m: float) -> Unit:
    """Return km from 20 km, mm below half a metre, else m, by the longest range of an axis [m]."""
    units = ((20e3, Unit("km", 1e3)), (0.5, Unit("m", 1.0)), (0.0, Unit("mm", 1e-3)))
    return _chosen(units, largest_m) if largest_m > 0 else Unit("m", 1.0)


def speed_unit(largest_mps: float) -> Unit:
    """Return km/s from 5 km/s, mm/s below 0.1 m/s, else m/s."""
    units = ((5e3, Unit("km/s", 1e3)), (0.1, Unit("m/s", 1.0)), (0.0, Unit("mm/s", 1e-3)))
    return _chosen(units, largest_mps) if largest_mps > 0 else Unit("m/s", 1.0)


def frequency_unit(largest_hz: float) -> Unit:
    """Return MHz from 10 MHz, kHz from 10 kHz, else Hz."""
    return _chosen(
        ((1e7, Unit("MHz", 1e6)), (1e4, Unit("kHz", 1e3)), (0, Unit("Hz", 1.0))), largest_hz
    )


def time_unit(largest_s: float) -> Unit:
    """Return s from 1 s, ms from 1 ms, ns below 0.1 us, else us."""
    units = (
        (1.0, Unit("s", 1.0)),
        (1e-3, Unit("ms", 1e-3)),
        (1e-7, Unit("µs", 1e-6)),
        (0.0, Unit("ns", 1e-9)),
    )
    return _chosen(units, largest_s)


def reference_text(power: float, unit: str) -> str:
    """Return the power of 0 dB as text such as " = -73.1 dBW"; "" if its unit is unknown."""
    if not (unit and power > 0):
        return ""
    return f" = {with_minus(fixed(10 * math.log10(power), 1))} {unit}"


def with_minus(text: str) -> str:
    """Replace hyphens before digits by minus signs, as on matplotlib's axes."""
    return re.sub(r"-(?=[\d.])", "\N{MINUS SIGN}", text)


@dataclass(frozen=True)
class CellAxis:
    """Outer edges of the joined cells of a picture's axis, in the axis' unit.

    `end` is the outer edge of the last cell before joining: the last joined cell may extend beyond
    it. `step` is the number of cells joined to one.
    """

    low: float
    high: float
    end: float
    step: int


def cell_axis(centres: Real, most: int, unit_size: float = 1.0, single: float = 1.0) -> CellAxis:
    """Return the axis of evenly spaced cells of which at most `most` are drawn.

    `centres` (cells,) ascend, in SI units; `unit_size` is SI units per unit of the picture,
    `single` the width of a lone cell in SI units.
    """
    width = cell_width(centres) or single
    step = -(-centres.size // most)
    low = float(centres[0]) - width / 2
    high = low + -(-centres.size // step) * step * width
    end = float(centres[-1]) + width / 2
    return CellAxis(low / unit_size, high / unit_size, end / unit_size, step)


def strongest(values: Real, steps: Sequence[int]) -> Real:
    """Return the largest of `steps` adjacent values along each axis."""
    for axis, step in enumerate(steps):
        if step > 1:
            values = np.maximum.reduceat(values, np.arange(0, values.shape[axis], step), axis=axis)
    return values


def cell_image(axis: Axes, across: CellAxis, up: CellAxis, **style: Any) -> AxesImage:
    """Draw empty levels over the cells of two axes, which end with the last whole cell."""
    image = axis.imshow(
        np.zeros((1, 1)), aspect="auto", origin="lower", interpolation="nearest",
        extent=(across.low, across.high, up.low, up.high), **style,
    )  # fmt: skip
    axis.set_xlim(across.low, across.end)
    axis.set_ylim(up.low, up.end)
    return image


def say_empty(axis: Axes, colour: str, size: float = 14) -> None:
    """Write in the middle of axes that there is no echo."""
    axis.text(
        0.5, 0.5, "no echo", color=colour, fontsize=size, ha="center", va="center",
        transform=axis.transAxes,
    )  # fmt: skip


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure with constrained layout that does not belong to pyplot."""
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


def second_scale(
    axis: Axes, factor: float, label: str, side: Literal["top", "bottom"] = "top"
) -> None:
    """Draw a second scale above or below axes: the numbers of the first one times `factor`."""
    second = axis.secondary_xaxis(
        side, functions=(lambda x: np.multiply(x, factor), lambda x: np.divide(x, factor))
    )
    second.ticklabel_format(axis="x", useOffset=False)
    second.set_xlabel(label)


def lay_out(figure: Figure) -> None:
    """Place all axes once. Whatever is drawn later does not move them.

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


class Sheet:
    """A figure that is laid out and drawn once. The parts `changing` are drawn again for each
    picture, in this order.
    """

    def __init__(self, figure: Figure, changing: Sequence[Artist], dpi: float = DPI) -> None:
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
        self._last = self._empty

    def _children(self) -> list[Artist]:
        """Return all parts, except the parts of axes that change themselves."""
        still = [axes for axes in self._figure.axes if axes not in self._changing]
        return [child for part in (self._figure, *still) for child in part.get_children()]

    def picture(self, on_top: bool = False) -> NDArray[np.uint8]:
        """Draw the changing parts and the added ones, then remove the added ones. Return (height,
        width, 3).

        `on_top`: draw what was added over the last picture that was drawn without it.
        """
        added = [child for child in self._children() if child not in self._still]
        self._canvas.restore_region(self._last if on_top else self._empty)
        renderer = self._canvas.get_renderer()
        changing = () if on_top else self._changing
        for artist in (*changing, *sorted(added, key=lambda child: child.get_zorder())):
            artist.draw(renderer)
        pixels = np.array(self._canvas.buffer_rgba())[..., :3]
        for artist in added:
            artist.remove()
        if not on_top:
            self._last = self._canvas.copy_from_bbox(self._figure.bbox)
        return pixels


def save_picture(pixels: NDArray[np.uint8], path: Path) -> Path:
    """Write a picture (height, width, 3) as PNG; return the file."""
    with replaced(path) as temporary:
        temporary.write_bytes(png_bytes(pixels, DPI))
    return path


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
