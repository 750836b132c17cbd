#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Print a comparison of radarsim with another program or a measurement as a table.

    python scripts/other_programs.py weather
    python scripts/other_programs.py --list

The other program computes its values again if it is installed; otherwise they come from
tests/data/other_programs.csv, which names their sources.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from scripts.validation.other_programs import COMPARISONS, Comparison, Values


def table(comparison: Comparison, ours: Values, theirs: Values) -> str:
    """Return the table in Markdown."""
    unit, digits = comparison.unit, comparison.digits
    own, other, difference = (
        f"{name} [{unit}]" if unit else name
        for name in ("radarsim", comparison.other, "difference")
    )
    relative = comparison.kind == "relative"
    if unit == "dBW":
        difference = "difference [dB]"
    lines = [
        f"| {comparison.heading} | {own} | {other} | {'difference' if relative else difference} |",
        "| --- | --- | --- | --- |",
    ]
    for case, value in theirs.items():
        gap = ours[case] / value - 1 if relative else ours[case] - value
        values = f"{ours[case]:.{digits}f} | {value:.{digits}f}"
        lines.append(f"| {case} | {values} | {_gap(gap, digits, relative)} |")
    return "\n".join(lines) + "\n"


def _gap(gap: float, digits: int, relative: bool) -> str:
    """Return a difference as text; rounding errors look alike on every machine."""
    if relative:
        return "below 1e-12" if abs(gap) < 1e-12 else f"{gap:+.1e}"
    return f"{round(gap, digits) + 0.0:+.{digits}f}".replace(
        "+0." + "0" * digits, "0." + "0" * digits
    )


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", nargs="?", choices=COMPARISONS, help="the comparison")
    parser.add_argument("--list", action="store_true", help="name the comparisons and end")
    chosen = parser.parse_args(argv)
    if chosen.list or not chosen.name:
        print("\n".join(f"{key:15} {one.other}" for key, one in COMPARISONS.items()))
        return 0
    comparison = COMPARISONS[chosen.name]
    print(table(comparison, comparison.ours(), comparison.reference(chosen.name)), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
