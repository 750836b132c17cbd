# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing result files whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .errors import OutputError


@contextlib.contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Give a temporary path to write to, and rename it to `path` when all went well.

    Raises
    ------
    OutputError
        The folder is missing, read-only or full.
    """
    temporary = path.with_name(f"{path.stem}.part{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise OutputError(
            f"Cannot write {path}: {error.strerror or error}. "
            "Choose an output folder that exists, is writable and has room."
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def make_folder(path: Path) -> Path:
    """Make a folder for results, parents included, or raise OutputError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"Cannot make the folder {path}: {error.strerror or error}. "
            "Choose an output folder that is writable and has room."
        ) from error
    return path


def remove_file(path: Path) -> None:
    """Remove a file where there is one, or raise OutputError."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"Cannot remove {path}, which is of an earlier processing: {error.strerror or error}. "
            "Remove it, or choose another output folder."
        ) from error


def write_arrays(path: Path, arrays: dict[str, Any]) -> None:
    """Write plain arrays and numbers as .npz; ``numpy.load`` needs no pickle for it."""
    with replaced(path) as temporary:
        np.savez(temporary, **arrays)


def write_json(path: Path, data: Any) -> None:
    """Write JSON without NaN or Inf."""
    text = json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False)
    with replaced(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def replace_file(temporary: Path, final: Path) -> None:
    """Rename a finished file into its place.

    Raises
    ------
    OutputError
        It cannot be renamed.
    """
    try:
        os.replace(temporary, final)
    except OSError as error:
        raise OutputError(
            f"{temporary} cannot be renamed to {final.name}: {error.strerror or error}. "
            "Choose an output folder that is writable."
        ) from error
