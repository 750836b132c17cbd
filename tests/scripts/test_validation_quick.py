# SPDX-License-Identifier: GPL-3.0-or-later
"""The quick subset of the validation, and what it makes of broken bounds."""

from __future__ import annotations

import dataclasses
import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("bpy")

from scripts import validate
from scripts.validation import versions
from scripts.validation.case import (
    Bench,
    Case,
    Check,
    Group,
    Outcome,
    absolute_check,
    outcome_from_json,
    power_check,
    ratio_db,
    relative_check,
    run_case,
    worst_of,
)
from scripts.validation.registry import groups
from scripts.validation.report import markdown

pytestmark = pytest.mark.blender

GOOD = power_check("level", 1.0, 1.01, 0.05, "by hand")
BROKEN = power_check("other level", 1.0, 1.02, 0.05, "by hand")
MACHINE = {
    "date": "2026-01-01",
    "radarsim": "0",
    "blender": "5",
    "numpy": "2",
    "python": "3",
    "processor": "p",
    "cpus": 2,
    "load": 0.0,
    "cpu_s": 1.0,
    "wall_s": 1.0,
}


def group_of(*checks: Check, limit_s: float = 100.0) -> Group:
    return Group("g", "G", "Text.", (Case("c", lambda bench: list(checks), limit_s),))


