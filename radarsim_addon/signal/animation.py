# SPDX-License-Identifier: GPL-3.0-or-later
"""The range-Doppler maps of a run as a moving picture (GIF): axes and colours stay the same."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FrameFileError
from .files import replaced
from .plots import SIGN_TEXT, new_figure
from .rangedoppler import decibels

#: Pictures a second.
FRAMES_PER_SECOND = 5
#: Most cells along an axis of a picture; more are drawn as the largest of those next to each other.
_MOST_CELLS = 600


@dataclass(frozen=True)
class MapFile:
    """A frame's ``_map.npz``, and what to write above its picture."""

    path: Path
    frame: int
    time_s: float


def animate_maps(maps: Sequence[MapFile], out: Path, floor_db: float = -80.0) -> Path:
    """Write the maps of several frames as one GIF.

    Decibels are relative to the strongest cell of all frames. Maps are read one at a time.

    Parameters
    ----------
    maps
        In the order of their showing, all with the same axes.
    out
        File to write.
    floor_db
        Lowest level drawn.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    FrameFileError
        A map is missing or damaged, or has other axes than the first one.
    """
    writer_class = None
    figure = new_figure(8, 6.5)
    writer_class = importlib.import_module("matplotlib.animation").PillowWriter
    first = _read(maps[0].path)
    top = max(float(_read(item.path)["power"].max()) for item in maps) or 1.0
    axis = figure.subplots()
    doppler_hz, range_m = first["doppler_hz"], first["range_m"]
    left, right = _edges(doppler_hz)
    bottom, upper = _edges(range_m)
    picture = axis.imshow(
        _level(first["power"], top, floor_db),
        aspect="auto",
        origin="lower",
        extent=(left, right, bottom, upper),
        vmin=floor_db,
        vmax=0,
        cmap="viridis",
        interpolation="nearest",
    )
    figure.colorbar(picture, ax=axis, label="power [dB re strongest cell of all frames]")
    axis.set_xlabel(f"Doppler [Hz]      {SIGN_TEXT}")
    axis.set_ylabel("one-way range [m]")
    factor = _velocity_factor(first)
    if factor:
        speeds = axis.secondary_xaxis("top", functions=(lambda f: f * factor, lambda v: v / factor))
        speeds.set_xlabel("range rate v [m/s]")
    title = axis.set_title("", fontsize=10)
    with replaced(out) as temporary:
        writer = writer_class(fps=FRAMES_PER_SECOND)
        writer.setup(figure, str(temporary), dpi=80)
        for item in maps:
            arrays = _read(item.path)
            same = all(np.array_equal(arrays[n], first[n]) for n in ("doppler_hz", "range_m"))
            if not same:
                raise FrameFileError(
                    f"{item.path} has other axes than {maps[0].path}. Process the run anew."
                )
            picture.set_data(_level(arrays["power"], top, floor_db))
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
            f"{path} cannot be read as a range-Doppler map ({error}). Process the run anew."
        ) from error


def _level(power: Any, top: float, floor_db: float) -> Any:
    """Decibels, ranges upwards; strong cells stay visible where cells are joined."""
    for axis in (0, 1):
        step = -(-power.shape[axis] // _MOST_CELLS)
        if step > 1:
            power = np.maximum.reduceat(power, np.arange(0, power.shape[axis], step), axis=axis)
    return decibels(power, top, floor_db).T


def _edges(centres: Any) -> tuple[float, float]:
    half = (centres[1] - centres[0]) / 2 if len(centres) > 1 else 0.5
    return float(centres[0] - half), float(centres[-1] + half)


def _velocity_factor(arrays: dict[str, Any]) -> float:
    """Range rate over Doppler; 0 where there is one row."""
    place = int(np.argmax(np.abs(arrays["doppler_hz"])))
    doppler_hz = float(arrays["doppler_hz"][place])
    return float(arrays["velocity_mps"][place]) / doppler_hz if doppler_hz else 0.0
