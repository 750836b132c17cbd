# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim render`` in a process of its own, with its processor time by stages.

    python -m scripts.benchmarks.stages STAGES.json radarsim's own words ...

Stages: Blender's start (until bpy is there), preparation (until the first render), Cycles (within
Blender's renders, their files included), rest.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from pathlib import Path
from typing import Any

from .clock import command_cost

_ROOT = Path(__file__).resolve().parents[2]


def render_cost(blend: Path, run: Path, *words: str | int) -> dict[str, Any]:
    """Render a file into a folder, which is removed before: the stages [s of processor], and more.

    `render_s` is without Blender's start, `wall_s` with it; `peak_mib` is without mapped files;
    `begun_s` are the moments at which renders began.
    """
    shutil.rmtree(run, ignore_errors=True)  # else it resumes
    stages = run.with_name("stages.json")
    options = [str(word) for word in words]
    module = ["-m", "scripts.benchmarks.stages", str(stages), str(blend), "--out", str(run)]
    cost = command_cost([*module, *options], _ROOT)
    found: dict[str, Any] = json.loads(stages.read_text(encoding="utf-8"))
    found |= {"wall_s": cost.wall_s, "peak_mib": cost.peak_mib}
    return {"render_s": cost.cpu_s - found["start_s"], **found}


def process_cost(run: Path, *words: str) -> dict[str, float]:
    """Process a run; processor time and memory of the command."""
    cost = command_cost(["-m", "radarsim_addon", "process", str(run), "--again", *words], _ROOT)
    return {"process_s": cost.cpu_s, "peak_mib": cost.peak_mib}


def main() -> None:
    """Run the command; it ends the process."""
    # As the command does before it loads numpy: threads that wait for work take processor time.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import bpy

    start_s = time.process_time()
    from radarsim_addon.__main__ import render_command
    from radarsim_addon.atomic_files import write_json

    output, *words = sys.argv[1:]
    begun: list[float] = []
    ended: list[float] = []
    leave = os._exit

    @bpy.app.handlers.persistent
    def begin(*_: Any) -> None:
        begun.append(time.process_time())

    @bpy.app.handlers.persistent
    def end(*_: Any) -> None:
        ended.append(time.process_time())

    def write_and_leave(code: int) -> None:
        total_s = time.process_time()
        first_s = begun[0] if begun else total_s
        cycles_s = sum(b - a for a, b in zip(begun, ended))
        stages = {
            "start_s": start_s,
            "preparation_s": first_s - start_s,
            "cycles_s": cycles_s,
            "rest_s": total_s - first_s - cycles_s,
            "renders": len(ended),
            "begun_s": begun,
        }
        write_json(Path(output), stages)
        leave(code)

    bpy.app.handlers.render_init.append(begin)
    bpy.app.handlers.render_complete.append(end)
    os._exit = write_and_leave  # type: ignore[assignment]
    render_command(words)


if __name__ == "__main__":
    main()
