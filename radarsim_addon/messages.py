# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages between the window and processes of its own: a JSON object and arrays."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Mapping
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Bytes that hold the length of the JSON text.
_LENGTH_BYTES = 8
#: Line before the first message of a worker. Blender prints its version before it.
_START = b"radarsim messages\n"


class Message(NamedTuple):
    """A JSON object, and arrays of numbers by name."""

    fields: dict[str, Any]
    arrays: dict[str, NDArray[Any]]


def open_messages() -> tuple[IO[bytes], IO[bytes]]:
    """Return two streams of messages for a worker process: one to read, one to write.

    From now on, everything else that the process prints goes to its standard error.
    """
    if hasattr(signal, "SIGPIPE"):  # Blender's Python does not ignore it, and the window may end
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    if sys.platform == "win32":
        import msvcrt

        for number in (0, 1):
            msvcrt.setmode(number, os.O_BINARY)
    sys.stdout.flush()
    writing = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    writing.write(_START)
    writing.flush()
    return os.fdopen(os.dup(0), "rb"), writing


def skip_greeting(stream: IO[bytes]) -> None:
    """Read what a worker printed before its first message."""
    while (line := stream.readline()) and not line.endswith(_START):
        pass


def write_message(
    stream: IO[bytes], fields: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]
) -> None:
    """Write a message to the other process."""
    shapes = [(name, item.dtype.str, item.shape) for name, item in arrays.items()]
    text = json.dumps([dict(fields), shapes]).encode()
    stream.write(len(text).to_bytes(_LENGTH_BYTES, "little") + text)
    for item in arrays.values():
        stream.write(np.ascontiguousarray(item).tobytes())
    stream.flush()


def read_message(stream: IO[bytes]) -> Message | None:
    """Read a message; None where the other process has ended, or ended within a message."""
    length = stream.read(_LENGTH_BYTES)
    if len(length) < _LENGTH_BYTES:
        return None
    text = stream.read(int.from_bytes(length, "little"))
    arrays = {}
    try:
        fields, shapes = json.loads(text)
        for name, kind, shape in shapes:
            dtype = np.dtype(kind)
            count = int(np.prod(shape, dtype=np.int64))
            data = stream.read(count * dtype.itemsize)
            arrays[name] = np.frombuffer(data, dtype, count).reshape(shape)
    except ValueError:  # cut off
        return None
    return Message(fields, arrays)
