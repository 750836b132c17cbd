# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/slips.py: every slip still fits the code, and the verdicts are right."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from scripts import slips

ROOT = Path(__file__).resolve().parents[2]
SLIPS = slips.read_slips()


def test_a_slip_fits_the_code_and_names_tests_that_are_there(subtests: pytest.Subtests) -> None:
    for slip in SLIPS:
        with subtests.test(slip.name):
            changed = slips.slipped_text(slip, ROOT)
            assert changed != (ROOT / slip.path).read_text("utf-8")
            ast.parse(changed)
            assert slip.seen.endswith(".") and slip.tests
            for test in slip.tests:
                path, _, function = test.partition("[")[0].partition("::")
                text = (ROOT / path).read_text("utf-8")
                assert re.search(rf"^def {function or 'test_'}", text, re.MULTILINE), test


def test_names_are_taken_once_and_every_part_has_slips() -> None:
    assert len({slip.name for slip in SLIPS}) == len(SLIPS) >= 100
    for part in slips.PARTS:
        assert sum(slip.part == part for slip in SLIPS) >= 25


def test_a_text_that_is_gone_is_named() -> None:
    gone = slips.Slip(
        "physics", "gone", "radar_equation.py", "no such text", "", ("tests",), "Nothing."
    )
    with pytest.raises(slips.CannotRunError, match="'no such text' occurs 0 times"):
        slips.slipped_text(gone, ROOT)


def test_a_mistake_is_caught_and_a_harmless_change_is_missed(tmp_path: Path) -> None:
    slips.copy_checkout(tmp_path)
    test = ("tests/physics/test_noise.py::test_thermal_noise_in_one_hertz",)
    old = "BOLTZMANN_J_PER_K * temperature * bandwidth"
    before = (tmp_path / "radarsim_addon/physics/radar_equation.py").read_bytes()

    def caught(new: str) -> bool:
        slip = slips.Slip("physics", "one", "radar_equation.py", old, new, test, "Noise.")
        return slips.is_caught(slip, tmp_path)

    assert caught("BOLTZMANN_J_PER_K * temperature / bandwidth * 2")
    assert not caught("bandwidth * temperature * BOLTZMANN_J_PER_K")
    with pytest.raises(slips.CannotRunError, match="pytest ended with"):
        caught("BOLTZMANN_J_PER_K * (")
    assert (tmp_path / "radarsim_addon/physics/radar_equation.py").read_bytes() == before


def test_tests_that_fail_as_the_code_is_are_named(tmp_path: Path) -> None:
    (tmp_path / "radarsim_addon").mkdir()
    (tmp_path / "test_wrong.py").write_text("def test_wrong() -> None:\n    assert 1 == 2\n")
    slip = slips.Slip("physics", "one", "radar_equation.py", "a", "b", ("test_wrong.py",), "Noise.")
    with pytest.raises(slips.CannotRunError, match="tests fail without a slip"):
        slips.check_without_slips([slip], tmp_path)


def test_unknown_names_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert slips.main(["--slip", "no-such-slip"]) == slips.CANNOT_RUN
    assert "there is no slip 'no-such-slip'" in capsys.readouterr().err
    assert slips.main(["--list", "--only", "physics"]) == slips.CAUGHT
    assert "physics/debye-that-amplifies: " in capsys.readouterr().out
