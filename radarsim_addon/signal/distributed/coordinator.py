# SPDX-License-Identifier: GPL-3.0-or-later
"""A command whose frames are done by workers: progress, findings, frames set aside."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from typing import TextIO

from ...errors import WorkerError
from ...findings import Finding, finding_lines, from_json, merge
from ...options import Share
from ...terminal import ProgressLine, printable
from .workers import MAX_FAILURES, DaskWorkers, LocalWorkers, Reply, as_error, scheduled

#: Module of the package that does a frame, and that a worker process runs.
_WORKER_MODULE = f"{__package__.partition('.signal')[0]}.frame_worker"
#: Findings that are kept apart; more become one for each code.
_MAX_FINDINGS = 1000


def run_frames(
    words: Sequence[str],
    share: Share,
    stream: TextIO,
    show: Callable[[Reply], None] = lambda reply: None,
    command: Sequence[str] | None = None,
    about: Reply | None = None,
) -> Reply:
    """Do all frames of a command line by workers; return what is known of the run.

    `show` is called with each answer. `command` starts a worker process of this machine; None: by
    Python. `about` has "frames", all that the command line names; None: the first worker is asked
    before the others begin. WorkerError after the last frame, where some were set aside.
    """
    folder = os.getcwd()
    local = command or [sys.executable, "-m", _WORKER_MODULE, folder, *words]
    with ExitStack() as stack:
        stack.enter_context(stop_signals())
        workers: LocalWorkers | DaskWorkers
        if share.dask is not None:
            workers = DaskWorkers(share.dask, _WORKER_MODULE, folder, words)
        else:
            workers = LocalWorkers(local, share.workers or 1)
        stack.enter_context(workers)
        about = workers.open() if about is None else about
        if "error" in about:
            raise as_error(about)
        for line in about.get("lines", ()):
            print(f"radarsim: {line}", file=stream, flush=True)
        frames = share.part(about["frames"])
        _Count(frames, stream, show).run(scheduled(workers, frames))
    return about


class Interrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM, with the exit code that shells give it."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.exit_code = 128 + number


@contextlib.contextmanager
def stop_signals() -> Iterator[None]:
    """Raise `Interrupted` at Ctrl-C, SIGTERM and, where there is one, at a closed terminal."""

    def interrupt(number: int, _: object) -> None:
        raise Interrupted(number)

    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), interrupt) for name in names}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)


class _Count:
    """Counts answers, shows how far they are, and keeps findings and frames set aside."""

    def __init__(
        self, frames: Sequence[int], stream: TextIO, show: Callable[[Reply], None]
    ) -> None:
        self._frames, self._stream, self._show = frames, stream, show
        self._progress = ProgressLine(stream, "frames")
        self._findings: list[Finding] = []
        self._done = self._new = 0
        self._aside: dict[int, str] = {}

    def run(self, replies: Iterable[Reply]) -> None:
        """Take all answers; WorkerError in the end where frames were set aside."""
        start_s = time.monotonic()
        self._progress.show(0, len(self._frames), None)
        try:
            for reply in replies:
                self._take(reply)
                left = len(self._frames) - self._done
                pace_s = (time.monotonic() - start_s) / self._new if self._new else None
                left_s = None if pace_s is None else pace_s * left
                self._progress.show(self._done, len(self._frames), left_s)
        finally:  # of the frames that are done, whatever ended the run
            for line in finding_lines(self._findings, self._frames):
                print(f"radarsim: {line}", file=self._stream, flush=True)
        if self._aside:
            reasons = "".join(
                f"\n  frame {frame}: {printable(reason.strip().splitlines()[-1])}"
                for frame, reason in sorted(self._aside.items())
            )
            raise WorkerError(
                f"{len(self._aside)} of {len(self._frames)} frames failed {MAX_FAILURES} times and "
                "were set aside; the others are done. Correct what is said here and give the same "
                f"command again, which does these alone:{reasons}"
            )

    def _take(self, reply: Reply) -> None:
        self._done += 1
        self._new += not reply.get("earlier")
        if "set_aside" in reply:
            self._aside[reply["frame"]] = str(reply["set_aside"])
            return
        where = f"the answer of frame {reply['frame']}"
        self._findings += [from_json(item, where) for item in reply.get("findings", ())]
        if len(self._findings) > _MAX_FINDINGS:
            self._findings = merge(self._findings)
        self._show(reply)
