# SPDX-License-Identifier: GPL-3.0-or-later
"""What the catalogue declares of each code of a finding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["info", "caution", "error"]


@dataclass(frozen=True)
class Kind:
    """Severity and templates (what happened, why it matters, what to do) of a kind of finding.

    "info": nothing is wrong; "caution": a result may not mean what you expect; "error": the
    results concerned are wrong or empty.
    """

    severity: Severity
    text: str
    cause: str
    remedy: str
