# SPDX-License-Identifier: GPL-3.0-or-later
"""One case of the fuzzer: inputs changed, a command run in a process of its own, its end judged."""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import signal
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from radarsim_addon.blender.plan import given_settings, parse_render_arguments
from radarsim_addon.blender.plan.render_arguments import render_settings
from radarsim_addon.errors import RadarSimError
from radarsim_addon.signal.pictures import figure as _figure  # noqa: F401  (loaded before the fork)
from radarsim_addon.signal.pipeline import main
from radarsim_addon.signal.pipeline.cli import add_process_parser

from .corpus import correct_hashes
from .mutations import NUMBERS, TEXTS, change_file

#: Processor time, memory and output that a case may take.
CPU_S, MEMORY_BYTES, OUTPUT_BYTES = 20, 2 << 30, 100_000

__all__ = ["CPU_S", "MEMORY_BYTES", "Case", "run_case"]


@dataclass(frozen=True)
class Case:
    """How a case ended: `fault` is empty where it was well."""

    words: list[str]
    changed: list[str]
    code: int
    output: str
    cpu_s: float
    peak_bytes: int
    fault: str


def run_case(folder: Path, seed: int, number: int) -> Case:
    """Run one case on a copy of the inputs in ``folder / "corpus"``."""
    rng = random.Random(f"{seed}/{number}")
    place = folder / "case"
    shutil.rmtree(place, ignore_errors=True)
    run = rng.choice(["rings", "paths", "paths"])
    shutil.copytree(folder / "corpus" / run, place / "run")
    shutil.copytree(folder / "corpus" / "files", place / "files")
    command, words = _words(rng, place, run)
    changed = _change(rng, place, words)
    log = folder / "output.txt"
    code, used = _forked(lambda: command(words), log, place)
    output = log.read_text("utf-8", errors="replace")
    case = Case(
        words, changed, code, output, used.ru_utime + used.ru_stime, 1024 * used.ru_maxrss, ""
    )
    return Case(**{**vars(case), "fault": _fault(case)})


def _fault(case: Case) -> str:
    if case.code < 0:
        return f"ended by {signal.Signals(-case.code).name}"
    if "Traceback (most recent call last)" in case.output:
        return "traceback"
    if case.code not in (0, 1, 2, 3):
        return f"exit code {case.code}"
    if case.cpu_s > CPU_S:
        return f"{case.cpu_s:.1f} s of processor"
    if case.peak_bytes > MEMORY_BYTES:
        return f"{case.peak_bytes / 2**20:.0f} MiB"
    if len(case.output) > OUTPUT_BYTES:
        return f"{len(case.output)} characters of output"
    return ""


def _change(rng: random.Random, place: Path, words: Sequence[str]) -> list[str]:
    """Change one or two files, of the run or of those that the words name; returns their names."""
    files = {str(path): path for path in sorted((place / "files").iterdir())}
    named = [files[word] for word in words if word in files]  # no other file of this machine
    side = [path for path in sorted((place / "files").iterdir()) if path.suffix != ".json"] + named
    run = [path for path in sorted((place / "run").rglob("*")) if path.is_file()]
    heavy = [path for path in run if path.suffix == ".json"]
    changed = []
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        path = rng.choice(rng.choice([side, heavy, run]) if named else rng.choice([heavy, run]))
        change_file(rng, path, place)
        changed.append(str(path.relative_to(place)))
    if rng.random() < 0.7:
        correct_hashes(place / "run")
    return changed


def _words(
    rng: random.Random, place: Path, run: str
) -> tuple[Callable[[list[str]], int], list[str]]:
    """A command and its words."""
    files = place / "files"
    radars = [str(path) for path in sorted(files.glob("radar_*.json"))]
    budget, kind = str(files / "link_budget.json"), rng.random()
    if kind < 0.08:
        return main, ["info", str(place / "run")]
    if kind < 0.16:
        source = rng.choice([budget, str(place / "run")])
        return main, ["antennas", source, "--carrier-ghz", rng.choice(["77", "5.3", _number(rng)])]
    if kind < 0.24:
        words = ["objects", str(place / "run")]
        return main, words + rng.choice([[], ["--object", rng.choice(["N*", *TEXTS])]])
    if kind < 0.34:
        return _render_arguments, ["a.blend", *_options(rng, 3, _RENDER)]
    words = ["process", str(place / "run")]
    words += ["--plots" if rng.random() < 0.08 else "--no-plots"]
    if rng.random() < 0.4:
        words += ["--waveform", rng.choice(radars)]
    if rng.random() < 0.3:
        words += ["--link-budget", budget]
    if rng.random() < 0.1:
        words += ["--phase-noise", str(files / "noise.csv")]
    for flag in ("--hdf5", "--sigmf", "--allow-incomplete", "--paths-csv"):
        words += [flag] if rng.random() < 0.05 else []
    return main, words + _options(rng, rng.choice([0, 0, 0, 1, 2]), _PROCESS)


def _options(rng: random.Random, count: int, known: Sequence[str]) -> list[str]:
    words = []
    for _ in range(count):
        flag, what = rng.choice(known), rng.random()
        text = _number(rng) if what < 0.6 else rng.choice(TEXTS)[:1000].replace("\0", "")
        if what > 0.8:
            text = rng.choice(["none", "hann", "kaiser:1e9", "taylor:9:9", "os", "1:3", "0:1e9"])
        text = rng.choice([text, text, f"{text}:{_number(rng)}"])
        words += [f"{flag}={text}".encode("utf-8", "replace").decode()]
    return words


def _number(rng: random.Random) -> str:
    return f"{rng.choice(NUMBERS)}"[:60]


def _process_flags() -> list[str]:
    parser = argparse.ArgumentParser()
    commands = parser.add_subparsers()
    add_process_parser(commands)
    flags = [f for a in commands.choices["process"]._actions for f in a.option_strings]
    return sorted(set(flags) - {"-h", "--help", "--out", "--plots", "--animate"})


def _render_arguments(words: list[str]) -> int:
    """What `radarsim render` does before Blender opens the file."""
    try:
        given_settings(parse_render_arguments(words, "radarsim render", True))
    except RadarSimError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return error.exit_code
    return 0


_PROCESS = _process_flags()
_RENDER = [item.flag for item in render_settings().values()] + [
    "--frames", "--resolution", "--scene",
]  # fmt: skip


def _forked(work: Callable[[], int], log: Path, place: Path) -> tuple[int, resource.struct_rusage]:
    """Exit code (negative: the signal) and resources of `work` in a child process."""
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            for number, name in ((1, "stdout"), (2, "stderr")):
                os.dup2(output, number)  # and not into what pytest has put in their place
                setattr(sys, name, os.fdopen(number, "w", encoding="utf-8", closefd=False))
            os.chdir(place)
            resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 2))
            resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_BYTES + (1 << 29),) * 2)
            resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 30,) * 2)
            warnings.simplefilter("ignore")
            code = work()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    _, status, used = os.wait4(child, 0)
    return os.waitstatus_to_exitcode(status), used
