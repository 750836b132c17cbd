# SPDX-License-Identifier: GPL-3.0-or-later
"""Reported standard errors of two replicates against the scatter of what they report."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.signal import Burst, Radar, open_run
from radarsim_addon.signal.decoding import open_frame, pixel_rays
from radarsim_addon.signal.detection import object_echoes, objects
from radarsim_addon.signal.maps import expected_power
from radarsim_addon.signal.paths import PathRows
from tests.signal.path_runs import WAVEFORM, camera, pose, write_run

SIDE_PX, OBJECTS, SPREAD = 16, 64, 0.4


def replicate_rows(seed: int) -> PathRows:
    """Objects side by side, a tile and a range each, of powers that differ by replicate alone."""
    rng = np.random.default_rng(seed)
    receiver = camera(pose((0, 0, 0)))
    across = SIDE_PX * math.isqrt(OBJECTS)
    rays = pixel_rays(receiver, across, across)
    rows = PathRows.zeros(OBJECTS * 2 * SIDE_PX**2)
    rows["order"] = 1
    for number in range(OBJECTS):
        top, left = (SIDE_PX * place for place in divmod(number, math.isqrt(OBJECTS)))
        here = slice(top, top + SIDE_PX), slice(left, left + SIDE_PX)
        direction = rays.direction[here].reshape(-1, 3)
        range_m = 100.0 + 20.0 * number
        mine = rows[number * 2 * SIDE_PX**2 : (number + 1) * 2 * SIDE_PX**2]
        mine["direction"], mine["length_m"] = np.tile(direction, (2, 1)), 2 * range_m
        mine["first_scatterer_m"] = mine["last_scatterer_m"] = range_m * mine["direction"]
        mine["solid_angle_sr"] = np.tile(rays.solid_angle_sr[here].ravel(), 2) / 2
        mine["last_object"] = mine["first_object"] = number + 1
        mine["tile"], mine["replicate"] = number, np.repeat([0, 1], SIDE_PX**2)
        powers = 1e-9 * (1 + SPREAD * rng.standard_normal(2))
        mine["power_w"] = np.repeat(powers, SIDE_PX**2) / 2 / SIDE_PX**2
    return rows


def run_of(folder: Path, rows: PathRows) -> Path:
    receiver = camera(pose((0, 0, 0)))
    transmitter = contract.TransmitterRecord(pose((0, 0, 0)), 1.0)
    names = [f"Object {number}" for number in range(1, OBJECTS + 1)]
    return write_run(
        folder, rows, names, receiver, transmitter, range_limits_m=1500.0, replicates=2
    )


def test_objects_of_two_replicates(tmp_path: Path) -> None:
    """The mean of two is off by SPREAD / sqrt(2), and that is what is reported, rms."""
    reported, seen = [], []
    for seed in range(3):
        frame = open_run(run_of(tmp_path / f"run_{seed}", replicate_rows(seed))).frame(1)
        for echo in object_echoes(frame, 5.3e9):
            reported.append(echo.power_error_w)
            seen.append(echo.power_w - 1e-9)
    true_w = 1e-9 * SPREAD / math.sqrt(2)
    assert np.sqrt(np.mean(np.square(seen))) / true_w < 1.2  # the draw itself
    # a fifth less would be beyond three of its own standard errors
    assert 0.88 < np.sqrt(np.mean(np.square(reported))) / true_w < 1.15


def test_groups_that_overlap_are_each_as_if_alone(tmp_path: Path) -> None:
    """Power over groups that share an object; of paths between two groups it is nobody's own."""
    rows = replicate_rows(0)
    rows["first_object"][rows["last_object"] == 3] = 1
    frame = open_run(run_of(tmp_path, rows)).frame(1)
    names = open_frame(frame).table.record.objects
    groups = {"low": names[:3], "high": names[2:6], "one": names[4:5], "rest": names[10:]}
    found = {echo.name: echo for echo in object_echoes(frame, 5.3e9, groups=groups)}
    for name, members in groups.items():
        (alone,) = object_echoes(frame, 5.3e9, groups={name: members})
        assert found[name] == alone
        numbers = [names.index(member) + 1 for member in members]
        ends = [np.isin(rows[end], numbers) for end in ("first_object", "last_object")]
        own = rows["power_w"][ends[0] & ends[1]].sum()
        assert alone.power_w == pytest.approx(own, rel=1e-12)
        shared = rows["power_w"][ends[0] ^ ends[1]].sum()
        assert alone.multi_object_power_w == pytest.approx(shared, rel=1e-12)
    assert found["high"].multi_object_power_w > 0


def test_replicates_of_a_tile_together_or_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = open_run(run_of(tmp_path, replicate_rows(0))).frame(1)
    together = object_echoes(frame, 5.3e9)
    monkeypatch.setattr(objects, "_SMALL_TILE", 0)
    assert together == object_echoes(frame, 5.3e9)


def test_profile_of_two_replicates(tmp_path: Path) -> None:
    """Likewise of the expected power in each object's range cell."""
    radar = Radar(WAVEFORM, Burst(1000.0, 4))
    ratios = []
    for seed in range(3):
        frame = open_run(run_of(tmp_path / f"run_{seed}", replicate_rows(seed))).frame(1)
        found = expected_power(open_frame(frame, radar=radar, range_limits_m=(50.0, 1500.0)))
        peaks = [np.argmin(np.abs(found.range_m - 100.0 - 20.0 * n)) for n in range(OBJECTS)]
        ratios.append(found.profile_error[peaks] / np.median(found.profile[peaks]))
    assert 0.88 < np.sqrt(np.mean(np.square(ratios))) / (SPREAD / math.sqrt(2)) < 1.15
