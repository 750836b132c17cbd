# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the multilayer EXR files that Blender just wrote: passes by name. Does not import bpy.

Up to Blender 4.5 such a file has one part, from 5.0 on a part for each pass; channels are named
``Layer.Pass.Component`` in both.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ...array_types import Single
from ...errors import RenderError
from ...signal.runs import exr_backend


def read_passes(path: Path, wanted: Iterable[str]) -> dict[str, dict[str, Single]]:
    """Read the wanted passes of the only view layer in a multilayer EXR, those that are there.

    Pass to component ("R", "X"...) to float32 array (height, width). RenderError where unreadable.
    """
    kind, module = exr_backend()
    names = set(wanted)
    try:
        read = _openexr if kind == "OpenEXR" else _openimageio
        planes = read(module, path, names)
    except (RuntimeError, ValueError, TypeError, OSError) as error:
        raise RenderError(
            f"The render in {path} cannot be read ({error}). Is the disk for temporary files full?"
        ) from error
    passes: dict[str, dict[str, Single]] = {}
    for channel, plane in planes.items():
        _, name, component = channel.rsplit(".", 2)
        passes.setdefault(name, {})[component] = plane
    return passes


def _is_wanted(channel: str, names: Collection[str]) -> bool:
    parts = channel.rsplit(".", 2)
    return len(parts) == 3 and parts[1] in names


def _openexr(module: Any, path: Path, names: Collection[str]) -> dict[str, Single]:
    found: dict[str, Single] = {}
    with module.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                if _is_wanted(name, names):
                    found[name] = np.asarray(channel.pixels, dtype=np.float32)
    return found


def _openimageio(module: Any, path: Path, names: Collection[str]) -> dict[str, Single]:
    source = module.ImageInput.open(str(path))
    if source is None:
        raise RuntimeError(module.geterror() or "OpenImageIO cannot open it")
    found: dict[str, Single] = {}
    try:
        index = 0
        while source.seek_subimage(index, 0):
            spec = source.spec()
            index += 1
            if not any(_is_wanted(name, names) for name in spec.channelnames):
                continue
            pixels = source.read_image(index - 1, 0, 0, spec.nchannels, module.FLOAT)
            if pixels is None:
                raise RuntimeError(source.geterror() or "OpenImageIO cannot read its pixels")
            for number, name in enumerate(spec.channelnames):
                if _is_wanted(name, names):
                    found[name] = np.ascontiguousarray(np.asarray(pixels)[..., number])
    finally:
        source.close()
    return found
