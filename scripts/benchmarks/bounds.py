# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures that radarsim is held to, next to those measured, and their history.

`docs/benchmarks.json` has one row a version: each figure with its error (half the range of the
repeats, or a standard error).
"""

from __future__ import annotations

import datetime
import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from radarsim_addon.atomic_files import write_json

from .clock import half_range

_ROOT = Path(__file__).resolve().parents[2]
HISTORY = _ROOT / "docs" / "benchmarks.json"
#: Value and error; None where it was measured once.
Figures = dict[str, tuple[float, float | None]]


@dataclass(frozen=True)
class Row:
    """One figure with its bound, and Sionna RT's on a canyon like this one.

    A bound was set on another machine and on another street, where the first version (commit
    ea7593f, 22 November 2026) had the figure `first_there`. Where `first` is known, that version's
    figure on these scenes and the machine of docs/benchmarks.md, the bound keeps its ratio to it.
    `most` is False where the figure must reach the bound.
    """

    key: str
    label: str
    unit: str
    first_there: float | None
    bound_there: float | None
    first: float | None = None
    sionna: float | None = None
    most: bool = True

    @property
    def bound(self) -> float | None:
        """The bound here."""
        if self.bound_there is None or self.first_there is None or self.first is None:
            return self.bound_there
        return self.bound_there * self.first / self.first_there

    def keeps(self, value: float) -> bool:
        """Whether a figure is within the bound; without one, each is."""
        return self.bound is None or (value <= self.bound if self.most else value >= self.bound)


ROWS = (
    Row("canyon_1_render", "canyon, 1e6 rays, order 1: render", "s", 6.7, 2.0, 11.4, 0.30),
    Row("canyon_1_render_mib", "   its memory", "MiB", 1347, 450, 1344, 598),
    Row("canyon_2_render", "canyon, order 2: render", "s", 14.6, 5.5, 19.1, 0.69),
    Row("canyon_1_process", "canyon, order 1: process", "s", 16.0, 1.5, 26.9),
    Row("canyon_1_process_mib", "   its memory", "MiB", 4256, 500, 4297),
    Row("canyon_1_process_pictures", "   with pictures", "s", 16.0, 2.5, 26.7),
    Row("canyon_2_process", "canyon, order 2: process", "s", 18.4, None, 25.8),
    Row("canyon_1_error", "rms error of bins of 1 m, order 1", "dB", 0.085, 0.012, 0.286, 0.012),
    Row("canyon_2_error", "   second reflections alone", "dB", 1.8, 1.0),
    Row("frame_render", "77 GHz, 64 x 64, moving car: render, a frame", "s", 0.36, 0.08, 0.41),
    Row("frame_process", "   process, a frame", "s", None, 0.10, 0.48),
    Row("frame_process_pictures", "   with pictures", "s", 1.03, 0.35, 1.50),
    Row("instances_first", "1e5 opaque instances: to the first render", "s", None, 4.0),
    Row("instances_frame", "   a later frame, nothing moves", "s", None, 0.5),
    Row("traffic_frame", "   a later frame, one object moves", "s", None, 0.5),
    Row("objects_prepared", "5000 objects prepared", "s", 36.0, 2.0),
    Row("city_render", "city of 2367 objects, 1e6 rays, order 1: render", "s", 14.3, 4.0, 13.3),
    Row("mirror_cost", "a mirror under everything: render, over that without", "x", None, 1.3),
    Row("mirror_paths", "   its paths, over those without", "x", None, None),
    Row("ten_million_1_wall", "1e7 paths, order 1: wall", "s", 61.4, 40.0, 59.3),
    Row("ten_million_1_mib", "   its memory", "MiB", None, 600),
    Row("ten_million_wall", "1.2e7 paths, order 2: wall", "s", 61.4, 40.0, 148.0),
    Row("ten_million_mib", "   its memory", "MiB", None, 600),
    Row("demo_wall", "the demo: wall", "s", 24.5, 15.0, 27.3),
    Row("two_workers", "60 frames: 2 workers over 1, times faster", "x", None, 1.6, most=False),
    Row("dask_frame", "   what Dask adds to a frame: wall", "s", None, 0.05),
    Row("hits", "1e6 hit points in float64, large faces", "s", None, 0.5),
    Row("fine_hits", "   3.2e5 triangles", "s", None, 0.5),
    Row("clutter_rows", "1e6 rows over a clutter surface, bistatic: weights", "s", None, 0.05),
    Row("footprints", "1e6 rows of a ground: what pixels cover", "s", None, 1.0),
)


def figures(result: dict[str, Any]) -> Figures:
    """Return what was measured, value and error by the keys of `ROWS`."""
    found: Figures = {}
    for row in result.get("canyon", ()):
        for key, name in (
            ("render_s", "render"),
            ("render_mib", "render_mib"),
            ("process_s", "process"),
            ("process_mib", "process_mib"),
            ("process_pictures_s", "process_pictures"),
        ):
            low_high = row[f"{key}_range"] if row["repeats"] > 1 else row[f"{key}_range"][:1]
            found[f"canyon_{row['order']}_{name}"] = row[key], half_range(low_high)
    error = result.get("canyon_error", {})
    for order, name in ((1, "first_db"), (2, "second_db")):
        if name in error:
            found[f"canyon_{order}_error"] = error[name], error[f"{name}_error"]
    scenes = result.get("scenes", {})
    for part, name, key in (
        (result.get("frames", {}), "render_s", "frame_render"),
        (result.get("frames", {}), "process_s", "frame_process"),
        (result.get("frames", {}), "process_pictures_s", "frame_process_pictures"),
        (scenes.get("instances", {}), "first_render_s", "instances_first"),
        (scenes.get("instances", {}), "frame_s", "instances_frame"),
        (scenes.get("traffic", {}), "frame_s", "traffic_frame"),
        (scenes.get("objects", {}), "preparation_s", "objects_prepared"),
        (scenes.get("city", {}), "render_s", "city_render"),
        (scenes.get("mirror", {}), "cost_ratio", "mirror_cost"),
        (scenes.get("mirror", {}), "path_ratio", "mirror_paths"),
        (result.get("demo", {}), "wall_s", "demo_wall"),
        (result.get("workers", {}), "two_workers", "two_workers"),
        (result.get("workers", {}), "dask_s", "dask_frame"),
        (result.get("clutter", {}), "hits_s", "hits"),
        (result.get("clutter", {}), "fine_hits_s", "fine_hits"),
        (result.get("clutter", {}), "rows_s", "clutter_rows"),
        (result.get("clutter", {}), "footprints_s", "footprints"),
    ):
        if name in part:
            found[key] = part[name], part[f"{name}_error"]
    for row in result.get("scaling", ()):
        if row["paths"] > 9e6:  # once: no error is known
            name = "ten_million_1" if row["order"] == 1 else "ten_million"
            found[f"{name}_wall"] = row["wall_s"], None
            found[f"{name}_mib"] = row["peak_mib"], None
    known = {row.key for row in ROWS}
    return {key: pair for key, pair in found.items() if key in known}


def bound_lines(result: dict[str, Any], history: list[dict[str, Any]]) -> list[str]:
    """The table of all figures measured, next to the last version's, the first and the bounds."""
    measured = figures(result)
    if not measured:
        return []
    sionna = _sionna(result.get("sionna", {}))
    before = history[-1]["figures"] if history else {}
    lines = [
        "",
        "Processor seconds without Blender's start, memory without mapped files; +- half the range",
        f"{'':50}{'now':>19}{'last version':>14}{'first':>9}{'bound':>9}{'Sionna RT':>11}",
    ]
    for row in ROWS:
        if row.key not in measured:
            continue
        value, error = measured[row.key]
        quoted = row.key not in sionna
        other = row.sionna if quoted else sionna[row.key]
        now = f"{value:.3g} +- {error:.1g}" if error is not None else f"{value:.3g}"
        last = before.get(row.key, [None])[0]
        cells = [f"{'' if n is None else format(n, '.3g'):>{w}}" for n, w in (
            (last, 14), (row.first, 9), (row.bound, 9), (other, 10))]  # fmt: skip
        mark = "*" if quoted and other is not None else " "
        over = "" if row.keeps(value) else f"  {'over' if row.most else 'below'} the bound"
        lines.append(f"{row.label:50}{now + ' ' + row.unit:>19}{''.join(cells)}{mark}{over}")
    lines.append("* quoted, not measured here. Sionna RT's times are without start and compilation")
    return lines


