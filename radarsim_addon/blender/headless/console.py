# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard output without Blender's own messages. Does not import bpy."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import TextIO


@contextlib.contextmanager
def quiet_blender() -> Iterator[TextIO]:
    """Discard the output of Blender's C code (up to Blender 4.5, 50 lines for each render).

    Yield a stream to the real standard output.
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
