# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the multilayer EXR files that Blender just wrote: passes by name. Does not import bpy.

Up to Blender 4.5 such a file has one part, from 5.0 on a part for each pass; channels are named
``Layer.Pass.Component`` in both.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...array_types import Single
from ...errors import RenderError
from ...signal.runs import exr_backend
from .requests import Region, View


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


def read_view(
    path: Path, size: tuple[int, int], region: Region | None, lights: str, marks: str | None
) -> View:
    """Read what was rendered of a view, and remove the file; RenderError where it is not there.

    Parameters
    ----------
    path
        The file.
    size
        Width and height of the view, of which only the `region` is in the file.
    region
        None: all.
    lights, marks
        Light groups of the transmitter, and of marked vertices if there are any.
    """
    groups = [f"Combined_{group}" for group in (lights, marks) if group is not None]
    # Multi-part files name the same pass "Object Index" or "IndexOB" by version.
    passes = read_passes(path, (*groups, "Position", "Object Index", "IndexOB"))
    with contextlib.suppress(OSError):  # a file that is written over goes to the disk at once
        path.unlink()
    for name in groups:
        if name not in passes:
            raise RenderError(
                f"The render has no pass {name}; found {', '.join(passes) or 'none'}."
            )

    def whole(plane: Single) -> Single:
        return _whole(plane, size, region)

    position = None
    if "Position" in passes:
        found = passes["Position"]
        position = np.stack([whole(found[axis]) for axis in "XYZ"], axis=-1)
    index = passes.get("Object Index") or passes.get("IndexOB")
    number = None
    if index is not None:
        number = np.rint(whole(next(iter(index.values())))).astype(np.int32)
        if position is not None:
            position[number == 0] = np.nan  # nothing was hit
    light, *marked = (_light(passes[name], size, region) for name in groups)
    return replace(
        light, position=position, object_index=number, marks=marked[0] if marked else None
    )


def _light(channels: dict[str, Single], size: tuple[int, int], region: Region | None) -> View:
    red, green, blue = (_whole(channels[name], size, region) for name in "RGB")
    return View(red, green, blue)


def _whole(plane: Single, size: tuple[int, int], region: Region | None) -> Single:
    """A channel over the whole view: 0 outside the region."""
    width, height = size
    expected = (height, width)
    if region is not None:
        expected = (region.bottom - region.top, region.right - region.left)
    if plane.shape != expected:
        raise RenderError(
            f"The render has {plane.shape[1]} x {plane.shape[0]} pixels; expected "
            f"{expected[1]} x {expected[0]}. Report this with the scene's render settings."
        )
    if region is None:
        return plane
    filled = np.zeros((height, width), dtype=np.float32)
    filled[region.top : region.bottom, region.left : region.right] = plane
    return filled


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
