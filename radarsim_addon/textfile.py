# SPDX-License-Identifier: GPL-3.0-or-later
"""Text of files that a user or another program gives: never more of it than expected. No bpy."""

from __future__ import annotations

import stat
from pathlib import Path


class TextTooLongError(ValueError):
    """A file is longer than the part that is read."""


def read_text(path: Path, most_bytes: int) -> str:
    """Text of a file of at most `most_bytes`, UTF-8 with or without byte-order mark.

    What is read is counted, not what the file system says: a device or a pipe has no size.
    """
    with open(path, "rb") as stream:
        data = stream.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise TextTooLongError(f"it holds more than {most_bytes} bytes")
    return data.decode("utf-8-sig")


def refusal_to_open(path: Path) -> str:
    """Say why a file that a user names cannot be read: "does not exist"; "" where it can.

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
