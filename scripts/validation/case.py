# SPDX-License-Identifier: GPL-3.0-or-later
"""What a case is, what it finds, and when a bound is broken. Standard library only."""

from __future__ import annotations

import dataclasses
import math
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.benchmarks.clock import stopwatch


@dataclass(frozen=True)
class Check:
    """One number against what it should be.

    Attributes
    ----------
    name
        What was measured, with the numbers that tell it from its neighbours.
    expected, measured, unit
        The two numbers.
    error, bound, error_unit
        Their difference in `error_unit` ("dB", "relative", ...), and the largest |error| allowed.
    source
        Where `expected` comes from.
    standard_error
        Of `error`, in the same unit; None where nothing is drawn at random or sampled.
    points
        How many numbers this one stands for; with more than 1 it is the worst of them.
    usual_bound
        Where `bound` is wider because this version of Blender cannot do better: that of others.
    """

    name: str
    expected: float
    measured: float
    unit: str
    error: float
    bound: float
    error_unit: str
    source: str
    standard_error: float | None = None
    points: int = 1
    usual_bound: float | None = None

    @property
    def passed(self) -> bool:
        """Whether the bound holds; NaN breaks every bound."""
        return bool(abs(self.error) <= self.bound)


def power_check(
    name: str,
    expected: float,
    measured: float,
    bound_db: float,
    source: str,
    *,
    unit: str = "dBW",
    relative_error: float | None = None,
) -> Check:
    """Two powers, shown and compared in dB; `relative_error` is one of `measured`."""
    error = ratio_db(measured, expected)
    spread = None if relative_error is None else relative_error * 10 / math.log(10)
    shown = (ratio_db(expected, 1.0), ratio_db(measured, 1.0))
    return Check(name, *shown, unit, error, bound_db, "dB", source, spread)


def relative_check(
    name: str,
    expected: float,
    measured: float,
    bound: float,
    source: str,
    *,
    unit: str = "",
    standard_error: float | None = None,
) -> Check:
    """Two numbers, compared relative to the expected one."""
    error = measured / expected - 1 if expected else math.inf
    return Check(name, expected, measured, unit, error, bound, "relative", source, standard_error)


def absolute_check(
    name: str,
    expected: float,
    measured: float,
    bound: float,
    source: str,
    *,
    unit: str = "",
    standard_error: float | None = None,
) -> Check:
    """Two numbers, compared by their difference."""
    error = measured - expected
    return Check(name, expected, measured, unit, error, bound, unit or "1", source, standard_error)


def worst_of(name: str, checks: Sequence[Check]) -> Check:
    """The check that comes nearest to its bound, or is farthest beyond it, under a common name."""
    if not checks:
        raise ValueError(f"{name}: nothing was checked.")

    def share(check: Check) -> float:
        if math.isnan(check.error) or not check.bound:
            return 0.0 if check.passed else math.inf
        return abs(check.error) / check.bound

    chosen = max(checks, key=share)
    label = f"{name}: {chosen.name}" if chosen.name else name
    points = sum(check.points for check in checks)
    return dataclasses.replace(chosen, name=label, points=points)


def ratio_db(value: float, over: float) -> float:
    """10 log10(value / over); -999 where value is 0, so that JSON can hold it; else NaN."""
    ratio = value / over if over else math.nan
    if ratio == 0:
        return -999.0
    return 10 * math.log10(ratio) if ratio > 0 and math.isfinite(ratio) else math.nan


@dataclass
class Bench:
    """What a case gets: a folder for its files, and places for curves that pictures show and for
    lines of the report."""

    folder: Path
    quick: bool = False
    curves: dict[str, list[dict[str, float | str]]] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    _runs: int = 0

    def fresh(self) -> Path:
        """A folder that does not exist yet, for one run."""
        self._runs += 1
        return self.folder / f"run_{self._runs}"

    def point(self, curve: str, **numbers: float | str) -> None:
        """A point of a named curve."""
        plain = {k: v if isinstance(v, str) else float(v) for k, v in numbers.items()}
        self.curves.setdefault(curve, []).append(plain)


@dataclass(frozen=True)
class Case:
    """A function that measures, and its limit of processor time on two cores.

    Attributes
    ----------
    run
        Gives the checks, one row of the table each.
    limit_s
        Processor time, all threads, that the case may take.
    quick
        Whether it belongs to the quick subset.
    """

    name: str
    run: Callable[[Bench], list[Check]]
    limit_s: float
    quick: bool = False


@dataclass(frozen=True)
class Group:
    """Cases of one topic, run in one process."""

    key: str
    title: str
    text: str
    cases: tuple[Case, ...]


@dataclass
class Outcome:
    """A case that was run."""

    group: str
    case: str
    checks: list[Check]
    wall_s: float
    cpu_s: float
    limit_s: float
    error: str = ""

    @property
    def faults(self) -> list[str]:
        """What is wrong, one text each; empty: all bounds hold."""
        where = f"{self.group} / {self.case}"
        if self.error:
            return [f"{where}: {self.error}"]
        found = [
            f"{where}: {c.name}: error {c.error:.3g} {c.error_unit}, bound {c.bound:g}"
            for c in self.checks
            if not c.passed
        ]
        if not self.checks:
            found.append(f"{where}: nothing was checked")
        if self.cpu_s > self.limit_s:
            found.append(f"{where}: {self.cpu_s:.1f} s of processor time, limit {self.limit_s:g} s")
        return found

    def as_json(self) -> dict[str, Any]:
        """Plain numbers and texts; NaN and infinity, which JSON has not, become texts."""
        record = dataclasses.asdict(self)
        for check, row in zip(self.checks, record["checks"], strict=True):
            row["passed"] = check.passed
            for key, value in row.items():
                if isinstance(value, float) and not math.isfinite(value):
                    row[key] = str(value)
        return record


def outcome_from_json(record: dict[str, Any]) -> Outcome:
    """The reverse of `Outcome.as_json`."""
    checks = []
    for row in record["checks"]:
        row = {key: value for key, value in row.items() if key != "passed"}
        for key in ("expected", "measured", "error", "bound", "standard_error"):
            if isinstance(row[key], str):
                row[key] = float(row[key])
        checks.append(Check(**row))
    return Outcome(**{**record, "checks": checks})


def run_case(group: Group, case: Case, bench: Bench) -> Outcome:
    """Run a case; what it raises becomes its error."""
    checks: list[Check] = []
    error = ""
    with stopwatch() as cost:
        try:
            checks = case.run(bench)
        except Exception as problem:
            traceback.print_exc()
            error = f"{type(problem).__name__}: {problem}"
    return Outcome(group.key, case.name, checks, cost.wall_s, cost.cpu_s, case.limit_s, error)


def now_utc() -> str:
    """Date and time for the report."""
    return time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
