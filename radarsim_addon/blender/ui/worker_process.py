# SPDX-License-Identifier: GPL-3.0-or-later
"""Modules of this package as processes of their own."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import IO, Any

import bpy

from ... import errors
from ...errors import RenderError
from ...messages import Message, read_message, skip_greeting, write_message

_ROOT = Path(errors.__file__).parent


def python_program() -> str | None:
    """The Python that Blender brings; None where it names another program."""
    return sys.executable if "python" in Path(sys.executable or "").name.lower() else None


def start_worker(
    module: str, *words: str, in_blender: bool = False, **options: Any
) -> subprocess.Popen[Any]:
    """Start a module of this package, named from its root; `options` are those of Popen.

    `in_blender`: the module imports bpy. Add-ons and preferences of the user are not loaded there.
    """
    name = f"{_ROOT.name}.{module}"
    paths = [str(_ROOT.parent), *sys.path]
    command = [str(python_program()), "-m", name]
    if in_blender and not bpy.app.binary_path:  # bpy is a module of this Python, with own paths
        paths = [str(_ROOT.parent), os.environ.get("PYTHONPATH", "")]
    elif in_blender:
        code = (
            f"import runpy, sys; sys.path[:0] = {paths[:1]!r}; "
            f"sys.path += [p for p in {paths!r} if p not in sys.path]; "
            f"runpy.run_module({name!r}, run_name='__main__')"
        )
        command = [bpy.app.binary_path, "--background", "--factory-startup"]
        command += ["--disable-autoexec", "--python-expr", code, "--"]
    return subprocess.Popen(
        [*command, *words],
        env={
            # A BLAS rounds otherwise with each number of threads.
            "OPENBLAS_NUM_THREADS": "1",
            "MKL_NUM_THREADS": "1",
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        },
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        **options,
    )


class WorkerProcess:
    """A module of this package that answers messages in a process of its own; `close` ends it.

    Nothing here waits. Raises RenderError where Blender names no Python.
    """

    def __init__(self, module: str, *words: str, in_blender: bool = False) -> None:
        if python_program() is None and not (in_blender and bpy.app.binary_path):
            raise RenderError(
                "Blender names no Python program, so there is no process to compute in. Use a "
                "Blender from blender.org, or render at quality Draft."
            )
        self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = start_worker(
            module,
            *words,
            in_blender=in_blender,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
        )
        self._outgoing: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        self._incoming: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        threading.Thread(target=self._write, daemon=True).start()

    def _write(self) -> None:
        stream = self._process.stdin
        assert stream is not None
        # Blender does not ignore this signal, as Python does: a worker that has ended would end it.
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGPIPE})
        with contextlib.suppress(OSError, ValueError):  # ended meanwhile
            while (message := self._outgoing.get()) is not None:
                write_message(stream, *message)
        # Here, and not by the collection of garbage: that may be in Blender's own thread.
        with contextlib.suppress(OSError, ValueError):
            stream.close()

    def _read(self) -> None:
        stream = self._process.stdout
        assert stream is not None
        with contextlib.suppress(OSError, ValueError):
            skip_greeting(stream)
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
    def is_read(self) -> bool:
        """Whether it has closed its output and all its messages were received."""
        return not self._reader.is_alive() and self._incoming.empty()

    @property
    def exit_code(self) -> int | None:
        """Its exit code, below 0 for a signal; None while it runs."""
        return self._process.poll()

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
