# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim render`` with its processor time by stages.

    python -m scripts.benchmarks.stages STAGES.json radarsim's own words ...

Stages: Blender's start (until bpy is there), preparation (until the first render), Cycles (within
Blender's renders, their files included), rest.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Any

import bpy

START_S = time.process_time()


def main() -> None:
    """Run the command; it ends the process."""
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
        cycles_s = sum(ended) - sum(begun)
        first_s = begun[0] if begun else time.process_time()
        stages = {
            "start_s": START_S,
            "preparation_s": first_s - START_S,
            "cycles_s": cycles_s,
            "rest_s": time.process_time() - first_s - cycles_s,
            "renders": len(ended),
        }
        write_json(Path(output), stages)
        leave(code)

    bpy.app.handlers.render_init.append(begin)
    bpy.app.handlers.render_complete.append(end)
    os._exit = write_and_leave  # type: ignore[assignment]
    render_command(words)


if __name__ == "__main__":
    main()
