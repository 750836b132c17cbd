# SPDX-License-Identifier: GPL-3.0-or-later
"""A finding, made from the catalogue, to JSON and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, get_args

from ..errors import FrameFileError
from .catalogue import CATALOGUE
from .kinds import Severity
from .texts import fill, names_text

Value = float | int | str | tuple[float, float]
"""A number in SI units, a word, or the least and the largest of several findings' numbers."""


@dataclass(frozen=True)
class Finding:
    """One finding, or several of the same code after :func:`.merging.merge`.

    Attributes
    ----------
    code
        Name of the kind of finding, as in ``docs/findings.md``.
    severity
        "info", "caution" or "error".
    subjects
        Names of the objects or materials it concerns; empty where it concerns the whole frame.
    frames
        Radar frames it concerns; empty where it concerns the whole run.
    numbers
        Values by name, in SI units; (least, largest) after a merge.
    text, cause, remedy
        What happened, why it matters, and what to do.
    """

    code: str
    severity: Severity
    subjects: tuple[str, ...] = ()
    frames: tuple[int, ...] = ()
    numbers: Mapping[str, Value] = field(default_factory=dict)
    text: str = ""
    cause: str = ""
    remedy: str = ""

    @property
    def message(self) -> str:
        """The three texts as one."""
        return " ".join(part for part in (self.text, self.cause, self.remedy) if part)

    def about(self, *subjects: str) -> Finding:
        """The same finding about these objects or materials."""
        return written(replace(self, subjects=tuple(dict.fromkeys(subjects))))

    def as_information(self) -> Finding:
        """The same finding where it is no danger."""
        return replace(self, severity="info")

    def in_frame(self, frame: int) -> Finding:
        """The same finding of one radar frame."""
        return replace(self, frames=(frame,))


def written(item: Finding) -> Finding:
    """Return a finding with the catalogue's texts."""
    kind = CATALOGUE[item.code]
    values = {**item.numbers, "subjects": names_text(item.subjects)}
    values["they"] = len(item.subjects)
    text, cause, remedy = (fill(part, values) for part in (kind.text, kind.cause, kind.remedy))
    return replace(item, text=text, cause=cause, remedy=remedy)


def finding(code: str, *subjects: str, **numbers: Any) -> Finding:
    """Make a finding of a code of the catalogue.

    Parameters
    ----------
    code
        Key of :data:`.catalogue.CATALOGUE`.
    subjects
        Names of the objects or materials that it concerns.
    numbers
        Values of the catalogue's placeholders, in SI units; numpy scalars are converted.

    Returns
    -------
    Finding
        With its texts.

    Raises
    ------
    KeyError
        The catalogue has no such code, or its texts need a number that is not given.
    """
    plain = {name: _plain(value) for name, value in numbers.items()}
    names = tuple(dict.fromkeys(subjects))
    return written(Finding(code, CATALOGUE[code].severity, names, (), plain))


# -- JSON ------------------------------------------------------------------------------------------
def to_json(item: Finding) -> dict[str, Any]:
    """Return a finding as plain JSON types.

    Parameters
    ----------
    item
        Finding.

    Returns
    -------
    dict
        Its fields by name; tuples become lists.
    """
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


def from_json(data: Any, where: str) -> Finding:
    """Read a finding.

    Parameters
    ----------
    data
        What :func:`to_json` gave.
    where
        File and place, for error messages.

    Returns
    -------
    Finding
        The same record as was written.

    Raises
    ------
    FrameFileError
        Something of it is of a wrong type, or its severity is unknown.
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


def _tuple_of(kind: type, values: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(values, list) or any(type(value) is not kind for value in values):
        raise FrameFileError(f"{where} is {values!r:.60}; expected a list of {kind.__name__}.")
    return tuple(values)


def _number_from_json(value: Any, where: str) -> Value:
    ends = tuple(value) if isinstance(value, list) else (value,)
    if isinstance(value, str) or (
        all(type(end) in (int, float) for end in ends) and (len(ends) == 2 or ends == (value,))
    ):
        return ends if isinstance(value, list) else value
    raise FrameFileError(f"{where} is {value!r:.60}; expected a number, a text or two numbers.")


def _plain(value: Any) -> Value:
    """Return a numpy scalar as Python's own; infinite and undefined values as words."""
    plain = value.item() if hasattr(value, "item") else value
    return str(plain) if isinstance(plain, float) and not math.isfinite(plain) else plain
