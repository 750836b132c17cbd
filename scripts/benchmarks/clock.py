# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run costs: wall time, processor time of all threads, peak memory."""

from __future__ import annotations

import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

#: Time between two looks at the memory of a command [s].
_LOOK_S = 0.01


@dataclass
class Cost:
    """Time of a stretch of code [s]; processor time counts all threads of this process.

    `peak_mib`, of commands only: most memory without mapped files, NaN where the system does not
    tell it.
    """

    wall_s: float = 0.0
    cpu_s: float = 0.0
    peak_mib: float = math.nan


@contextmanager
def stopwatch() -> Iterator[Cost]:
    """Measure the body; the numbers are there when it is left."""
    cost = Cost()
    wall_s, cpu_s = time.perf_counter(), processor_s()
    yield cost
    cost.wall_s, cost.cpu_s = time.perf_counter() - wall_s, processor_s() - cpu_s


def processor_s() -> float:
    """User and system time of this process so far [s]."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def peak_mib() -> float:
    """Peak resident memory of this process so far [MiB]."""
    # Linux hands the peak of the parent on through getrusage; the file has the process's own
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 2**10
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def command_cost(words: Sequence[str | Path], folder: Path) -> Cost:
    """Run Python with these words, from `folder`; RuntimeError with what it wrote if it fails."""
    started_s = time.perf_counter()
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as output:
        process = subprocess.Popen(
            [sys.executable, *map(str, words)],
            cwd=folder,
            # compiled modules are kept, as they are where the program is installed
            env={**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": ""},
            stdout=output,
            stderr=output,
        )
        peak_mib, ended = math.nan, 0
        while not ended:
            time.sleep(_LOOK_S)
            peak_mib = max(_anonymous_mib(process.pid), peak_mib, key=lambda m: (m == m, m))
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode not in (0, 3):  # 3: done, with findings of severity error
            output.seek(0)
            raise RuntimeError(f"{' '.join(map(str, words))} failed: {output.read()[-2000:]}")
    wall_s = time.perf_counter() - started_s
    return Cost(wall_s, usage.ru_utime + usage.ru_stime, peak_mib)


def half_range(values: Sequence[float]) -> float | None:
    """Half the range of repeats, their error; None of one alone."""
    return (max(values) - min(values)) / 2 if len(values) > 1 else None


def _anonymous_mib(pid: int) -> float:
    """Memory of a process now, without mapped files [MiB]; NaN where Linux does not tell it."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return math.nan
    found = [int(line.split()[1]) for line in lines if line.startswith(("RssAnon:", "RssShmem:"))]
    return sum(found) / 2**10 if found else math.nan
