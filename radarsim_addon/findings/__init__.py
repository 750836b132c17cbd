# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings: records of what went wrong, or of what you should know before you trust a result.

A finding has a code, a severity, subjects (objects, materials), frames and numbers, and three texts
made from them: what happened, why it matters, what to do. catalogue.md declares every code once;
records.py makes findings of the codes, merges those of many frames and objects, and reads and
writes them as JSON. Console, window, JSON
files and ``docs/findings.md`` show the same records. Standard library only.
"""

from .catalogue import NO_ECHO_CODES
from .records import (
    Finding,
    Value,
    exit_code,
    finding,
    finding_about,
    finding_lines,
    frames_text,
    frequency_text,
    from_json,
    length_text,
    merge,
    percent_text,
    to_json,
)

__all__ = [
    "NO_ECHO_CODES",
    "Finding",
    "Value",
    "exit_code",
    "finding",
    "finding_about",
    "finding_lines",
    "frames_text",
    "frequency_text",
    "from_json",
    "length_text",
    "merge",
    "percent_text",
    "to_json",
]
