#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long things take and how good they are, next to the bounds and to the version before.

    python scripts/bench.py [--out out/bench] [--only canyon|frames|...] [--large] [--quick]

Prints a table, writes bench.json and pictures, and the version's row of docs/benchmarks.json.
Processor time stands next to wall time: on a busy machine it is the one to compare. A quarter of an
hour on two idle cores.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from radarsim_addon.atomic_files import write_json, write_text  # noqa: E402

#: The street canyon's cost and error, frames of a moving car, scenes of many objects, the demo;
#: then error against time in the paper's scene, cost against the number of paths, echo synthesis,
#: motion by both methods, rows over a clutter surface, runs by several processes.
PARTS = (
    "canyon", "frames", "scenes", "demo", "paper", "scaling", "synthesis", "motion", "clutter",
    "workers",
)  # fmt: skip


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = ROOT / "out" / "bench"
    parser.add_argument("--out", type=Path, default=default, metavar="DIR")
    parser.add_argument("--large", action="store_true", help="also a run of ten million paths")
    parser.add_argument("--quick", action="store_true", help="a tenth of it, to see that it runs")
    parser.add_argument("--only", choices=PARTS, action="append", help="this part; may be repeated")
    parser.add_argument(
        "--pictures", action="store_true", help="draw the pictures of a bench.json again"
    )
    arguments = parser.parse_args(argv)
    from scripts.benchmarks.bounds import add_to_history
    from scripts.benchmarks.figures import draw
    from scripts.benchmarks.report import table

    out = arguments.out.resolve()
    if arguments.pictures:
        for path in draw(json.loads((out / "bench.json").read_text(encoding="utf-8")), out):
            print(f"wrote {path}")
        return 0
    out.mkdir(parents=True, exist_ok=True)
    result = measure(arguments.only or PARTS, arguments.large, arguments.quick)
    write_json(out / "bench.json", result)
    text = table(result)
    write_text(out / "bench.txt", text + "\n")
    print("\n" + text)
    if out == default and not arguments.quick:
        add_to_history(result)
    for path in draw(result, out):
        print(f"wrote {path}")
    return 0


def measure(parts: Sequence[str], large: bool, quick: bool) -> dict[str, Any]:
    """The parts asked for."""
    import bpy

    from radarsim_addon import __version__
    from scripts.benchmarks.accuracy import run_accuracy
    from scripts.benchmarks.canyon import run_canyon, run_canyon_error
    from scripts.benchmarks.clutter_costs import run_clutter
    from scripts.benchmarks.motion import run_motion
    from scripts.benchmarks.scaling import run_scaling
    from scripts.benchmarks.sionna_canyon import run_sionna
    from scripts.benchmarks.synthesis import run_synthesis
    from scripts.benchmarks.worker_costs import run_workers
    from scripts.benchmarks.workload_costs import built, run_demo, run_frames, run_scenes

    machine = {
        "cpus": os.cpu_count() or 1,
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
        "blender": bpy.app.version_string,
        "radarsim": __version__,
        "processor": platform.processor() or platform.machine(),
    }
    blend = ROOT / "blend_examples" / "paper_scene.blend"
    with tempfile.TemporaryDirectory(prefix="radarsim_bench_") as name:
        folder = Path(name)
        result: dict[str, Any] = {"machine": machine}
        if "synthesis" in parts:
            say("echo synthesis")
            result["synthesis"] = run_synthesis()
        if "canyon" in parts:
            say("the street canyon")
            result["canyon"] = run_canyon(1 if quick else 5, (1,) if quick else (1, 2))
            result["canyon_error"] = run_canyon_error(quick)
            result["sionna"] = {} if quick else run_sionna(folder)
        if "frames" in parts:
            say("frames of a moving car")
            result["frames"] = run_frames(folder, quick)
        if "scenes" in parts:
            say("scenes of many objects")
            result["scenes"] = run_scenes(folder, quick)
        if "demo" in parts:
            say("the demo")
            result["demo"] = run_demo(folder, quick)
        if "scaling" in parts:
            say("paths against their number")
            result["scaling"] = run_scaling(blend, folder, large, quick)
        if "motion" in parts:
            say("motion by both methods")
            result["motion"] = run_motion(folder / "motion")
        if "clutter" in parts:
            say("rows over a clutter surface")
            result["clutter"] = run_clutter(folder, quick)
        if "workers" in parts:
            say("runs by several processes")
            result["workers"] = run_workers(built("car", folder), folder, quick)
        if "paper" in parts:
            say("error against time")
            result["accuracy"] = run_accuracy(blend, folder, quick)
    return result


def say(what: str) -> None:
    print(f"radarsim bench: {what}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
