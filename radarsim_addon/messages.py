# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages between the window and processes of its own: a JSON object and arrays.

`packed` makes an array of any value of the package's types. The other end has them under a name of
its own: Blender puts packages of extensions into one of its own.
"""

from __future__ import annotations

import io
import json
import pickle
from collections.abc import Mapping
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Bytes that hold the length of the JSON text.
_LENGTH_BYTES = 8


class Message(NamedTuple):
    """A JSON object, and arrays of numbers by name."""

    fields: dict[str, Any]
    arrays: dict[str, NDArray[Any]]


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
    def find_class(self, module: str, name: str) -> Any:
        package = __name__.rpartition(".")[0]
        inner = module.rpartition(f"{package}.")
        return super().find_class(f"{package}.{inner[2]}" if inner[1] else module, name)
