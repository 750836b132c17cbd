# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of pictures of a run, and where its targets are in them; processing for the window.

Does not import bpy.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...errors import RadarSimError
from ...findings import to_json
from ...messages import open_messages, write_message
from ...signal.pictures import FrameProfile, FrameView, Target, decimals_for, fixed

#: Farthest target that a place in a picture means, in a picture of `WIDTH` [px].
NEAR_PX = 30.0
#: Size of pictures that are saved, in which distances of clicks are counted [px].
WIDTH, HEIGHT = 1200, 800


class Kind(NamedTuple):
    """A kind of picture: label and tooltip, name of its image.

    needs: array of the frame without which it cannot be drawn.
    """

    label: str
    tooltip: str
    image: str
    needs: str = "map_db"


KINDS: Mapping[str, Kind] = {
    "MAP": Kind(
        "Range-Doppler Map", "Show power against range and Doppler, with a ring around each target",
        "Radar range-Doppler map",
    ),
    "PROFILE": Kind(
        "Range Profile", "Show expected power against range, without speckle",
        "Radar range profile",
    ),
    "ECHO": Kind(
        "Echo", "Show the samples that the receiver records, against fast time and pulse",
        "Radar echo",
    ),
    "SPECTROGRAM": Kind(
        "Spectrogram", "Show range rate against time within the burst: micro-Doppler",
        "Radar spectrogram", "spectrogram_db",
    ),
    "RANGE_TIME": Kind(
        "Range-Time", "Show the range profiles of all frames against time",
        "Radar range-time",
    ),
    "PPI": Kind(
        "Plan Position", "Show the range profiles of all frames by the direction of the receiver",
        "Radar plan position",
    ),
}  # fmt: skip


class PictureAxes(NamedTuple):
    """Axes of a picture: edges as fractions of it, and the values there, in SI."""

    #: Left, lower, right and upper edge.
    box: Sequence[float]
    x: Sequence[float]
    y: Sequence[float]
    #: Whether either axis is logarithmic.
    log: Sequence[bool]

    def holds(self, across: float, up: float) -> bool:
        """Return whether a place in the picture, as fractions, is between the axes."""
        left, low, right, high = self.box
        return left <= across <= right and low <= up <= high

    def value(self, across: float, up: float) -> tuple[float, float]:
        """Return the values at a place in the picture."""
        left, low, right, high = self.box
        parts = (across - left) / (right - left), (up - low) / (high - low)
        found = []
        for part, ends, log in zip(parts, (self.x, self.y), self.log, strict=True):
            first, last = np.log(ends) if log else ends
            value = first + part * (last - first)
            found.append(math.exp(value) if log else float(value))
        return found[0], found[1]

    def place(self, x: float | None, y: float | None) -> tuple[float | None, float | None]:
        """Return the place of values in the picture; None stays None."""
        left, low, right, high = self.box
        found: list[float | None] = []
        for value, ends, log, start, stop in (
            (x, self.x, self.log[0], left, right),
            (y, self.y, self.log[1], low, high),
        ):
            if value is None:
                found.append(None)
                continue
            first, last, at = np.log([*ends, value]) if log else (*ends, value)
            found.append(float(start + (at - first) / (last - first) * (stop - start)))
        return found[0], found[1]


def nearest_target(
    kind: str, axes: PictureAxes, view: FrameView, across: float, up: float
) -> tuple[int, float]:
    """Return the row of the target next to a place in a picture, -1 without any, and how far away
    it is drawn [px of `WIDTH`].

    kind: "MAP", "PROFILE", "SPECTROGRAM" or "RANGE_TIME". across, up: fractions of the picture.
    """
    rows: Collection[int] = range(len(view.targets))
    cell_px = 0.0
    if kind == "SPECTROGRAM":  # of all targets in the cell the strongest, which is the first one
        rows = view.spectrogram_rows
        height_px = (axes.box[3] - axes.box[1]) * HEIGHT
        cell_px = height_px / view.arrays["spectrogram_db"].shape[1]
    found = -1, math.inf
    for row in rows:
        item = view.targets[row]
        x, y = axes.place(*_values(kind, view, item))
        away_px = math.hypot(
            0.0 if x is None else (x - across) * WIDTH, 0.0 if y is None else (y - up) * HEIGHT
        )
        away_px = max(away_px - cell_px / 2, 0.0)
        if away_px < found[1]:
            found = row, away_px
    return found


