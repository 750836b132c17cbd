# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of frames that the window asks for, as messages.

Figures are laid out and drawn once: levels of another frame are put into the same axes, and a
target that is chosen is drawn on top.
"""

from __future__ import annotations

import functools
import importlib
import io
import math
import weakref
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from ...arrays import Real
from ...atomic_files import replaced
from ...errors import RadarSimError
from ...messages import Message
from ...movie_file import png_bytes
from ..maps import power_to_db
from .antennas import plot_coverage
from .echo import EchoAxes, empty_echo
from .figure import TALL_TEXT, Sheet, cell_width, new_figure, range_unit, save_figure, time_unit
from .frame_view import FrameProfile, FrameView, profile_of, read_view
from .map import (
    ColourScale,
    MapAxes,
    SpectrogramAxes,
    empty_map,
    empty_spectrogram,
    label_colours,
)
from .profile import draw_expected_profile

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.text import Text

    from ..radar import Coverage, CoverageCurve
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Size of all pictures [in], and colour of the chosen target in maps and in curves.
WIDTH_IN, HEIGHT_IN = 9.6, 6.4
_CHOSEN, _CHOSEN_LINE = "white", "C1"
#: Maximum number of names in a picture, and the room that each has, as fractions of the axes.
_MOST_NAMES, _NAME_WIDTH, _NAME_HEIGHT = 8, 0.16, 0.05


class _Request(NamedTuple):
    """A picture without its chosen target."""

    folder: str
    frames: tuple[int, ...]
    kind: str
    frame: int
    span_db: float
    width_px: int

    @property
    def view(self) -> FrameView:
        return _view(self.folder, self.frame)

    @property
    def profiles(self) -> list[FrameProfile]:
        """Profiles of all frames."""
        return [_profile(self.folder, frame) for frame in self.frames]

    def scale(self, top: float, noise_power: float = 0.0) -> ColourScale:
        return ColourScale(top, -self.span_db, noise_power, self.view.unit)


@functools.lru_cache(maxsize=8)  # some ten megabytes each
def _view(folder: str, frame: int) -> FrameView:
    return read_view(Path(folder), frame)


@functools.lru_cache(maxsize=4096)
def _profile(folder: str, frame: int) -> FrameProfile:
    return profile_of(_view(folder, frame))


class _Axes(NamedTuple):
    """Axes of a picture, size of their units to the right and up in SI, and their place."""

    axis: Axes
    right: float
    up: float
    sheet: Sheet
    place: dict[str, Any]

    @classmethod
    def of(
        cls,
        figure: Figure,
        axis: Axes,
        units: tuple[float, float],
        changing: Sequence[Artist],
        width_px: int,
    ) -> _Axes:
        """Lay out a figure with finished axes."""
        # a little more than the width, which would else be cut to a whole number below
        sheet = Sheet(figure, changing, (width_px + 0.01) / WIDTH_IN)
        return cls(axis, *units, sheet, _place(axis, units))


def _place(axis: Axes, units: tuple[float, float]) -> dict[str, Any]:
    """Return the edges of axes as fractions of the picture, and the values there in SI."""
    return {
        "box": [float(edge) for edge in axis.get_position().extents],
        "x": [float(end) * units[0] for end in axis.get_xlim()],
        "y": [float(end) * units[1] for end in axis.get_ylim()],
        "log": [axis.get_xscale() == "log", axis.get_yscale() == "log"],
    }


# -- levels over two axes --------------------------------------------------------------------------


class _Levels(NamedTuple):
    """Empty axes, and the parts that change from frame to frame."""

    axes: _Axes
    image: AxesImage
    bar: Colorbar
    title: Text


def _units_of(axes: MapAxes | SpectrogramAxes | EchoAxes) -> tuple[float, float]:
    if isinstance(axes, MapAxes):
        return axes.doppler_unit.size, axes.range_unit.size
    if isinstance(axes, SpectrogramAxes):
        return axes.time_unit.size, axes.doppler_unit.size
    return axes.time.size, 1.0


_EMPTY: dict[str, tuple[Callable[..., tuple[Axes, AxesImage, Colorbar]], str]] = {
    "MAP": (empty_map, "Range-Doppler map"),
    "ECHO": (empty_echo, "Echo"),
    "SPECTROGRAM": (empty_spectrogram, "Spectrogram"),
}


@functools.lru_cache(maxsize=8)
def _empty_levels(
    kind: str, axes: MapAxes | SpectrogramAxes | EchoAxes, floor_db: float, width_px: int
) -> _Levels:
    figure = new_figure(WIDTH_IN, HEIGHT_IN)
    axis, image, bar = _EMPTY[kind][0](figure, axes, floor_db)
    title = axis.set_title(TALL_TEXT, fontsize=10)
    bar.set_label(TALL_TEXT)
    changing = [image, *axis.spines.values(), title, bar.ax.yaxis.label]
    return _Levels(_Axes.of(figure, axis, _units_of(axes), changing, width_px), image, bar, title)


#: What was drawn last into each sheet.
_drawn: weakref.WeakKeyDictionary[Sheet, _Request] = weakref.WeakKeyDictionary()


def _levels(request: _Request) -> _Axes:
    """Put the levels of a frame, and its detections, into axes of their kind."""
    view, kind, name = request.view, request.kind, request.kind.lower()
    cells, power = view.levels(name)
    scale = request.scale(view.tops[name], view.noise_power if kind == "MAP" else 0.0)
    axes, image, bar, title = _empty_levels(kind, cells, scale.floor_db, request.width_px)
    if _drawn.get(axes.sheet) == request:
        return axes
    level = power_to_db(power, scale.reference or 1.0, scale.floor_db)
    image.set_data(level if kind == "ECHO" else level.T)
    label_colours(axes.axis, bar, scale)
    title.set_text(f"{_EMPTY[kind][1]}, {view.title}")
    if kind == "MAP" and view.detections:
        size = 8.0 if len(view.detections) <= 20 else 5.0 if len(view.detections) <= 60 else 2.5
        places = [_place_in_map(item, view.wavelength_m, axes) for item in view.detections]
        axes.axis.plot(*zip(*places, strict=True), "o", ls="", mfc="none", mec="C1", ms=size)
    if kind == "MAP":
        named = [(one["name"], _place_in_map(one, view.wavelength_m, axes)) for one in view.targets]
        write_names(axes.axis, named, "0.9", "black")
    return axes


def write_names(
    axis: Axes, named: Sequence[tuple[str, tuple[float, float]]], colour: str, back: str
) -> None:
    """Write the names of the first targets next to their places; none near another one."""
    taken: list[tuple[float, float]] = []
    to_axes = axis.transData + axis.transAxes.inverted()
    for name, place in named:
        x, y = to_axes.transform(place)
        near = any(abs(x - a) < _NAME_WIDTH and abs(y - b) < _NAME_HEIGHT for a, b in taken)
        if len(taken) == _MOST_NAMES or not name or near or not (0 <= x <= 1 and 0 <= y <= 1):
            continue
        taken.append((x, y))
        left = x > 1 - _NAME_WIDTH
        note = axis.annotate(
            name, place, xytext=(-7 if left else 7, 6), textcoords="offset points",
            ha="right" if left else "left", va="bottom", fontsize=8, color=colour, clip_on=True,
            bbox={"boxstyle": "square,pad=0.1", "fc": back, "ec": "none", "alpha": 0.5},
        )  # fmt: skip
        note.set_in_layout(False)  # or the axes would shrink for it


def _place_in_map(item: Mapping[str, Any], wavelength_m: float, axes: _Axes) -> tuple[float, float]:
    doppler_hz = -2 * item["map_velocity_mps"] / wavelength_m
    return doppler_hz / axes.right, item["map_range_m"] / axes.up


# -- other pictures --------------------------------------------------------------------------------


@functools.lru_cache(maxsize=8)
def _whole(request: _Request) -> _Axes:
    """Draw a picture that has nothing in common with that of another frame."""
    figure, view = new_figure(WIDTH_IN, HEIGHT_IN), request.view
    profiles = [profile_of(view)] if request.kind == "PROFILE" else request.profiles
    scale = request.scale(max(float(one.power.max(initial=0.0)) for one in profiles))
    frames = "1 frame" if len(profiles) == 1 else f"{len(profiles)} frames"
    units = 1.0, 1.0
    if request.kind == "PROFILE":
        range_m = profiles[0].range_m
        axis = draw_expected_profile(figure, range_m, profiles[0].power, scale)
        size = range_unit(float(range_m[-1])).size
        level = power_to_db(profiles[0].power, scale.reference or 1.0, scale.floor_db)
        at = [np.argmin(np.abs(range_m - one["range_m"])) for one in view.targets]
        places = [(float(range_m[n]) / size, float(level[n])) for n in at]
        names = [one["name"] for one in view.targets]
        write_names(axis, list(zip(names, places, strict=True)), "black", "white")
        units, title = (size, 1.0), f"Range profile, {view.title}"
    elif request.kind == "RANGE_TIME":
        axis, units = draw_range_time(figure, profiles, scale)
        title = f"Range profiles, {frames}"
    else:
        axis = draw_plan_position(figure, profiles, scale)
        title = f"Plan position, {frames}"
    axis.set_title(title, fontsize=10)
    return _Axes.of(figure, axis, units, [], request.width_px)


def _draw(fields: Mapping[str, Any]) -> Message:
    """Draw the picture of a request; return the answer with its PNG file as bytes.

    `folder`: of the files of `write_view`; `frames`: all; `kind`, `frame`, `span_db`, `width_px`;
    `chosen`: the target that is marked, or None. The answer has the place of the axes: `box` (left,
    lower, right and upper edge as fractions of the picture), `x` and `y` (values there, in SI), and
    whether these are on a logarithmic scale.
    """
    request = _Request(
        fields["folder"], tuple(fields["frames"]), fields["kind"], fields["frame"],
        fields["span_db"], fields["width_px"],
    )  # fmt: skip
    view, chosen = request.view, fields["chosen"]
    if request.kind in ("RANGE_TIME", "PPI"):  # the same for all frames
        request = request._replace(frame=request.frames[0])
    axes = _levels(request) if request.kind in _EMPTY else _whole(request)
    if _drawn.get(axes.sheet) != request:
        axes.sheet.picture()
        _drawn[axes.sheet] = request
    if chosen is not None:
        _mark(axes, view, request.kind, chosen)
    pixels = axes.sheet.picture(on_top=True)
    dpi = request.width_px / WIDTH_IN
    png = np.frombuffer(png_bytes(pixels, dpi), dtype=np.uint8)
    return Message({"number": fields["number"], "axes": axes.place}, {"png": png})


def _mark(axes: _Axes, view: FrameView, kind: str, chosen: Mapping[str, Any]) -> None:
    """Mark the chosen target: a ring at its place, or a line at its range or Doppler."""
    ring: dict[str, Any] = {"ls": "", "mfc": "none", "mec": _CHOSEN, "ms": 15.0, "mew": 2.0}
    axis = axes.axis
    if kind == "MAP":
        axis.plot(*_place_in_map(chosen, view.wavelength_m, axes), "o", **ring)
    elif kind == "PROFILE":
        axis.axvline(chosen["range_m"] / axes.right, color=_CHOSEN_LINE, lw=1.5)
    elif kind == "SPECTROGRAM":
        doppler_hz = -2 * chosen["map_velocity_mps"] / view.wavelength_m
        axis.axhline(doppler_hz / axes.up, color=_CHOSEN, ls="--", lw=1.2)
    elif kind == "RANGE_TIME":
        axis.plot(view.time_s / axes.right, chosen["range_m"] / axes.up, "o", **ring)


def save_gif(path: Path, files: list[Path], seconds: float) -> None:
    """Write PNG files as an animation that repeats."""
    pillow = importlib.import_module("PIL.Image")
    # all colours of a map within 2 %, where Pillow's own choice is 20 % off at rare ones
    images = [
        pillow.open(file)
        .convert("RGB")
        .quantize(256, method=pillow.Quantize.MAXCOVERAGE, dither=pillow.Dither.NONE)
        for file in files
    ]
    with replaced(path) as temporary:
        images[0].save(
            temporary, format="gif", save_all=True, append_images=images[1:],
            duration=round(1000 * seconds), loop=0,
        )  # fmt: skip


def _coverage(message: Message) -> Message:
    """Draw a coverage diagram and its curve; `file` is written, too."""
    fields, arrays = message.fields, message.arrays
    parts: dict[str, dict[str, Any]] = {"found": {"title": fields["title"]}, "curve": {}}
    parts["curve"]["range_m"] = fields["curve_m"]
    for name, values in arrays.items():
        part, _, name = name.partition(" ")
        parts[part][name] = values
    figure = plot_coverage(*(cast("Any", SimpleNamespace(**one)) for one in parts.values()))
    if "file" in fields:
        save_figure(figure, fields["file"])
    stream = io.BytesIO()
    dpi = (fields["width_px"] + 0.01) / figure.get_figwidth()
    figure.savefig(stream, format="png", dpi=dpi)
    png = np.frombuffer(stream.getvalue(), dtype=np.uint8)
    units = range_unit(float(arrays["found range_m"][-1])).size, 1.0
    place = _place(figure.axes[0], units)
    return Message({"number": fields["number"], "axes": place}, {"png": png})


def coverage_message(found: Coverage, curve: CoverageCurve) -> Message:
    """Return the request for the picture of a coverage diagram."""
    arrays = {
        f"{part} {name}": np.asarray(getattr(item, name))
        for part, item, names in (
            ("found", found, ("range_m", "height_m", "factor", "zone")),
            ("curve", curve, ("factor", "ground_gain", "zone", "two_ray")),
        )
        for name in names
    }
    return Message({"title": found.title, "curve_m": curve.range_m}, arrays)


def answer_request(message: Message) -> Message:
    """Answer a request. Errors of this package become answers."""
    fields = message.fields
    try:
        if "curve_m" in fields:
            return _coverage(message)
        if "gif" in fields:
            files = [Path(file) for file in fields["files"]]
            save_gif(Path(fields["gif"]), files, fields["seconds"])
            return Message({"number": fields["number"]}, {})
        return _draw(fields)
    except (RadarSimError, OSError) as error:
        return Message({"number": fields["number"], "error": str(error)}, {})


# -------------------------------------------------------------------------------------------------
# Pictures of the range profiles of all frames: against time, and by direction (plan position).
# -------------------------------------------------------------------------------------------------

#: Most cells of range in either picture.
_MOST_CELLS = 2000
#: Smallest sector of a plan position, and widest part of a sector that is drawn straight [deg].
_LEAST_SECTOR_DEG, _STRAIGHT_DEG = 0.2, 1.0


def draw_range_time(
    figure: Figure, profiles: Sequence[FrameProfile], scale: ColourScale
) -> tuple[Axes, tuple[float, float]]:
    """Draw profiles side by side: each column shows the frame nearest in time.

    Return the axes, and the size of their units to the right and up [s] and [m].
    """
    order = sorted(profiles, key=lambda one: one.time_s)
    times_s = np.array([one.time_s for one in order])
    gap_s = float(np.median(np.diff(times_s))) if times_s.size > 1 else 1.0
    ends = times_s[0] - gap_s / 2, times_s[-1] + gap_s / 2
    edges_s = np.array([ends[0], *(times_s[1:] + times_s[:-1]) / 2, ends[1]])
    seconds = time_unit(float(np.abs(edges_s).max()))
    edges_m, levels = _common_levels(order, scale)
    length = range_unit(float(edges_m[-1]))
    axis = figure.subplots()
    mesh = axis.pcolormesh(
        edges_s / seconds.size, edges_m / length.size, levels.T,
        vmin=scale.floor_db, vmax=0, cmap="viridis", rasterized=True,
    )  # fmt: skip
    axis.set_xlim(*(edges_s[[0, -1]] / seconds.size).tolist())
    axis.set_ylim(*(edges_m[[0, -1]] / length.size).tolist())
    axis.set_xlabel(f"time [{seconds.name}]")
    axis.set_ylabel(f"one-way range [{length.name}]")
    axis.ticklabel_format(useOffset=False)
    axis.set_facecolor("0.85")
    label_colours(axis, figure.colorbar(mesh, ax=axis, pad=0.02), scale)
    return axis, (seconds.size, length.size)


def draw_plan_position(
    figure: Figure, profiles: Sequence[FrameProfile], scale: ColourScale
) -> Axes:
    """Draw profiles by the direction that the receiver looked in: +Y of the world is up.

    Each direction shows the frame that looked nearest to it, grey where none did. Return the axes.
    """
    order = sorted(profiles, key=lambda one: one.azimuth_deg)
    azimuth_deg = np.array([one.azimuth_deg for one in order])
    after = np.append(azimuth_deg, azimuth_deg[0] + 360)
    gaps = np.diff(after)
    apart = gaps[gaps > _LEAST_SECTOR_DEG]
    # A sector is as wide as the step of the scan; of one direction alone, as the field of view.
    sector = float(np.median(apart)) if apart.size > 1 else profiles[-1].width_deg
    half = max(sector, _LEAST_SECTOR_DEG) / 2
    # it ends half a sector away, or amid the next frame's direction
    up = np.minimum(azimuth_deg + half, (after[1:] + after[:-1]) / 2)
    before = np.insert(azimuth_deg, 0, azimuth_deg[-1] - 360)
    down = np.maximum(azimuth_deg - half, (before[1:] + before[:-1]) / 2)
    edges_m, levels = _common_levels(order, scale)
    length = range_unit(float(edges_m[-1]))
    axis = figure.subplots()
    axis.set_facecolor("0.85")
    edges_deg, columns = [down[:1]], []
    for row, (first, last) in enumerate(zip(down, up, strict=True)):
        if first > edges_deg[-1][-1] + 1e-9:
            edges_deg.append(np.array([first]))
            columns.append(np.full((1, levels.shape[1]), np.nan))
        parts = max(math.ceil((last - first) / _STRAIGHT_DEG), 1)
        edges_deg.append(np.linspace(first, last, parts + 1)[1:])
        columns.append(np.repeat(levels[row][None], parts, axis=0))
    turn = np.radians(np.concatenate(edges_deg))[:, None]
    mesh = axis.pcolormesh(
        np.sin(turn) * edges_m / length.size, np.cos(turn) * edges_m / length.size,
        np.ma.masked_invalid(np.concatenate(columns)),
        vmin=scale.floor_db, vmax=0, cmap="viridis", rasterized=True,
    )  # fmt: skip
    far = edges_m[-1] / length.size
    axis.set_xlim(-far, far)
    axis.set_ylim(-far, far)
    axis.set_aspect("equal")
    axis.set_xlabel(f"east, +X [{length.name}]")
    axis.set_ylabel(f"north, +Y [{length.name}]")
    label_colours(axis, figure.colorbar(mesh, ax=axis, pad=0.02), scale)
    return axis


def _common_levels(profiles: Sequence[FrameProfile], scale: ColourScale) -> tuple[Real, Real]:
    """Return the edges of common range cells [m], and the levels of all profiles there, (profiles,
    cells) [dB]. The cells are no wider than those of any profile; beyond the ends of a profile, its
    levels are NaN.
    """
    widths_m = [cell_width(one.range_m) or 1.0 for one in profiles]
    both = list(zip(profiles, widths_m, strict=True))
    low_m = max(min(float(one.range_m[0]) - width / 2 for one, width in both), 0.0)
    high_m = max(float(one.range_m[-1]) + width / 2 for one, width in both)
    count = math.ceil((high_m - low_m) / min(widths_m) - 1e-6)
    edges_m = np.linspace(low_m, high_m, min(count, _MOST_CELLS) + 1)
    found = np.full((len(profiles), edges_m.size - 1), np.nan)
    for row, (one, width_m) in enumerate(both):
        middle_m = (edges_m[1:] + edges_m[:-1]) / 2
        place = np.rint((middle_m - one.range_m[0]) / width_m).astype(np.int64)
        inside = (place >= 0) & (place < one.range_m.size)
        power = one.power[place[inside]]
        found[row, inside] = power_to_db(power, scale.reference or 1.0, scale.floor_db)
    return edges_m, found
