# SPDX-License-Identifier: GPL-3.0-or-later
"""Read and write float32 EXR files, one array per channel.

Outside Blender the PyPI package ``OpenEXR`` is used, inside a Blender program the ``OpenImageIO``
that Blender ships: PyPI's OpenEXR crashes some Blender builds on import, so it is never imported
there. :mod:`.runs.exr_header` checks files first, because both libraries accept damaged ones.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...array_types import Single
from ...atomic_files import cannot_write, replaced
from ...contract import CHANNELS
from ...errors import FrameFileError, MissingDependencyError
from .exr_header import read_header


def inside_blender_program() -> bool:
    """Whether this Python is embedded in Blender, not a bpy wheel in a plain Python."""
    app = getattr(sys.modules.get("bpy"), "app", None)
    return bool(getattr(app, "binary_path", ""))


def exr_backend() -> tuple[str, ModuleType]:
    """Return the library that reads EXR files in this Python.

    Returns
    -------
    name, module
        "OpenEXR" or "OpenImageIO", and the module.

    Raises
    ------
    MissingDependencyError
        Neither is installed; the message has what to install.
    """
    names = ("OpenImageIO",) if inside_blender_program() else ("OpenEXR", "OpenImageIO")
    for name in names:
        if importlib.util.find_spec(name) is not None:
            return name, importlib.import_module(name)
    if inside_blender_program():
        raise MissingDependencyError(
            "This Blender has no OpenImageIO module, which reads and writes EXR files here. "
            "Install it (Debian: python3-openimageio), or process the run outside Blender with "
            "'radarsim process DIR'."
        )
    raise MissingDependencyError(
        "Neither OpenEXR nor OpenImageIO is installed; one of them reads and writes EXR files. "
        "Install it with 'pip install OpenEXR'."
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
        No EXR library is installed.
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
        _require_finite(path, name, image)
    return images


def _require_finite(path: Path, name: str, image: Single) -> None:
    bad = ~np.isfinite(image)
    count = int(np.count_nonzero(bad))
    if count:
        row, col = (int(i) for i in np.argwhere(bad)[0])
        raise FrameFileError(
            f"{path}: channel {name} holds {count} value(s) that are NaN or Inf, the first "
            f"({image[row, col]}) at row {row}, column {col}. A material in the scene emits or "
            "divides by zero: fix it and render this frame again."
        )


def _read_openexr(module: Any, path: Path, channels: Sequence[str]) -> dict[str, Single]:
    with module.File(str(path), separate_channels=True) as file:
        found = file.channels()
        # copies: the library's own buffers die with the file
        return {name: np.array(found[name].pixels) for name in channels}


def _read_openimageio(module: Any, path: Path, channels: Sequence[str]) -> dict[str, Single]:
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
        No EXR library is installed.
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


def _write_openexr(module: Any, path: Path, planes: Mapping[str, Single]) -> None:
    header = {"compression": module.ZIP_COMPRESSION, "type": module.scanlineimage}
    with module.File(header, dict(planes)) as file:
        file.write(str(path))


def _write_openimageio(module: Any, path: Path, planes: Mapping[str, Single]) -> None:
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