def _sionna(part: dict[str, dict[str, float]]) -> dict[str, float]:
    """Sionna RT's figures, where they were measured, by the keys of `ROWS`."""
    names = {"render_s": "render", "mib": "render_mib", "error_db": "error"}
    return {
        f"canyon_{order}_{name}": one[key]
        for order, one in part.items()
        for key, name in names.items()
    }


def read_history(path: Path = HISTORY) -> list[dict[str, Any]]:
    """Return the rows of the history, the oldest first."""
    rows: list[dict[str, Any]] = []
    if path.exists():
        rows = json.loads(path.read_text(encoding="utf-8"))
    return rows


def add_to_history(result: dict[str, Any], path: Path = HISTORY) -> None:
    """Write a version's figures into the history; those that were not measured stay."""
    machine, measured = result["machine"], figures(result)
    if not measured:
        return
    key = {"version": machine["radarsim"], "commit": _commit()}
    rows = read_history(path)
    row = next((r for r in rows if all(r[k] == v for k, v in key.items())), None)
    if row is None:
        row = {**key, "figures": {}}
        rows.append(row)
    row |= {"date": datetime.date.today().isoformat(), "blender": machine["blender"]}
    row |= {"cpus": machine["cpus"], "load": machine["load"]}
    row["figures"] |= {
        name: [round(value, 4), None if error is None else round(error, 4)]
        for name, (value, error) in measured.items()
    }
    write_json(path, rows)


def _commit() -> str:
    """Short name of the checkout's commit; empty outside one."""
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=_ROOT, capture_output=True, text=True
    )
    return done.stdout.strip()
