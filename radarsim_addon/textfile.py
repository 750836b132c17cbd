# SPDX-License-Identifier: GPL-3.0-or-later
"""Text of files that a user or another program gives: never more of it than expected. No bpy."""

from __future__ import annotations

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
