# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost and memory of the paths against their number; each run in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from .clock import peak_mib

#: Width, height, replicates: 15 000 to a million paths, in tiles of the default size.
SIZES = ((160, 90, 1), (320, 180, 1), (640, 360, 1), (1280, 720, 1), (640, 360, 4))
#: Ten million, and the same tiles and replicates in a shorter run, for the memory.
LARGE = ((512, 480, 11), (1280, 720, 11))


def run_scaling(script: Path, blend: Path, folder: Path, large: bool) -> list[dict[str, Any]]:
    """One row for each size; `script` is bench.py, which runs `measure_one` for us."""
    rows = []
    for size in (*SIZES, *(LARGE if large else ())):
        command = [sys.executable, str(script), "--one", str(blend), str(folder), *map(str, size)]
        result = subprocess.run(
            command,
            stdout=subprocess.PIPE,
            text=True,
            check=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        rows.append(json.loads(result.stdout.strip().splitlines()[-1]))
    return rows


def measure_one(
    blend: Path, folder: Path, width: int, height: int, replicates: int
) -> dict[str, Any]:
    """One run of paths and the memory it needed in addition to the open scene."""
    from .paper import PaperScene

    scene = PaperScene(blend, folder)
    scene.paths(16, 16, replicates=1)
    before_mib = peak_mib()
    result = scene.paths(width, height, replicates=replicates)
    return {
        "width_px": width,
        "height_px": height,
        "replicates": replicates,
        "paths": result.samples,
        "renders": result.renders,
        "wall_s": result.acquire.wall_s,
        "cpu_s": result.acquire.cpu_s,
        "cpu_us_per_path": 1e6 * result.acquire.cpu_s / result.samples,
        "process_cpu_s": result.process.cpu_s,
        "peak_mib": result.details["peak_mib"],
        "peak_above_idle_mib": result.details["peak_mib"] - before_mib,
    }
