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
    sections: dict[str, list[str]],
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
    sections
        Further lines of Markdown by group: tables that are no checks.
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
            f"Written by `make validate` on {machine['date']}: radarsim {machine['radarsim']}, "
            f"Blender {machine['blender']}, numpy {machine['numpy']}, "
            f"Python {machine['python']}, {machine['processor']}, {machine['cpus']} processors "
            f"(load {machine['load']:.1f} at the start). {machine['cpu_s']:.0f} s of processor "
            f"time, {machine['wall_s']:.0f} s by the clock."
        ),
        "",
        (
            f"**{len(checks)} results from {numbers} compared numbers, {len(faults)} broken "
            f"bound{'' if len(faults) == 1 else 's'}.** Powers and ranges go through the "
            "program's own chain (scene, renders by Cycles, files, table of paths or signal); the "
            "library is called, the furnace rendered, as such. All are compared with a closed "
            "form, an independent integration or an independent table, the scales of a scene also "
            "with the same scene in metres."
        ),
        "",
    ]
    lines += [f"- BROKEN: {fault}" for fault in faults] + ([""] if faults else [])
    lines += [
        (
            "A row shows one case: of the numbers that one source gives (*of*: how many), the one "
            "that is nearest to its bound. validation.json holds every result. *Error* is measured "
            "against expected, in the unit next to it; *s.e.* its standard error, from the "
            "replicates or the seeds of the run where there are any (replicates of a "
            "low-discrepancy sequence are better than independent ones: an upper bound). *Time* is "
            "processor time of the case, with its limit on two cores."
        ),
        "",
    ]
    lines += [line for file, caption in pictures for line in (f"![{caption}]({file})", "")]
    lines += versions
    for group in found:
        lines += [f"## {group.title}", "", group.text, ""]
        lines += _table([o for o in outcomes if o.group == group.key])
        lines += [*sections.get(group.key, []), ""]
    while lines and not lines[-1]:
        lines.pop()
    return "\n".join(lines) + "\n"


def _table(outcomes: Sequence[Outcome]) -> list[str]:
    """One row for the results of a case that have one source: that nearest to its bound.

    Broken results have rows of their own.
    """
    lines = [
        "| case: nearest to its bound | of | expected | measured | error | bound | source | time |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for outcome in outcomes:
        spent = f"{outcome.cpu_s:.1f} of {outcome.limit_s:g} s"
        if outcome.error:
            lines.append(f"| {outcome.case} | | | | **{_cell(outcome.error)}** | | | {spent} |")
        alike: dict[str, list[Check]] = {}
        for check in outcome.checks:
            alike.setdefault(check.source if check.passed else check.name, []).append(check)
        for checks in alike.values():
            lines.append(_row(outcome.case, checks, spent))
            spent = ""
    return lines


def _row(case: str, checks: Sequence[Check], spent: str) -> str:
    worst = worst_of(case, checks)
    error = f"{worst.error:+.2g} {worst.error_unit}"
    spread = worst.standard_error
    if spread is not None and not math.isnan(spread):
        error += f" (s.e. {spread:.1g})"
    cells = (
        worst.name,
        str(worst.points),
        f"{number(worst.expected)} {worst.unit}".strip(),
        f"{number(worst.measured)} {worst.unit}".strip(),
        error if worst.passed else f"**{error} BROKEN**",
        f"{worst.bound:.3g}",
        worst.source,
        spent,
    )
    return "| " + " | ".join(_cell(cell) for cell in cells) + " |"


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
