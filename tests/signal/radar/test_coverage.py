# SPDX-License-Identifier: GPL-3.0-or-later
"""Coverage diagrams against image geometry, the textbook's lobes, and bad input."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from radarsim_addon.arrays import Real
from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.antennas import Gaussian
from radarsim_addon.physics.mirrors import MirrorMaterial
from radarsim_addon.signal.radar import (
    ConstantGain,
    CoverageSetup,
    Mount,
    compute_coverage,
    coverage_curve,
    two_ray_gain,
)

WAVELENGTH_M = 0.1
#: Looks along +y, level; columns are the antenna's axes in the world.
LEVEL = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def setup(**changes: Any) -> CoverageSetup:
    mount = Mount(ConstantGain(3.0), 10.0, LEVEL)
    conductor = MirrorMaterial(1e4 + 1e4j, 1.0, True)
    made = CoverageSetup(mount, mount, conductor, WAVELENGTH_M, "horizontal", math.inf)
    return dataclasses.replace(made, **changes)


def image_field(height_m: Real, range_m: float, gain: Any = None) -> Real:
    """|F|^2 of a perfect conductor, horizontal: direct wave less that of the image."""
    direct, via = (np.hypot(range_m, height_m + sign * 10.0) for sign in (-1, 1))
    weights = [
        np.ones(height_m.shape) if gain is None else np.sqrt(gain(angle))
        for angle in (np.arctan2(height_m - 10, range_m), -np.arctan2(height_m + 10, range_m))
    ]
    waves = [
        weight * np.exp(-2j * math.pi * way / WAVELENGTH_M) * direct / way
        for weight, way in zip(weights, (direct, via), strict=True)
    ]
    return np.abs(waves[0] - waves[1]) ** 2


def test_flat_conductor_is_the_field_of_the_image() -> None:
    heights = np.linspace(0.0, 40.0, 801)
    found = compute_coverage(setup(), heights, 700.0)
    expected = image_field(heights, 700.0) ** 2
    # the index of 1e4 differs from a perfect conductor's by 2 sin / n
    assert np.allclose(found.factor[:, 0], expected, atol=2e-4)
    assert np.allclose(found.ground_gain, found.factor)
    assert (found.zone == 0).all()


def test_both_antennas_weigh_both_paths() -> None:
    antenna = Gaussian(math.radians(20), math.radians(4))
    turn = math.radians(2)  # up
    tilt = np.array(
        [[1, 0, 0], [0, math.cos(turn), -math.sin(turn)], [0, math.sin(turn), math.cos(turn)]]
    )
    pose = np.eye(4)
    pose[:3, :3] = tilt @ LEVEL[:3, :3]
    beam, level = Mount(antenna, 10.0, pose), Mount(ConstantGain(), 10.0, LEVEL)
    heights = np.linspace(0.5, 40.0, 100)

    def gain(elevation: Real) -> Real:
        off = np.degrees(elevation - turn)
        return 0.5 ** ((off / 2) ** 2)

    one = compute_coverage(setup(transmitter=beam, receiver=level), heights, 400.0)
    both = compute_coverage(setup(transmitter=beam, receiver=beam), heights, 400.0)
    shaped, plain = image_field(heights, 400.0, gain), image_field(heights, 400.0)
    assert np.allclose(one.factor[:, 0], shaped * plain, rtol=2e-3, atol=2e-4)
    assert np.allclose(both.factor[:, 0], shaped**2, rtol=2e-3, atol=2e-4)
    direct = gain(np.arctan2(heights - 10, 400.0))
    assert np.allclose(both.ground_gain[:, 0] * direct**2, both.factor[:, 0])


def test_rough_ground_keeps_the_coherent_part() -> None:
    rough = MirrorMaterial(1e4 + 1e4j, 1.0, True, rms_height_m=0.5)
    heights = np.array([20.0])
    found = compute_coverage(setup(ground=rough), heights, 200.0)
    sine = 30 / math.hypot(30, 200)
    # Miller-Brown: exp(-x) I0(x), x = 2 (k h sin)^2; its asymptote is 1/sqrt(2 pi x)
    x = 2 * (2 * math.pi / WAVELENGTH_M * 0.5 * sine) ** 2
    rho = 1 / math.sqrt(2 * math.pi * x) * (1 + 1 / (8 * x))
    direct, via = math.hypot(200, 10), math.hypot(200, 30)
    turn = np.exp(-2j * math.pi * (via - direct) / WAVELENGTH_M)
    assert found.factor[0, 0] == pytest.approx(abs(1 - rho * turn * direct / via) ** 4, rel=1e-3)


def test_textbook_model_is_the_limit_of_low_angles() -> None:
    heights = np.linspace(1.0, 50.0, 200)
    lobes = 16 * np.sin(2 * math.pi * 10 * heights / (WAVELENGTH_M * 2e4)) ** 4
    assert np.allclose(two_ray_gain(setup(), heights, 2e4), lobes, atol=2e-3)
    high = Mount(ConstantGain(3.0), 14.0, LEVEL)
    both = 4 * np.sqrt(lobes) * np.sin(2 * math.pi * 14 * heights / (WAVELENGTH_M * 2e4)) ** 2
    for changes in ({"transmitter": high}, {"receiver": high}):
        assert np.allclose(two_ray_gain(setup(**changes), heights, 2e4), both, atol=2e-3)
    curve = coverage_curve(compute_coverage(setup(), heights, [1e4, 2e4]))
    assert curve.range_m == 2e4
    assert np.allclose(curve.factor, lobes, atol=2e-3)


def test_below_the_horizon_there_is_nothing() -> None:
    radius_m = 8.495e6
    heights, ranges = np.array([0.0, 5.0, 30.0]), np.array([1e3, 2e4, 4e4])
    found = compute_coverage(setup(radius_m=radius_m), heights, ranges)
    reach = math.sqrt(2 * radius_m * 10) + np.sqrt(2 * radius_m * heights)
    hidden = ranges[None, :] > reach[:, None]
    assert hidden.any() and not hidden.all()
    assert np.array_equal(np.isnan(found.factor), hidden)
    assert np.array_equal(found.zone == 2, hidden)
    limit = (WAVELENGTH_M / (2 * math.pi * radius_m)) ** (1 / 3)
    steep = (10 + heights[:, None]) / ranges > 20 * limit  # far from the horizon
    assert (found.zone[steep] == 0).all() and (found.zone == 1).any()
    codes = {item.code: item for item in found.findings}
    assert codes["coverage-near-horizon"].numbers["hidden"] == hidden.mean()
    flat = compute_coverage(setup(), heights, [1e3, 1e6])
    assert (flat.zone == 0).all() and "coverage-near-horizon" not in {f.code for f in flat.findings}


def test_lobes_between_the_steps_are_told() -> None:
    # 2 h_r h / R turns 2 pi every lambda R / (2 h_r) = 5 m at 1 km
    fine, coarse = (compute_coverage(setup(), np.arange(0, 40, step), [1e3]) for step in (1.0, 5.0))
    assert not fine.findings
    (told,) = coarse.findings
    assert told.code == "coverage-lobes-unresolved" and told.numbers["height_times"] == 4


@pytest.mark.parametrize(
    ("changes", "heights", "ranges", "words"),
    [
        ({}, [-1.0, 1.0], [100.0], "Target heights"),
        ({}, [1.0, 1.0], [100.0], "do not rise"),
        ({}, [1.0], [0.0, 100.0], "above 0"),
        ({}, [1.0, math.nan], [100.0], "finite"),
        ({}, np.arange(3000.0), np.arange(1.0, 3001.0), "4,000,000"),
        ({"receiver": Mount(ConstantGain(), -1.0, LEVEL)}, [1.0], [100.0], "-1 m over the ground"),
        ({"receiver": Mount(ConstantGain(), 9.0, np.eye(4))}, [1.0], [100.0], "straight up"),
    ],
)  # fmt: skip
def test_bad_input_is_named(changes: dict[str, Any], heights: Any, ranges: Any, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        compute_coverage(setup(**changes), heights, ranges)


def test_antennas_far_apart_are_refused() -> None:
    pose = LEVEL.copy()
    pose[0, 3] = 3.0
    apart = setup(receiver=Mount(ConstantGain(), 10.0, pose))
    compute_coverage(apart, [5.0], [301.0])
    with pytest.raises(ConfigError, match="3 m apart"):
        compute_coverage(apart, [5.0], [299.0, 500.0])
