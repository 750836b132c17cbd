# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost and memory of `radarsim render` against the number of paths, in the paper's scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from radarsim_addon.contract import PATHS_FILE, PathsRecord, frame_dir
from radarsim_addon.typed_json import read_record

from .stages import render_cost

#: Width, height, replicates, reflections: 15 000 to a million paths, in tiles of the default size.
SIZES = ((160, 90, 1, 1), (320, 180, 1, 1), (640, 360, 1, 1), (1280, 720, 1, 1), (640, 360, 4, 1))
#: Ten million.
LARGE = ((1280, 720, 11, 1), (1280, 720, 11, 2))


def run_scaling(blend: Path, folder: Path, large: bool, quick: bool) -> list[dict[str, Any]]:
    """One row for each size."""
    rows = []
    for width, height, replicates, order in SIZES[: 2 if quick else None] + LARGE * large:
        words: list[str | int] = ["--sampling-mode", "paths", "--motion", "off", "--snapshots", 1]
        words += ["--resolution", f"{width}x{height}", "--replicates", replicates]
        cost = render_cost(blend, folder / "run", *words, "--max-reflections", order)
        record = read_record(folder / "run" / frame_dir(1) / PATHS_FILE, PathsRecord)
        row = {"width_px": width, "height_px": height, "replicates": replicates, "order": order}
        row |= {"paths": record.path_count, "renders": record.renders, "wall_s": cost["wall_s"]}
        row |= {"cpu_s": cost["render_s"], "peak_mib": cost["peak_mib"]}
        rows.append({**row, "cpu_us_per_path": 1e6 * cost["render_s"] / record.path_count})
    return rows
