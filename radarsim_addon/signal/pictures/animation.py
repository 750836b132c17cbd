# SPDX-License-Identifier: GPL-3.0-or-later
"""Range-Doppler maps of a run as GIF or MP4, with the same axes and colours in all frames."""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...array_files import read_npz
from ...array_types import Real
from ...atomic_files import replaced
from ...errors import FrameFileError
from ...movie_file import MovieWriter
from ..results import FrameResult, frame_file
from .figure import new_figure
from .map import ColourScale, MapAxes, draw_map, floor_db_of, joined_level, map_axes
from .sheet import TALL_TEXT, Sheet

#: Pictures per second.
FRAMES_PER_SECOND = 5
#: Pixels per inch.
_DPI = 80
_ARRAYS = ("doppler_hz", "velocity_mps", "range_m", "power")


@dataclass(frozen=True)
class MapFile:
    """A frame's ``_map.npz``, and what its picture needs before the file is read.

    Attributes
    ----------
    path
        The file.
    frame, time_s
        Number and scene time [s] of the frame, written above the picture.
    strongest, median, noise_power
        Power of the strongest cell, median of all, and mean noise of a cell (0: not known).
    """

    path: Path
    frame: int
    time_s: float
    strongest: float
    median: float
    noise_power: float


def map_file(result: FrameResult, folder: Path) -> MapFile:
    """Describe the map that the writer "npz" wrote.

    Parameters
    ----------
    result, folder
        Result of a frame, and where it was written.

    Returns
    -------
    MapFile
        Path of the map, and the numbers that set its colours.
    """
    return MapFile(
        frame_file(folder, result.frame, "_map.npz"),
        result.frame,
        result.time_s,
        *result.rd_map.strongest_and_median,
        result.map_noise_power,
    )


def common_scale(maps: Sequence[MapFile], unit: str = "") -> ColourScale:
    """Return the colours that all maps share, without a look into their files.

    Parameters
    ----------
    maps
        At least one.
    unit
        Unit of the powers in decibels, such as "dBW"; "": unknown.

    Returns
    -------
    ColourScale
        Decibels relative to the strongest cell of all frames.
    """
    top, noise_power = max(item.strongest for item in maps), maps[-1].noise_power
    floor_db = max(floor_db_of(top, item.median, noise_power) for item in maps)
    return ColourScale(top, floor_db, noise_power, unit, "strongest cell of all")


def animate_maps(maps: Sequence[MapFile], out: Path, scale: ColourScale) -> Path:
    """Write the maps of several frames as a GIF or MP4 file, read one at a time.

    Parameters
    ----------
    maps
        Maps in order of display, all with the same axes.
    out
        File to write; its ending, .gif or .mp4, is the format.
    scale
        Colours of all frames, see `common_scale`.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FrameFileError
        A map is missing or damaged, or has other axes than the first one.
    MissingDependencyError, OutputError
        Blender's module bpy, whose FFmpeg writes MP4 files, is not installed or fails.
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
    """Axes of a map's picture; range rate over Doppler is 0 where there is one row."""
    doppler_hz = arrays["doppler_hz"]
    place = int(np.argmax(np.abs(doppler_hz)))
    largest_hz = float(doppler_hz[place])
    factor = float(arrays["velocity_mps"][place]) / largest_hz if largest_hz else 0.0
    return map_axes(doppler_hz, arrays["range_m"], factor)
