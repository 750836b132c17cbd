# SPDX-License-Identifier: GPL-3.0-or-later
"""Gains and losses of paths over images of the antennas."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from radarsim_addon.contract import (
    AntennaRecord,
    LinkBudget,
    ReceiverRecord,
    TransmitterRecord,
)
from radarsim_addon.physics.mirrors import coherent_reflection
from radarsim_addon.signal.motion import (
    AntennaMotion,
    BodyMotion,
    LinearMotion,
)
from radarsim_addon.signal.paths import (
    channel_lengths,
    geometry_of,
    images_of,
    make_paths,
)
from radarsim_addon.signal.radar import Channel, Element, make_system
from radarsim_addon.signal.scattering import Link
from radarsim_addon.signal.scattering.amplitudes import PathEnds
from tests.signal.scattering.test_images import FLOOR, rows_over


def link(pose: np.ndarray) -> Link:
    """Both antennas at a pose, Gaussian, and an EIRP of 1 MW."""
    beam = AntennaRecord(
        "gaussian", {"azimuth_beamwidth_deg": 30.0, "elevation_beamwidth_deg": 20.0}
    )
    system = make_system(LinkBudget(5.0, beam, beam), 0.03)
    camera = ReceiverRecord("perspective", pose.tolist(), -1, 1, -1, 1, 0.0)
    return Link(system, camera, TransmitterRecord(pose.tolist(), 1e6))


def level_pose(place: tuple[float, float, float]) -> np.ndarray:
    """An antenna that looks along +Y, z up."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=float)
    pose[:3, 3] = place
    return pose


def test_gains_are_those_towards_the_mirror() -> None:
    """Over the floor the antenna looks down at the point of reflection, on both ways."""
    pose = level_pose((0.0, 0.0, 3.0))
    target = np.array([0.0, 40.0, 5.0])
    rows = rows_over([(0, 0), (0, 1), (1, 0), (1, 1)], target)
    depressed = math.degrees(math.atan2(3 + 5 + 2, 40))  # floor at z = -1
    raised = math.degrees(math.atan2(2, 40))
    for number, back in enumerate((0, 0, 1, 1)):
        row = rows[number : number + 1]
        row["direction"] = [0, math.cos(math.radians(raised)), math.sin(math.radians(raised))]
        if back:
            down = math.radians(depressed)
            row["direction"] = [0, math.cos(down), -math.sin(down)]
        row["length_m"] = 80
    ends = PathEnds(
        rows["length_m"],
        rows["direction"],
        rows["first_scatterer_m"],
        rows["last_scatterer_m"],
        LinearMotion(rows["length_m"], np.zeros(4)),
        images_of(rows, [FLOOR]),
    )
    budget = link(pose)

    def loss_db(angle_deg: float) -> float:
        return 40 * math.log10(2) * (angle_deg / 20) ** 2

    straight, over = loss_db(raised), loss_db(depressed)
    expected = [0.0, over - straight, over - straight, 2 * (over - straight)]
    for found in (budget.ends_factor(ends), budget.factors(ends, np.zeros(1))[:, 0]):
        np.testing.assert_allclose(-10 * np.log10(found / found[0]), expected, atol=1e-6)


def test_elements_away_from_the_origin() -> None:
    """An element above the antenna's origin has its image below the image."""
    pose = level_pose((0.0, 0.0, 3.0))
    target = np.array([2.0, 40.0, 5.0])
    rows = rows_over([(0, 1), (1, 1)], target)
    image = np.array([0.0, 0.0, -5.0])
    back = [np.linalg.norm(target - place) for place in (pose[:3, 3], image)]
    rows["length_m"] = np.array(back) + np.linalg.norm(target - image)
    paths = dataclasses.replace(
        make_paths(np.ones(2), rows["length_m"]), geometry=geometry_of(rows, [FLOOR])
    )
    raised = Element(position_m=(0.0, 0.5, 0.0))
    body = BodyMotion(pose)
    found = channel_lengths(paths, Channel(raised, raised), AntennaMotion(body, body))
    up = np.array([0.0, 0.0, 0.5])
    back = [np.linalg.norm(target - place) for place in (pose[:3, 3] + up, image - up)]
    expected = np.array(back) + np.linalg.norm(target - (image - up))
    np.testing.assert_allclose(
        found.lengths_m(np.zeros(1), slice(None))[:, 0], expected, rtol=1e-13
    )


def test_coherent_part_of_rough_mirrors() -> None:
    """Against the integral over the heights of a sinusoid of Gaussian amplitude: exp(-x) I0(x)."""
    wavelength_m, height_m = 0.03, 0.05
    sines = np.array([0.0, 0.02, 0.1, 0.5, 1.0])
    found = coherent_reflection(height_m, sines, wavelength_m)
    # I0 by its integral, mean of exp(x cos t)
    turn = (np.arange(20_000) + 0.5) * math.pi / 20_000
    for sine, value in zip(sines, found, strict=True):
        x = 2 * (2 * math.pi * height_m * sine / wavelength_m) ** 2
        expected = np.mean(np.exp(x * (np.cos(turn) - 1)))
        assert value == pytest.approx(expected, rel=1e-5)
    steep = coherent_reflection(1.0, np.array([0.99, 1.0]), 0.0806)
    assert steep[1] / steep[0] == pytest.approx(0.99, rel=1e-6)  # 1 / sqrt(x) far out
