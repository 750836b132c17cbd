# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of a frame (writer "png"), and the animation of a run's range-Doppler maps.

All maps of an animation have the same axes and colours; it is a GIF or MP4.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...arrays import Real, read_npz
from ...atomic_files import replaced
from ...errors import FrameFileError
from ...movie_file import MovieWriter
from ..detection import DirectedDetection
from ..maps import power_unit
from ..products import FrameResult, frame_file, result_writer
from .echo import draw_echo, plot_echo, plot_rings
from .figure import TALL_TEXT, Sheet, new_figure, save_figure, save_picture
from .map import (
    ColourScale,
    MapAxes,
    draw_map,
    draw_range_doppler,
    floor_db_of,
    joined_level,
    map_axes,
    plot_clutter,
    plot_spectrogram,
)
from .profile import draw_range_profile

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NAMES = ("rings", "echo", "range_profile", "range_doppler", "points", "clutter", "spectrogram")
#: Pictures per second.
FRAMES_PER_SECOND = 5
#: Pixels per inch.
_DPI = 80
_ARRAYS = ("doppler_hz", "velocity_mps", "range_m", "power")


@result_writer("png", *(f"_{name}.png" for name in _NAMES))
def draw_results(result: FrameResult, folder: Path) -> list[Path]:
    """Draw the pictures of a frame into an existing folder; images of rings are read again."""
    title = f"frame {result.frame}, t = {result.time_s:.4g} s"
    if uncertain := result.budget.uncertain_text:
        title += f", {uncertain}"
    unit = power_unit(result.echoes.amplitude_model)

    def file(name: str) -> Path:
        return frame_file(folder, result.frame, f"_{name}.png")

    files = []
    if result.source.frame.sampling_mode == "rings":
        files.append(save_figure(plot_rings(result.source.frame), file("rings")))
    echoes, echo_title = result.echoes.channel(0), f"Raw echo, {title}"
    pixels = draw_echo(echoes, echo_title)
    if pixels is None:
        files.append(save_figure(plot_echo(echoes, echo_title), file("echo")))
    else:
        files.append(save_picture(pixels, file("echo")))
    line = result.echoes.radar.waveform.family == "line"
    pixels = draw_range_profile(
        result.compressed.channel(0),
        result.profile,
        result.edges,
        f"{'Range profile' if line else 'Matched filter'}, {title}",
        expected=result.expected,
        noise_power=result.profile_noise_power,
        unit=unit,
    )
    files.append(save_picture(pixels, file("range_profile")))
    found = result.detections
    pixels = draw_range_doppler(
        result.rd_map.channel(0),
        result.moving_targets,
        f"Range-Doppler map, {f'{result.mti}-pulse MTI, ' if result.mti else ''}{title}",
        targets=() if found is None else found.targets,
        left_out=0 if found is None else found.left_out,
        noise_power=result.map_noise_power,
        unit=unit,
    )
    files.append(save_picture(pixels, file("range_doppler")))
    points = [one for one in found.targets if isinstance(one, DirectedDetection)] if found else []
    if points:
        fastest_mps = result.source.radar.max_unambiguous_velocity_mps
        elevations = points[0].elevation_deg is not None
        figure = plot_points(points, f"Point cloud, {title}", fastest_mps, elevations)
        files.append(save_figure(figure, file("points")))
    if result.spectrogram is not None:
        name = result.spectrogram.options.object_name
        figure = plot_spectrogram(
            result.spectrogram, f"Spectrogram{f' of {name}' if name else ''}, {title}", unit
        )
        files.append(save_figure(figure, file("spectrogram")))
    expected = result.expected
    if expected is not None and expected.clutter_map is not None:
        noise_power = result.noise_of_budget or 0.0
        figure = plot_clutter(
            expected,
            result.source.radar,
            f"Expected clutter, {title}",
            noise_power=noise_power,
            unit=unit,
        )
        files.append(save_figure(figure, file("clutter")))
    return files


#: Area of a point in the picture at 10 dB, and for each dB above [points^2].
_LEAST_AREA, _AREA_PER_DB = 12.0, 2.0
#: Names are written at so many of the strongest points.
_NAMED = 8


