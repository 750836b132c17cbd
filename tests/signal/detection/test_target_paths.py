# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of a target: the object they end on, and their corners."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.contract import ImageRecord
from radarsim_addon.signal import ProcessOptions, Radar, open_frame, open_run, process_frame
from radarsim_addon.signal.detection import PathFinder
from radarsim_addon.signal.detection.target_paths import mirror_corners
from tests.signal import path_runs as pr


@pytest.fixture(scope="module")
def finder(tmp_path_factory: pytest.TempPathFactory) -> PathFinder:
    """Two plates that face the radar, 300 and 430 m away, the far one 9 times as large."""
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    plates = [pr.plate("Near", (-60, 300, 0), 25.0), pr.plate("Far", (120, 430, 0), 75.0)]
    rows = pr.trace(plates, receiver, transmitter, 48, 1)
    folder = pr.write_run(
        tmp_path_factory.mktemp("paths") / "run", rows, ["Near", "Far"], receiver, transmitter,
        range_limits_m=600.0,
    )  # fmt: skip
    return PathFinder(open_frame(open_run(folder).frame(1)))


@pytest.mark.parametrize(("name", "centre"), [("Near", (-60, 300, 0)), ("Far", (120, 430, 0))])
def test_a_target_is_the_object_at_its_range(
    finder: PathFinder, name: str, centre: tuple[float, float, float]
) -> None:
    range_m = float(np.linalg.norm(centre))
    found = finder.of_target(range_m, 0.0, most=5)
    assert found.object_name == name
    assert len(found.lines_m) == 5 == found.power_w.size
    for line in found.lines_m:
        assert line.shape == (3, 3)
        np.testing.assert_array_equal(line[[0, 2]], 0.0)
        assert abs(np.linalg.norm(line[1]) - range_m) < 1.5 * pr.WAVEFORM.range_resolution_m
        assert abs(line[1] - centre)[[0, 2]].max() <= 75 / 2
    of_object = finder.of_object(name)
    assert of_object.object_name == name
    assert (np.diff(of_object.power_w) <= 0).all() and of_object.power_w[0] > 0
    assert abs(of_object.lines_m[0][1] - centre)[1] < 1e-6


def test_velocity_decides_too_and_folds(finder: PathFinder) -> None:
    """Nothing moves: at 20 cells there is nothing, at whole multiples of the interval all is."""
    radar = Radar(pr.WAVEFORM, pr.BURST)
    assert finder.of_target(306.0, 20 * radar.velocity_resolution_mps).lines_m == []
    folded = finder.of_target(306.0, 2 * radar.max_unambiguous_velocity_mps)
    assert folded.object_name == "Near"
    assert finder.of_target(360.0, 0.0).object_name == ""
    assert finder.of_object("Nothing").lines_m == []


def test_the_strongest_cell_of_the_map_is_on_the_strongest_object(tmp_path: Path) -> None:
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    plates = [pr.plate("Weak", (-60, 300, 0), 5.0), pr.plate("Strong", (120, 430, 0), 60.0)]
    rows = pr.trace(plates, receiver, transmitter, 48, 1)
    folder = pr.write_run(
        tmp_path / "run", rows, ["Weak", "Strong"], receiver, transmitter, range_limits_m=600.0
    )
    options = ProcessOptions().for_run(open_run(folder))
    result = process_frame(options.open(open_run(folder).frame(1)), options)
    shown = result.rd_map
    row, col = np.unravel_index(np.argmax(shown.plane_power), shown.plane_power.shape)
    found = PathFinder(result.source).of_target(
        float(shown.range_m[col]), float(shown.velocity_mps[row])
    )
    assert found.object_name == "Strong"


def test_corners_on_mirrors_obey_the_law_of_reflection() -> None:
    """Ground z = 0, then a wall x = 10: legs as long as the straight line to the image."""
    antenna, scatterer = np.array([0.0, 0.0, 2.0]), np.array([4.0, 30.0, 3.0])
    image = ImageRecord([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], [0.0, 10.0], ["Ground", "Wall"])
    corners = mirror_corners(antenna, image, scatterer)
    assert len(corners) == 2
    assert corners[0][2] == pytest.approx(0.0, abs=1e-12)
    assert corners[1][0] == pytest.approx(10.0)
    points = np.array([antenna, *corners, scatterer])
    walked = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert walked == pytest.approx(np.linalg.norm(scatterer - [20.0, 0.0, -2.0]))
    assert mirror_corners(antenna, None, scatterer) == ()
