# SPDX-License-Identifier: GPL-3.0-or-later
"""Check that Blender has written an EXR file completely. Uses the standard library and numpy.

A full disk leaves a truncated file, and Blender does not report it when it renders in the
background. A Blender program has no EXR library that is safe to import, so the pixels are
decompressed here; only a plain float32 ZIP image, as Blender writes it, is accepted.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...array_types import Single
from ...atomic_files import disk_of
from ...contract import CHANNELS
from ...errors import FrameFileError, OutputError, RenderError
from ...signal.runs import CHUNK_LINES, ZIP, ExrHeader, read_header


def verify_exr(path: Path, width_px: int, height_px: int) -> None:
    """Check that a file is complete: right channels, type and size, every pixel finite.

    OutputError: it is missing or incomplete. RenderError: it holds NaN or infinite pixels.
    """
    if not path.exists():
        raise OutputError(
            f"Blender has not written {path}. {disk_of(path).capitalize()} is full, or the folder "
            "was removed. Make room and render again."
        )
    try:
        header = read_header(path)
        _check_layout(header, width_px, height_px)
        finite = all(np.isfinite(values).all() for values in _pixels(path, header))
    except (OSError, ValueError, zlib.error, FrameFileError) as error:
        raise OutputError(
            f"Blender has written {path} incompletely ({error}). The disk is probably full: "
            f"{disk_of(path)}. Make room and render again."
        ) from error
    if not finite:
        raise RenderError(
            f"Cycles has rendered NaN or infinite pixels into {path}, which have no power. Look "
            "for a material or a transmitter power near 1e38, or an object at the antenna."
        )


def _check_layout(header: ExrHeader, width_px: int, height_px: int) -> None:
    if header.channels != dict.fromkeys(CHANNELS, "float"):
        raise ValueError(f"channels {header.channels}, expected float {sorted(CHANNELS)}")
    if header.compression != ZIP:
        raise ValueError("not ZIP compressed")
    size = header.width_px, header.height_px
    if size != (width_px, height_px):
        raise ValueError(f"{size[0]} x {size[1]} pixels, expected {width_px} x {height_px}")


def _pixels(path: Path, header: ExrHeader) -> Iterator[Single]:
    """Yield the values of each chunk: inflate, undo the predictor, re-interleave."""
    data = path.read_bytes()
    for row, (start, length) in header.chunks.items():
        rows = min(CHUNK_LINES[ZIP], header.height_px - row)
        size = 4 * rows * header.width_px * len(CHANNELS)
        packed = data[start : start + length]
        if length == size:  # stored as it is where ZIP gains nothing
            yield np.frombuffer(packed, dtype="<f4")
            continue
        raw = np.frombuffer(zlib.decompress(packed), dtype=np.uint8)
        if raw.size != size:
            raise ValueError("a chunk has a wrong length")
        # Predictor: each byte is the difference from the one before, plus 128.
        steps = raw.astype(np.int64)
        steps[1:] -= 128
        values = np.cumsum(steps).astype(np.uint8)
        half = (size + 1) // 2
        merged = np.empty_like(values)
        merged[0::2], merged[1::2] = values[:half], values[half:]
        yield merged.view("<f4")
