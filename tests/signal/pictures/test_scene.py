# SPDX-License-Identifier: GPL-3.0-or-later
"""Places in a picture of the scene are those of the pixels that see them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.signal.decoding import image_places, in_view, pixel_rays
from radarsim_addon.signal.pictures.scene import PlacedTarget, plot_scene
from tests.signal import path_runs as pr

POSE = pr.pose((3.0, -2.0, 1.5), azimuth_deg=40.0, elevation_deg=-10.0)
RECEIVERS = {
    "perspective": (-0.3, 0.7, -0.2, 0.4),
    "orthographic": (-4.0, 6.0, -2.0, 3.0),
    "equirectangular": (-2.0, 3.0, -0.6, 1.2),
}


def receiver(kind: str) -> contract.ReceiverRecord:
    left, right, bottom, top = RECEIVERS[kind]
    return contract.ReceiverRecord(kind, POSE, left, right, bottom, top, 0.0)


@pytest.mark.parametrize("kind", RECEIVERS)
def test_points_along_a_pixels_ray_are_at_that_pixel(kind: str) -> None:
    """`pixel_rays` is the way there, `image_places` the way back."""
    record, (width, height) = receiver(kind), (10, 6)
    rays = pixel_rays(record, width, height)
    direction = rays.direction.reshape(-1, 3)
    origin = np.broadcast_to(rays.origin_m, rays.direction.shape).reshape(-1, 3)
    for range_m in (0.5, 80.0):
        points = origin + range_m * direction
        u, v = image_places(points, record)
        across, down = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        expected_u = record.left + across.ravel() / width * (record.right - record.left)
        expected_v = record.top - down.ravel() / height * (record.top - record.bottom)
        np.testing.assert_allclose(u, expected_u, atol=1e-12)
        np.testing.assert_allclose(v, expected_v, atol=1e-12)
        assert in_view(points, record).all()


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_what_is_behind_is_nowhere(kind: str) -> None:
    pose = np.array(POSE)
    behind = (pose[:3, 3] + 5.0 * pose[:3, 2])[None]
    assert all(math.isnan(float(place[0])) for place in image_places(behind, receiver(kind)))
    assert not in_view(behind, receiver(kind)).any()


def test_targets_out_of_view_are_not_numbered() -> None:
    record, pose = receiver("perspective"), np.array(POSE)
    ahead = PlacedTarget("Ahead", pose[:3, 3] - 5.0 * pose[:3, 2])
    aside = PlacedTarget("Aside", pose[:3, 3] - 5.0 * pose[:3, 2] + 50.0 * pose[:3, 0])
    figure = plot_scene(np.zeros((6, 10, 3), dtype=np.uint8), record, [aside, ahead], "Title")
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["Ahead"]
    (axis,) = figure.axes
    np.testing.assert_allclose(axis.lines[0].get_data(), [[0.0], [0.0]], atol=1e-12)
    assert axis.get_title() == "Title"
    assert not plot_scene(np.zeros((6, 10, 3), dtype=np.uint8), record).legends
