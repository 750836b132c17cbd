# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings of many frames, each said once with the frames it concerns. Pure standard library."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

#: A quoted name, whose digits are no quantity; or a number that stands by itself.
_TOKEN = re.compile(
    r"""(?<!\w)(?P<name>'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")"""
    r"""|(?<![\w.,])(?P<number>[+-]?\d[\d,]*(?:\.\d+)?(?:[eE][+-]?\d+)?)(?!\w|\.\w)"""
)


@dataclass
class _Warning:
    """Texts of one kind, which differ in their numbers alone, and whose they are."""

    texts: list[str] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)


class FrameWarnings:
    """Collects warnings frame by frame; what differs in its numbers alone is one warning."""

    def __init__(self) -> None:
        self._frames: list[int] = []
        self._found: dict[str, _Warning] = {}

    def add(self, frame: int, warnings: Iterable[str]) -> None:
        """Take what is said of a frame, nothing included; a frame may come several times."""
        if frame not in self._frames:
            self._frames.append(frame)
        of_this_call: set[str] = set()
        for text in warnings:
            kind = _TOKEN.sub(lambda match: match["name"] or "\0", text)
            if kind in of_this_call:  # the same of another thing: both are to be seen whole
                kind = text
            of_this_call.add(kind)
            entry = self._found.setdefault(kind, _Warning())
            if text not in entry.texts:
                entry.texts.append(text)
            if frame not in entry.frames:
                entry.frames.append(frame)

    def lines(self) -> list[str]:
        """Each warning once, in the order in which they came up.

        With several frames it is headed by those it concerns, "frames 1-20: ...", and a number
        that changes from frame to frame is given from the least to the largest.
        """
        return [
            (f"{frames_text(entry.frames, self._frames)}: " if len(self._frames) > 1 else "")
            + _merged(entry.texts)
            for entry in self._found.values()
        ]


def frames_text(frames: Sequence[int], among: Sequence[int]) -> str:
    """ "frame 3" or "frames 1-20, 25"; a dash joins frames that follow one another in `among`."""
    place = {frame: number for number, frame in enumerate(among)}
    runs: list[list[int]] = []
    for frame in sorted(frames, key=place.__getitem__):
        if runs and place[frame] == place[runs[-1][-1]] + 1:
            runs[-1].append(frame)
        else:
            runs.append([frame])
    words = [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
    return f"frame{'s' if len(frames) > 1 else ''} {', '.join(words)}"


def _merged(texts: Sequence[str]) -> str:
    """One text for several that differ in their numbers alone."""
    numbers = [[match["number"] for match in _TOKEN.finditer(text)] for text in texts]
    columns = iter([list(column) for column in zip(*numbers, strict=True)])

    def replace(match: re.Match[str]) -> str:
        found = next(columns)
        if match["name"] or len(set(found)) == 1:
            return match[0]
        ordered = sorted(found, key=lambda number: float(number.replace(",", "")))
        return f"{ordered[0]} to {ordered[-1]}"

    return _TOKEN.sub(replace, texts[0])
