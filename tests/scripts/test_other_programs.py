# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparisons with other programs: the pages show what the script prints."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

from scripts.other_programs import main, table
from scripts.validation import other_programs
from scripts.validation.case import Bench

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = {
    "weather": "weather.md",
    "sea": "clutter.md",
    "spheres": "physics.md",
    "radar-equation": "system.md",
}
#: Those that compare with recorded values and need no render.
QUICK = ("weather", "spheres", "radar-equation")


@pytest.fixture(autouse=True)
def nothing_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Recorded values on every machine."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)


@pytest.mark.parametrize("key", PAGES)
def test_a_page_shows_what_the_script_prints(key: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([key]) == 0
    text = (DOCS / PAGES[key]).read_text("utf-8")
    assert capsys.readouterr().out in text
    assert f"python scripts/other_programs.py {key}" in text


@pytest.mark.parametrize("key", QUICK)
def test_bounds_hold_and_a_wrong_value_breaks_them(
    key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    comparison = other_programs.COMPARISONS[key]
    checks = comparison.checks(key)
    assert len(checks) == len(other_programs.recorded(key)) >= 3
    assert all(check.passed for check in checks), checks
    wrong = {case: 1.001 * value for case, value in other_programs.recorded(key).items()}
    monkeypatch.setattr(other_programs, "recorded", lambda _key: wrong)
    assert not any(check.passed for check in comparison.checks(key))


def test_the_sea_model_differs_from_measured_values_as_its_report_says(tmp_path: Path) -> None:
    checks = other_programs.sea_deviations(Bench(tmp_path))
    assert [check.passed for check in checks] == [True, True]


def test_an_installed_program_computes_its_values(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: object())
    comparison = other_programs.Comparison(
        "x", "", 1, "y", dict, package="itur", theirs=lambda: {"a": 2.0}
    )
    assert comparison.reference("weather") == {"a": 2.0}
    shown = table(comparison, {"a": 2.25}, {"a": 2.0}).splitlines()
    assert shown[-1] == "| a | 2.2 | 2.0 | +0.2 |"


@pytest.mark.slow
@pytest.mark.blender
def test_the_canyon_has_the_powers_of_sionna_rt() -> None:
    """At a quarter of the rays; its page shows the recorded values."""
    pytest.importorskip("bpy")
    comparison = other_programs.COMPARISONS["canyon"]
    ours, theirs = other_programs.canyon("706x353"), other_programs.recorded("canyon")
    for case, value in theirs.items():
        # twice the errors of the bounds, which are those of four times as many rays
        bound_db = 2 * next(b for start, b in comparison.bounds.items() if case.startswith(start))
        assert ours[case] == pytest.approx(value, abs=bound_db), case
    page = (DOCS / "acquisition.md").read_text("utf-8")
    rows = dict(re.findall(r"^\| (\w+ reflections?, [^|]+) \| [^|]+ \| ([-\d.]+) \|", page, re.M))
    assert {case: float(shown) for case, shown in rows.items()} == {
        case: round(value, 2) for case, value in theirs.items()
    }
