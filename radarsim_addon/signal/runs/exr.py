# SPDX-License-Identifier: GPL-3.0-or-later
"""Read and write float32 EXR files, one array per channel.

Outside Blender the PyPI package ``OpenEXR`` is used, inside a Blender program the ``OpenImageIO``
that Blender ships: PyPI's OpenEXR crashes some Blender builds on import, so it is never imported
there.

Both libraries are lenient in different ways: a truncated file yields a warning on stderr and no
pixels, missing channels yield zeros, and a header of 2^31 x 2^31 is believed. A radar frame must be
complete, so header and chunk table are read first, with the standard library alone. Format:
"OpenEXR File Layout", openexr.com (single-part scan-line files, version 2).
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import struct
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ...arrays import Single
from ...atomic_files import cannot_write, replaced
from ...contract import CHANNELS, MAX_PIXELS
from ...errors import FrameFileError, MissingDependencyError

#: Compression of every file that radarsim writes.
ZIP = 3
#: A header is a few hundred bytes; a file that claims more is not a radar frame.
_MAX_HEADER_BYTES = 1 << 20

_TILED, _DEEP, _MULTIPART = 0x200, 0x800, 0x1000
#: Scan lines in one chunk by the number of the compression.
CHUNK_LINES = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256}

_RENDER_AGAIN = "Remove it and render the run again: radarsim render measures what is missing."


@dataclass(frozen=True)
class ExrHeader:
    """Size, channels and chunks of an EXR file."""

    width_px: int
    height_px: int
    #: Pixel type ("float", "half" or "uint") of each channel by name.
    channels: dict[str, str]
    compression: int
    #: First byte and length of the compressed pixels of each chunk, by its first row from 0.
    chunks: dict[int, tuple[int, int]]


def read_header(path: Path) -> ExrHeader:
    """Read the header and check that every chunk of pixels is inside the file.

    The file must be a single-part scan-line EXR of at most `MAX_PIXELS`.
    """
    try:
        with open(path, "rb") as stream:
            return _read_header(stream, path)
    except FileNotFoundError as error:
        raise FrameFileError(
            f"{path} is missing; the run's plan expects it. Render the run again: "
            "radarsim render measures what is missing."
        ) from error
    except OSError as error:
        raise FrameFileError(f"{path} cannot be read: {error.strerror or error}.") from error


def _read_header(stream: BinaryIO, path: Path) -> ExrHeader:
    size = os.fstat(stream.fileno()).st_size
    start = stream.read(8)
    magic = b"\x76\x2f\x31\x01"
    if start[:4] != magic[: len(start[:4])] or (size and not start):
        raise FrameFileError(f"{path} is not an OpenEXR file (it starts with {start[:4]!r}).")
    if len(start) < 8:
        raise _damaged(path, f"it holds {size} bytes")
    version = struct.unpack("<I", start[4:])[0]
    if version & 0xFF != 2 or version & (_TILED | _DEEP | _MULTIPART):
        raise FrameFileError(
            f"{path} is a tiled, deep, multi-part or unknown kind of EXR (version word "
            f"{version:#x}); expected a single-part scan-line EXR. "
            "Write it with media type Image, format OpenEXR."
        )
    attributes: dict[str, bytes] = {}
    while name := _text(stream, path):
        _text(stream, path)
        raw = stream.read(4)
        length = struct.unpack("<i", raw)[0] if len(raw) == 4 else -1
        if not 0 <= length <= _MAX_HEADER_BYTES or stream.tell() > _MAX_HEADER_BYTES:
            raise _damaged(path, f"header attribute {name!r} has no sensible length")
        value = stream.read(length)
        if len(value) < length:
            raise _damaged(path, f"the header ends inside attribute {name!r}")
        attributes[name] = value
    window = attributes.get("dataWindow", b"")
    display = attributes.get("displayWindow", window)
    compression = attributes.get("compression", b"")
    if len(window) != 16 or len(compression) != 1 or "channels" not in attributes:
        raise _damaged(path, "the header lacks dataWindow, compression or channels")
    x_min, y_min, x_max, y_max = struct.unpack("<iiii", window)
    width, height = x_max - x_min + 1, y_max - y_min + 1
    if width < 1 or height < 1:
        raise _damaged(path, f"its data window is {width} x {height}")
    if width * height > MAX_PIXELS:
        raise FrameFileError(
            f"{path} claims {width} x {height} pixels; at most {MAX_PIXELS} are read. "
            "Render at a lower resolution."
        )
    if display != window:
        raise FrameFileError(
            f"{path} holds only a part of its frame (data window differs from display window). "
            "Render without a border, or with Crop to Render Region."
        )
    lines = CHUNK_LINES.get(compression[0])
    if lines is None:
        raise FrameFileError(f"{path} has unknown compression {compression[0]}; expected ZIP.")
    channels = _channels(attributes["channels"], path)
    chunks = _chunks(stream, path, size, -(-height // lines))
    chunks = {row - y_min: place for row, place in chunks.items()}
    if chunks.keys() != set(range(0, height, lines)):
        raise _damaged(path, f"{len(chunks)} of {-(-height // lines)} chunks are complete")
    return ExrHeader(width, height, channels, compression[0], chunks)


def _text(stream: BinaryIO, path: Path) -> str:
    """Read a null-terminated name (at most 255 bytes in version 2)."""
    name = b""
    while (byte := stream.read(1)) != b"\0":
        name += byte
        if not byte or len(name) > 255:
            raise _damaged(path, "the header ends inside a name")
    return name.decode("utf-8", errors="replace")


def _channels(data: bytes, path: Path) -> dict[str, str]:
    """Parse a channel list: name, type, 4 bytes of linear flag and padding, x and y sampling."""
    found: dict[str, str] = {}
    at = 0
    while at < len(data) and data[at] != 0:
        end = data.find(b"\0", at)
        if end < 0 or end + 17 > len(data):
            raise _damaged(path, "the list of channels is cut off")
        kind, _, x_step, y_step = struct.unpack_from("<iiii", data, end + 1)
        name = data[at:end].decode("utf-8", errors="replace")
        if (x_step, y_step) != (1, 1):
            raise FrameFileError(
                f"{path}: channel {name} is subsampled ({x_step} x {y_step}); expected every "
                "pixel. Write it without chroma subsampling."
            )
        found[name] = {0: "uint", 1: "half", 2: "float"}.get(kind, f"type {kind}")
        at = end + 17
    return found


def _chunks(stream: BinaryIO, path: Path, size: int, count: int) -> dict[int, tuple[int, int]]:
    """Return first byte and length of the pixels of each chunk, by its row in the data window."""
    table = stream.read(8 * count)
    if len(table) < 8 * count:
        raise _damaged(path, "the file ends inside the table of chunks")
    first = stream.tell()
    found = {}
    for offset in struct.unpack(f"<{count}Q", table):
        if not first <= offset <= size - 8:
            raise _damaged(path, f"a chunk starts at byte {offset} of {size}")
        stream.seek(offset)
        row, length = struct.unpack("<ii", stream.read(8))
        if length < 0 or offset + 8 + length > size:
            raise _damaged(path, f"the chunk of row {row} needs {length} bytes beyond the end")
        found[row] = offset + 8, length
    return found


def _damaged(path: Path, what: str) -> FrameFileError:
    return FrameFileError(f"{path} is damaged or truncated: {what}. {_RENDER_AGAIN}")


def inside_blender_program() -> bool:
    """Return whether this Python is embedded in Blender, not a bpy wheel in a plain Python."""
    app = getattr(sys.modules.get("bpy"), "app", None)
    return bool(getattr(app, "binary_path", ""))


def exr_backend() -> tuple[str, ModuleType]:
    """Return name ("OpenEXR" or "OpenImageIO") and module of the library for EXR files here."""
    # the Python that Blender brings, which processes for the window, has no OpenEXR either
    for name in ("OpenImageIO",) if inside_blender_program() else ("OpenEXR", "OpenImageIO"):
        if importlib.util.find_spec(name) is not None:
            return name, importlib.import_module(name)
    raise MissingDependencyError(
        "This Blender has no OpenImageIO module, which reads and writes EXR files here. "
        "Install it (Debian: python3-openimageio), or process the run outside Blender with "
        "'radarsim process DIR'."
    )


def read_exr(path: str | Path, channels: Sequence[str] = CHANNELS) -> dict[str, Single]:
    """Read float32 channels of a single-part EXR file.

    Parameters
    ----------
    path
        File to read.
    channels
        Names of the channels to read; others are ignored.

    Returns
    -------
    dict
        Channel name to float32 array (height, width), row 0 on top, in the file's units.

    Raises
    ------
    FrameFileError
        Missing, truncated or oversized file, other channels, half float, NaN or Inf.
    MissingDependencyError
        This Blender has no OpenImageIO.
    """
    path = Path(path)
    header = read_header(path)
    missing = [name for name in channels if name not in header.channels]
    if missing:
        raise FrameFileError(
            f"{path} lacks channel {', '.join(missing)}; found {', '.join(header.channels)}. "
            "Give an EXR that radarsim rendered (colour mode RGB)."
        )
    for name in channels:
        if header.channels[name] != "float":
            raise FrameFileError(
                f"{path}: channel {name} is {header.channels[name]}; expected 32 bit float. "
                "Half float makes metres of range error: set Color Depth to Float (Full)."
            )
    kind, module = exr_backend()
    shape = (header.height_px, header.width_px)
    try:
        read = _read_openexr if kind == "OpenEXR" else _read_openimageio
        images = read(module, path, channels)
    except (RuntimeError, ValueError, TypeError, KeyError, OSError) as error:
        raise FrameFileError(
            f"{path} cannot be decoded ({error}). Remove it and render the run again: "
            "radarsim render measures what is missing."
        ) from error
    for name, image in images.items():
        if image.shape != shape or image.dtype != np.float32:
            raise FrameFileError(
                f"{path}: channel {name} was read as {image.shape} {image.dtype}; "
                f"expected {shape} float32."
            )
        bad = ~np.isfinite(image)
        count = int(np.count_nonzero(bad))
        if count:
            row, col = (int(i) for i in np.argwhere(bad)[0])
            raise FrameFileError(
                f"{path}: channel {name} holds {count} value(s) that are NaN or Inf, the first "
                f"({image[row, col]}) at row {row}, column {col}. A material in the scene emits or "
                "divides by zero: fix it and render this frame again."
            )
    return images


def _read_openexr(module: ModuleType, path: Path, channels: Sequence[str]) -> dict[str, Single]:
    with module.File(str(path), separate_channels=True) as file:
        found = file.channels()
        # copies: the library's own buffers die with the file
        return {name: np.array(found[name].pixels) for name in channels}


def _read_openimageio(module: ModuleType, path: Path, channels: Sequence[str]) -> dict[str, Single]:
    source = module.ImageInput.open(str(path))
    if source is None:
        raise RuntimeError(module.geterror() or "OpenImageIO cannot open it")
    try:
        names = list(source.spec().channelnames)
        pixels = source.read_image(module.FLOAT)
        if pixels is None:
            raise RuntimeError(source.geterror() or "OpenImageIO cannot read its pixels")
    finally:
        source.close()
    pixels = np.asarray(pixels)
    return {name: np.ascontiguousarray(pixels[..., names.index(name)]) for name in channels}


def write_exr(path: str | Path, images: Mapping[str, NDArray[Any]]) -> None:
    """Write a lossless float32 ZIP EXR under a temporary name, then rename.

    Parameters
    ----------
    path
        File to write; its folder must exist.
    images
        Channel name to array (height, width), all of one shape. Converted to float32.

    Raises
    ------
    OutputError
        The folder is missing, read-only or full.
    ValueError
        No channel, or channels of unequal shape.
    MissingDependencyError
        This Blender has no OpenImageIO.
    """
    path = Path(path)
    planes = {k: np.ascontiguousarray(v, dtype=np.float32) for k, v in sorted(images.items())}
    shapes = {plane.shape for plane in planes.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 2 or 0 in next(iter(shapes)):
        raise ValueError(f"Channels of one shape (height, width) are needed; got {shapes}.")
    kind, module = exr_backend()
    write = _write_openexr if kind == "OpenEXR" else _write_openimageio
    with replaced(path) as temporary:
        try:
            write(module, temporary, planes)
            read_header(temporary)  # a full disk can end a file without an error
        except (RuntimeError, FrameFileError) as error:
            raise cannot_write(path, error) from error


def _write_openexr(module: ModuleType, path: Path, planes: Mapping[str, Single]) -> None:
    header = {"compression": module.ZIP_COMPRESSION, "type": module.scanlineimage}
    with module.File(header, dict(planes)) as file:
        file.write(str(path))


def _write_openimageio(module: ModuleType, path: Path, planes: Mapping[str, Single]) -> None:
    pixels = np.stack(list(planes.values()), axis=-1)
    height, width, count = pixels.shape
    spec = module.ImageSpec(width, height, count, module.FLOAT)
    spec.channelnames = tuple(planes)
    spec.attribute("compression", "zip")
    target = module.ImageOutput.create(str(path))
    if target is None or not target.open(str(path), spec):
        raise RuntimeError(module.geterror() or "OpenImageIO cannot create it")
    written = target.write_image(pixels)
    message = target.geterror()
    if not (target.close() and written):
        raise RuntimeError(message or "OpenImageIO cannot write its pixels")
