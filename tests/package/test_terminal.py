# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines for a terminal."""

from __future__ import annotations

from radarsim_addon.terminal import wrapped


def test_lines_are_broken_between_values() -> None:
    """A name that is padded, and a number that is aligned to the right, stay with their words."""
    line = (
        "  moving target      39.81 m   level  -124.84 dBW   range rate   +14.999 m/s   "
        "Doppler  -7704.76 Hz   37.1 dB above its surroundings   Car"
    )
    assert wrapped(line) == [
        "  moving target      39.81 m   level  -124.84 dBW   range rate   +14.999 m/s",
        "                Doppler  -7704.76 Hz   37.1 dB above its surroundings   Car",
    ]
    assert wrapped("short   line") == ["short   line"]
    name = "A name of a file, which nothing breaks, is as long as it is: " + "x" * 40
    assert wrapped(name) == [name]
    assert " ".join(wrapped(line * 3)).split() == (line * 3).split()
