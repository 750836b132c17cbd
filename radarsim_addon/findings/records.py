# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings: made from the catalogue, merged, to JSON and back.

`finding` fills the templates of a code with its numbers. `merge` makes one finding of all of a
code, over frames and objects: subjects and frames are joined, a number becomes its least and
largest value, and the templates are filled again.
"""

from __future__ import annotations

import math
import string
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast, get_args

from ..errors import FrameFileError
from ..terminal import printable
from .catalogue import CATALOGUE, Severity

# -- numbers, spans of numbers, names and frames as text -------------------------------------------

#: Names that a text gives in full; the others are counted.
_NAMES_SHOWN = 3
#: Frames, or series of them, that a text gives; the others are counted.
_FRAMES_SHOWN = 8
#: Unit, its size, and the least value that is given in it.
_NUMBER_UNITS = {
    "length": (("km", 1e3, 1e4), ("m", 1.0, -math.inf)),
    "frequency": (("GHz", 1e9, 1e9), ("MHz", 1e6, 1e6), ("kHz", 1e3, 1e3), ("Hz", 1.0, -math.inf)),
}


def frames_text(frames: Sequence[int], among: Sequence[int]) -> str:
    """Return the numbers of frames as a text: "frame 3", or "frames 1-20, 25".

    If the run has only every second frame, the text is "2-8 (every 2nd)". `frames` has at least one
    number. The text has the order of `among`, which lists all frames of the run.
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
    """Return equally spaced frames as one word, or as one word each where a dash would mislead."""
    step = run[1] - run[0] if len(run) > 1 else 1
    if len(run) == 1 or (step != 1 and len(run) < 4):
        return [str(frame) for frame in run]
    every = {1: "", 2: " (every 2nd)", 3: " (every 3rd)"}.get(step, f" (every {step}th)")
    return [f"{run[0]}-{run[-1]}{every}"]


def names_text(names: Sequence[str]) -> str:
    """Return the first names in quotes, and how many more there are."""
    shown = ", ".join(f"'{name}'" for name in names[:_NAMES_SHOWN])
    more = len(names) - _NAMES_SHOWN
    return f"{shown} and {more} more" if more > 0 else shown


def length_text(metres: float) -> str:
    """Return a length with a unit that suits it."""
    return _TEXT.format_field(metres, "length")


def percent_text(fraction: float) -> str:
    """Return a fraction in percent, with two digits below 10 %."""
    return _TEXT.format_field(fraction, "percent")


def frequency_text(hertz: float) -> str:
    """Return a frequency with a unit that suits it."""
    return _TEXT.format_field(hertz, "frequency")


class _Text(string.Formatter):
    """Formats numbers, spans of numbers and words by the specifications of the catalogue.

    ``percent``, ``length``, ``height`` and ``frequency`` choose digits and unit, ``#path`` counts
    ("1 path", "3 paths"), ``is|are`` gives the word for a count of one, or that for any other
    count. Other specifications are Python's own.
    """

    def format_field(self, value: object, spec: str) -> str:
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


Value = float | int | str | tuple[float, float]
"""A number in SI units, a word, or the least and the largest of several findings' numbers."""


@dataclass(frozen=True)
class Finding:
    """One finding, or several of the same code after `merge`."""

    code: str  # as in ``docs/findings.md``
    severity: Severity
    subjects: tuple[str, ...] = ()  # objects or materials; empty: it concerns the whole frame
    frames: tuple[int, ...] = ()  # radar frames; empty: it concerns the whole run
    numbers: Mapping[str, Value] = field(default_factory=dict)  # by the templates' placeholders
    text: str = ""  # what happened
    cause: str = ""  # why it matters
    remedy: str = ""  # what to do

    @property
    def message(self) -> str:
        """The three texts as one."""
        return " ".join(part for part in (self.text, self.cause, self.remedy) if part)

    def about(self, *subjects: str) -> Finding:
        """Return this finding about other objects or materials."""
        return written(replace(self, subjects=tuple(dict.fromkeys(subjects))))

    def as_information(self) -> Finding:
        """Return this finding with the severity "info"."""
        return replace(self, severity="info")

    def in_frame(self, frame: int) -> Finding:
        """Return this finding, of one radar frame."""
        return replace(self, frames=(frame,))


def written(item: Finding) -> Finding:
    """Return a finding with the catalogue's texts."""
    kind = CATALOGUE[item.code]
    values = {**item.numbers, "subjects": names_text(item.subjects)}
    values["they"] = len(item.subjects)
    text, cause, remedy = (
        _TEXT.vformat(part, (), values) for part in (kind.text, kind.cause, kind.remedy)
    )
    return replace(item, text=text, cause=cause, remedy=remedy)


def finding(code: str, *subjects: str, **numbers: object) -> Finding:
    """Make a finding of a code of the catalogue; numbers are in SI, numpy scalars are converted.

    KeyError: there is no such code, or its texts need a number that is not given.
    """
    plain = {name: _plain(value) for name, value in numbers.items()}
    names = tuple(dict.fromkeys(subjects))
    return written(Finding(code, CATALOGUE[code].severity, names, (), plain))


# -- JSON ------------------------------------------------------------------------------------------


def to_json(item: Finding) -> dict[str, Any]:
    """Return a finding as plain JSON types; tuples become lists."""
    numbers = {k: list(v) if isinstance(v, tuple) else v for k, v in item.numbers.items()}
    return {
        "code": item.code,
        "severity": item.severity,
        "subjects": list(item.subjects),
        "frames": list(item.frames),
        "numbers": numbers,
        "text": item.text,
        "cause": item.cause,
        "remedy": item.remedy,
    }


