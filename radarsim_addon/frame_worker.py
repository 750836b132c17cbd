# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker: it keeps the run of a command line open and does the frames that a coordinator names.

``python -m radarsim_addon.frame_worker FOLDER render scene.blend ...`` reads one frame a line from
standard input, or "null" for what the run is, and answers in one line of JSON each. Workers of a
Dask cluster call `run_frame`.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from .errors import RadarSimError


class FrameWorker(Protocol):
    """A run that is open in this process."""

    def about(self) -> dict[str, Any]:
        """Describe the run: its "frames", and "lines" to print."""

    def do(self, frame: int) -> dict[str, Any]:
        """Do a frame; "held" where another process has it, "earlier" where it was done before."""

    def stop(self) -> None:
        """Raise SystemExit, here or in `do` as soon as that can stop."""

    def close(self) -> None:
        """Let go of the run. May be called again."""


#: Modules that a worker of a command needs.
_MODULES = {"render": ".blender.headless", "process": ".signal.pipeline"}
#: The run that this process has open, by what it was opened with.
_open: dict[tuple[str, ...], FrameWorker] = {}


def run_frame(
    folder: str, words: Sequence[str], frame: int | None, command: str = ""
) -> dict[str, Any]:
    """Do a frame of a command line given in `folder`. None: describe the run.

    `command` names the call of the command: each call opens its files again. An error is part of
    the answer. It closes the run: the next frame finds a new one.
    """
    try:
        key = (command, folder, *words)
        if key not in _open:
            close()
            with contextlib.chdir(folder), _signals_wait():  # for file names of the command line
                _open[key] = _open_worker(words, joins=frame is not None)
        worker = _open[key]
        return worker.about() if frame is None else {"frame": frame, **worker.do(frame)}
    except Exception as error:
        close()
        named = isinstance(error, RadarSimError)
        message = str(error) if named else traceback.format_exc()
        return {"frame": frame, "error": type(error).__name__, "message": message}


def close() -> None:
    """Let go of the run that is open."""
    while _open:
        _open.popitem()[1].close()


@contextlib.contextmanager
def _signals_wait() -> Iterator[None]:
    """Let SIGTERM wait: where it cuts Blender's import, the process ends without us, or hangs."""
    if threading.current_thread() is not threading.main_thread():  # on Dask, which stops by itself
        yield
        return
    arrived: list[int] = []
    handler = signal.signal(signal.SIGTERM, lambda number, _: arrived.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, handler)
        if arrived:
            signal.raise_signal(arrived[0])


def _open_worker(words: Sequence[str], joins: bool) -> FrameWorker:
    if words[0] == "render":
        from .blender.headless import FrameRenderer
        from .blender.plan import parse_render_arguments

        return FrameRenderer(parse_render_arguments(list(words[1:]), needs_blend=False), joins)
    from .processes import keep_freed_memory
    from .signal.pipeline import FrameProcessor, parse_process_arguments

    keep_freed_memory()
    return FrameProcessor(parse_process_arguments(list(words)))


def serve(folder: str, words: Sequence[str]) -> int:
    """Do frames until the input ends, or SIGTERM comes; return the exit code, or leave Blender."""
    code = 0
    signal.signal(signal.SIGTERM, _stop)
    # Only answers go to the coordinator: Blender prints to the standard output.
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as replies:
        os.dup2(2, 1)
        try:
            # a failure shows again, and is told, with the first frame
            with contextlib.suppress(Exception), _signals_wait():
                importlib.import_module(_MODULES[words[0]], __package__)
            for line in sys.stdin:
                print(json.dumps(run_frame(folder, words, json.loads(line))), file=replies)
                replies.flush()
        except BrokenPipeError:
            code = 1  # the coordinator was killed
        except SystemExit as end:
            code = int(end.code or 0)
        close()
        if "bpy" in sys.modules:
            from .blender.headless import leave_blender

            leave_blender(code)
    return code


def _stop(number: int, _: object) -> None:
    for worker in _open.values():
        worker.stop()
    if not _open:
        sys.exit(128 + number)


if __name__ == "__main__":
    sys.exit(serve(sys.argv[1], sys.argv[2:]))
