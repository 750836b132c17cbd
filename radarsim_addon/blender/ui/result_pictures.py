# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures that the window shows: of a run, one function a kind; coverage. No import of bpy."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...array_types import Indices, Mask, Real, Single
from .frame_views import COLUMNS, ROWS, FrameView, Target
from .pictures import (
    SPAN_DB,
    Axes,
    Mark,
    cell_edges,
    draw_levels,
    draw_map,
    draw_marks,
    draw_profile,
)

#: Strongest level of a coverage diagram, and what is below it in the picture [dB].
_COVERAGE_TOP_DB, _COVERAGE_SPAN_DB = 12.5, 52.5
#: Smallest sector of a plan position indicator [deg].
_LEAST_SECTOR_DEG = 0.2


@dataclass(frozen=True)
class FrameProfile:
    """The profile of a frame, for pictures of all frames.

    power: (ranges,) [W]. azimuth_deg, width_deg: as of `FrameView`.
    """

    time_s: float
    range_m: Real
    power: Real
    azimuth_deg: float
    width_deg: float


@dataclass(frozen=True)
class Shown:
    """What a picture is drawn from.

    view: the frame. profiles: of all frames, in their order. chosen: the target that is marked.
    """

    view: FrameView
    profiles: Sequence[FrameProfile] = ()
    span_db: float = SPAN_DB
    chosen: Target | None = None
    title: str = field(init=False)
    power: str = field(init=False)

    def __post_init__(self) -> None:
        frame = f"frame {self.view.frame}, t = {self.view.time_s:.4g} s"
        if self.view.uncertain:
            frame += f", {self.view.uncertain}"
        object.__setattr__(self, "title", frame)
        object.__setattr__(self, "power", f"Power [{self.view.unit}]")


def profile_of(view: FrameView) -> FrameProfile:
    """Return the profile of a frame."""
    arrays = view.arrays
    return FrameProfile(
        view.time_s, arrays["profile_range_m"], arrays["profile"], view.azimuth_deg, view.width_deg
    )


def _map(shown: Shown) -> Single:
    view, arrays = shown.view, shown.view.arrays
    marks = [_mark(view, item) for item in view.detections or ()]
    if shown.chosen is not None:
        marks.append(_mark(view, shown.chosen)._replace(chosen=True))
    return draw_map(
        arrays["map_range_m"],
        arrays["map_doppler_hz"],
        arrays["map_db"],
        view.wavelength_m,
        f"Range-Doppler map, {shown.title}",
        view.unit,
        shown.span_db,
        marks,
    )


def _mark(view: FrameView, item: Target) -> Mark:
    """Place of a target in the map."""
    return Mark(-2 * item["map_velocity_mps"] / view.wavelength_m, item["map_range_m"])


def nearest_target(kind: str, shown: Shown, x_px: float, y_px: float) -> tuple[int, float]:
    """Return the target next to a place in a picture, and how far away it is drawn.

    Parameters
    ----------
    kind
        "MAP", "PROFILE", "SPECTROGRAM" or "RANGE_TIME".
    shown
        What the picture was drawn from.
    x_px, y_px
        Place from the left and the upper edge [px].

    Returns
    -------
    tuple
        Row of the list of targets, -1 without any, and distance [px].
    """
    rows: Collection[int] = range(len(shown.view.targets))
    cell_px = 0.0
    if kind == "SPECTROGRAM":  # of all targets in the cell the strongest, which is the first one
        rows = shown.view.spectrogram_rows
        cell_px = ROWS / shown.view.arrays["spectrogram_mps"].size
    found = -1, math.inf
    for row in rows:
        x, y = _place(kind, shown, shown.view.targets[row])
        away_px = math.hypot(0.0 if x is None else x - x_px, 0.0 if y is None else y - y_px)
        away_px = max(away_px - cell_px / 2, 0.0)
        if away_px < found[1]:
            found = row, away_px
    return found


def _place(kind: str, shown: Shown, item: Target) -> tuple[float | None, float | None]:
    """Column and row of a target in a picture [px]; None: it has none of its own."""
    view, arrays = shown.view, shown.view.arrays
    if kind == "PROFILE":
        return Axes(*cell_edges(arrays["profile_range_m"]), 0, 1).column(item["range_m"]), None
    if kind == "SPECTROGRAM":
        return None, _spectrogram_axes(shown).row(item["map_velocity_mps"])
    if kind == "RANGE_TIME":
        return None, _range_time_axes(shown.profiles).row(item["range_m"])
    axes = Axes(*cell_edges(arrays["map_doppler_hz"]), *cell_edges(arrays["map_range_m"]))
    mark = _mark(view, item)
    return axes.column(mark.x), axes.row(mark.y)


