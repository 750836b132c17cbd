# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that appear whole or not at all: written under a temporary name, synced, then renamed.

Each temporary name is unique, so that several processes may write the same file: the last rename
wins, and no reader ever sees a mixture. Texts are read with a limit. Standard library, and numpy
for `write_arrays`.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import functools
import json
import os
import secrets
import shutil
import stat
import zlib
from collections.abc import Hashable, Iterator
from pathlib import Path
from typing import Any, cast

from .errors import OutputError
from .processes import identity, process_began

#: Pattern of temporary names, for tidying up after a killed process.
TEMPORARY_PATTERN = "*.part*"


def cannot_write(path: Path, error: object) -> OutputError:
    """Return the error that names a file and why it cannot be written."""
    remedy = "Choose an output folder that exists, is writable and has room."
    if getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        remedy = f"Make room on {disk_of(path)}, or choose an output folder on another disk."
    return OutputError(
        f"Cannot write {path}: {getattr(error, 'strerror', None) or error}. {remedy}"
    )


def disk_of(path: Path) -> str:
    """Name the disk that a file is on, and what is free there: "the disk / (12.3 MB free)"."""
    place = path.absolute()
    while not (place.exists() and os.path.ismount(place)) and place != place.parent:
        place = place.parent
    return f"the disk {place} ({shutil.disk_usage(place).free / 1e6:.1f} MB free)"


