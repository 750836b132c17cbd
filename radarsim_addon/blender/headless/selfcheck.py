# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim selfcheck``: whether Cycles on a device gives what measurements stand on."""

from __future__ import annotations

import json
import math
import sys
import tempfile
import time
from pathlib import Path

import bpy

from ...errors import RadarSimError
from ...option_arguments import CommandParser
from ...terminal_text import error_line
from ..run.devices import (
    KINDS,
    Device,
    Verdict,
    cache_file,
    check,
    choose_device,
    chosen_device,
    keep,
)
from .console import quiet_blender
from .cycles_facts import measure_facts
from .session import leave_blender


def verdict_here(device: Device) -> Verdict:
    """Measure all facts in this process; a case that raises is a fact that fails."""
    facts: dict[str, tuple[float, float]] = {}
    failed = []
    with tempfile.TemporaryDirectory(prefix="radarsim_") as name, quiet_blender():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        try:
            choose_device(bpy.context.scene, device)
            for fact in measure_facts(Path(name)):
                shown = fact.deviation if math.isfinite(fact.deviation) else 1e300
                facts[fact.name] = shown, fact.bound
                if not fact.holds:
                    failed.append(fact.name)
        except (RadarSimError, RuntimeError) as error:
            failed.append(f"renders without an error ({str(error).strip()[:200]})")
    return Verdict(facts, tuple(failed))


def check_here(path: str) -> None:
    """Check the device that a file names, and put the verdict in its place; ends the process."""
    data = json.loads(Path(path).read_text(encoding="utf-8"))
    keep(Path(path), verdict_here(Device(data["kind"], tuple(data["ids"]))))
    leave_blender(0)


def main(words: list[str]) -> int:
    """Check a device again, keep the outcome, print it; 1 if a fact fails."""
    parser = CommandParser(
        prog="radarsim selfcheck",
        description="Check on small scenes that Cycles gives what measurements stand on.",
    )
    parser.add_argument(
        "--device", choices=[kind.lower() for kind in KINDS], default="cpu", type=str.lower,
        help="Check the devices of this kind [cpu]",
    )  # fmt: skip
    kind = parser.parse_args(words).device.upper()
    scene = bpy.context.scene
    device = Device(kind)
    started_s = time.perf_counter()
    try:
        if kind != "CPU":
            choose_device(scene, device)
            device = chosen_device(scene)
    except RadarSimError as error:
        print(error_line(error), file=sys.stderr)
        return error.exit_code
    verdict = check(device)
    keep(cache_file(device), verdict)
    for name, (deviation, bound) in verdict.facts.items():
        mark = "FAILED" if name in verdict.failed else "holds"
        print(f"{mark:7} {name:45} {deviation:9.2g}, at most {bound:g}")
    for name in verdict.failed:
        if name not in verdict.facts:
            print(f"FAILED  {name}")
    count, seconds = len(verdict.failed), time.perf_counter() - started_s
    ended = f"{count} facts fail" if count else "all facts hold"
    print(f"{kind}, Blender {bpy.app.version_string}: {ended} ({seconds:.1f} s)")
    return 1 if verdict.failed else 0
