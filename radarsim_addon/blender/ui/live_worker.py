# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that drafts, as the window sees it: nothing here waits. Does not import bpy."""

from __future__ import annotations

import contextlib
import queue
import subprocess
import tempfile
import threading
from typing import IO

from ...errors import RenderError
from ...signal.draft import Message, read_message, write_message
from .worker_process import python_program, start_worker


class DraftProcess:
    """A process that drafts; `close` ends it.

    Raises RenderError where Blender names no Python.
    """

    def __init__(self) -> None:
        if python_program() is None:
            raise RenderError(
                "Blender names no Python program, so the live preview has no process to compute "
                "in. Use a Blender from blender.org, or render at quality Draft."
            )
        self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = start_worker(
            "signal.draft.worker",
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
        )
        self._outgoing: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        self._incoming: queue.SimpleQueue[Message] = queue.SimpleQueue()
        for target in (self._write, self._read):
            threading.Thread(target=target, daemon=True).start()

    def _write(self) -> None:
        stream = self._process.stdin
        assert stream is not None
        with contextlib.suppress(OSError, ValueError):  # ended meanwhile
            while (message := self._outgoing.get()) is not None:
                write_message(stream, *message)
            stream.close()

    def _read(self) -> None:
        stream = self._process.stdout
        assert stream is not None
        with contextlib.suppress(OSError, ValueError):
            while (message := read_message(stream)) is not None:
                self._incoming.put(message)

    def send(self, message: Message) -> None:
        """Send a message; it is copied into the pipe in the background."""
        self._outgoing.put(message)

    def received(self) -> list[Message]:
        """Messages that have come since."""
        found = []
        with contextlib.suppress(queue.Empty):
            while True:
                found.append(self._incoming.get_nowait())
        return found

    @property
    def last_words(self) -> str | None:
        """What it wrote before it ended; None while it runs."""
        if self._process.poll() is None:
            return None
        self._log.seek(0)
        return self._log.read()[-300:].decode(errors="replace").strip() or "no words"

    def close(self) -> None:
        """End the process."""
        self._outgoing.put(None)
        self._process.kill()
        self._process.wait()
        self._log.close()
