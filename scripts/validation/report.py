# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/validation.md and validation.json out of what was measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from .case import Check, Group, Outcome, worst_of

Notes = Sequence[tuple[str, str]]


def markdown(
    machine: dict[str, Any],
    found: Sequence[Group],
    outcomes: Sequence[Outcome],
    pictures: Sequence[tuple[str, str]],
    versions: Sequence[str] = (),
) -> str:
    """The whole document.

    Parameters
    ----------
    machine
        Versions, date and machine.
    found, outcomes
        Groups that were run and what they gave.
    pictures
        File (relative to the document) and caption.
    versions
        Lines of Markdown on other versions of Blender.
    """
    faults = [fault for outcome in outcomes for fault in outcome.faults]
    checks = [check for outcome in outcomes for check in outcome.checks]
    numbers = sum(check.points for check in checks)
    lines = [
        "# Validation",
        "",
        "<!-- Written by `make validate`: change scripts/validation, not this file. -->",
        "",
        (
            f"Run of {machine['date']}: radarsim {machine['radarsim']}, "
            f"Blender {machine['blender']}, numpy {machine['numpy']}, "
            f"Python {machine['python']}, {machine['processor']}, {machine['cpus']} processors "
            f"(load {machine['load']:.1f}); {machine['cpu_s']:.0f} s of processor time, "
            f"{machine['wall_s']:.0f} s by the clock."
        ),
        "",
        (
            f"**{len(checks)} results from {numbers} compared numbers, {len(faults)} broken "
            f"bound{'' if len(faults) == 1 else 's'}.** Powers and ranges go through the whole "
            "chain, from scene to signal."
        ),
        "",
    ]
    lines += [f"- BROKEN: {fault}" for fault in faults] + ([""] if faults else [])
    lines += [
        (
            "A row compares one case with one source (empty: that of the row above). It shows the "
            "error that is nearest to its bound, with the standard error where renders or seeds "
            "give one. "
            "[validation.json](validation.json) has every result, with expected and measured "
            "values and times."
        ),
        "",
    ]
    lines += [line for file, caption in pictures for line in (f"![{caption}]({file})", "")]
    lines += versions
    for group in found:
        lines += [f"## {group.title}", "", group.text, ""]
        lines += _table([o for o in outcomes if o.group == group.key])
        lines.append("")
    while lines and not lines[-1]:
        lines.pop()
    return "\n".join(lines) + "\n"


def _table(outcomes: Sequence[Outcome]) -> list[str]:
    """One row for the results of a case that have one source: that nearest to its bound.

    Rows of one source follow one another. Broken results have rows of their own, with the name of
    the number.
    """
    lines = ["| case | source | worst error / bound |", "| --- | --- | --- |"]
    rows: dict[str, list[tuple[str, Check]]] = {}
    for outcome in outcomes:
        if outcome.error:
            lines.append(f"| {outcome.case} | | **{_cell(outcome.error)}** |")
        alike: dict[str, list[Check]] = {}
        for check in outcome.checks:
            alike.setdefault(check.source if check.passed else check.name, []).append(check)
        for checks in alike.values():
            worst = worst_of(outcome.case, checks)
            rows.setdefault(worst.source, []).append((outcome.case, worst))
    for source, found in rows.items():
        shown = source
        for case, worst in found:
            error = _error(worst)
            if not worst.passed:
                case, error = worst.name, f"**{error} BROKEN**"
            cells = (case, shown, error)
            lines.append("| " + " | ".join(_cell(cell) for cell in cells) + " |")
            shown = ""
    return lines


def _error(check: Check) -> str:
    """Error with its standard error, bound and unit."""
    spread = check.standard_error
    spread_text = "" if spread is None or math.isnan(spread) else f"±{spread:.1g}"
    unit = "" if check.error_unit == "1" else f" {check.error_unit}"
    return f"{check.error:+.2g}{spread_text} / {check.bound:.3g}{unit}"


def _cell(text: str) -> str:
    """A text inside a table: a bar would end the cell."""
    return text.replace("|", "\\|").replace("\n", " ")


def number(value: float) -> str:
    """A number with the digits that matter."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    return f"{value:.6g}" if 1e-4 <= abs(value) < 1e7 else f"{value:.4g}"


def console(outcome: Outcome) -> str:
    """One line for the terminal."""
    state = "BROKEN" if outcome.faults else "ok"
    worst = max((abs(c.error) / c.bound for c in outcome.checks if c.bound), default=0.0)
    return (
        f"  {state:6} {outcome.group} / {outcome.case}: {len(outcome.checks)} results, worst at "
        f"{100 * worst:.3g} % of its bound, {outcome.cpu_s:.1f} s cpu, {outcome.wall_s:.1f} s wall"
    )
