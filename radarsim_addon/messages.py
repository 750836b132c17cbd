# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages between the window and processes of its own: a JSON object and arrays."""

from __future__ import annotations

import json
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
