# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers, spans of numbers, names and frames as text."""

from __future__ import annotations

import math
import string
from collections.abc import Mapping, Sequence
from typing import Any

#: Names that a text gives in full; the others are counted.
_NAMES_SHOWN = 3
#: Frames, or series of them, that a text gives; the others are counted.
_FRAMES_SHOWN = 8
#: Unit, its size, and the least value that is given in it.
_NUMBER_UNITS = {
    "length": (("km", 1e3, 1e4), ("m", 1.0, -math.inf)),
    "frequency": (("GHz", 1e9, 1e9), ("MHz", 1e6, 1e6), ("kHz", 1e3, 1e3), ("Hz", 1.0, -math.inf)),
}


def fill(template: str, values: Mapping[str, Any]) -> str:
    """Return a template of the catalogue with its values, each a number, a word or a span."""
    return _TEXT.vformat(template, (), values)


def frames_text(frames: Sequence[int], among: Sequence[int]) -> str:
    """Return "frame 3" or "frames 1-20, 25"; "2-8 (every 2nd)" where those between do not exist.

    Parameters
    ----------
    frames
        Frame numbers, at least one.
    among
        All frames of the run, in their order.

    Returns
    -------
    str
        The frames in the order of `among`.
    """
    place = {frame: number for number, frame in enumerate(among)}
    runs: list[list[int]] = []
    for frame in sorted(frames, key=lambda number: place.get(number, len(place) + number)):
        if runs and place.get(frame, -1) == place.get(runs[-1][-1], -3) + 1:
            step, run = frame - runs[-1][-1], runs[-1]
            if len(run) == 1 or step == run[1] - run[0]:
                run.append(frame)
                continue
        runs.append([frame])
    words = [word for run in runs for word in _run_words(run)]
    shown = ", ".join(words[:_FRAMES_SHOWN])
    left = len(words) - _FRAMES_SHOWN
    more = f" and {left} more" if left > 0 else ""
    return f"frame{'s' if len(frames) > 1 else ''} {shown}{more}"


def _run_words(run: Sequence[int]) -> list[str]:
    """Return frames of one distance as one word, or one word each where a dash would mislead."""
    step = run[1] - run[0] if len(run) > 1 else 1
    if len(run) == 1 or (step != 1 and len(run) < 4):
        return [str(frame) for frame in run]
    every = {1: "", 2: " (every 2nd)", 3: " (every 3rd)"}.get(step, f" (every {step}th)")
    return [f"{run[0]}-{run[-1]}{every}"]


def names_text(names: Sequence[str]) -> str:
    """Return the first names in quotes, and how many there are besides."""
    shown = ", ".join(f"'{name}'" for name in names[:_NAMES_SHOWN])
    more = len(names) - _NAMES_SHOWN
    return f"{shown} and {more} more" if more > 0 else shown


def length_text(metres: float) -> str:
    """Return a length with a unit that suits it.

    Parameters
    ----------
    metres
        Length [m].

    Returns
    -------
    str
        Number and unit.
    """
    return _TEXT.format_field(metres, "length")


def frequency_text(hertz: float) -> str:
    """Return a frequency with a unit that suits it.

    Parameters
    ----------
    hertz
        Frequency [Hz].

    Returns
    -------
    str
        Number and unit.
    """
    return _TEXT.format_field(hertz, "frequency")


class _Text(string.Formatter):
    """Formats numbers, spans of numbers and words by the specifications of the catalogue.

    ``percent``, ``length``, ``height`` and ``frequency`` choose digits and unit, ``#path`` counts
    ("1 path", "3 paths"), ``is|are`` gives the word for a count of one, or that for any other
    count. Other specifications are Python's own.
    """

    def format_field(self, value: Any, spec: str) -> str:
        """Return one value, or the span of several, as text."""
        if "|" in spec:
            one, other = spec.split("|")
            return one if value == 1 else other
        if isinstance(value, str):
            return value
        (first, unit), (last, last_unit) = (
            _number(end, spec) for end in (value if isinstance(value, tuple) else (value, value))
        )
        if (first, unit) == (last, last_unit):
            return first + unit
        if unit == last_unit or spec.startswith("#"):
            unit = ""
        return f"{first}{unit} to {last}{last_unit}"


def _number(value: float, spec: str) -> tuple[str, str]:
    """Return a number's digits and its unit."""
    if spec == "percent":
        return f"{100 * value:{'.2g' if abs(value) < 0.0995 else '.0f'}}", " %"
    if spec.startswith("#"):
        return f"{value:,}", f" {spec[1:]}{'' if value == 1 else 's'}"
    if spec == "height":
        return f"{1e3 * value:.2g}", " mm"
    for unit, scale, least in _NUMBER_UNITS.get(spec, ()):
        if value >= least:
            return f"{value / scale:.5g}", f" {unit}"
    return format(value, spec), ""


_TEXT = _Text()
