# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages between the window and processes of its own: a JSON object and arrays.

`packed` makes an array of any value of the package's types. The other end has them under a name of
its own: Blender puts packages of extensions into one of its own.
"""

from __future__ import annotations

import io
import json
import os
import pickle
import sys
from collections.abc import Mapping
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Bytes that hold the length of the JSON text.
_LENGTH_BYTES = 8
#: Types outside the package and numpy that a packed value may have.
_PLAIN = {("builtins", name) for name in ("complex", "set", "frozenset", "slice", "range")}
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


def packed(value: object) -> NDArray[np.uint8]:
    """Return bytes for `unpacked` in a process of the window, (n,)."""
    return np.frombuffer(pickle.dumps(value, pickle.HIGHEST_PROTOCOL), dtype=np.uint8)


def unpacked(data: NDArray[np.uint8]) -> Any:
    """Return the value that was `packed`."""
    return _Unpickler(io.BytesIO(data.tobytes())).load()


class _Unpickler(pickle.Unpickler):
    """Makes values of types of this package and arrays of numpy, and of nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        package = __name__.rpartition(".")[0]
        inner = module.rpartition(f"{package}.")
        if inner[1]:
            return super().find_class(f"{package}.{inner[2]}", name)
        if module.partition(".")[0] != "numpy" and (module, name) not in _PLAIN:
            raise pickle.UnpicklingError(f"{module}.{name} is no value of a message")
        return super().find_class(module, name)
