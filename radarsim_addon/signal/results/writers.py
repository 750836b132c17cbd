# SPDX-License-Identifier: GPL-3.0-or-later
"""Writers of result files, registered by name.

A room that writes a format registers a function for it::

    @result_writer("npz", "_profile.npz", "_map.npz")
    def write_arrays(result: FrameResult, folder: Path) -> list[Path]: ...

The endings tell the files of this writer from all others, so that processing again can remove what
it no longer writes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from ...atomic_files import remove_file
from ...errors import ConfigError
from .frame_result import FrameResult

WriteResult = Callable[[FrameResult, Path], list[Path]]
"""Writes files of a result into a folder and returns those that it wrote; maybe none."""


@dataclass(frozen=True)
class _Writer:
    write: WriteResult
    endings: tuple[str, ...]


_WRITERS: dict[str, _Writer] = {}


def result_writer(name: str, *endings: str) -> Callable[[WriteResult], WriteResult]:
    """Register a writer under a name.

    Parameters
    ----------
    name
        Name of the format, such as "hdf5"; not taken yet.
    *endings
        Endings of all files that the writer may write, after ``frame_0001``; not taken yet.

    Returns
    -------
    callable
        Decorator that registers a function ``write(result, folder) -> list of Path``.
    """
    taken = {ending for writer in _WRITERS.values() for ending in writer.endings}
    if name in _WRITERS or taken.intersection(endings):
        raise ValueError(f"A writer {name!r}, or one of {endings}, is registered already.")

    def register(write: WriteResult) -> WriteResult:
        _WRITERS[name] = _Writer(write, endings)
        return write

    return register


def writer_names() -> tuple[str, ...]:
    """Return the names of all registered writers, sorted."""
    return tuple(sorted(_WRITERS))


def write_result(result: FrameResult, folder: Path, names: Iterable[str]) -> list[Path]:
    """Write a result with some of the registered writers.

    Parameters
    ----------
    result
        Result of a frame.
    folder
        Existing folder.
    names
        Names of writers, called in this order.

    Returns
    -------
    list of Path
        Files written.

    Raises
    ------
    ConfigError
        No writer has that name.
    MissingDependencyError, OutputError
        A package is not installed, or a file cannot be written.
    """
    files: list[Path] = []
    for name in names:
        if name not in _WRITERS:
            raise ConfigError(f"No writer is called {name!r}; expected one of {writer_names()}.")
        files += _WRITERS[name].write(result, folder)
    return files


def frame_file(folder: Path, frame: int, ending: str) -> Path:
    """Return the path of a frame's file, such as ``frame_0001_map.npz``.

    Parameters
    ----------
    folder
        Folder of the products.
    frame
        Number of the frame.
    ending
        Ending after the number, such as "_map.npz".

    Returns
    -------
    Path
        In `folder`.
    """
    return folder / f"frame_{frame:04d}{ending}"


def remove_stale(folder: Path, frame: int, written: Collection[Path]) -> None:
    """Remove files of a frame that an earlier processing wrote and this one did not.

    Parameters
    ----------
    folder
        Folder of the products.
    frame
        Number of the frame.
    written
        Files to keep.
    """
    for writer in _WRITERS.values():
        for ending in writer.endings:
            path = frame_file(folder, frame, ending)
            if path not in written:
                remove_file(path)
