# SPDX-License-Identifier: GPL-3.0-or-later
"""Range-Doppler maps of a run as an animated GIF with the same axes and colours in all frames."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...atomic_files import replaced
from ...errors import FrameFileError
from .figure import new_figure
from .map import draw_map, joined_level, map_axes, picture_floor_db

#: Pictures per second.
FRAMES_PER_SECOND = 5


@dataclass(frozen=True)
class MapFile:
    """A frame's ``_map.npz``, and the time to write above its picture.

    Attributes
    ----------
    path
        File.
    frame
        Number of the frame.
    time_s
        Scene time [s].
    """

    path: Path
    frame: int
    time_s: float


def animate_maps(
    maps: Sequence[MapFile],
    out: Path,
    floor_db: float | None = None,
    *,
    noise_power: float = 0.0,
    unit: str = "",
) -> Path:
    """Write the maps of several frames as one GIF.

    Decibels are relative to the strongest cell of all frames. Maps are read one at a time.

    Parameters
    ----------
    maps
        Maps in order of display, all with the same axes.
    out
        File to write.
    floor_db
        Lowest level drawn; None: as for one map, see :func:`.pictures.map.picture_floor_db`.
    noise_power, unit
        As for :func:`.pictures.map.plot_range_doppler`.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    FrameFileError
        A map is missing or damaged, or has other axes than the first one.
    """
    figure = new_figure(8, 6.5)
    writer_class = importlib.import_module("matplotlib.animation").PillowWriter
    first = _read(maps[0].path)
    top = max(float(_read(item.path)["power"].max()) for item in maps)
    if floor_db is None:
        floor_db = max(
            picture_floor_db(_read(item.path)["power"], noise_power, top) for item in maps
        )
    axes = map_axes(first["doppler_hz"], first["range_m"], _velocity_factor(first))
    axis, picture = draw_map(
        figure,
        first["power"],
        axes,
        reference=top,
        floor_db=floor_db,
        noise_power=noise_power,
        unit=unit,
        of="strongest cell of all",
    )
    title = axis.set_title("", fontsize=10)
    with replaced(out) as temporary:
        writer = writer_class(fps=FRAMES_PER_SECOND)
        writer.setup(figure, str(temporary), dpi=80)
        for item in maps:
            arrays = _read(item.path)
            same = all(np.array_equal(arrays[n], first[n]) for n in ("doppler_hz", "range_m"))
            if not same:
                raise FrameFileError(
                    f"{item.path} has other axes than {maps[0].path}, so they have no common "
                    "animation. Process the run again."
                )
            picture.set_data(joined_level(arrays["power"], axes, top or 1.0, floor_db))
            title.set_text(f"Range-Doppler map, frame {item.frame}, t = {item.time_s:.3f} s")
            writer.grab_frame()
        writer.finish()
    return out


def _read(path: Path) -> dict[str, Any]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            names = ("doppler_hz", "velocity_mps", "range_m", "power")
            return {name: archive[name] for name in names}
    # zipfile and numpy raise errors of many kinds on damaged files
    except Exception as error:
        raise FrameFileError(
            f"{path} cannot be read as a range-Doppler map ({error}). Process the run again."
        ) from error


def _velocity_factor(arrays: dict[str, Any]) -> float:
    """Return range rate over Doppler; 0 for a map of one row."""
    place = int(np.argmax(np.abs(arrays["doppler_hz"])))
    doppler_hz = float(arrays["doppler_hz"][place])
    return float(arrays["velocity_mps"][place]) / doppler_hz if doppler_hz else 0.0
