# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings and errors in Blender's window: in panels, and as reports of operators."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from ...errors import RadarSimError
from ...findings import Finding, finding_lines, from_json, merge, to_json
from .fields import wrapped

#: Icon of a severity.
ICONS = {"info": "INFO", "caution": "ERROR", "error": "CANCEL"}  # Blender's ERROR is a triangle


@contextlib.contextmanager
def reported(operator: Any) -> Iterator[None]:
    """Turn a named error into the operator's report; the operator returns CANCELLED then."""
    try:
        yield
    except RadarSimError as error:
        operator.report({"ERROR"}, str(error))


def report_findings(operator: Any, findings: list[Finding], frames: Sequence[int] = ()) -> None:
    """Report findings of `frames` in Blender's status bar and Info editor."""
    for item in merge(findings):
        kind = "INFO" if item.severity == "info" else "WARNING"  # ERROR would raise in scripts
        operator.report({kind}, finding_lines([item], frames)[0])


def draw_findings(context: Any, layout: Any, findings: Iterable[Finding]) -> None:
    """Draw findings in a panel, each with the icon of its severity."""
    for item in findings:
        wrapped(context, layout, item.message, ICONS[item.severity])


def findings_text(findings: list[Finding]) -> str:
    """Return findings as text for a Blender property."""
    return json.dumps([to_json(item) for item in findings])


def read_findings(text: str) -> list[Finding]:
    """Return the findings that `findings_text` wrote."""
    return [from_json(item, "Findings") for item in json.loads(text or "[]")]
