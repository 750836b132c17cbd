# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings in Blender's window: reports of operators, and sentences in panels."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.ui.fields import (
    draw_findings,
    findings_text,
    read_findings,
    report_findings,
)
from radarsim_addon.findings import finding

FOUND = [
    finding("single-snapshot"),
    finding("no-radar-material", "Wall").in_frame(1),
    finding("no-radar-material", "Roof").in_frame(3),
    finding("mesh-open", "Box"),
]


class Drawn:
    """A layout that keeps what is drawn."""

    def __init__(self) -> None:
        self.labels: list[tuple[str, str]] = []

    def column(self, **_: Any) -> Drawn:
        return self

    def label(self, *, text: str, icon: str) -> None:
        self.labels.append((icon, text))


def test_reports_are_merged_and_never_errors() -> None:
    """Blender raises where a script calls an operator that reports an error."""
    reports: list[tuple[set[str], str]] = []
    operator = SimpleNamespace(report=lambda kind, text: reports.append((kind, text)))
    report_findings(operator, FOUND, frames=(1, 2, 3))
    assert [kind for kind, _ in reports] == [{"INFO"}, {"WARNING"}, {"WARNING"}]
    assert reports[1][1].startswith("caution: frames 1, 3: No Radar Material")
    assert "'Wall', 'Roof'" in reports[1][1]


def test_panels_draw_severity_and_wrap_lines() -> None:
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))
    context = SimpleNamespace(region=SimpleNamespace(width=280), preferences=preferences)
    layout = Drawn()
    draw_findings(context, layout, FOUND)
    icons = [icon for icon, _ in layout.labels if icon != "BLANK1"]
    assert icons == ["INFO", "ERROR", "ERROR", "CANCEL"]
    assert all(len(text) <= 36 for _, text in layout.labels)
    words = " ".join(text for _, text in layout.labels)
    assert words == " ".join(item.message for item in FOUND)


def test_the_window_keeps_records() -> None:
    assert read_findings(findings_text(FOUND)) == FOUND
    assert read_findings("") == []
