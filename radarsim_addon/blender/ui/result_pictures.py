# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures that the window shows: of a run, one function a kind; coverage. No import of bpy."""

from __future__ import annotations

import functools
import json
import math
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

import numpy as np

from ...arrays import Indices, Mask, Real, Single, read_npz
from ...errors import RadarSimError
from ...findings import to_json
from .pictures import (
    BOTTOM,
    HEIGHT,
    LEFT,
    RIGHT,
    SPAN_DB,
    TOP,
    WIDTH,
    Axes,
    Mark,
    cell_edges,
    draw_levels,
    draw_map,
    draw_marks,
    draw_profile,
    resample_max,
)

# -------------------------------------------------------------------------------------------------
# What the window shows of a processed frame, in files between two processes. No import of bpy.
#
# Arrays are no finer than the pictures drawn of them: joined cells keep the strongest one, so that
# a frame takes about a megabyte and is read and drawn in some hundredths of a second.
# -------------------------------------------------------------------------------------------------


#: Cells of a picture: to the right, and up.
COLUMNS, ROWS = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
#: Paths of a target that are drawn.
_MOST_PATHS = 12


class Target(TypedDict):
    """A detection, or an object where nothing was detected; None where a number is not known.

    map_range_m and map_velocity_mps are its place in the map; lines_m the corners of its paths.
    """

    name: str
    range_m: float
    velocity_mps: float
    map_range_m: float
    map_velocity_mps: float
    power_dbm: float | None
    rcs_dbsm: float | None
    snr_db: float | None
    power_error: float
    lines_m: list[list[list[float]]]


@dataclass(frozen=True)
class FrameView:
    """What is shown of a frame.

    Attributes
    ----------
    frame, time_s
        Number and scene time [s].
    unit
        Unit of levels, "dBW" or "dB".
    wavelength_m
        Wavelength at the carrier [m].
    azimuth_deg
        Direction that the receiver looks in, from the world's +Y clockwise [deg].
    width_deg
        Its field of view; 0: not known [deg].
    objects
        Objects with an echo, by name.
    detections
        Targets that CFAR found, by falling SNR; None: no CFAR.
    arrays
        Levels in dB and axes, by name.
    spectrogram_rows
        Numbers in `targets` of those whose echoes the spectrogram was made of.
    """

    frame: int
    time_s: float
    unit: str
    wavelength_m: float
    azimuth_deg: float
    width_deg: float
    objects: dict[str, Target]
    detections: list[Target] | None
    arrays: Mapping[str, Real]
    uncertain: str = ""
    spectrogram_rows: Collection[int] = ()

    @property
    def targets(self) -> list[Target]:
        """What the list shows: detections; without CFAR the objects, the strongest first."""
        return list(self.objects.values()) if self.detections is None else self.detections


def _file(folder: Path, frame: int, ending: str) -> Path:
    return folder / f"view_{frame:06d}.{ending}"


def read_view(folder: Path, frame: int) -> FrameView:
    """Read what `write_view` wrote."""
    record = json.loads(_file(folder, frame, "json").read_text(encoding="utf-8"))
    found = read_npz(_file(folder, frame, "npz"))
    arrays = {name: array.astype(np.float64) for name, array in found.items()}
    return FrameView(arrays=arrays, **record)


def write_view(result: Any, folder: Path) -> None:
    """Write what is shown of a frame's result (a `signal.FrameResult`)."""
    from ...signal.detection import FrameBudget, PathFinder  # slow: not for `add-on enabled`

    source, radar = result.source, result.rd_map.radar
    finder = PathFinder(source, FrameBudget(source).link) if source.tables else None
    interval_mps = 2 * radar.max_unambiguous_velocity_mps
    later_s = (radar.burst.pulses - 1) / 2 / radar.burst.prf_hz
    period_m = radar.unambiguous_range_m if radar.waveform.kind != "fmcw" else math.inf

    errors = {echo.name: echo.power_error for echo in result.budget.objects}

    def of_object(echo: Any) -> Target:
        budget, rate = result.budget, echo.range_rate_mps
        place_m = echo.range_m + later_s * rate
        snr = budget.snr.get(echo.name)
        return Target(
            name=echo.name,
            range_m=echo.range_m,
            velocity_mps=rate,
            map_range_m=place_m % period_m if math.isfinite(period_m) else place_m,
            map_velocity_mps=(rate + interval_mps / 2) % interval_mps - interval_mps / 2,
            power_dbm=_finite(echo.power_dbm),
            rcs_dbsm=_finite(echo.rcs_dbsm),
            snr_db=None if snr is None else snr.burst_db,
            power_error=echo.power_error,
            lines_m=_lines(finder.of_object(echo.name, _MOST_PATHS)) if finder else [],
        )

    def of_detection(item: Any) -> Target:
        found = finder.of_target(item.range_m, item.velocity_mps, _MOST_PATHS) if finder else None
        watts = result.echoes.amplitude_model == "radar-equation"
        true_mps = item.unfolded_velocity_mps
        return Target(
            name=found.name if found else "",
            range_m=item.range_m,
            velocity_mps=item.velocity_mps if true_mps is None else true_mps,
            map_range_m=item.range_m,
            map_velocity_mps=item.velocity_mps,
            power_dbm=item.level_db + 30 if watts else None,
            rcs_dbsm=None,
            snr_db=item.snr_db,
            power_error=errors.get(found.last_object, 0.0) if found else 0.0,
            lines_m=_lines(found) if found else [],
        )

    detections = result.detections
    matrix, camera = np.asarray(source.receiver.matrix_world), source.receiver
    ahead = -matrix[:3, 2]
    perspective = camera.kind == "perspective"
    width = math.atan(camera.right) - math.atan(camera.left) if perspective else 0.0
    record = {
        "frame": result.frame,
        "time_s": result.time_s,
        "unit": "dBW" if result.echoes.amplitude_model == "radar-equation" else "dB",
        "wavelength_m": radar.waveform.wavelength_m,
        "azimuth_deg": math.degrees(math.atan2(ahead[0], ahead[1])),
        "width_deg": math.degrees(width),
        "uncertain": result.budget.uncertain_text,
        "objects": {echo.name: of_object(echo) for echo in result.budget.objects},
        "detections": None
        if detections is None
        else [of_detection(item) for item in detections.targets],
    }
    targets = FrameView(**record, arrays={}).targets
    record["spectrogram_rows"] = _spectrogram_rows(result, targets)
    np.savez(_file(folder, result.frame, "npz"), **_arrays(result))
    text = json.dumps(record)
    _file(folder, result.frame, "json").write_text(text, encoding="utf-8")


