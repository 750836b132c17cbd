# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies that jump during a burst: a jump is no velocity."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.blender.motion.samples import SamplingPlan
from radarsim_addon.contract import MOTION_FILE, MotionRecord, frame_dir
from radarsim_addon.signal.radar import Burst
from radarsim_addon.typed_json import read_record
from tests.blender import motion_helpers as mh
from tests.blender import radar_scenes as rs

#: 1.2 frames, so that one that begins at frame 24 has frame 25 in it.
BURST = Burst(5_000.0, 256)
FPS = 24.0


def measured(
    folder: Path, frame: int, place_m: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray, MotionRecord]:
    """Velocities along Y of all echoes [m/s], the error of their ranges (paths, pulses) [m]."""
    rows, paths, run = mh.measured(folder, 77e9, BURST, frame)
    times_s = np.arange(BURST.pulses) / BURST.prf_hz
    found_m = paths.lengths.lengths_m(times_s, slice(None)) / 2
    points = np.repeat(rows["last_scatterer_m"][:, None], times_s.size, axis=1)
    points[..., 1] += place_m(frame + times_s * FPS) - place_m(np.array([float(frame)]))
    want_m = np.linalg.norm(points, axis=-1)
    error_m = (found_m - found_m[:, :1]) - (want_m - want_m[:, :1])
    record = read_record(run.folder / frame_dir(frame) / MOTION_FILE, MotionRecord)
    assert rows.size
    return rows["range_rate_mps"] / rows["direction"][:, 1], error_m, record


def target() -> Any:
    mh.scene_at(20.0, 2.6)
    item = mh.facets("Target", [(0, 0, 0), (0.3, 0.2, -0.4)], 0.6)
    item.location = (0, 20, 0)
    return item


def repeated(item: Any, speed_mps: float) -> None:
    """Straight on for a second from frame 1, then again from the start, and so on."""
    mh.key(item, "location", (1, (0, 20, 0)), (25, (0, 20 + speed_mps, 0)))
    mh.interpolation(item, "LINEAR")
    for curve in rs.animation_curves(item.animation_data):
        curve.modifiers.new("CYCLES")


@pytest.mark.parametrize("frame", [24, 240])
@pytest.mark.parametrize("speed_mps", [10.0, -6.0])
def test_cycles_modifier_that_begins_again(tmp_path: Path, frame: int, speed_mps: float) -> None:
    """The target returns amid the burst: one speed before and after, and one jump of a second."""
    repeated(target(), speed_mps)
    speeds, error_m, record = measured(
        tmp_path, frame, lambda at: 20 + speed_mps * (((at - 1) / FPS) % 1)
    )
    np.testing.assert_allclose(speeds, speed_mps, rtol=1e-5)
    # At the pulse nearest to the jump, Blender holds the key's value for 1e-4 frames.
    assert np.sort(np.abs(error_m).max(axis=0))[-2] < 1e-5
    (said,) = record.findings
    assert said.code == "motion-jumps" and said.subjects == ("Target",)
    assert said.numbers["size_m"] == pytest.approx(abs(speed_mps), rel=1e-4)
    assert said.numbers["frame"] == frame + 1
    assert record.samples <= 600


@pytest.mark.parametrize("frame", [25, 49])
def test_burst_that_begins_at_the_jump(tmp_path: Path, frame: int) -> None:
    repeated(target(), 10.0)
    speeds, _, record = measured(tmp_path, frame, lambda at: at)
    np.testing.assert_allclose(speeds, 10.0, rtol=1e-5)
    assert [one.code for one in record.findings] == ["motion-jumps"]
    assert record.samples <= 129


@pytest.mark.parametrize(("period", "frame"), [(7.3, 21), (3.1, 21), (0.37, 100)])
def test_driver_that_begins_again_between_frames(tmp_path: Path, period: float, frame: int) -> None:
    """No key says when: up to four jumps in a burst are found from the samples."""
    curve = target().driver_add("location", 1)
    curve.driver.expression = f"20 + (frame % {period})"
    speeds, error_m, record = measured(tmp_path, frame, lambda at: 20 + at % period)
    np.testing.assert_allclose(speeds, FPS, rtol=1e-5)
    inside = int((frame + 256 / 5000 * FPS) // period - frame // period)
    worst_m = np.sort(np.abs(error_m).max(axis=0))
    assert worst_m[-1 - inside] < 1e-5  # a pulse at each jump may be on its other side
    (said,) = record.findings
    assert said.code == "motion-jumps"
    assert said.numbers["size_m"] == pytest.approx(period, rel=1e-3)


def test_fast_motion_is_no_jump(tmp_path: Path) -> None:
    """Periods of a fifth of the samples' first interval; 12 m/s at most."""
    curve = target().driver_add("location", 1)
    curve.driver.expression = "20 + 0.005 * sin(frame * 100)"
    _, error_m, record = measured(tmp_path, 3, lambda at: 20 + 0.005 * np.sin(at * 100))
    assert "motion-jumps" not in [one.code for one in record.findings]
    assert np.abs(error_m).max() < 1e-5 or record.findings


def test_no_sample_on_a_jump() -> None:
    """On a key Blender gives the value of one side; on a jump that is another place."""
    plan = SamplingPlan(24, FPS, 0.05, 1.0, 0.004, 17, keys=(1.0, 25.0))
    at_s = 1 / FPS
    assert plan.is_clear(at_s)
    jumps = plan.with_jumps([25.0001, 24.5])
    assert jumps.jumps == [25.0, 24.5] and jumps.keys == [1.0, 24.5, 25.0]
    assert not jumps.is_clear(at_s) and not jumps.is_clear(0.5 / FPS)
    times_s = np.array([one_s for one_s, _ in jumps.grid(17, *jumps.window)])
    for frame in (24.5, 25.0):
        apart = np.abs(24 + times_s * FPS - frame)
        assert 1e-4 < apart.min() < 3e-4
