# SPDX-License-Identifier: GPL-3.0-or-later
"""Text from files, made safe to print. Standard library only."""

from __future__ import annotations

import unicodedata

#: Unicode categories that steer a terminal or end a line: controls, formats (which change the
#: direction of writing), halves of surrogates, line and paragraph separators.
_STEERING = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})


def printable(text: str) -> str:
    """Return text on one line, with the characters that steer a terminal escaped.

    Names of objects may hold any character, and files may come from strangers.

    Parameters
    ----------
    text
        Any text.

    Returns
    -------
    str
        The text; each control or format character as Python escapes it (``\\x1b``).
    """
    return "".join(
        character.encode("unicode_escape").decode("ascii")
        if unicodedata.category(character) in _STEERING
        else character
        for character in text
    )