def plot_points(
    points: Sequence[DirectedDetection], title: str, fastest_mps: float, elevations: bool
) -> Figure:
    """Draw the targets of an array: from above and, where it measures elevations, from the side.

    Colours are range rates up to `fastest_mps`, areas grow with the SNR in dB. The radar is at the
    lower end of the upper picture, at the left of the lower one.
    """
    figure = new_figure(8, 9 if elevations else 7)
    if elevations:
        above, side = figure.subplots(2, 1, height_ratios=[3, 1])
    else:
        above, side = figure.add_subplot(), None
    area = [_LEAST_AREA + _AREA_PER_DB * max(one.snr_db - 10, 0) for one in points]
    rate = [one.velocity_mps for one in points]
    style = {"c": rate, "s": area, "cmap": "coolwarm", "vmin": -fastest_mps, "vmax": fastest_mps}
    style |= {"edgecolors": "black", "linewidths": 0.4}
    forward, left, up = np.array([[one.x_m, one.y_m, one.z_m] for one in points]).reshape(-1, 3).T
    drawn = above.scatter(-left, forward, **style)
    above.plot(0, 0, "k^", markersize=9)
    strongest = {one.name: one for one in reversed(points) if one.name}  # of each name
    for one in points[:_NAMED]:
        if strongest.get(one.name) is one:
            above.annotate(
                one.name, (-one.y_m, one.x_m), (5, 5), textcoords="offset points", fontsize=7
            )
    above.set_aspect("equal", adjustable="datalim")
    above.set_xlabel("right of the radar [m]")
    above.set_ylabel("ahead of the radar [m]")
    above.set_title(title, fontsize=10)
    above.grid(alpha=0.3)
    figure.colorbar(drawn, ax=above, label="range rate, receding positive [m/s]")
    if side is not None:
        side.scatter(forward, up, **style)
        side.plot(0, 0, "k>", markersize=9)
        side.set_xlabel("ahead of the radar [m]")
        side.set_ylabel("above the radar [m]")
        side.grid(alpha=0.3)
    return figure


@dataclass(frozen=True)
class MapFile:
    """The file ``_map.npz`` of a frame, and numbers for its picture that are known without it."""

    path: Path
    frame: int
    time_s: float
    #: Power of the strongest cell, median of all, and mean noise of a cell (0: not known).
    strongest: float
    median: float
    noise_power: float


def map_file(result: FrameResult, folder: Path) -> MapFile:
    """Describe the map that the writer "npz" wrote into a folder."""
    return MapFile(
        frame_file(folder, result.frame, "_map.npz"),
        result.frame,
        result.time_s,
        *result.rd_map.strongest_and_median,
        result.map_noise_power,
    )


def common_scale(maps: Sequence[MapFile], unit: str = "") -> ColourScale:
    """Return the colours that all maps share, without a look into their files."""
    top, noise_power = max(item.strongest for item in maps), maps[-1].noise_power
    floor_db = max(floor_db_of(top, item.median, noise_power) for item in maps)
    return ColourScale(top, floor_db, noise_power, unit, "strongest cell of all")


def animate_maps(maps: Sequence[MapFile], out: Path, scale: ColourScale) -> Path:
    """Write the maps of several frames, in order of display, as a .gif or .mp4 file; return it.

    They are read one at a time, and must have the same axes. FFmpeg of Blender's module bpy writes
    MP4.
    """
    pictures = _pictures(maps, _read(maps[0].path), scale)
    with replaced(out) as temporary:
        (_write_mp4 if out.suffix == ".mp4" else _write_gif)(temporary, pictures)
    return out


def _write_gif(path: Path, pictures: Iterator[NDArray[np.uint8]]) -> None:
    pillow = importlib.import_module("PIL.Image")
    images = map(pillow.fromarray, pictures)
    next(images).save(
        path, format="gif", save_all=True, append_images=images,
        duration=1000 // FRAMES_PER_SECOND, loop=0,
    )  # fmt: skip


def _write_mp4(path: Path, pictures: Iterator[NDArray[np.uint8]]) -> None:
    with MovieWriter(path, 1 / FRAMES_PER_SECOND) as writer:
        for picture in pictures:
            writer.add(picture)
        for _ in writer.close():
            time.sleep(0.05)


def _pictures(
    maps: Sequence[MapFile], first: Mapping[str, Real], scale: ColourScale
) -> Iterator[NDArray[np.uint8]]:
    """Yield the pictures of maps, of which the first was read: (height, width, 3)."""
    figure = new_figure(8, 6.5)
    axes = _axes_of(first)
    axis, picture = draw_map(figure, first["power"], axes, scale)
    title = axis.set_title(TALL_TEXT, fontsize=10)
    sheet = Sheet(figure, [picture, *axis.spines.values(), title], _DPI)
    for item in maps:
        arrays = first if item is maps[0] else _read(item.path)
        if not all(np.array_equal(arrays[n], first[n]) for n in ("doppler_hz", "range_m")):
            raise FrameFileError(
                f"{item.path} has other axes than {maps[0].path}, so they have no common "
                "animation. Process the run again."
            )
        picture.set_data(joined_level(arrays["power"], axes, scale))
        title.set_text(f"Range-Doppler map, frame {item.frame}, t = {item.time_s:.3f} s")
        yield sheet.picture()


def _read(path: Path) -> Mapping[str, Real]:
    try:
        arrays = read_npz(path, _ARRAYS)
        return arrays | {"power": arrays["power"][0]}
    # zipfile and zlib raise errors of many kinds on damaged files
    except Exception as error:
        raise FrameFileError(
            f"{path} cannot be read as a range-Doppler map ({error}). Process the run again."
        ) from error


def _axes_of(arrays: Mapping[str, Real]) -> MapAxes:
    """Return axes of a map's picture; range rate over Doppler is 0 where there is one row."""
    doppler_hz = arrays["doppler_hz"]
    place = int(np.argmax(np.abs(doppler_hz)))
    largest_hz = float(doppler_hz[place])
    factor = float(arrays["velocity_mps"][place]) / largest_hz if largest_hz else 0.0
    return map_axes(doppler_hz, arrays["range_m"], factor)
