# SPDX-License-Identifier: GPL-3.0-or-later
"""Modules of this package as processes of their own. Does not import bpy."""

from __future__ import annotations

import contextlib
import os
import queue
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import IO, Any

from ... import errors
from ...errors import RenderError
from ...messages import Message, read_message, write_message


def python_program() -> str | None:
    """The Python that Blender brings; None where it names another program."""
    return sys.executable if "python" in Path(sys.executable or "").name.lower() else None


def start_worker(module: str, *words: str, **options: Any) -> subprocess.Popen[Any]:
    """Start a module of this package, named from its root; `options` are those of Popen."""
    root = Path(errors.__file__).parent
    return subprocess.Popen(
        [str(python_program()), "-m", f"{root.name}.{module}", *words],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(root.parent), *sys.path])},
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        **options,
    )


class WorkerProcess:
    """A module of this package that answers messages in a process of its own; `close` ends it.

    Nothing here waits. Raises RenderError where Blender names no Python.
    """

    def __init__(self, module: str) -> None:
        if python_program() is None:
            raise RenderError(
                "Blender names no Python program, so there is no process to compute in. Use a "
                "Blender from blender.org, or render at quality Draft."
            )
        self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = start_worker(
            module, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log
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
