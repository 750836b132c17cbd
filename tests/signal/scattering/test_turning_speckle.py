# SPDX-License-Identifier: GPL-3.0-or-later
"""Speckle of a body that turns."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.motion import BodyMotion, FrameMotion
from radarsim_addon.signal.motion.body_motion import Segment
from radarsim_addon.signal.paths import motion_of_rows
from radarsim_addon.signal.paths.paths import Paths, path_power_w
from radarsim_addon.signal.radar import Radar
from radarsim_addon.signal.runs import RadarFrame, open_run
from radarsim_addon.signal.scattering import FrameSpeckle
from radarsim_addon.typed_json import write_record
from tests.signal import path_runs as pr
from tests.signal.scattering.speckle_scenes import WAVELENGTH_M, WAVENUMBER, scene


def turning_plate(folder: Path, rms_height_m: float | None) -> tuple[Radar, RadarFrame, Paths]:
    """A plate that turns by 0.03 rad about the vertical through its middle within 0.1 s."""
    _, table, _ = scene(folder, side_m=30.0, size_px=48)
    if rms_height_m is not None:
        item = contract.ObjectRecord("Plate", 1000.0, 1000.0, None, rms_height_m=rms_height_m)
        record = contract.GroundTruthRecord(1, 0.0, [item])
        write_record(folder / contract.frame_dir(1) / contract.GROUND_TRUTH_FILE, record)
    frame = open_run(folder).frame(1)
    pose = np.eye(4)
    pose[:3, 3] = 0, 1000, 0
    turn = np.array([[0, 0, 0.015]])
    piece = Segment(0.0, 0.1, pose[None, :3, 3], np.zeros(3), turn, np.eye(3))
    plate, still = BodyMotion(pose, (piece,)), BodyMotion(np.eye(4))
    rows = table.copy()
    rows["last_body"] = rows["first_body"] = 1
    motion = motion_of_rows(rows, FrameMotion(0.1, still, still, False, [plate]))
    paths = dataclasses.replace(frame_paths(frame), motion=motion)
    return Radar(pr.WAVEFORM, pr.BURST), frame, paths


def fields(paths: Paths, times_s: np.ndarray) -> np.ndarray:
    amplitude = np.sqrt(path_power_w(paths, WAVELENGTH_M)) * paths.phasors
    phase = WAVENUMBER * paths.lengths.lengths_m(times_s, slice(None))
    return np.asarray(amplitude @ np.exp(-1j * phase))


def test_power_of_a_body_that_turns_is_the_sum_of_powers_at_every_pulse(tmp_path: Path) -> None:
    radar, frame, paths = turning_plate(tmp_path / "run", None)
    times_s = np.array([0.0, 0.05, 0.1])
    # From one end of a cell to the other the phase turns by more than a cycle.
    made = FrameSpeckle(open_frame(frame, radar=radar), 0, cell_m=2.0)
    assert 2 * 2.0 * 0.03 / WAVELENGTH_M > 1
    found = [
        np.abs(
            fields(
                FrameSpeckle(open_frame(frame, radar=radar), seed, cell_m=2.0).apply(paths), times_s
            )
        )
        ** 2
        for seed in range(150)
    ]
    mean = np.mean(found, axis=0) / path_power_w(paths, WAVELENGTH_M).sum()
    assert np.abs(mean - 1).max() < 3.5 / math.sqrt(150)
    assert len(made.apply(paths)) == len(paths)


@pytest.mark.parametrize("rms_height_m", [None, 0.0, 0.003])
def test_scatterers_that_move_are_where_they_were_at_the_frames_time(
    tmp_path: Path, rms_height_m: float | None
) -> None:
    radar, frame, paths = turning_plate(tmp_path / "run", rms_height_m)
    made = FrameSpeckle(open_frame(frame, radar=radar), 5)
    at_rest = made.apply(dataclasses.replace(paths, motion=None))
    moving = made.apply(paths)
    start = fields(moving, np.zeros(1))
    np.testing.assert_allclose(start, fields(at_rest, np.zeros(1)), rtol=1e-9)
    assert len(moving) == len(paths)
