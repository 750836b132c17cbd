# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings of many frames and objects, one for each code."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, get_args

from ..terminal_text import printable
from .catalogue import CATALOGUE
from .kinds import Severity
from .records import Finding, Value, written
from .texts import frames_text

#: Exit code where all is done, and findings of severity error concern all of it.
UNUSABLE = 3


def merge(findings: Iterable[Finding]) -> list[Finding]:
    """Make one finding of all those of a code, over frames and objects.

    Parameters
    ----------
    findings
        In any order.

    Returns
    -------
    list of Finding
        In the order in which their codes came up. Subjects and frames are joined; a number becomes
        its least and largest value. Findings whose code is not in the catalogue are one where their
        texts are equal.
    """
    groups: dict[tuple[str, ...], list[Finding]] = {}
    for item in findings:
        groups.setdefault(_group(item), []).append(item)
    return [_merged(group) for group in groups.values()]


def finding_about(code: str, found: Mapping[str, Mapping[str, float]]) -> Finding:
    """Make one finding about many subjects, as `merge` makes it of one for each.

    Parameters
    ----------
    code
        Key of :data:`.catalogue.CATALOGUE`.
    found
        Numbers of the catalogue's placeholders by subject, at least one.

    Returns
    -------
    Finding
        With the least and largest of each number.
    """
    columns: dict[str, set[float]] = {}
    for numbers in found.values():
        for name, value in numbers.items():
            columns.setdefault(name, set()).add(value)
    spans: dict[str, Value] = {
        name: min(values) if len(values) == 1 else (min(values), max(values))
        for name, values in columns.items()
    }
    return written(Finding(code, CATALOGUE[code].severity, tuple(found), (), spans))


def finding_lines(findings: Iterable[Finding], frames: Sequence[int] = ()) -> list[str]:
    """Return the merged findings as lines for a console.

    Parameters
    ----------
    findings
        In any order.
    frames
        All frames that were looked at, in order; with more than one, a line names its frames.

    Returns
    -------
    list of str
        Such as ``caution: frames 1-3: ... [doppler-ambiguous-paths]``; safe to print.
    """
    lines = []
    for item in merge(findings):
        place = ""
        if len(frames) > 1 and item.frames:
            place = f"{frames_text(item.frames, frames)}: "
        lines.append(printable(f"{item.severity}: {place}{item.message} [{item.code}]"))
    return lines


def exit_code(findings: Iterable[Finding], frames: Sequence[int]) -> int:
    """Return the exit code of a command that did all its work.

    Parameters
    ----------
    findings
        Of the run and of its frames.
    frames
        All frames that were looked at.

    Returns
    -------
    int
        `UNUSABLE` if findings of severity error concern the whole run, or all frames; else 0.
    """
    errors = [item for item in findings if item.severity == "error"]
    spoilt = {frame for item in errors for frame in item.frames}
    whole = any(not item.frames for item in errors)
    return UNUSABLE if whole or (spoilt and spoilt.issuperset(frames)) else 0


def _group(item: Finding) -> tuple[str, ...]:
    """Return what findings that become one have in common."""
    if item.code not in CATALOGUE:
        return item.code, item.message
    return (item.code,)


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