def _values(kind: str, view: FrameView, item: Target) -> tuple[float | None, float | None]:
    """Values of a target along both axes; None: it has none of its own."""
    doppler_hz = -2 * item["map_velocity_mps"] / view.wavelength_m
    values: dict[str, tuple[float | None, float | None]] = {
        "MAP": (doppler_hz, item["map_range_m"]),
        "PROFILE": (item["range_m"], None),
        "SPECTROGRAM": (None, doppler_hz),
        "RANGE_TIME": (None, item["range_m"]),
    }
    return values[kind]


def read_out(kind: str, axes: PictureAxes, view: FrameView, across: float, up: float) -> str:
    """Return the values at a place in a picture, and the target that is drawn there; "" outside.

    Arguments as of `nearest_target`. Levels are those of cells as they are drawn.
    """
    if not axes.holds(across, up):
        return ""
    x, y = axes.value(across, up)
    parts = []
    if kind in ("MAP", "SPECTROGRAM"):
        doppler_hz, ends, along = (x, axes.x, 0) if kind == "MAP" else (y, axes.y, 1)
        cells = view.arrays["map_db" if kind == "MAP" else "spectrogram_db"].shape[along]
        rates = [-view.wavelength_m / 2 * value for value in (doppler_hz, *ends)]
        digits = decimals_for(abs(rates[2] - rates[1]) / cells)
        first = f"{y:.4g} m" if kind == "MAP" else f"{1e3 * x:.4g} ms"
        parts = [first, f"{fixed(rates[0], digits, signed=True)} m/s"]
        parts.append(f"{view.level_db(kind.lower(), x, y):.1f} {view.unit}")
    elif kind == "PROFILE":
        parts = [f"{x:.4g} m", f"{y:.1f} dB"]
    elif kind == "RANGE_TIME":
        parts = [f"{x:.4g} s", f"{y:.4g} m"]
    row, away_px = nearest_target(kind, axes, view, across, up) if parts else (-1, math.inf)
    if row >= 0 and away_px <= NEAR_PX and view.targets[row]["name"]:
        parts.append(view.targets[row]["name"])
    return "   ".join(parts)


def nearest_frame(profiles: Sequence[FrameProfile], time_s: float) -> int:
    """Return the number, in `profiles`, of the frame next to a time."""
    return int(np.argmin([abs(one.time_s - time_s) for one in profiles]))


# -------------------------------------------------------------------------------------------------
# Processing of a run for the window, in a process of its own. Does not import bpy.
#
#     python -m radarsim_addon.blender.ui.result_pictures RUN VIEWS [OPTION ...]
#
# writes messages: progress, results of frames, an error. What the window shows of each frame goes
# into the folder VIEWS. OPTIONs are those of `radarsim process`.
# -------------------------------------------------------------------------------------------------


def processing_records(folder: Path, views: Path, words: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Process a run step by step; write what the window shows of each frame.

    words: options of `radarsim process`.
    """
    # slow: not for `add-on enabled`
    from ...signal.pictures import write_view
    from ...signal.pipeline import (
        Progress,
        parse_process_arguments,
        process_options,
        process_run,
    )

    chosen = parse_process_arguments(["process", str(folder), "--no-plots", *words])
    for event in process_run(folder, process_options(chosen)):
        if isinstance(event, Progress):
            yield {"fraction": event.done / max(event.total, 1), "text": event.text}
        else:
            write_view(event, views)
            yield _frame_record(event)


def _frame_record(result: Any) -> dict[str, Any]:
    text = f"Frame {result.frame}: {len(result.files)} files"
    if result.files:
        text += f" in {result.files[0].parent}"
    findings = [to_json(item) for item in result.findings]
    return {"frame": result.frame, "text": text, "findings": findings}


def main(words: list[str]) -> None:
    """Write the records of a run as messages."""
    _, writing = open_messages()
    try:
        for record in processing_records(Path(words[0]), Path(words[1]), words[2:]):
            write_message(writing, record, {})
    except RadarSimError as error:
        write_message(writing, {"error": str(error), "kind": type(error).__name__}, {})


if __name__ == "__main__":
    main(sys.argv[1:])