@pytest.mark.slow
def test_quick_subset_holds_its_bounds(tmp_path: Path) -> None:
    """As a user runs it: exit status, report, JSON, pictures."""
    script = Path(validate.__file__)
    command = [sys.executable, str(script), "--quick", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    record = json.loads((tmp_path / "validation.json").read_text(encoding="utf-8"))
    assert record["passed"] is True
    outcomes = [outcome_from_json(row) for row in record["outcomes"]]
    wanted = [(g.key, c.name) for g in groups(quick=True) for c in g.cases]
    assert [(o.group, o.case) for o in outcomes] == wanted
    assert all(o.checks and not o.faults for o in outcomes)
    text = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert "0 broken bounds" in text
    assert (tmp_path / "images" / "validation_bounds.png").stat().st_size > 10_000


def test_errors_and_bounds_in_closed_form() -> None:
    assert GOOD.error == pytest.approx(10 * math.log10(1.01))
    assert GOOD.passed
    assert not BROKEN.passed
    assert relative_check("x", 2.0, 2.002, 1e-3, "").error == pytest.approx(1e-3)
    assert absolute_check("x", 2.0, 1.5, 1.0, "").error == -0.5
    assert not relative_check("x", 0.0, 1e-9, 1.0, "").passed
    assert not power_check("nothing", 1.0, 0.0, 0.05, "").passed
    assert not power_check("nan", 1.0, math.nan, 0.05, "").passed
    assert math.isnan(ratio_db(-1.0, 1.0))
    worst = worst_of("all", [GOOD, BROKEN, GOOD])
    assert (worst.name, worst.points, worst.passed) == ("all: other level", 3, False)
    nan = absolute_check("n", 0.0, math.nan, 1.0, "")
    assert math.isnan(worst_of("all", [nan, BROKEN]).error)


def test_a_broken_bound_is_named_and_ends_with_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for checks, status in (((GOOD,), 0), ((GOOD, BROKEN), 1)):
        group = group_of(*checks)
        outcome = run_case(group, group.cases[0], Bench(tmp_path))
        part = {
            "machine": {},
            "outcomes": [json.loads(json.dumps(outcome.as_json()))],
            "curves": {},
            "sections": {},
        }
        monkeypatch.setattr(validate, "_run_part", lambda *_, part=part: part)
        assert validate.validate([group], False, tmp_path / str(status)) == status
    said = capsys.readouterr()
    assert "BROKEN g / c: other level" in said.err
    text = (tmp_path / "1" / "validation.md").read_text(encoding="utf-8")
    assert "1 broken bound." in text
    assert "BROKEN: g / c: other level" in text


def test_what_raises_hangs_or_checks_nothing_is_a_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(_bench: Bench) -> list[Check]:
        raise ValueError("no such thing")

    group = Group("g", "G", "", (Case("c", fail, 1.0),))
    outcome = run_case(group, group.cases[0], Bench(tmp_path))
    assert outcome.faults == ["g / c: ValueError: no such thing"]
    assert "no such thing" in markdown(MACHINE, [group], [outcome], [])
    assert run_case(group_of(), group_of().cases[0], Bench(tmp_path)).faults
    slow = Outcome("g", "c", [GOOD], 1.0, 5.0, 4.0)
    assert "5.0 s of processor time" in slow.faults[0]
    # A process that dies without a word breaks its cases.
    monkeypatch.setattr(sys, "executable", "/bin/false")
    lost = validate._run_part([group_of(GOOD)], False)
    assert "ended with status 1" in lost["outcomes"][0]["error"]
    capsys.readouterr()


def test_json_holds_what_cannot_be_written_as_a_number(tmp_path: Path) -> None:
    check = absolute_check("n", 0.0, math.nan, 1.0, "", standard_error=math.inf)
    outcome = Outcome("g", "c", [check, GOOD], 1.0, 1.0, 1.0)
    again = outcome_from_json(json.loads(json.dumps(outcome.as_json(), allow_nan=False)))
    assert math.isnan(again.checks[0].error)
    assert again.checks[0].standard_error == math.inf
    assert again.checks[1] == GOOD


def test_versions_are_kept_beside_one_another(tmp_path: Path) -> None:
    """Each in place of its own earlier record; bounds that are wider on one of them are named."""
    wide = dataclasses.replace(GOOD, name="wide", usual_bound=0.01)
    for version, checks in (("4.5.15", (BROKEN,)), ("5.2.3", (GOOD,)), ("4.5.15", (GOOD, wide))):
        outcome = Outcome("g", "c", list(checks), 1.0, 1.0, 2.0)
        records = versions.keep(tmp_path, {**MACHINE, "blender": version}, [outcome])
    assert records == versions.read(tmp_path)
    first, second = versions.table(records)[-3:-1]
    assert first.startswith("| 5.2.3 |") and first.endswith("| 0 | level: 86 % | none |")
    assert second.startswith("| 4.5.15 |")
    assert second.endswith("| wide: +0.043 dB (bound 0.05, elsewhere 0.01) |")
    nan = absolute_check("n", 0.0, math.nan, 1.0, "")
    broken = versions.summary(MACHINE, [Outcome("g", "c", [nan], 1.0, 1.0, 2.0)])
    assert (broken["broken"], broken["worst"]) == (1, "n")
    json.dumps(broken, allow_nan=False)


def test_table_cells_hold_bars() -> None:
    group = group_of(absolute_check("|r|", 0.0, 0.0, 1.0, "a|b"))
    outcome = Outcome("g", "c", group.cases[0].run(Bench(Path())), 0, 0, 1)
    row = markdown(MACHINE, [group], [outcome], []).splitlines()[-1]
    assert row.replace("\\|", "").count("|") == 4


def test_a_row_shows_the_result_of_a_source_that_is_nearest_to_its_bound() -> None:
    """Broken ones and those of another source have rows of their own."""
    near = absolute_check("near", 0.0, 0.9, 1.0, "closed form")
    exact = absolute_check("exact", 0.0, 0.0, 0.0, "closed form")
    other = absolute_check("other", 0.0, 0.2, 1.0, "table")
    for checks, shown in (
        ([exact, near, other], ["| c | closed form | +0.9 / 1 |", "| c | table | +0.2 / 1 |"]),
        (
            [near, dataclasses.replace(near, name="beyond", error=2.0)],
            ["| c | closed form | +0.9 / 1 |", "| c: beyond |  | **+2 / 1 BROKEN**"],
        ),
    ):
        outcome = Outcome("g", "c", checks, 0, 0, 1)
        rows = markdown(MACHINE, [group_of(*checks)], [outcome], []).splitlines()[-len(shown) :]
        assert all(text in row for text, row in zip(shown, rows, strict=True)), rows


def test_unknown_group_is_named() -> None:
    with pytest.raises(KeyError, match="no group nonsense; there are: radiometric"):
        groups(["nonsense"])