def nearest_frame(profiles: Sequence[FrameProfile], x_px: float) -> int:
    """Return the number, in `profiles`, of the frame at a column of the range-time picture."""
    axes = _range_time_axes(profiles)
    return int(np.argmin([abs(axes.column(one.time_s) - x_px) for one in profiles]))


def _profile(shown: Shown) -> Single:
    view, arrays = shown.view, shown.view.arrays
    return draw_profile(
        arrays["profile_range_m"],
        arrays["profile"],
        f"Range profile, {shown.title}",
        view.unit,
        shown.span_db,
        None if shown.chosen is None else shown.chosen["range_m"],
    )


def _echo(shown: Shown) -> Single:
    arrays = shown.view.arrays
    axes = Axes(*cell_edges(arrays["echo_row"]), *cell_edges(arrays["echo_s"] * 1e6))
    texts = ("Pulse", "Fast time [us]", f"Echo, {shown.title}")
    return draw_levels(axes, arrays["echo_db"].T, texts, shown.power, shown.span_db)


def _spectrogram_axes(shown: Shown) -> Axes:
    """Time within the burst [ms] and range rate [m/s]."""
    arrays = shown.view.arrays
    return Axes(*cell_edges(arrays["spectrogram_s"] * 1e3), *cell_edges(arrays["spectrogram_mps"]))


def _spectrogram(shown: Shown) -> Single:
    axes, level_db = _spectrogram_axes(shown), shown.view.arrays["spectrogram_db"].T
    texts = (
        "Time since the frame [ms]",
        "Range rate [m/s] (receding: positive)",
        f"Spectrogram, {shown.title}",
    )
    canvas = draw_levels(axes, level_db, texts, shown.power, shown.span_db)
    if shown.chosen is not None:
        middle_ms = (axes.x_low + axes.x_high) / 2
        draw_marks(canvas, axes, [Mark(middle_ms, shown.chosen["map_velocity_mps"], True)])
    return canvas


def _range_time_axes(profiles: Sequence[FrameProfile]) -> Axes:
    """Time [s] and range [m]: half a frame more than the first and the last one."""
    times_s = np.sort([one.time_s for one in profiles])
    gap_s = float(np.median(np.diff(times_s))) if times_s.size > 1 else 1.0
    return Axes(times_s[0] - gap_s / 2, times_s[-1] + gap_s / 2, *_range_edges(profiles))


def _range_time(shown: Shown) -> Single:
    """Profiles of all frames side by side: each column shows the frame nearest in time."""
    order, axes = shown.profiles, _range_time_axes(shown.profiles)
    times_s = np.array([one.time_s for one in order])
    column_s = axes.x_low + (axes.x_high - axes.x_low) * (np.arange(COLUMNS) + 0.5) / COLUMNS
    nearest = np.abs(column_s[:, None] - times_s).argmin(axis=1)
    rows_m = axes.y_low + (axes.y_high - axes.y_low) * (np.arange(ROWS) + 0.5) / ROWS
    levels = np.stack([_level_at(one, rows_m) for one in order], axis=1)
    texts = ("Time [s]", "Range [m]", f"Range profiles of {len(order)} frames")
    canvas = draw_levels(axes, levels[:, nearest], texts, shown.power, shown.span_db)
    if shown.chosen is not None:
        draw_marks(canvas, axes, [Mark(shown.view.time_s, shown.chosen["range_m"], True)])
    return canvas


def _ppi(shown: Shown) -> Single:
    """Profiles of all frames by the direction that the receiver looked in: +Y of the world is up.

    Each direction shows the frame that looked nearest to it, grey where none did.
    """
    azimuth_deg = np.array([one.azimuth_deg for one in shown.profiles])
    sorted_deg = np.sort(azimuth_deg)
    gaps = np.diff(np.append(sorted_deg, sorted_deg[:1] + 360.0))
    gaps = gaps[gaps > _LEAST_SECTOR_DEG]
    # A sector is as wide as the step of the scan; of one direction alone, as the field of view.
    sector = float(np.median(gaps)) if gaps.size > 1 else shown.profiles[-1].width_deg
    sector = max(sector, _LEAST_SECTOR_DEG)
    far_m = _range_edges(shown.profiles)[1]
    inside, ring, direction = _polar_cells()
    order = np.argsort(azimuth_deg)
    # a frame's sector ends half a turn away, or amid the next frame's direction
    after = np.append(azimuth_deg[order], azimuth_deg[order[0]] + 360)
    around = np.insert(after, 0, azimuth_deg[order[-1]] - 360)
    near = np.searchsorted((around[1:] + around[:-1]) / 2, direction)
    frame = np.concatenate([order[-1:], order, order[:1]])
    rings_m = far_m * (np.arange(ROWS) + 0.5) / ROWS
    levels = np.stack([_level_at(one, rings_m) for one in shown.profiles])
    level = np.full((ROWS, COLUMNS), np.nan)
    away_deg = np.abs(direction - around[near])
    level[inside] = np.where(away_deg > sector / 2 * 1.001, np.nan, levels[frame[near], ring])
    half = COLUMNS / ROWS * far_m
    texts = ("East, +X [m]", "North, +Y [m]", f"Plan position, {len(shown.profiles)} frames")
    axes = Axes(-half, half, -far_m, far_m)
    return draw_levels(axes, level, texts, shown.power, shown.span_db)


