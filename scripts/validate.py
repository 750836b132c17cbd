#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the program's powers, ranges and losses with closed forms, case by case.

    python scripts/validate.py [--quick] [--only GROUP ...] [--out docs] [--list] [--pictures]
    python scripts/validate.py --other-blender

Writes validation.md, validation.json and images/validation_*.png into the folder of --out (with
--quick or --only: out/validation, unless told otherwise). Exit status 1 if a bound is broken; the
cases are named. Each group of cases runs in a process of its own.

A whole run also puts its outcome into validation_versions.json, from which the report has its table
of Blender's versions. With --other-blender that is all that it writes there.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from radarsim_addon.atomic_files import write_text  # noqa: E402
from scripts.validation.case import (  # noqa: E402
    Bench,
    Group,
    Outcome,
    now_utc,
    outcome_from_json,
    run_case,
)
from scripts.validation.report import console, markdown  # noqa: E402
from scripts.validation.versions import keep, table  # noqa: E402

#: A process that takes this many times its cases' processor time by the clock is hung.
_PATIENCE = 6.0


def main(argv: list[str] | None = None) -> int:
    """Entry of the script; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the report")
    parser.add_argument("--quick", action="store_true", help="a subset, in less than a minute")
    parser.add_argument("--only", nargs="+", metavar="GROUP", help="these groups alone")
    parser.add_argument(
        "--pictures", action="store_true", help="write page and pictures of a validation.json again"
    )
    parser.add_argument(
        "--other-blender",
        action="store_true",
        help="keep the outcome for the table of versions alone; the report stays as it is",
    )
    parser.add_argument("--list", action="store_true", help="name the cases and end")
    parser.add_argument("--worker", type=Path, metavar="JSON", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.worker:
        _work(arguments.only, arguments.quick, arguments.worker)
        # bpy 4.5 as a module hangs at its exit while properties are registered
        sys.stdout.flush()
        os._exit(0)
    if arguments.pictures:
        redraw((arguments.out or ROOT / "docs").resolve())
        return 0
    from scripts.validation.registry import groups

    try:
        found = groups(arguments.only, arguments.quick)
    except KeyError as error:
        parser.error(str(error.args[0]))
    if arguments.list:
        for group in found:
            for case in group.cases:
                mark = "quick" if case.quick else ""
                print(f"{group.key:16} {case.name:44} {case.limit_s:>5g} s {mark}")
        return 0
    partial = arguments.quick or arguments.only
    out = (arguments.out or (ROOT / "out" / "validation" if partial else ROOT / "docs")).resolve()
    if partial and arguments.other_blender:
        parser.error("--other-blender keeps the outcome of all cases; leave out --quick and --only")
    return validate(found, arguments.quick, out, whole=not partial, only=arguments.other_blender)


def validate(
    found: list[Group], quick: bool, out: Path, *, whole: bool = False, only: bool = False
) -> int:
    """Run the groups, write the report; 1 if a bound is broken.

    whole: these are all cases, so the outcome is kept for the table of versions; only: that is all.
    """
    machine = _machine()
    outcomes: list[Outcome] = []
    curves: dict[str, Any] = {}
    sections: dict[str, list[str]] = {}
    start_s = time.perf_counter()
    # The quick subset shares one process: starting Blender takes longer than most of its cases.
    parts = [found] if quick else [[group] for group in found]
    for part in parts:
        result = _run_part(part, quick)
        machine |= result["machine"]
        new = [outcome_from_json(record) for record in result["outcomes"]]
        for outcome in new:
            print(console(outcome), flush=True)
        outcomes += new
        curves |= result["curves"]
        sections |= result["sections"]
    machine["wall_s"] = time.perf_counter() - start_s
    machine["cpu_s"] = sum(outcome.cpu_s for outcome in outcomes)
    records = keep(out, machine, outcomes) if whole else {}
    if not only:
        _write(out, machine, found, outcomes, curves, sections, table(records))
    faults = [fault for outcome in outcomes for fault in outcome.faults]
    for fault in faults:
        print(f"BROKEN {fault}", file=sys.stderr)
    checks = sum(len(outcome.checks) for outcome in outcomes)
    print(
        f"{checks} results, {len(faults)} broken, {machine['cpu_s']:.0f} s of processor time, "
        f"{machine['wall_s']:.0f} s by the clock"
    )
    return 1 if faults else 0


def redraw(out: Path) -> None:
    """Page and pictures of what was measured before, from validation.json in the folder `out`."""
    from scripts.validation.registry import groups
    from scripts.validation.versions import read

    record = json.loads((out / "validation.json").read_text(encoding="utf-8"))
    outcomes = [outcome_from_json(item) for item in record["outcomes"]]
    versions = table(read(out))
    sections = record["sections"]
    _write(out, record["machine"], groups(), outcomes, record["curves"], sections, versions)


def _run_part(part: list[Group], quick: bool) -> dict[str, Any]:
    """Run groups in a new process; one that dies or hangs breaks all its cases."""
    keys = [group.key for group in part]
    patience_s = 60 + _PATIENCE * sum(c.limit_s for g in part for c in g.cases)
    with tempfile.TemporaryDirectory(prefix="radarsim_validate_") as name:
        result = Path(name) / "result.json"
        command = [sys.executable, str(Path(__file__).resolve()), "--worker", str(result)]
        command += ["--quick"] * quick + ["--only", *keys]
        # Blender's user folder is an empty one: a user's own preferences play no part.
        # Threads of BLAS that wait for one another over small matrices would count as work.
        environment = {
            **os.environ,
            "BLENDER_USER_RESOURCES": name,
            "OPENBLAS_NUM_THREADS": "1",
        }
        try:
            done = subprocess.run(command, env=environment, timeout=patience_s, check=False)
            trouble = f"its process ended with status {done.returncode}"
        except subprocess.TimeoutExpired:
            trouble = f"its process did not end within {patience_s:.0f} s"
        if result.exists():
            found: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))
            return found
    lost = [Outcome(g.key, c.name, [], 0.0, 0.0, c.limit_s, trouble) for g in part for c in g.cases]
    return {
        "machine": {},
        "outcomes": [outcome.as_json() for outcome in lost],
        "curves": {},
        "sections": {},
    }


def _work(keys: list[str], quick: bool, result: Path) -> None:
    """The other process: run the cases, write what they found."""
    import bpy

    from scripts.validation.kept_groups import kept_groups
    from scripts.validation.registry import groups

    outcomes: list[Outcome] = []
    curves: dict[str, Any] = {}
    sections: dict[str, list[str]] = {}
    with tempfile.TemporaryDirectory(prefix="radarsim_cases_") as name, kept_groups(Path(name)):
        for group in groups(keys, quick):
            bench = Bench(Path(name) / group.key, quick)
            bench.folder.mkdir()
            outcomes += [run_case(group, case, bench) for case in group.cases]
            curves |= bench.curves
            if bench.lines:
                sections[group.key] = bench.lines
    record = {
        "machine": {"blender": bpy.app.version_string},
        "outcomes": [outcome.as_json() for outcome in outcomes],
        "curves": curves,
        "sections": sections,
    }
    write_text(result, json.dumps(record, allow_nan=False))


def _machine() -> dict[str, Any]:
    import numpy

    from radarsim_addon import __version__

    return {
        "date": now_utc(),
        "radarsim": __version__,
        "blender": "?",
        "numpy": numpy.__version__,
        "python": platform.python_version(),
        "processor": _processor(),
        "cpus": os.cpu_count() or 1,
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0,
    }


def _processor() -> str:
    """Name of the processor where the system tells it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _write(
    out: Path,
    machine: dict[str, Any],
    found: list[Group],
    outcomes: list[Outcome],
    curves: dict[str, Any],
    sections: dict[str, list[str]],
    versions: list[str],
) -> None:
    from scripts.validation.figures import draw

    out.mkdir(parents=True, exist_ok=True)
    pictures = [
        (f"images/{file}", caption) for file, caption in draw(outcomes, curves, out / "images")
    ]
    text = markdown(machine, found, outcomes, pictures, versions)
    record = {
        "machine": machine,
        "passed": not any(outcome.faults for outcome in outcomes),
        "outcomes": [outcome.as_json() for outcome in outcomes],
        "curves": curves,
        "sections": sections,
    }
    files = {
        "validation.md": text,
        "validation.json": json.dumps(record, indent=1, allow_nan=False) + "\n",
    }
    for name, content in files.items():
        write_text(out / name, content)
        print(f"wrote {out / name}")


if __name__ == "__main__":
    sys.exit(main())
