# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run costs: wall time, processor time of all threads, peak memory."""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path


@dataclass
class Cost:
    """Time of a stretch of code [s]; processor time counts all threads of this process."""

    wall_s: float = 0.0
    cpu_s: float = 0.0


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
