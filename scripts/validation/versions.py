# SPDX-License-Identifier: GPL-3.0-or-later
"""What whole runs under each version of Blender found, kept next to the report."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from radarsim_addon.atomic_files import write_text

from .case import Check, Outcome
from .report import number

FILE = "validation_versions.json"


def summary(machine: dict[str, Any], outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """One version's record: counts, the row nearest to its bound, and bounds that are wider here.

    Parameters
    ----------
    machine
        Versions and date.
    outcomes
        Of all cases.
    """
    checks = [check for outcome in outcomes for check in outcome.checks]
    rated = [(_share(check), check.name) for check in checks if check.bound]
    share, worst = max(rated, default=(0.0, ""))
    return {
        "date": machine["date"],
        "radarsim": machine["radarsim"],
        "results": len(checks),
        "numbers": sum(check.points for check in checks),
        "broken": sum(len(outcome.faults) for outcome in outcomes),
        "worst": worst,
        "worst_share": share,
        "wider": [
            {
                "name": check.name,
                "error": check.error,
                "unit": check.error_unit,
                "bound": check.bound,
                "usual_bound": check.usual_bound,
            }
            for check in checks
            if _beyond_usual(check)
        ],
    }


def _share(check: Check) -> float:
    """Of its bound that a row takes up; what is no number takes up all that JSON can say."""
    share = abs(check.error) / check.bound
    return share if math.isfinite(share) else sys.float_info.max


def _beyond_usual(check: Check) -> bool:
    usual = check.usual_bound
    return usual is not None and usual < abs(check.error) < math.inf


def read(folder: Path) -> dict[str, dict[str, Any]]:
    """Records by version; empty where there are none yet."""
    file = folder / FILE
    found: dict[str, dict[str, Any]] = {}
    if file.exists():
        found = json.loads(file.read_text(encoding="utf-8"))
    return found


def keep(
    folder: Path, machine: dict[str, Any], outcomes: Sequence[Outcome]
) -> dict[str, dict[str, Any]]:
    """Put this run's record in place of an earlier one of the same Blender; all of them."""
    records = read(folder) | {machine["blender"]: summary(machine, outcomes)}
    records = {version: records[version] for version in sorted(records, reverse=True)}
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / FILE, json.dumps(records, indent=1, allow_nan=False) + "\n")
    return records


def table(records: dict[str, dict[str, Any]]) -> list[str]:
    """Lines of Markdown; none for no records."""
    if not records:
        return []
    lines = [
        "## Versions of Blender",
        "",
        "The last whole run of `make validate-all-blenders` under each:",
        "",
        "| Blender | run | results | broken | nearest to its bound | beyond the others' bound |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for version, record in records.items():
        worst = f"{record['worst']}: {100 * record['worst_share']:.0f} %"
        wider = sorted(record["wider"], key=lambda row: -abs(row["error"]) / row["usual_bound"])
        beyond = "none"
        if wider:
            first, more = wider[0], len(wider) - 1
            unit = "" if first["unit"] == "1" else " " + first["unit"]
            beyond = (
                f"{first['name']}: {first['error']:+.2g}{unit} (bound {number(first['bound'])}, "
                f"elsewhere {number(first['usual_bound'])})" + f", and {more} more" * bool(more)
            )
        cells = (
            version,
            f"{record['date']}, radarsim {record['radarsim']}",
            f"{record['results']} from {record['numbers']} numbers",
            str(record["broken"]),
            worst,
            beyond,
        )
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return [*lines, ""]
