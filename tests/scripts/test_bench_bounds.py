# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of the benchmark next to their bounds, and the history of versions."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from scripts.benchmarks import bounds
from scripts.benchmarks.clock import command_cost

MACHINE = {"radarsim": "1.2", "blender": "5.2.3", "cpus": 2, "load": 0.5}
ROW = {"order": 1, "repeats": 5, "render_s": 5.0, "render_s_range": [4.5, 6.5]}
OTHERS = {
    name: value
    for key in ("render_mib", "process_s", "process_mib", "process_pictures_s")
    for name, value in ((key, 100.0), (f"{key}_range", [90.0, 120.0]))
}
RESULT: dict[str, Any] = {
    "machine": MACHINE,
    "canyon": [{**ROW, **OTHERS}],
    "scenes": {"city": {"render_s": 3.5, "render_s_error": 0.25}},
    "scaling": [
        {"paths": 1e7, "order": 1, "wall_s": 30.0, "peak_mib": 400.0},
        {"paths": 1e7, "order": 2, "wall_s": 50.0, "peak_mib": 500.0},
        {"paths": 1e5, "order": 1},
    ],
    "workers": {"two_workers": 1.5, "two_workers_error": 0.1, "dask_s": 0.01, "dask_s_error": 0.0},
}


def test_figures_and_their_errors() -> None:
    found = bounds.figures(RESULT)
    assert found["canyon_1_render"] == (5.0, 1.0)
    assert found["city_render"] == (3.5, 0.25)
    assert found["ten_million_1_wall"] == (30.0, None)
    assert found["ten_million_wall"] == (50.0, None)
    assert "demo_wall" not in found
    assert len({row.key for row in bounds.ROWS}) == len(bounds.ROWS)


def test_the_table_says_what_is_over_its_bound() -> None:
    history = [{"figures": {"canyon_1_render": [2.75, 0.1]}}]
    lines = {line[:50].strip(): line for line in bounds.bound_lines(RESULT, history)}
    canyon = lines["canyon, 1e6 rays, order 1: render"]
    assert "5 +- 1 s" in canyon and "2.75" in canyon and "0.3*" in canyon
    assert "over the bound" in canyon
    assert "over the bound" not in lines["city of 2367 objects, 1e6 rays, order 1: render"]
    assert "below the bound" in lines["60 frames: 2 workers over 1, times faster"]
    assert "the bound" not in lines["what Dask adds to a frame: wall"]
    measured = {**RESULT, "sionna": {"1": {"render_s": 0.25, "mib": 700.0, "error_db": 0.05}}}
    assert any("0.25 " in line and "*" not in line for line in bounds.bound_lines(measured, []))
    assert bounds.bound_lines({"machine": MACHINE}, []) == []


def test_the_history_has_a_row_a_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "benchmarks.json"
    monkeypatch.setattr(bounds, "_commit", lambda: "abc")
    bounds.add_to_history(RESULT, path)
    other = {"machine": MACHINE, "demo": {"wall_s": 20.0, "wall_s_error": 1.0}}
    bounds.add_to_history(other, path)
    (row,) = bounds.read_history(path)
    assert row["figures"]["demo_wall"] == [20.0, 1.0]
    assert row["figures"]["canyon_1_render"] == [5.0, 1.0]  # of the run before
    assert row["figures"]["ten_million_wall"] == [50.0, None]
    monkeypatch.setattr(bounds, "_commit", lambda: "def")
    bounds.add_to_history(other, path)
    assert [r["commit"] for r in bounds.read_history(path)] == ["abc", "def"]


def test_the_kept_history_can_be_read() -> None:
    known = {row.key for row in bounds.ROWS}
    for row in bounds.read_history():
        assert row["figures"].keys() <= known and row["version"] and row["blender"]


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_cost_of_a_command(tmp_path: Path) -> None:
    """200 MiB that are touched, and half a second of a processor."""
    code = (
        "import time; data = bytearray(b'x') * (200 << 20)\nwhile time.process_time() < 0.5: pass"
    )
    cost = command_cost(["-c", code], tmp_path)
    assert 200 < cost.peak_mib < 260
    assert 0.45 < cost.cpu_s < 2.0
    with pytest.raises(RuntimeError, match="no such thing"):
        command_cost(["-c", "raise SystemExit('no such thing')"], tmp_path)


def test_a_bound_keeps_its_ratio_to_the_first_version() -> None:
    row = bounds.Row("key", "label", "s", first_there=8.0, bound_there=2.0, first=12.0)
    assert row.bound == pytest.approx(3.0)
    assert bounds.Row("key", "label", "s", 8.0, 2.0).bound == 2.0
    assert bounds.Row("key", "label", "s", 8.0, None, 12.0).bound is None