@functools.cache
def _polar_cells() -> tuple[Mask, Indices, Single]:
    """Cells of a plan position indicator within the farthest range, (rows, columns); ring and
    direction [deg] of each of these.
    """
    x, y = np.meshgrid(
        (2 * np.arange(COLUMNS) + 1 - COLUMNS) / ROWS,
        (2 * np.arange(ROWS) + 1 - ROWS) / ROWS,
    )
    away = np.hypot(x, y)
    inside = away <= 1
    ring = (away[inside] * ROWS).astype(np.intp).clip(0, ROWS - 1)
    return inside, ring, np.degrees(np.arctan2(x[inside], y[inside]), dtype=np.float32)


def _range_edges(profiles: Sequence[FrameProfile]) -> tuple[float, float]:
    edges = [cell_edges(one.range_m) for one in profiles]
    return max(min(low for low, _ in edges), 0.0), max(high for _, high in edges)


def _level_at(profile: FrameProfile, range_m: Real) -> Real:
    """Levels of a profile at ranges [dB]; NaN beyond its ends."""
    step_m = (profile.range_m[-1] - profile.range_m[0]) / max(profile.range_m.size - 1, 1)
    place = np.rint((range_m - profile.range_m[0]) / (step_m or 1.0)).astype(np.int64)
    inside = (place >= 0) & (place < profile.range_m.size)
    power = profile.power[np.clip(place, 0, profile.range_m.size - 1)]
    level = np.full(range_m.shape, -300.0)
    np.log10(power, out=level, where=power > 0)
    return np.asarray(np.where(inside, np.where(power > 0, 10 * level, -300.0), np.nan))


class Kind(NamedTuple):
    """A kind of picture: label and tooltip, name of its image, and what draws it.

    needs: array of the frame without which it cannot be drawn.
    """

    label: str
    tooltip: str
    image: str
    draw: Callable[[Shown], Single]
    needs: str = "map_db"


KINDS: Mapping[str, Kind] = {
    "MAP": Kind(
        "Range-Doppler Map", "Show power against range and Doppler, with a ring around each target",
        "Radar range-Doppler map", _map,
    ),
    "PROFILE": Kind(
        "Range Profile", "Show expected power against range, without speckle",
        "Radar range profile", _profile,
    ),
    "ECHO": Kind(
        "Echo", "Show the samples that the receiver records, against fast time and pulse",
        "Radar echo", _echo,
    ),
    "SPECTROGRAM": Kind(
        "Spectrogram", "Show range rate against time within the burst: micro-Doppler",
        "Radar spectrogram", _spectrogram, "spectrogram_db",
    ),
    "RANGE_TIME": Kind(
        "Range-Time", "Show the range profiles of all frames against time",
        "Radar range-time", _range_time,
    ),
    "PPI": Kind(
        "Plan Position", "Show the range profiles of all frames by the direction of the receiver",
        "Radar plan position", _ppi,
    ),
}  # fmt: skip


def draw_coverage(range_m: Real, height_m: Real, level_db: Real, title: str) -> Single:
    """Draw a coverage diagram: height against range, grey below the horizon.

    Parameters
    ----------
    range_m, height_m
        Ranges along the ground and heights, ascending, shapes (r,) and (h,) [m].
    level_db
        Pattern-propagation factor F^4, NaN below the horizon, shape (h, r) [dB].
    title
        First line.
    """
    axes = Axes(*cell_edges(range_m), *cell_edges(height_m))
    texts = ("Range along the ground [m]", "Height over the ground [m]", title)
    label = "F^4 [dB over free space]"
    return draw_levels(axes, level_db, texts, label, _COVERAGE_SPAN_DB, highest_db=_COVERAGE_TOP_DB)
