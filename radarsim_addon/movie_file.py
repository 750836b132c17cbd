# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving pictures as MP4, by the FFmpeg that Blender brings, in a Blender process of its own."""

from __future__ import annotations

import importlib.util
import struct
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import MissingDependencyError, OutputError

_ENCODER = Path(__file__).parent / "blender" / "ui" / "movie_encoder.py"


def png_bytes(pixels: NDArray[np.uint8], dpi: float) -> bytes:
    """Return the file of a picture (height, width, 3) of so many pixels per inch."""
    height, width, _ = pixels.shape
    # no filters: Pillow tries five of them on each row, takes three times as long, and makes
    # larger files of figures
    rows = np.zeros((height, 1 + 3 * width), dtype=np.uint8)
    rows[:, 1:] = pixels.reshape(height, -1)
    per_metre = round(dpi / 0.0254)
    # More compression takes four times as long and saves 3 % of a picture of noise.
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1)),
        (b"IDAT", zlib.compress(rows, 1)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


class MovieWriter:
    """Writes pictures of one size into an MP4 file, each for some seconds; used as a context.

    Raises as `movie_encoder`.
    """

    def __init__(self, path: Path, seconds: float) -> None:
        self._command = movie_encoder()
        self._path, self._seconds, self._count = path, seconds, 0
        self._folder = tempfile.TemporaryDirectory(prefix="radarsim_movie_")
        self._encoder: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> MovieWriter:
        return self

    def __exit__(self, *_: object) -> None:
        if self._encoder is not None:
            self._encoder.kill()
            self._encoder.wait()
        self._folder.cleanup()

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Take a picture (height, width, 3), sRGB."""
        self.add_png(png_bytes(picture, 72))

    def add_png(self, png: bytes) -> None:
        """Take a picture as the bytes of its PNG file."""
        self._count += 1
        Path(self._folder.name, f"{self._count:06d}.png").write_bytes(png)

    def close(self) -> Iterator[None]:
        """Encode the pictures; a step looks whether that has ended. Raises OutputError."""
        log = Path(self._folder.name, "log.txt")
        words = ["--", self._folder.name, repr(self._seconds), str(self._path)]
        with open(log, "wb") as said:
            self._encoder = subprocess.Popen(
                [*self._command, str(_ENCODER), *words],
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=subprocess.STDOUT,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        while self._encoder.poll() is None:
            yield
        # A Blender that cannot write a movie may end as if nothing had happened.
        if self._encoder.returncode or not self._path.stat().st_size:
            end = log.read_text(encoding="utf-8", errors="replace").strip()[-300:]
            raise OutputError(
                f"Blender's FFmpeg wrote no movie: {end or 'no words'}. Choose GIF as the "
                "format of the animation."
            )


def movie_encoder() -> list[str]:
    """Return the command that runs a script with bpy: a Blender without a window, or Python with
    bpy.

    Raises MissingDependencyError without bpy, OutputError where this Blender has no FFmpeg.
    """
    bpy: Any = sys.modules.get("bpy")
    if bpy is None:
        if importlib.util.find_spec("bpy") is None:
            raise MissingDependencyError(
                "Blender's module bpy is not installed. Its FFmpeg writes MP4 movies. Install bpy "
                "with pip install '.[blender]' (Python 3.13 or 3.11), or choose GIF as the format "
                "of the animation."
            )
        return [sys.executable]
    if not bpy.app.build_options.codec_ffmpeg:
        raise OutputError(
            "This Blender is built without FFmpeg, so it writes no MP4 files. Choose GIF as the "
            "format of the animation."
        )
    if Path(sys.executable).resolve() == Path(bpy.app.binary_path or sys.executable).resolve():
        return [sys.executable]
    return [
        bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "1", "-P",
    ]  # fmt: skip
