# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of frames that the window asks for, as messages.

A figure is laid out and drawn once; a target that is chosen is drawn on top of it.
"""

from __future__ import annotations

import functools
import importlib
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from ...atomic_files import replaced
from ...errors import RadarSimError
from ...messages import Message
from ...movie_file import png_bytes
from ..maps import power_to_db
from .antennas import plot_coverage
from .echo import draw_echo_levels
from .figure import Sheet, new_figure, range_unit, save_figure
from .frame_view import FrameView, profile_of, read_view
from .map import ColourScale, MapAxes, draw_spectrogram, empty_map, label_colours
from .profile import draw_expected_profile
from .scan import draw_plan_position, draw_range_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..radar import Coverage, CoverageCurve

#: Size of all pictures [in], and colour of the chosen target in maps and in curves.
WIDTH_IN, HEIGHT_IN = 9.6, 6.4
_CHOSEN, _CHOSEN_LINE = "white", "C1"


class _Request(NamedTuple):
    """A picture without its chosen target."""

    folder: str
    frames: tuple[int, ...]
    kind: str
    frame: int
    span_db: float
    width_px: int


@dataclass(frozen=True)
class _Drawn:
    """Axes of a picture, and size of their units to the right and up in SI."""

    axis: Axes
    right: float = 1.0
    up: float = 1.0


def _scale(view: FrameView, top: float, request: _Request, noise_power: float = 0.0) -> ColourScale:
    return ColourScale(top, -request.span_db, noise_power, view.unit)


def _map(figure: Figure, view: FrameView, request: _Request) -> _Drawn:
    axes: MapAxes
    axes, power = view.levels("map")
    scale = _scale(view, view.tops["map"], request, view.noise_power)
    axis, image, bar = empty_map(figure, axes, scale.floor_db)
    image.set_data(power_to_db(power, scale.reference or 1.0, scale.floor_db).T)
    label_colours(axis, bar, scale)
    drawn = _Drawn(axis, axes.doppler_unit.size, axes.range_unit.size)
    if view.detections:
        size = 8.0 if len(view.detections) <= 20 else 5.0 if len(view.detections) <= 60 else 2.5
        places = [_place_in_map(item, view.wavelength_m, drawn) for item in view.detections]
        axis.plot(*zip(*places, strict=True), "o", ls="", mfc="none", mec="C1", ms=size)
    axis.set_title(f"Range-Doppler map, {view.title}", fontsize=10)
    return drawn


def _place_in_map(
    item: Mapping[str, Any], wavelength_m: float, drawn: _Drawn
) -> tuple[float, float]:
    doppler_hz = -2 * item["map_velocity_mps"] / wavelength_m
    return doppler_hz / drawn.right, item["map_range_m"] / drawn.up


def _profile(figure: Figure, view: FrameView, request: _Request) -> _Drawn:
    range_m, power = view.arrays["profile_range_m"], view.arrays["profile"]
    top = float(power.max(initial=0.0))
    axis = draw_expected_profile(figure, range_m, power, _scale(view, top, request))
    axis.set_title(f"Range profile, {view.title}", fontsize=10)
    return _Drawn(axis, range_unit(float(range_m[-1])).size)


def _echo(figure: Figure, view: FrameView, request: _Request) -> _Drawn:
    axes, power = view.levels("echo")
    axis = draw_echo_levels(figure, power, axes, _scale(view, view.tops["echo"], request))
    axis.set_title(f"Echo, {view.title}", fontsize=10)
    return _Drawn(axis, axes.time.size)


def _spectrogram(figure: Figure, view: FrameView, request: _Request) -> _Drawn:
    axes, power = view.levels("spectrogram")
    scale = _scale(view, view.tops["spectrogram"], request)
    axis = draw_spectrogram(figure, power, axes, scale)
    axis.set_title(f"Spectrogram, {view.title}", fontsize=10)
    return _Drawn(axis, axes.time_unit.size, axes.doppler_unit.size)


def _range_time(figure: Figure, view: FrameView, request: _Request) -> _Drawn:
    profiles = [profile_of(_view(request.folder, frame)) for frame in request.frames]
    top = max(float(one.power.max(initial=0.0)) for one in profiles)
    axis, units = draw_range_time(figure, profiles, _scale(view, top, request))
    axis.set_title(f"Range profiles of {len(profiles)} frames", fontsize=10)
    return _Drawn(axis, *units)


def _plan_position(figure: Figure, view: FrameView, request: _Request) -> _Drawn:
    profiles = [profile_of(_view(request.folder, frame)) for frame in request.frames]
    top = max(float(one.power.max(initial=0.0)) for one in profiles)
    axis = draw_plan_position(figure, profiles, _scale(view, top, request))
    axis.set_title(f"Plan position, {len(profiles)} frames", fontsize=10)
    return _Drawn(axis)


_KINDS: dict[str, Callable[[Figure, FrameView, _Request], _Drawn]] = {
    "MAP": _map,
    "PROFILE": _profile,
    "ECHO": _echo,
    "SPECTROGRAM": _spectrogram,
    "RANGE_TIME": _range_time,
    "PPI": _plan_position,
}


@functools.lru_cache(maxsize=256)
def _view(folder: str, frame: int) -> FrameView:
    return read_view(Path(folder), frame)


@functools.lru_cache(maxsize=8)
def _sheet(request: _Request) -> tuple[_Drawn, Sheet, dict[str, Any]]:
    """Return a picture that is laid out and drawn, and the place of its axes."""
    figure = new_figure(WIDTH_IN, HEIGHT_IN)
    drawn = _KINDS[request.kind](figure, _view(request.folder, request.frame), request)
    # a little more than the width, which would else be cut to a whole number below
    sheet = Sheet(figure, [], (request.width_px + 0.01) / WIDTH_IN)
    box, axis = drawn.axis.get_position(), drawn.axis
    place = {
        "box": [float(edge) for edge in box.extents],
        "x": [float(end) * drawn.right for end in axis.get_xlim()],
        "y": [float(end) * drawn.up for end in axis.get_ylim()],
        "log": [axis.get_xscale() == "log", axis.get_yscale() == "log"],
    }
    return drawn, sheet, place


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
    drawn, sheet, place = _sheet(request)
    chosen = fields["chosen"]
    if chosen is not None:
        _mark(drawn, _view(request.folder, request.frame), request.kind, chosen)
    dpi = request.width_px / WIDTH_IN
    png = np.frombuffer(png_bytes(sheet.picture(), dpi), dtype=np.uint8)
    return Message({"number": fields["number"], "axes": place}, {"png": png})


def _mark(drawn: _Drawn, view: FrameView, kind: str, chosen: Mapping[str, Any]) -> None:
    """Mark the chosen target: a ring at its place, or a line at its range or Doppler."""
    ring: dict[str, Any] = {"ls": "", "mfc": "none", "mec": _CHOSEN, "ms": 15.0, "mew": 2.0}
    axis = drawn.axis
    if kind == "MAP":
        axis.plot(*_place_in_map(chosen, view.wavelength_m, drawn), "o", **ring)
    elif kind == "PROFILE":
        axis.axvline(chosen["range_m"] / drawn.right, color=_CHOSEN_LINE, lw=1.5)
    elif kind == "SPECTROGRAM":
        doppler_hz = -2 * chosen["map_velocity_mps"] / view.wavelength_m
        axis.axhline(doppler_hz / drawn.up, color=_CHOSEN, ls="--", lw=1.2)
    elif kind == "RANGE_TIME":
        axis.plot(view.time_s / drawn.right, chosen["range_m"] / drawn.up, "o", **ring)


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
    return Message({"number": fields["number"], "axes": None}, {"png": png})


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
    """Do what a request asks for; errors of this package become answers."""
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
