# SPDX-License-Identifier: GPL-3.0-or-later
"""A progress line on standard output, while Blender's own chatter is kept off it. No bpy."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import TextIO


@contextlib.contextmanager
def quiet_blender() -> Iterator[TextIO]:
    """Send what Blender's C code prints (50 lines a render up to 4.5) to nowhere.

    Yields
    ------
    TextIO
        A stream to the real standard output.
    """
    sys.stdout.flush()
    try:
        real = os.dup(1)
    except OSError:  # no standard output at all
        yield sys.stdout
        return
    sink = os.open(os.devnull, os.O_WRONLY)
    stream = os.fdopen(real, "w", encoding="utf-8", errors="replace", closefd=False)
    try:
        os.dup2(sink, 1)
        yield stream
    finally:
        with contextlib.suppress(OSError):  # a reader that went away (| head)
            stream.flush()
        os.dup2(real, 1)
        os.close(sink)
        os.close(real)


class ProgressLine:
    """A line ``12/42 renders, 29 %, 0:18 left``: rewritten in a terminal, else one per 5 %.

    Parameters
    ----------
    stream
        Where the line is written.
    unit
        Plural noun of what is counted.
    """

    def __init__(self, stream: TextIO, unit: str = "renders") -> None:
        self._stream = stream
        self._unit = unit
        self._terminal = stream.isatty()
        self._last_step = -1

    def show(self, done: int, total: int, seconds_left: float | None) -> None:
        """Print the state, if it is time to."""
        step = done * 20 // max(total, 1)
        text = progress_text(done, total, seconds_left, self._unit)
        if self._terminal:
            self._stream.write(f"\r{text:<60}" + ("\n" if done >= total else ""))
        elif step != self._last_step:
            self._stream.write(text + "\n")
        self._last_step = step
        self._stream.flush()


def progress_text(done: int, total: int, seconds_left: float | None, unit: str = "renders") -> str:
    """Return the line of progress.

    Parameters
    ----------
    done, total
        Units that are complete, and all.
    seconds_left
        Estimated time to the end [s]; None: unknown.
    unit
        Plural noun of what is counted.

    Returns
    -------
    str
        One line.
    """
    percent = 100 * done // total if total else 100
    text = f"radarsim: {done}/{total} {unit}, {percent} %"
    if seconds_left is None or done >= total:
        return text
    whole = round(seconds_left)
    hours, rest = divmod(whole, 3600)
    clock = f"{rest // 60}:{rest % 60:02d}" if not hours else f"{hours}:{rest // 60:02d} h"
    return f"{text}, {clock} left"
