# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the multilayer EXR files that Blender just wrote: passes by name. Does not import bpy.

Up to Blender 4.5 such a file has one part, from 5.0 on a part for each pass; channels are named
``Layer.Pass.Component`` in both, or ``Layer.Pass.View.Component``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...array_types import Single
from ...errors import RenderError
from ...signal.runs import exr_backend
from .requests import Region, View


def read_passes(path: Path, wanted: Iterable[str]) -> dict[str, dict[str, Single]]:
    """Read the wanted passes of the only view layer in a multilayer EXR, those that are there.

    Pass to component ("R", "X"...) to float32 array (height, width). Of files with several views
    the names are "pass.view". RenderError where unreadable.
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
        name = _wanted(channel, names)
        passes.setdefault(name, {})[channel.rpartition(".")[2]] = plane
    return passes


def read_views(
    path: Path,
    lights: Sequence[str],
    names: Sequence[str],
    size: tuple[int, int],
    region: Region | None,
) -> list[View]:
    """Read views by their names from a multilayer EXR; the only one has none: "".

    `lights` are the passes of the transmitter's light, and of marks if there are any; `size` is the
    width and height of a view, of which the file has the `region` (None: all). RenderError where a
    light is missing.
    """

    def whole(plane: Single) -> Single:
        return _whole(plane, size, region)

    # Multi-part files name the same pass "Object Index" or "IndexOB" by version.
    kinds = *lights, "Position", "Object Index", "IndexOB"
    ends = [f".{name}" if name else "" for name in names]
    passes = read_passes(path, [kind + end for kind in kinds for end in ends])
    views = []
    for end in ends:
        own: list[View] = []
        for name in (light + end for light in lights):
            if name not in passes:
                raise RenderError(
                    f"The render has no pass {name}; found {', '.join(passes) or 'none'}."
                )
            red, green, blue = (whole(passes[name][channel]) for channel in "RGB")
            own.append(View(red, green, blue))
        position = number = None
        if "Position" + end in passes:
            place = passes["Position" + end]
            position = np.stack([whole(place[axis]) for axis in "XYZ"], axis=-1)
        index = passes.get("Object Index" + end) or passes.get("IndexOB" + end)
        if index is not None:
            number = np.rint(whole(next(iter(index.values())))).astype(np.int32)
            if position is not None:
                position[number == 0] = np.nan  # nothing was hit
        light, marks = own[0], own[1] if len(own) > 1 else None
        views.append(
            dataclasses.replace(light, position=position, object_index=number, marks=marks)
        )
    return views


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


def _wanted(channel: str, names: Collection[str]) -> str:
    """The wanted pass that a channel is of, "pass" or "pass.view"; empty: none."""
    parts = channel.split(".")[:-1]
    found = (".".join(parts[-count:]) for count in (1, 2) if len(parts) > count)
    return next((name for name in found if name in names), "")


def _openexr(module: Any, path: Path, names: Collection[str]) -> dict[str, Single]:
    found: dict[str, Single] = {}
    with module.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                if _wanted(name, names):
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
            if not any(_wanted(name, names) for name in spec.channelnames):
                continue
            pixels = source.read_image(index - 1, 0, 0, spec.nchannels, module.FLOAT)
            if pixels is None:
                raise RuntimeError(source.geterror() or "OpenImageIO cannot read its pixels")
            for number, name in enumerate(spec.channelnames):
                if _wanted(name, names):
                    found[name] = np.ascontiguousarray(np.asarray(pixels)[..., number])
    finally:
        source.close()
    return found
