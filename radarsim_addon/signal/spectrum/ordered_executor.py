# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in threads with results in order: sums are then the same from run to run."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")

#: More threads than this gain nothing, and each has its buffers.
_MOST_THREADS = 8


def available_threads() -> int:
    """Processors that this process may use, at most 8."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    if asked.isdecimal() and int(asked) > 0:  # 1 in the workers of a coordinator
        return min(int(asked), _MOST_THREADS)
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), _MOST_THREADS)
    return min(os.cpu_count() or 1, _MOST_THREADS)


class OrderedExecutor:
    """Runs jobs in threads, at most two each under way; results come in the jobs' order."""

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._pool: ThreadPoolExecutor | None = None

    def run(self, jobs: Iterable[Callable[[], T]], count: int) -> Iterator[T]:
        """Results of all jobs, `count` of them, in order."""
        if self.threads == 1 or count == 1:
            for job in jobs:
                yield job()
            return
        pending: deque[Future[T]] = deque()
        try:
            for job in jobs:
                if self._pool is None:
                    self._pool = ThreadPoolExecutor(
                        self.threads, thread_name_prefix="radarsim-synthesis"
                    )
                pending.append(self._pool.submit(job))
                if len(pending) > 2 * self.threads:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            for future in pending:
                future.cancel()

    def close(self) -> None:
        """Let the threads go; `run` makes new ones."""
        if self._pool is not None:
            self._pool.shutdown(wait=True)
            self._pool = None