class AtomicFile:
    """A file in the making: write to `temporary`, then `commit` or `discard`.

    OutputError: the folder is missing, read-only or full, or the path is a symbolic link.
    """

    def __init__(self, path: Path) -> None:
        if path.is_symlink():
            raise OutputError(
                f"{path} is a symbolic link; expected a file. radarsim does not write through "
                "links. Remove the link, or choose another output folder."
            )
        self.path = path
        # Libraries choose a format by the suffix; who looks for files by the beginning of their
        # names does not find this one.
        unique = f"{_owner_mark()}-{secrets.token_hex(4)}"
        self.temporary = path.with_name(f".part-{unique}-{path.name}")
        try:
            # Exclusive: neither a file nor a link that somebody has put there is written to.
            os.close(os.open(self.temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        except OSError as error:
            raise cannot_write(path, error) from error

    def commit(self, sync: bool = True) -> None:
        """Make the file appear; `temporary` must be closed.

        Without `sync` a power failure may leave it damaged: for what is checked when it is read.
        """
        try:
            if sync:
                with open(self.temporary, "rb+") as stream:
                    os.fsync(stream.fileno())
            os.replace(self.temporary, self.path)
        except OSError as error:
            raise cannot_write(self.path, error) from error
        if sync:
            _sync_folder(self.path.parent)

    def discard(self) -> None:
        """Remove the temporary file where it is still there."""
        with contextlib.suppress(OSError):
            self.temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def replaced(path: Path, sync: bool = True) -> Iterator[Path]:
    """Give an empty temporary file in the folder of `path`, with its suffix; rename it at the end.

    `sync` is as for `AtomicFile.commit`.

    OutputError: the folder is missing, read-only or full, or `path` is a symbolic link.
    """
    file = AtomicFile(path)
    try:
        try:
            yield file.temporary
        except OSError as error:
            raise cannot_write(path, error) from error
        file.commit(sync)
    finally:
        file.discard()


def write_text(path: Path, text: str, sync: bool = True) -> None:
    """Write a text as UTF-8."""
    with replaced(path, sync) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_json(path: Path, data: object, sync: bool = True) -> None:
    """Write JSON without NaN or Inf; records in it as objects."""
    text = json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False, default=record_fields)
    write_text(path, text + "\n", sync)


def record_fields(record: object) -> dict[str, Any]:
    """Return the fields of a dataclass by name. TypeError: it is none."""
    # `dataclasses.asdict` copies all that is in it, which takes longer than writing it
    return {name: getattr(record, name) for name in _names(cast(Hashable, type(record)))}


@functools.cache
def _names(kind: Hashable) -> tuple[str, ...]:
    """Return the names of the fields of a dataclass. TypeError: it is none."""
    return tuple(field.name for field in dataclasses.fields(cast(Any, kind)))


def write_arrays(path: Path, arrays: dict[str, Any]) -> None:
    """Write plain arrays and numbers as .npz; ``numpy.load`` needs no pickle for it."""
    import numpy as np  # only here: records are written without numpy, too

    with replaced(path) as temporary:
        np.savez(temporary, **arrays)


def make_folder(path: Path, within: Path | None = None) -> Path:
    """Make a folder for results, parents included.

    `within`: the output folder that it belongs to. That one may be a link, since its name was
    given; inside it no link is followed.
    """
    if within is not None:
        refuse_links(path, within)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_make(path, error) from error
    return path


def cannot_make(folder: Path, error: OSError) -> OutputError:
    """Return the error that names a folder and why it cannot be made."""
    if os.path.islink(folder) and not os.path.exists(folder):
        return OutputError(
            f"{folder} is a symbolic link to {folder.readlink()}, which does not exist. Create "
            "that folder, remove the link, or choose another output folder."
        )
    why, remedy = error.strerror or str(error), "Choose a folder that you may write to."
    if isinstance(error, FileExistsError):
        why, remedy = "there is a file of this name", "Choose another name or remove the file."
    elif isinstance(error, FileNotFoundError) and not os.path.exists(folder.parent):
        why = f"{folder.parent} does not exist"
        remedy = "Create it, or choose a folder whose parent exists."
    elif isinstance(error, FileNotFoundError):  # Linux says so of /proc
        why = f"{folder.parent} exists, and no folder can be made in it"
    elif error.errno == errno.ENAMETOOLONG:
        remedy = "Choose a shorter name."
    elif error.errno in (errno.ENOSPC, errno.EDQUOT):
        remedy = "Make room there, or choose an output folder on another disk."
    return OutputError(f"Cannot make the folder {folder}: {why}. {remedy}")


def refuse_links(path: Path, within: Path) -> None:
    """Raise OutputError if `path`, or a folder between it and `within`, is a symbolic link."""
    inner = [path, *path.parents]
    for place in inner[: inner.index(within)]:
        if place.is_symlink():
            raise OutputError(
                f"{place} is a symbolic link; expected a folder. radarsim follows no links inside "
                f"the output folder {within}. Remove the link, or give the folder that it leads to "
                "as output folder."
            )


def remove_file(path: Path) -> None:
    """Remove a file of an earlier run where there is one."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"Cannot remove {path} of an earlier run: {error.strerror or error}. "
            "Remove it, or choose another output folder."
        ) from error


def _owner_mark() -> str:
    """Return host and process as the names of temporary files contain them."""
    host = identity()["host"] + identity()["space"]
    return f"{zlib.crc32(host.encode()):08x}-{os.getpid():x}"


def remove_abandoned(folder: Path) -> None:
    """Remove temporary files in a folder whose processes were killed on this machine."""
    host = _owner_mark().partition("-")[0]
    for path in folder.glob(f".part-{host}-*"):
        with contextlib.suppress(OSError, ValueError):
            if process_began(int(path.name.split("-")[2], 16)) is None:
                path.unlink(missing_ok=True)


def remove_temporaries(folder: Path) -> None:
    """Remove half-written files of killed processes. No other process may write to the folder."""
    for path in folder.glob(TEMPORARY_PATTERN):
        with contextlib.suppress(OSError):  # a leftover that stays harms nobody: it is never read
            path.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """Make a rename survive a power failure, where the system can."""
    if os.name != "posix":
        return
    with contextlib.suppress(OSError):  # some file systems cannot sync folders
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


# -- reading ---------------------------------------------------------------------------------------


class TextTooLongError(ValueError):
    """A file is longer than the part that is read."""


def read_text(path: Path, most_bytes: int) -> str:
    """Return the text of a file of at most `most_bytes`, UTF-8 with or without byte-order mark.

    What is read is counted, not what the file system says: a device or a pipe has no size.
    """
    with open(path, "rb") as stream:
        data = stream.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise TextTooLongError(f"it holds more than {most_bytes} bytes")
    return data.decode("utf-8-sig")


def refusal_to_open(path: Path) -> str:
    """Return the reason why a file that a user names cannot be read, such as "does not exist".
    Empty: it can be read.

    `Path.is_file` raises for names that are too long and in folders that are closed to this user.
    """
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            return "is a folder" if stat.S_ISDIR(mode) else "is no ordinary file"
        with open(path, "rb"):
            return ""
    except FileNotFoundError:
        return "does not exist"
    except OSError as error:
        return f"cannot be read: {error.strerror or error}"
