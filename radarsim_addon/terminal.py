# SPDX-License-Identifier: GPL-3.0-or-later
"""Text for a console: what files hold made safe to print, and a line of progress."""

from __future__ import annotations

import re
import unicodedata
from typing import TextIO

#: Unicode categories that steer a terminal or end a line: controls, formats (which turn the
#: direction of writing), halves of surrogates, line and paragraph separators.
_STEERING = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})


def printable(text: str) -> str:
    """Return a text on one line that no terminal obeys: control characters as Python escapes them.

    Names of objects may hold any character, and files come from strangers.
    """
    return "".join(
        character.encode("unicode_escape").decode("ascii")
        if unicodedata.category(character) in _STEERING
        else character
        for character in text
    )


#: Width of a terminal and of a page, and of what is before the second part of a line.
_COLUMNS, _INDENT = 80, 16
#: Between two values of a line.
_SEPARATOR = re.compile(r"(?<! )   (?! )")


def wrapped(line: str) -> list[str]:
    """Return a line in lines that fit into a terminal, broken between values where there are three
    spaces. All but the first one are indented.
    """
    lines = []
    while len(line) > _COLUMNS:
        places = [one for one in _SEPARATOR.finditer(line) if one.start() > _INDENT]
        fitting = [one for one in places if one.start() <= _COLUMNS] or places[:1]
        if not fitting:
            break
        lines.append(line[: fitting[-1].start()])
        line = " " * _INDENT + line[fitting[-1].end() :]
    return [*lines, line]


def error_line(error: Exception) -> str:
    """Return the line that a command prints for a named error, without its end."""
    return f"radarsim: {type(error).__name__}: {printable(str(error))}"


class ProgressLine:
    """A line ``12/42 renders, 29 %, 0:18 left``: rewritten in a terminal, else one per 5 %.

    `unit` is the plural noun of what is counted.
    """

    def __init__(self, stream: TextIO, unit: str = "renders") -> None:
        self._stream = stream
        self._unit = unit
        self._terminal = stream.isatty()
        self._last_step = -1

    def show(self, done: int, total: int, seconds_left: float | None) -> None:
        """Print the state, if it is time to."""
        step = done * 20 // max(total, 1)
        text = progress_text(done, total, seconds_left, self._unit)
        if self._terminal:
            self._stream.write(f"\r{text:<60}" + ("\n" if done >= total else ""))
        elif step != self._last_step:
            self._stream.write(text + "\n")
        self._last_step = step
        self._stream.flush()


def progress_text(done: int, total: int, seconds_left: float | None, unit: str = "renders") -> str:
    """Return the line of progress; without an estimate of the seconds left where it is None."""
    percent = 100 * done // total if total else 100
    text = f"radarsim: {done}/{total} {unit}, {percent} %"
    if seconds_left is None or done >= total:
        return text
    whole = round(seconds_left)
    hours, rest = divmod(whole, 3600)
    clock = f"{rest // 60}:{rest % 60:02d}" if not hours else f"{hours}:{rest // 60:02d} h"
    return f"{text}, {clock} left"
