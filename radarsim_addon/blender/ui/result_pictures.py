# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures that the window shows: of a run, one function a kind; coverage. No import of bpy."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...array_types import Real, Single
from .frame_views import COLUMNS, ROWS, FrameView, Target
from .pictures import SPAN_DB, Axes, Mark, cell_edges, draw_levels, draw_map, draw_profile

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


def nearest_target(kind: str, view: FrameView, x_px: float, y_px: float) -> tuple[int, float]:
    """Return the target next to a place in a picture, and how far away it is drawn.

    Parameters
    ----------
    kind
        "MAP" or "PROFILE", whose targets have one range and no height.
    view
        The frame that is shown.
    x_px, y_px
        Place from the left and the upper edge [px].

    Returns
    -------
    tuple
        Row of the list of targets, -1 without any, and distance [px].
    """
    arrays = view.arrays
    ranges = cell_edges(arrays["profile_range_m" if kind == "PROFILE" else "map_range_m"])
    if kind == "PROFILE":
        across = Axes(*ranges, 0.0, 1.0)
        away = [abs(across.column(item["range_m"]) - x_px) for item in view.targets]
    else:
        axes = Axes(*cell_edges(arrays["map_doppler_hz"]), *ranges)
        marks = [_mark(view, item) for item in view.targets]
        away = [math.hypot(axes.column(m.x) - x_px, axes.row(m.y) - y_px) for m in marks]
    row = int(np.argmin(away)) if away else -1
    return row, away[row] if away else math.inf


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


def _spectrogram(shown: Shown) -> Single:
    arrays = shown.view.arrays
    times_ms, rates = arrays["spectrogram_s"] * 1e3, arrays["spectrogram_mps"]
    axes = Axes(*cell_edges(times_ms), *cell_edges(rates))
    texts = (
        "Time since the frame [ms]",
        "Range rate [m/s] (receding: positive)",
        f"Spectrogram, {shown.title}",
    )
    return draw_levels(axes, arrays["spectrogram_db"].T, texts, shown.power, shown.span_db)


def _range_time(shown: Shown) -> Single:
    """Profiles of all frames side by side: each column shows the frame nearest in time."""
    order = sorted(shown.profiles, key=lambda one: one.time_s)
    times_s = np.array([one.time_s for one in order])
    gap_s = float(np.median(np.diff(times_s))) if len(order) > 1 else 1.0
    low_s, high_s = times_s[0] - gap_s / 2, times_s[-1] + gap_s / 2
    column_s = low_s + (high_s - low_s) * (np.arange(COLUMNS) + 0.5) / COLUMNS
    nearest = np.abs(column_s[:, None] - times_s).argmin(axis=1)
    low_m, high_m = _range_edges(order)
    rows_m = low_m + (high_m - low_m) * (np.arange(ROWS) + 0.5) / ROWS
    levels = np.stack([_level_at(one, rows_m) for one in order], axis=1)
    texts = ("Time [s]", "Range [m]", f"Range profiles of {len(order)} frames")
    axes = Axes(low_s, high_s, low_m, high_m)
    return draw_levels(axes, levels[:, nearest], texts, shown.power, shown.span_db)


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
    half = COLUMNS / ROWS * far_m
    x, y = np.meshgrid(
        half * (2 * (np.arange(COLUMNS) + 0.5) / COLUMNS - 1),
        far_m * (2 * (np.arange(ROWS) + 0.5) / ROWS - 1),
    )
    range_m, direction = np.hypot(x, y), np.degrees(np.arctan2(x, y))
    order = np.argsort(azimuth_deg)
    around = np.concatenate([azimuth_deg[order[-1:]] - 360, azimuth_deg[order]])
    around = np.append(around, azimuth_deg[order[0]] + 360)
    after = np.searchsorted(around, direction).clip(1, around.size - 1)
    near = np.where(direction - around[after - 1] < around[after] - direction, after - 1, after)
    frame = np.concatenate([order[-1:], order, order[:1]])[near]
    rings_m = far_m * (np.arange(ROWS) + 0.5) / ROWS
    levels = np.stack([_level_at(one, rings_m) for one in shown.profiles])
    level = levels[frame, (range_m / far_m * ROWS).astype(np.intp).clip(0, ROWS - 1)]
    outside = (np.abs(direction - around[near]) > sector / 2 * 1.001) | (range_m > far_m)
    level = np.where(outside, np.nan, level)
    texts = ("East, +X [m]", "North, +Y [m]", f"Plan position, {len(shown.profiles)} frames")
    axes = Axes(-half, half, -far_m, far_m)
    return draw_levels(axes, level, texts, shown.power, shown.span_db)


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
