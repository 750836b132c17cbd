# SPDX-License-Identifier: GPL-3.0-or-later
"""Text from files, made safe to print."""

from __future__ import annotations

import unicodedata

#: Unicode categories that steer a terminal or end a line: controls, formats (which turn the
#: direction of writing), halves of surrogates, line and paragraph separators.
_STEERING = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})


def printable(text: str) -> str:
    """Text on one line that no terminal obeys: control characters as Python escapes them.

    Names of objects may hold any character, and files come from strangers.
    """
    return "".join(
        character.encode("unicode_escape").decode("ascii")
        if unicodedata.category(character) in _STEERING
        else character
        for character in text
    )


def error_line(error: Exception) -> str:
    """Return the line that a command prints for a named error, without its end."""
    return f"radarsim: {type(error).__name__}: {printable(str(error))}"
