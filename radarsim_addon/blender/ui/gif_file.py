# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving pictures as GIF (GIF89a), without a package that Blender lacks. Does not import bpy."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ...array_types import Single

#: Pixels that are compressed between two breaks: about 20 ms.
_SLICE = 1 << 17
#: Bits of a colour channel by which the nearest colour of the palette is looked up.
_BITS = 5
_LARGEST_CODE = 4095


class GifWriter:
    """Writes pictures of one size into a stream, one after the other, and starts again at the end.

    Parameters
    ----------
    stream
        Open binary file.
    width, height
        Size of the pictures [px].
    palette
        At most 256 colours, sRGB values from 0 to 1, (colours, 3).
    seconds
        How long each picture is shown [s].
    """

    def __init__(
        self, stream: BinaryIO, width: int, height: int, palette: Single, seconds: float
    ) -> None:
        self._stream, self._size = stream, (width, height)
        self._hundredths = max(2, round(seconds * 100))
        colours = np.zeros((256, 3), dtype=np.uint8)
        colours[: len(palette)] = np.round(palette * 255)
        steps = (np.arange(1 << _BITS) + 0.5) / (1 << _BITS)
        cube = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        # |a - b|^2 without |a|^2, which is the same for all colours of the palette
        apart = (palette**2).sum(axis=1) - 2 * cube @ palette.T
        self._nearest: NDArray[np.uint8] = apart.argmin(axis=1).astype(np.uint8)
        stream.write(b"GIF89a" + struct.pack("<HHBBB", width, height, 0xF7, 0, 0))
        stream.write(colours.tobytes())
        stream.write(b"!\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00")  # for ever

    def add(self, picture: Single) -> Iterator[None]:
        """Write a picture (height, width, 3) in steps that take some hundredths of a second."""
        levels = (picture * (1 << _BITS)).astype(np.intp).clip(0, (1 << _BITS) - 1)
        place = (levels[..., 0] << 2 * _BITS) | (levels[..., 1] << _BITS) | levels[..., 2]
        pixels = self._nearest[place].tobytes()
        self._stream.write(struct.pack("<BBBBHBB", 0x21, 0xF9, 4, 0, self._hundredths, 0, 0))
        self._stream.write(struct.pack("<BHHHHB", 0x2C, 0, 0, *self._size, 0))
        self._stream.write(b"\x08")
        packed = bytearray()
        for part in _compressed(pixels):
            packed += part
            yield
        for start in range(0, len(packed), 255):
            block = packed[start : start + 255]
            self._stream.write(bytes([len(block)]) + block)
        self._stream.write(b"\0")

    def close(self) -> None:
        """Write the end of the file; the stream stays open."""
        self._stream.write(b";")


def _compressed(pixels: bytes) -> Iterator[bytes]:
    """Compress 8-bit pixels by LZW with codes of growing width (GIF89a, appendix F)."""
    clear, end = 256, 257
    known: dict[int, int] = {}
    following, width = 258, 9
    bits, count = clear, 9
    prefix = pixels[0]
    for start in range(1, max(len(pixels), 2), _SLICE):
        found = bytearray()
        for value in pixels[start : start + _SLICE]:
            key = prefix << 8 | value
            code = known.get(key)
            if code is not None:
                prefix = code
                continue
            bits |= prefix << count
            count += width
            known[key] = following
            if following == 1 << width:
                width += 1
            following += 1
            prefix = value
            if following > _LARGEST_CODE:
                bits |= clear << count
                count += width
                known, following, width = {}, 258, 9
            while count >= 8:
                found.append(bits & 255)
                bits >>= 8
                count -= 8
        yield bytes(found)
    bits |= prefix << count
    count += width
    # The reader has entered one more code by now, and may have widened its codes.
    if following == 1 << width:
        width += 1
    bits |= end << count
    count += width
    yield bits.to_bytes((count + 7) // 8, "little")
