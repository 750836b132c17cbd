# SPDX-License-Identifier: GPL-3.0-or-later
"""Is an EXR file that Blender has just written whole? Standard library and numpy only.

A full disk leaves a truncated file, and Blender reports it to nobody when it renders in the
background. The format is read here byte by byte (openexr.com, "OpenEXR File Layout") because a
Blender program has no EXR library that is safe to import; only what Blender writes for a plain
float32 ZIP image is accepted.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...contract import CHANNELS
from ...errors import OutputError, RenderError

_MAGIC = 20000630
_FLOAT = 2
_ZIP = 3
_TILED, _DEEP, _MULTIPART = 0x200, 0x800, 0x1000
_ROWS_PER_CHUNK = 16


def verify_exr(path: Path, width_px: int, height_px: int) -> None:
    """Check that a file is complete: right channels, type and size, every pixel finite.

    Raises
    ------
    OutputError
        The file is missing or incomplete.
    RenderError
        It holds NaN or infinite pixels.
    """
    try:
        finite = _verify(path.read_bytes(), width_px, height_px)
    except FileNotFoundError:
        raise OutputError(
            f"Blender has not written {path}. The disk is full or the folder was removed; make "
            "room and render again: the run goes on where it stopped."
        ) from None
    except (OSError, ValueError, struct.error, zlib.error) as error:
        raise OutputError(
            f"Blender has written {path} incompletely ({error}). The disk is probably full; make "
            "room and render again: the run goes on where it stopped."
        ) from error
    if not finite:
        raise RenderError(
            f"Cycles has rendered NaN or infinite pixels into {path}. A material or the emitter's "
            "power is out of bounds: look for values near 1e38, or an object at the antenna."
        )


def _verify(data: bytes, width_px: int, height_px: int) -> bool:
    """Read the whole file; whether every pixel is finite."""
    if len(data) < 8:
        raise ValueError(f"{len(data)} bytes")
    magic, version = struct.unpack_from("<ii", data)
    if magic != _MAGIC or version & (_TILED | _DEEP | _MULTIPART):
        raise ValueError("not a plain single-part EXR")
    attributes, offset = _header(data)
    channels = _channels(attributes["channels"])
    expected = dict.fromkeys(CHANNELS, _FLOAT)
    if channels != expected:
        raise ValueError(f"channels {channels}, expected float32 {sorted(expected)}")
    if attributes["compression"] != bytes([_ZIP]):
        raise ValueError("not ZIP compressed")
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    if (right - left + 1, bottom - top + 1) != (width_px, height_px):
        raise ValueError(
            f"{right - left + 1} x {bottom - top + 1} pixels, expected {width_px} x {height_px}"
        )
    finite = True
    chunks = -(-height_px // _ROWS_PER_CHUNK)
    for index, position in enumerate(struct.unpack_from(f"<{chunks}Q", data, offset)):
        rows = min(_ROWS_PER_CHUNK, height_px - index * _ROWS_PER_CHUNK)
        values = _chunk(data, position, rows * width_px * len(CHANNELS))
        finite = finite and bool(np.isfinite(values).all())
    return finite


def _header(data: bytes) -> tuple[dict[str, bytes], int]:
    """Attributes by name, and where the chunk offsets start."""
    attributes: dict[str, bytes] = {}
    position = 8
    while data[position : position + 1] != b"\0":
        name, position = _text(data, position)
        _, position = _text(data, position)
        (size,) = struct.unpack_from("<i", data, position)
        position += 4
        if size < 0 or position + size > len(data):
            raise ValueError("the header ends early")
        attributes[name] = data[position : position + size]
        position += size
    missing = {"channels", "compression", "dataWindow"} - attributes.keys()
    if missing:
        raise ValueError(f"the header lacks {sorted(missing)}")
    return attributes, position + 1


def _text(data: bytes, position: int) -> tuple[str, int]:
    end = data.find(b"\0", position, position + 256)
    if end < 0:
        raise ValueError("the header ends early")
    return data[position:end].decode("utf-8", "replace"), end + 1


def _channels(data: bytes) -> dict[str, int]:
    found = {}
    position = 0
    while data[position : position + 1] != b"\0":
        name, position = _text(data, position)
        (found[name],) = struct.unpack_from("<i", data, position)
        position += 16
    return found


def _chunk(data: bytes, position: int, count: int) -> NDArray[np.float32]:
    """Values of one chunk of rows, any order: inflate, undo the predictor, re-interleave."""
    _, size = struct.unpack_from("<ii", data, position)
    packed = data[position + 8 : position + 8 + size]
    if len(packed) != size:
        raise ValueError("the pixels end early")
    if size == count * 4:  # stored as it is where ZIP gains nothing
        return np.frombuffer(packed, dtype="<f4")
    raw = np.frombuffer(zlib.decompress(packed), dtype=np.uint8)
    if raw.size != count * 4:
        raise ValueError("a chunk has a wrong length")
    # Predictor: each byte is the difference from the one before, plus 128.
    steps = raw.astype(np.int64)
    steps[1:] -= 128
    values = np.cumsum(steps).astype(np.uint8)
    half = (values.size + 1) // 2
    merged = np.empty_like(values)
    merged[0::2] = values[:half]
    merged[1::2] = values[half:]
    return merged.view("<f4")
