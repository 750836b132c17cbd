# SPDX-License-Identifier: GPL-3.0-or-later
"""Worker processes of this machine. They read frames from standard input and answer in JSON lines.

A worker that loses its coordinator reads the end of its input: it ends after its frame.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import IO

from ...errors import WorkerError
from .schedule import Reply

#: What makes the libraries of a worker use one thread.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
#: Time that a worker has to end its step when it is asked to stop [s].
_GRACE_S = 60.0
_MAX_STARTS = 10


class _Child:
    """A worker process; `frame` is what it is doing: a frame, or None for the run as a whole."""

    def __init__(self, command: Sequence[str], replies: queue.Queue[tuple[_Child, str]]) -> None:
        package_parent = str(Path(__file__).resolve().parents[3])
        paths = [package_parent, *filter(None, [os.environ.get("PYTHONPATH")])]
        self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            env=os.environ | _ONE_THREAD | {"PYTHONPATH": os.pathsep.join(paths)},
            start_new_session=True,  # Ctrl-C goes to the coordinator alone
        )
        self.frame: int | None = None
        self.busy = self.answered = False
        threading.Thread(target=self._read, args=(replies,), daemon=True).start()

    def _read(self, replies: queue.Queue[tuple[_Child, str]]) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith(b"{"):  # else Blender's own words
                replies.put((self, line.decode()))
        self.process.wait()
        replies.put((self, ""))

    def ask(self, frame: int | None) -> None:
        """Have a frame done; None: answer what the run is."""
        self.frame, self.busy = frame, True
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):  # killed meanwhile: its output ends, too
            self.process.stdin.write(json.dumps(frame).encode() + b"\n")
            self.process.stdin.flush()

    def dismiss(self, stop: bool) -> None:
        """Let it end after its frame; `stop`: after its step."""
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.close()
        if stop:
            self.process.terminate()

    def last_words(self) -> str:
        """What it wrote last on standard error."""
        self._log.seek(max(0, self._log.seek(0, os.SEEK_END) - 2000))
        return self._log.read().decode(errors="replace").strip()

    def close(self) -> None:
        """See it end, if need be by force."""
        try:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(_GRACE_S)
        finally:
            self.process.kill()
            self._log.close()


class LocalWorkers:
    """`count` processes of `command`; who is lost is replaced when there is a frame for it."""

    def __init__(self, command: Sequence[str], count: int) -> None:
        self._command, self._count = command, count
        self._children: list[_Child] = []
        self._replies: queue.Queue[tuple[_Child, str]] = queue.Queue()

    def open(self) -> Reply:
        """Start the workers; return what one of them answers about the run.

        The others load their modules meanwhile.
        """
        for _ in range(_MAX_STARTS):
            asked = self._idle()
            asked.ask(None)
            while len(self._children) < self._count:
                self._children.append(_Child(self._command, self._replies))
            child, reply = self._next()
            while child is not asked:  # killed while it had nothing to do
                child, reply = self._next()
            child.busy = False
            if reply is not None:
                return reply
        raise WorkerError(f"{_MAX_STARTS} worker processes were killed before they answered.")

    def free(self) -> int:
        """Return how many frames more may be given out."""
        return self._count - sum(child.busy for child in self._children)

    def submit(self, frame: int) -> None:
        """Give out a frame."""
        self._idle().ask(frame)

    def wait(self) -> list[tuple[int, Reply | None]]:
        """Wait for an answer; None where the frame's worker was lost."""
        child, reply = self._next()
        busy, child.busy = child.busy, False
        # else killed while it had nothing to do
        return [(child.frame, reply)] if busy and child.frame is not None else []

    def _next(self) -> tuple[_Child, Reply | None]:
        """The next answer; None where its worker ended without one."""
        child, line = self._replies.get()
        if line:
            child.answered = True
            return child, json.loads(line)
        self._children.remove(child)
        words = child.last_words()
        child.close()
        code = child.process.returncode
        if not child.answered and code >= 0:  # it ended by itself, as the next one would
            raise WorkerError(
                f"A worker process ended with exit code {code} before it began. {words}\n"
                "Run the same command without --workers to see why."
            )
        return child, None

    def close(self, stop: bool) -> None:
        """End all workers after their frames; `stop`: after the step that they are doing."""
        for child in self._children:
            child.dismiss(stop)
        try:
            for child in self._children:
                child.close()
        finally:
            for child in self._children:
                child.process.kill()
            self._children.clear()

    def _idle(self) -> _Child:
        for child in self._children:
            if not child.busy:
                return child
        self._children.append(_Child(self._command, self._replies))
        return self._children[-1]

    def __enter__(self) -> LocalWorkers:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close(stop=kind is not None)
