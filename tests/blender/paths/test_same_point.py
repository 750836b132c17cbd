# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of one point over several mirrors, from those of its pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.paths.mirrors import add_reverse_paths, alike_in_both, in_view
from radarsim_addon.contract import ReceiverRecord
from radarsim_addon.signal.motion import PathImages
from tests.signal.scattering.test_images import FLOOR, SLOPE, rows_over


def test_both_ways_of_a_point() -> None:
    """Of a direct path and one over each of two mirrors come nine, by their amplitudes."""
    radar = np.array([1.0, 2.0, 3.0])
    rows = rows_over([(0, 0), (0, 1), (0, 2), (0, 1)], np.array([8.0, 30.0, 2.0]))
    rows["point"] = [4, 4, 4, 5]
    rows["power_w"] = [4.0, 2.0, 1.0, 9.0]
    rows["mirror_phase_rad"] = [0.0, 0.5, -0.7, 0.1]
    images = PathImages.of([FLOOR, SLOPE], np.zeros((0, 2)))
    every = add_reverse_paths(rows, images, radar, radar, 3)
    mine = every[every["point"] == 4]
    field = {0: 2.0, 1: math.sqrt(2) * np.exp(0.5j), 2: 1.0 * np.exp(-0.7j)}
    assert len(mine) == 9
    for row in mine:
        ends = int(row["receiver_image"]), int(row["transmitter_image"])
        amplitude = field[ends[0]] * field[ends[1]] / 2.0
        assert row["power_w"] == pytest.approx(abs(amplitude) ** 2, rel=1e-12)
        phase = np.exp(1j * row["mirror_phase_rad"])
        assert phase == pytest.approx(amplitude / abs(amplitude), abs=1e-12)
        over = PathImages.of([FLOOR, SLOPE], np.array([ends]))
        legs = [np.linalg.norm(row["last_scatterer_m"] - over.places(e, radar)) for e in (0, 1)]
        if any(ends):  # rows that were made; the first one has no length here
            assert row["order"] == 1 + sum(end > 0 for end in ends)
        if ends[0]:
            assert row["length_m"] == pytest.approx(sum(legs), rel=1e-14)
            seen = over.unfolded(0, row["last_scatterer_m"][None])[0] - radar
            np.testing.assert_allclose(row["direction"], seen / np.linalg.norm(seen), atol=1e-14)
    # A point without a direct path has no partner, and no more than two reflections leave out both.
    assert np.count_nonzero(every["power_w"] == 9.0) == 1
    assert every["point"][every["power_w"] == 9.0].tolist() == [0]
    assert len(add_reverse_paths(rows, images, radar, radar, 2)) == 4 + 2


def test_lobes_wide_and_narrow() -> None:
    point, radar = np.array([[0.0, 40.0, 4.0]]), np.array([0.0, 0.0, 4.0])
    image = np.array([0.0, 0.0, -4.0])
    angle = math.atan(8 / 40)
    for lobe, alike in ((math.inf, True), (0.0, False), (0.1, False), (1.0, True)):
        found = alike_in_both(point, radar, image, np.array([lobe]))
        assert found.tolist() == [alike]
    edge = angle / math.sqrt(0.1)  # angle^2 / (2 alpha^2) = 0.05
    for factor, alike in ((0.99, False), (1.01, True)):
        assert alike_in_both(point, radar, image, np.array([factor * edge]))[0] == alike


def test_view_of_a_camera_and_of_a_panorama() -> None:
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=float)
    points = np.array([[0, 10, 0], [4.9, 10, 0], [5.1, 10, 0], [0, 10, 3], [0, -10, 0.0]])
    camera = ReceiverRecord("perspective", pose.tolist(), -0.5, 0.5, -0.2, 0.2, 0.0)
    assert in_view(points, camera).tolist() == [True, True, False, False, False]
    sphere = ReceiverRecord("equirectangular", pose.tolist(), -0.47, 3.2, -0.2, 0.2, 0.0)
    assert in_view(points, sphere).tolist() == [True, True, True, False, True]