def _spectrogram_rows(result: Any, targets: list[Target]) -> list[int]:
    """Numbers of the targets in the ranges, and on the objects, of the spectrogram."""
    from ...signal.detection import matching_objects  # slow: not for `add-on enabled`

    shown = result.spectrogram
    if shown is None:
        return []
    low_m, high_m = shown.range_limits_m
    wanted = shown.options.object_name
    names = None if wanted is None else matching_objects(result.source, wanted)
    return [
        row
        for row, item in enumerate(targets)
        if low_m <= item["map_range_m"] <= high_m and (names is None or item["name"] in names)
    ]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _lines(found: Any) -> list[list[list[float]]]:
    """Corners of paths, to a tenth of a millimetre."""
    return [np.round(line, 4).tolist() for line in found.lines_m]


def _arrays(result: Any) -> dict[str, Any]:
    """Levels [dB] and axes; levels as float16, whose step is 0.06 dB at -100 dB."""
    rd_map, profile, echoes = result.rd_map, result.profile, result.echoes
    samples = np.abs(echoes.samples[0]) ** 2
    found: dict[str, Any] = {
        "map_doppler_hz": shrunk_axis(rd_map.doppler_hz, COLUMNS),
        "map_range_m": shrunk_axis(rd_map.range_m, ROWS),
        "map_db": _levels(rd_map.power[0], COLUMNS, ROWS),
        "profile_range_m": shrunk_axis(profile.range_m, COLUMNS),
        "profile": resample_max(profile.power, min(COLUMNS, profile.power.size), 0),
        "echo_s": shrunk_axis(echoes.fast_time_s, ROWS),
        "echo_row": shrunk_axis(np.arange(samples.shape[0], dtype=np.float64), COLUMNS),
        "echo_db": _levels(samples, COLUMNS, ROWS),
    }
    shown = result.spectrogram
    if shown is not None:
        found["spectrogram_s"] = shrunk_axis(shown.time_s, COLUMNS)
        found["spectrogram_mps"] = shrunk_axis(shown.velocity_mps[::-1], ROWS)
        found["spectrogram_db"] = _levels(shown.power[:, ::-1], COLUMNS, ROWS)
    return found


def shrunk_axis(centres: Real, most: int) -> Real:
    """Return the centres of at most `most` cells over the same edges, evenly spaced."""
    if centres.size <= most:
        return centres
    low, high = cell_edges(centres)
    return low + (high - low) * (np.arange(most) + 0.5) / most


def _levels(power: Real, rows: int, columns: int) -> Any:
    """Levels of the strongest of joined cells, (<= rows, <= columns) [dB]; -300 for no power."""
    small = resample_max(power, min(rows, power.shape[0]), 0)
    small = resample_max(small, min(columns, power.shape[1]), 1)
    level = np.full(small.shape, -300.0)
    np.log10(small, out=level, where=small > 0)
    return np.where(small > 0, np.maximum(10 * level, -300.0), -300.0).astype(np.float16)


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


# -------------------------------------------------------------------------------------------------
# Processing of a run for the window, in a process of its own. Does not import bpy.
#
#     python -m radarsim_addon.blender.ui.result_pictures RUN VIEWS [OPTION ...]
#
# writes one JSON record per line: progress, results of frames, an error. What the window shows of
# each frame goes into the folder VIEWS. OPTIONs are those of `radarsim process`.
# -------------------------------------------------------------------------------------------------


def processing_records(folder: Path, views: Path, words: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Process a run step by step; write what the window shows of each frame.

    words: options of `radarsim process`.
    """
    # slow: not for `add-on enabled`
    from ...signal.pipeline import parse_process_arguments, process_options, process_run

    chosen = parse_process_arguments(["process", str(folder), "--no-plots", *words])
    for event in process_run(folder, process_options(chosen)):
        if hasattr(event, "rd_map"):
            write_view(event, views)
            yield _frame_record(event)
        else:
            yield {"fraction": event.done / max(event.total, 1), "text": event.text}


def _frame_record(result: Any) -> dict[str, Any]:
    text = f"Frame {result.frame}: {len(result.files)} files"
    if result.files:
        text += f" in {result.files[0].parent}"
    findings = [to_json(item) for item in result.findings]
    return {"frame": result.frame, "text": text, "findings": findings}


def main(words: list[str]) -> int:
    """Write the records of a run to standard output; return the exit code."""
    try:
        for record in processing_records(Path(words[0]), Path(words[1]), words[2:]):
            print(json.dumps(record), flush=True)
    except RadarSimError as error:
        print(json.dumps({"error": str(error), "kind": type(error).__name__}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
