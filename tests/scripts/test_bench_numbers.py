# SPDX-License-Identifier: GPL-3.0-or-later
"""What scripts/bench.py makes of its runs, on numbers made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("bpy")  # the measure of the refinement lives beside it

from scripts.benchmarks.accuracy import (
    coarse,
    error_by_bin,
    ratios,
    standard_error,
    steady,
)
from scripts.benchmarks.paper import decibel_error, relative_l2
from scripts.benchmarks.target import target_summary


def test_errors_in_closed_form() -> None:
    reference = np.array([3.0, 4.0, 0.0])
    assert relative_l2(np.array([3.0, 4.0, 5.0]), reference) == pytest.approx(1.0)
    assert decibel_error(2.0, 1.0) == pytest.approx(10 * math.log10(2))
    assert decibel_error(0.0, 1.0) == -999.0
    np.testing.assert_array_equal(coarse(np.arange(7.0), 3), [3.0, 12.0])
    # 10 % of a bin of 1 W and 40 % of one of 9 W, weights 1 and 3; the empty bin does not count
    found = error_by_bin(np.array([1.1, 5.4, 7.0]), np.array([1.0, 9.0, 0.0]))
    assert found == pytest.approx(math.sqrt((0.1**2 + 3 * 0.4**2) / 4))


def test_standard_error_of_independent_replicates() -> None:
    """Sixteen profiles of unit variance in each of 400 bins about 10: 1/(4 x 10) of the mean."""
    generator = np.random.default_rng(3)
    replicates = list(10 + generator.normal(size=(16, 400)))
    assert standard_error(replicates, 1) == pytest.approx(1 / 40, rel=0.1)
    assert standard_error(replicates, 4) == pytest.approx(1 / 80, rel=0.2)


def row(
    kind: str, cpu_s: float, error: float, target_db: float, series: str = ""
) -> dict[str, object]:
    return {
        "sampling_mode": kind,
        "label": f"{kind} {cpu_s:g}",
        "series": series or kind,
        "cpu_s": cpu_s,
        "wall_s": cpu_s / 2,
        "error": error,
        "error_coarse": error,
        "error_by_bin": error,
        "target_db": target_db,
    }


def test_a_lucky_run_does_not_count() -> None:
    rows = [row("paths", *x) for x in ((1, 0.1, 0.01), (2, 0.1, -0.3), (3, 0.1, -0.1), (4, 0, 0))]
    best = steady(rows, "target_db", 0.2)
    assert best is not None
    assert best["cpu_s"] == 3
    assert steady(rows[:2], "target_db", 0.2) is None
    # Refined runs are a list of their own.
    rows.append(row("paths", 2.5, 0.1, 0.7, series="refined"))
    assert steady(rows, "target_db", 0.2) == best
    rows.append(row("paths", 2.7, 0.1, 0.0, series="refined"))
    assert steady(rows, "target_db", 0.2) == rows[-1]


def test_ratios() -> None:
    rows = [
        row("rings", 100, 0.3, 0.15),
        row("rings", 5, 0.3, 0.5),
        row("paths", 1, 0.4, 1.0),
        row("paths", 2, 0.2, 0.3),
        row("paths", 4, 0.1, -0.1),
    ]
    found = {r["what"]: r for r in ratios(rows)}
    assert found["range profile, 2.5 m bins"]["ratio_cpu"] == pytest.approx(50)
    assert found["range profile, 2.5 m bins"]["ratio_wall"] == pytest.approx(50)
    full = found["target within 0.2 dB, rings at full resolution"]
    assert (full["paths"], full["ratio_cpu"]) == ("paths 4", pytest.approx(25))


def test_the_target_is_judged_by_the_worst_of_several_frames() -> None:
    rows = [
        row("rings", 100, 0.3, 0.01),
        row("rings", 20, 0.3, 0.3),
        row("rings", 5, 0.3, 0.0),
        row("paths", 1, 0.4, -0.1, "tiles"),
        row("paths", 2, 0.2, 0.1, "tiles"),
        row("paths", 3, 0.2, 0.14, "tiles"),
    ]
    # the cheapest rings were right once, by luck
    spread = [
        {"label": "rings 20", "target_db": [0.1, -0.19], "rms_db": 0.15, "max_db": 0.19},
        {"label": "rings 5", "target_db": [0.0, 0.5], "rms_db": 0.35, "max_db": 0.5},
    ]
    found = target_summary(rows, spread)
    assert found["max_db"] == pytest.approx(0.14)
    assert found["rms_db"] == pytest.approx(math.sqrt((0.01 + 0.01 + 0.0196) / 3))
    assert found["rings"]["full"]["ratio_cpu"] == pytest.approx(50)
    assert found["rings"]["cheapest"]["label"] == "rings 20"
    assert found["rings"]["cheapest"]["ratio_cpu"] == pytest.approx(10)
