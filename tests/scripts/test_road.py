# SPDX-License-Identifier: GPL-3.0-or-later
"""The wet road: fading of the car and ranges of its ghosts, against geometry worked out here."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

#: Refractive index of water of 20 degrees at 24.125 GHz (Kaatze 1989: eps 31.6 + 36.3j).
WATER = complex(np.sqrt(31.6 + 36.3j))
WAVE = 2 * math.pi * 24.125e9 / 299_792_458
RADAR_M, BARRIER_M = 0.5, 10.0


def fading(distance_m: float) -> float:
    """Mean over the plate of |1 + Gamma exp|^4, with spreading and cosines."""
    height = np.linspace(0.545, 0.655, 1101)
    direct, via = (np.hypot(distance_m, height + sign * RADAR_M) for sign in (-1, 1))
    sine = (height + RADAR_M) / via
    root = np.sqrt(WATER**2 - (1 - sine**2))
    gamma = np.conj((sine - root) / (sine + root))
    waves = 1 + gamma * (direct / via) ** 1.5 * np.exp(-1j * WAVE * (via - direct))
    return float(np.mean(np.abs(waves) ** 4))


@pytest.mark.slow
def test_measured(bpy: Any, tmp_path: Path) -> None:
    from radarsim_addon import blender as radarsim
    from radarsim_addon.contract import PATHS_FILE, PathsRecord, frame_dir
    from radarsim_addon.signal import expected_power
    from radarsim_addon.signal.paths.table import open_table
    from radarsim_addon.typed_json import read_record
    from scripts import make_road

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    radar = make_road.build()
    frames = {1: 20.0, 7: 32.0, 11: 40.0, 15: 48.0}
    # Pixels of half the size, and no more of them than the plate needs.
    bpy.data.objects["Radar Receiver"].data.angle /= 4
    run = radarsim.measure(radar, tmp_path / "run", frames=frames, width_px=80, height_px=44)
    for frame, expected_m in frames.items():
        distance_m, found = make_road.fading(run, frame)
        assert distance_m == pytest.approx(expected_m, abs=0.01)
        # pixels sample the plate's height: the error falls with their number
        assert 10 * math.log10(found / fading(expected_m)) == pytest.approx(0, abs=0.1)
        # the textbook of the script leaves out spreading only
        assert make_road.two_ray(expected_m) == pytest.approx(fading(expected_m), rel=0.05)
    folder = run.path / frame_dir(11)
    record = read_record(folder / PATHS_FILE, PathsRecord)
    assert not [item.code for item in record.findings if "mirror" in item.code]
    rows = open_table(folder / record.table_file).copy()
    plate = rows[rows["last_object"] == record.objects.index("Rear Plate") + 1]
    barrier = 1 + [image.objects for image in record.images].index(["Barrier"])
    over_m = math.hypot(40.0, 2 * BARRIER_M)
    for ends, range_m in ((1, (40 + over_m) / 2), (2, over_m)):
        chosen = (plate["transmitter_image"] == barrier).astype(int)
        chosen += plate["receiver_image"] == barrier
        ghost = plate[(chosen == ends) & (plate["mirrors"] == ends)]
        lengths_m = ghost["length_m"] / 2
        assert np.average(lengths_m, weights=ghost["power_w"]) == pytest.approx(range_m, abs=0.02)
    # and in the range profile: peaks at the car and at both ghosts
    mean = expected_power(run.frame(11))
    for range_m in (40.0, (40 + over_m) / 2, over_m):
        near = np.abs(mean.range_m - range_m) < 0.6
        between = np.abs(mean.range_m - range_m - 1.2) < 0.3
        assert mean.profile[near].max() > 3 * mean.profile[between].min()
