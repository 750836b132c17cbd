# SPDX-License-Identifier: GPL-3.0-or-later
"""Costs of large runs, computed from measured figures."""

from __future__ import annotations

import pytest

from scripts.benchmarks import worker_costs

PART = {
    "start_s": 2.0, "process_start_s": 1.0, "frame_s": 0.2, "process_s": 0.1, "look_s": 0.001,
    "frame_bytes": 2e6, "frame_files": 8.0,
}  # fmt: skip


def test_hours_of_runs() -> None:
    """The first look is one process's in each run; the frames are shared by all cores."""
    hours = worker_costs.run_hours(PART, 1000, 2)
    assert hours == pytest.approx((3.0 + 1.0 + 1000 * 0.3 / 2) / 3600)
    hours = worker_costs.run_hours(PART, 10**5, 1000)
    assert hours == pytest.approx((3.0 + 100.0 + 1e5 * 0.3 / 1000) / 3600)
    # a hundred runs, ten cores for each
    hours = worker_costs.run_hours(PART, 10**7, 1000)
    assert hours == pytest.approx((3.0 + 100.0 + 1e5 * 0.3 / 10) / 3600)
    # fewer cores than runs: one after another on each core
    hours = worker_costs.run_hours(PART, 10**7, 2)
    assert hours == pytest.approx(50 * (3.0 + 1e5 * 0.301) / 3600)


def test_the_table_of_large_runs() -> None:
    lines = worker_costs.worker_lines(PART | {f"{key}_error": 0.01 for key in PART})
    text = "\n".join(lines)
    assert "0.2 +- 0.01 s" in text and "2,000 GB" not in text and "20,000 GB" in text
    assert f"{worker_costs.run_hours(PART, 10**5, 64):.3g}" in text