def from_json(data: object, where: str) -> Finding:
    """Read what `to_json` gave; `where`: file and place, for errors.

    FrameFileError: something of it is of a wrong type, or its severity is unknown.
    """
    if not isinstance(data, dict):
        raise FrameFileError(f"{where} is {data!r:.60}; expected a JSON object (a finding).")
    texts = {}
    for name in ("code", "severity", "text", "cause", "remedy"):
        texts[name] = data.get(name, "")
        if not isinstance(texts[name], str):
            raise FrameFileError(f"{where}: {name} is {texts[name]!r:.60}; expected text.")
    if texts["severity"] not in get_args(Severity):
        raise FrameFileError(
            f"{where}: severity is {texts['severity']!r:.60}; expected one of "
            f"{', '.join(get_args(Severity))}."
        )
    numbers = data.get("numbers", {})
    if not isinstance(numbers, dict):
        raise FrameFileError(f"{where}: numbers is {numbers!r:.60}; expected a JSON object.")
    return Finding(
        **texts,
        subjects=_tuple_of(str, data.get("subjects", []), f"{where}: subjects"),
        frames=_tuple_of(int, data.get("frames", []), f"{where}: frames"),
        numbers={k: _number_from_json(v, f"{where}: {k}") for k, v in numbers.items()},
    )


def _tuple_of(kind: type, values: object, where: str) -> tuple[Any, ...]:
    if not isinstance(values, list) or any(type(value) is not kind for value in values):
        raise FrameFileError(f"{where} is {values!r:.60}; expected a list of {kind.__name__}.")
    return tuple(values)


def _number_from_json(value: object, where: str) -> Value:
    ends = tuple(value) if isinstance(value, list) else (value,)
    if isinstance(value, str) or (
        all(type(end) in (int, float) for end in ends) and (len(ends) == 2 or ends == (value,))
    ):
        return cast(Value, ends) if isinstance(value, list) else cast(Value, value)
    raise FrameFileError(f"{where} is {value!r:.60}; expected a number, a text or two numbers.")


def _plain(value: object) -> Value:
    """Return a numpy scalar as Python's own; infinite and undefined values as words."""
    plain = cast(Value, value.item() if hasattr(value, "item") else value)
    return str(plain) if isinstance(plain, float) and not math.isfinite(plain) else plain


# -- many findings ---------------------------------------------------------------------------------

#: Exit code where all is done, and findings of severity error concern all of it.
UNUSABLE = 3


def merge(findings: Iterable[Finding]) -> list[Finding]:
    """Make one finding of all those of a code, in the order in which their codes came up.

    Findings whose code is not in the catalogue are one where their texts are equal.
    """
    groups: dict[tuple[str, ...], list[Finding]] = {}
    for item in findings:
        key = (item.code,) if item.code in CATALOGUE else (item.code, item.message)
        groups.setdefault(key, []).append(item)
    return [_merged(group) for group in groups.values()]


def finding_about(code: str, found: Mapping[str, Mapping[str, float]]) -> Finding:
    """Make one finding about many subjects, as `merge` makes it of one for each.

    `found` has the numbers of the templates by subject, of one at least.
    """
    severity = CATALOGUE[code].severity
    each = [Finding(code, severity, (name,), (), numbers) for name, numbers in found.items()]
    return written(_merged(each))


def finding_lines(
    findings: Iterable[Finding], frames: Sequence[int] = (), whole: bool = False
) -> list[str]:
    """Return the merged findings as lines that are safe to print.

    Such as ``caution: frames 1-3: ... [doppler-ambiguous-paths]``: what happened, and with `whole`
    its cause and remedy. `frames` are all frames that were looked at, in order; with more than one,
    a line names its frames.
    """
    lines = []
    for item in merge(findings):
        place = ""
        if len(frames) > 1 and item.frames:
            place = f"{frames_text(item.frames, frames)}: "
        text = item.message if whole else item.text
        lines.append(printable(f"{item.severity}: {place}{text} [{item.code}]"))
    return lines


def exit_code(findings: Iterable[Finding], frames: Sequence[int]) -> int:
    """Return the exit code of a command that did all its work on `frames`.

    `UNUSABLE` if findings of severity error concern the whole run, or all frames; else 0.
    """
    errors = [item for item in findings if item.severity == "error"]
    spoilt = {frame for item in errors for frame in item.frames}
    whole = any(not item.frames for item in errors)
    return UNUSABLE if whole or (spoilt and spoilt.issuperset(frames)) else 0


def _merged(group: Sequence[Finding]) -> Finding:
    first = group[0]
    if len(group) == 1:
        return first
    joined = replace(
        first,
        severity=max((item.severity for item in group), key=get_args(Severity).index),
        subjects=tuple(dict.fromkeys(name for item in group for name in item.subjects)),
        frames=tuple(sorted({frame for item in group for frame in item.frames})),
        numbers=_spans(group),
    )
    try:
        return written(joined)
    except (KeyError, ValueError):  # another version's numbers: its texts stay
        return joined


def _spans(group: Sequence[Finding]) -> dict[str, Value]:
    values: dict[str, list[Any]] = {}
    for item in group:
        for name, value in item.numbers.items():
            values.setdefault(name, []).extend(value if isinstance(value, tuple) else [value])
    spans: dict[str, Value] = {}
    for name, found in values.items():
        if len(set(found)) == 1:
            spans[name] = found[0]
        elif any(isinstance(value, str) for value in found):
            spans[name] = " or ".join(dict.fromkeys(map(str, found)))
        else:
            spans[name] = (min(found), max(found))
    return spans
