# SPDX-License-Identifier: GPL-3.0-or-later
"""What is left out of a path table, with its errors and bounds: no render."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.paths.measured_tiles import QualitySums
from radarsim_addon.blender.views import (
    PowerBeyond,
    TracedReplicate,
)
from radarsim_addon.blender.views.requests import variance_of_sum


def test_further_reflections_in_watts_have_their_error_in_watts() -> None:
    """2 +- 3 units of half a watt each, in addition to 9 W: 10 % +- 15 % of all."""
    sums = QualitySums()
    sums.add_view(TracedReplicate(total=18.0), 0.5)
    sums.add_beyond(PowerBeyond(power=2.0, variance=9.0), 0.5)
    fields = QualitySums.joined([sums]).record_fields(0.05)
    assert fields["total_power_w"] == pytest.approx(10.0)
    assert fields["truncated_reflections_fraction"] == pytest.approx(0.1)
    assert fields["truncated_reflections_stderr"] == pytest.approx(0.15)


def test_rare_further_reflections_have_an_upper_bound() -> None:
    """One path in 3000 rays brings 0.27 % of the power: most trials see none, and 95 % bound it."""
    rng = np.random.default_rng(5)
    rays, share = 1024, 0.0027
    chance = 1 / 3000
    strength = share / (rays * chance)  # of one such path, over the power of all others
    bounded, seen_none = 0, 0
    for _ in range(400):
        hits = rng.random(rays) < chance
        sums = QualitySums()
        probed = hits * strength
        sums.add_view(TracedReplicate(total=1.0), 1.0)
        variance = variance_of_sum(probed.reshape(32, 32))
        sums.add_beyond(PowerBeyond(float(probed.sum()), variance, strength), 1.0)
        fields = QualitySums.joined([sums, QualitySums()]).record_fields(0.05)
        seen_none += fields["truncated_reflections_fraction"] == 0.0
        bounded += fields["truncated_reflections_upper"] >= share / (1 + share)
    assert seen_none > 250
    assert bounded >= 0.95 * 400


def test_the_bound_of_rare_paths_takes_the_strongest_one_of_all_tiles() -> None:
    """The rule of three counts the rays of all tiles: three times the strongest, not of each."""
    parts = []
    for strongest in (0.5, 2.0, 1.0):
        part = QualitySums()
        part.add_view(TracedReplicate(total=100.0, strongest=strongest / 16), 1.0)
        parts.append(QualitySums.from_numbers(part.numbers()))
    beyond = QualitySums()
    found = QualitySums.joined(parts)
    beyond.add_beyond(PowerBeyond(pixels_per_ray=16.0), 1.0, found.strongest_path)
    parts.append(beyond)
    joined = QualitySums.joined(parts)
    more = -math.log(0.05) * 2.0
    assert joined.truncated_reflections_upper == pytest.approx(more / (300 + more), rel=1e-3)
    assert joined.findings(0.05) == []
    (said,) = joined.findings(0.05, tolerated=0.01)
    assert said.severity == "info" and "at most 2 %" in said.text


@pytest.mark.parametrize("slope", [0.0, 0.02])
def test_variance_of_the_sum_of_an_image(slope: float) -> None:
    """Rays that are reflected or not at random, over a surface that brightens across: by trial."""
    rng = np.random.default_rng(2)
    expected = (1 + slope * np.arange(14)) * np.ones((10, 1))
    sums, variances = [], []
    for _ in range(400):
        # one ray in twenty meets something, and is that much brighter
        rays = expected * (rng.random(expected.shape) < 0.05) / 0.05
        sums.append(rays.sum())
        variances.append(variance_of_sum(rays))
    assert np.mean(variances) == pytest.approx(np.var(sums), rel=0.2)


def test_variance_of_a_single_ray() -> None:
    assert variance_of_sum(np.full((1, 1), 24.0)) == 24.0**2
    assert variance_of_sum(np.zeros((8, 8))) == 0.0


@pytest.mark.parametrize(
    ("lost", "target", "severity"),
    [(0.015, 0.02, "info"), (0.04, 0.0, "info"), (0.04, 0.02, "caution"), (0.06, 0.0, "caution")],
)
def test_what_is_lost_below_the_error_asked_for_is_information(
    lost: float, target: float, severity: str
) -> None:
    """Without a target 5 % count, 0.2 dB."""
    sums = QualitySums()
    sums.total_w, sums.truncated_reflections_w, sums.mixed_w = 1.0, lost, lost
    found = sums.findings(0.05, (), target)
    assert {item.code: item.severity for item in found} == {
        "reflections-truncated": severity,
        "mixed-paths": severity,
    }


@pytest.mark.parametrize(
    ("power", "stderr", "strongest_ray", "target", "said"),
    [
        (0.0, 0.0, 0.1, 0.0, False),  # no ray met any: the bound of a small run, 23 %, is no news
        (0.0, 0.0, 0.1, 0.05, True),  # an error was asked for, and may be exceeded
        (0.006, 0.001, 0.005, 0.0, False),  # at most 0.8 %, 0.03 dB
        (0.006, 0.004, 0.005, 0.0, True),  # at most 1.3 %
        (0.006, 0.001, 0.0001, 0.005, True),
        (0.02, 0.001, 0.0001, 0.0, True),
    ],
)
def test_further_reflections_are_said_from_one_percent_on(
    power: float, stderr: float, strongest_ray: float, target: float, said: bool
) -> None:
    sums = QualitySums()
    sums.add_view(TracedReplicate(total=1 - power), 1.0)
    sums.add_beyond(PowerBeyond(power, stderr**2, strongest_ray), 1.0)
    found = {item.code for item in sums.findings(0.05, tolerated=target)}
    assert found == ({"reflections-truncated"} if said else set())
