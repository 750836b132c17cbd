# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost of the benchmark's own scenes (`workloads`) and of the demo, by the program's commands."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from radarsim_addon import contract
from radarsim_addon.signal.paths import open_table

from .clock import command_cost, half_range
from .stages import process_cost, render_cost

_ROOT = Path(__file__).resolve().parents[2]
_REPEATS = 3
#: Nothing is repeated that has taken so long [s].
_ENOUGH_S = 60.0


def built(name: str, folder: Path) -> Path:
    """Save a scene of `workloads` into a folder; return the file."""
    blend = folder / f"{name}.blend"
    command_cost(["-m", "scripts.benchmarks.workloads", name, blend], _ROOT)
    return blend


def _median(once: Callable[[], dict[str, float]], quick: bool) -> dict[str, Any]:
    """Medians of up to three runs, and half the range of each figure as its error."""
    started_s, each = time.perf_counter(), [once()]
    while not quick and len(each) < _REPEATS and time.perf_counter() - started_s < _ENOUGH_S:
        each.append(once())
    found: dict[str, Any] = {"repeats": len(each)}
    for key in each[0]:
        values = [one[key] for one in each]
        found |= {key: statistics.median(values), f"{key}_error": half_range(values)}
    return found


def run_frames(folder: Path, quick: bool = False) -> dict[str, Any]:
    """Frames of a moving car, processor seconds a frame without Blender's start."""
    blend, run = built("car", folder), folder / "run"
    count = 10 if quick else 100

    def once() -> dict[str, float]:
        render = render_cost(blend, run, "--frames", f"1:{count}")
        plain, pictures = process_cost(run, "--no-plots"), process_cost(run, "--plots")
        return {
            "render_s": render["render_s"] / count,
            "process_s": plain["process_s"] / count,
            "process_pictures_s": pictures["process_s"] / count,
        }

    return {"frames": count, **_median(once, quick)}


def run_scenes(folder: Path, quick: bool = False) -> dict[str, Any]:
    """Scenes of many instances and objects, processor seconds without Blender's start.

    Of a mirror: processor time and number of paths over those without its image.
    """
    run = folder / "run"

    def later_frame_s(name: str) -> tuple[float, float]:
        """Time to the first render, and of a frame after the second."""
        few, more = (
            render_cost(folder / f"{name}.blend", run, "--frames", f"1:{n}") for n in (2, 6)
        )
        return few["preparation_s"], (more["render_s"] - few["render_s"]) / 4

    def field() -> dict[str, float]:
        first_s, frame_s = later_frame_s("instances")
        return {"first_render_s": first_s, "frame_s": frame_s}

    def moving() -> dict[str, float]:
        return {"frame_s": later_frame_s("traffic")[1]}

    def prepared() -> dict[str, float]:
        return {"preparation_s": render_cost(folder / "objects.blend", run)["preparation_s"]}

    def town() -> dict[str, float]:
        return {"render_s": render_cost(folder / "city.blend", run)["render_s"]}

    def mirror() -> dict[str, float]:
        blend, costs, counts = folder / "mirror.blend", [], []
        for images in ("0", "8"):
            costs.append(render_cost(blend, run, "--mirror-images", images)["render_s"])
            table = open_table(run / contract.frame_dir(1) / contract.PATHS_TABLE)
            counts.append(table.size)
        return {"cost_ratio": costs[1] / costs[0], "path_ratio": counts[1] / counts[0]}

    found = {}
    each = {"city": town, "objects": prepared, "instances": field, "traffic": moving}
    for name, once in (each | {"mirror": mirror}).items():
        if not (quick and name in ("instances", "traffic")):
            built(name, folder)
            found[name] = _median(once, quick)
    return found


def run_demo(folder: Path, quick: bool = False) -> dict[str, Any]:
    """The paper's experiment, as `make demo` runs it: wall time [s]."""

    def once() -> dict[str, float]:
        cost = command_cost(["scripts/demo.py", "--out", folder / "demo"], _ROOT)
        return {"wall_s": cost.wall_s, "cpu_s": cost.cpu_s}

    return _median(once, quick)
