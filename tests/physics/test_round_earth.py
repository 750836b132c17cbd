# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths over a round Earth against Fermat's principle and tubes of rays in long double."""

from __future__ import annotations

import math

import numpy as np
import pytest

from radarsim_addon.physics.constants import STANDARD_EARTH_RADIUS_M
from radarsim_addon.physics.round_earth import ground_path

A = np.longdouble(STANDARD_EARTH_RADIUS_M)
CASES = [
    (15.0, 30.0, 5e3),
    (15.0, 60.0, 2e4),
    (300.0, 3e3, 1e5),
    (10.0, 5.0, 500.0),
    (2.0, 40.0, 60.0),
]


def point(height: float, angle: np.longdouble) -> np.ndarray:
    """A point over a sphere, (x, z)."""
    return (A + height) * np.array([np.sin(angle), np.cos(angle)])


def shortest(antenna: float, target: float, distance: float) -> tuple[float, np.ndarray]:
    """Angle and place on the sphere from which the path via the ground is shortest."""
    start, end = point(antenna, np.longdouble(0)), point(target, distance / A)
    low, high = np.longdouble(0), distance / A
    for _ in range(100):
        middle = (low + high) / 2
        foot, along = point(0.0, middle), np.array([np.cos(middle), -np.sin(middle)])
        slope = sum(
            along @ (foot - one) / np.sqrt(((foot - one) ** 2).sum()) for one in (start, end)
        )
        low, high = (middle, high) if slope < 0 else (low, middle)
    return float(middle), point(0.0, middle)


@pytest.mark.parametrize(("antenna", "target", "distance"), CASES)
def test_lengths_are_the_shortest_via_the_ground(
    antenna: float, target: float, distance: float
) -> None:
    found = ground_path(antenna, target, distance)
    _, foot = shortest(antenna, target, distance)
    start, end = point(antenna, np.longdouble(0)), point(target, distance / A)
    legs = [np.sqrt(((foot - one) ** 2).sum()) for one in (start, end)]
    direct = np.sqrt(((start - end) ** 2).sum())
    assert np.allclose(found.leg_m, np.array(legs, dtype=float), rtol=1e-8)
    assert float(found.direct_m) == pytest.approx(float(direct), rel=1e-12)
    # at 10 GHz 1e-8 m are 2e-6 rad of phase
    assert float(found.excess_m) == pytest.approx(float(sum(legs) - direct), abs=1e-8)
    up = foot / A
    assert float(found.grazing_rad) == pytest.approx(
        float(np.arcsin((start - foot) @ up / legs[0])), rel=1e-6
    )
    away = foot - start
    assert float(found.ground_elevation_rad) == pytest.approx(
        math.atan2(float(away[1]), float(away[0])), abs=1e-10
    )
    away = end - start
    assert float(found.direct_elevation_rad) == pytest.approx(
        math.atan2(float(away[1]), float(away[0])), abs=1e-10
    )


def reflected(start: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where a ray from a point meets the sphere, and its direction after it."""
    b, c = start @ way, start @ start - A**2
    foot = start + way * (-b - np.sqrt(b * b - c))
    normal = foot / A
    return foot, way - 2 * (way @ normal) * normal


@pytest.mark.parametrize(("antenna", "target", "distance"), CASES)
def test_divergence_is_that_of_a_tube_of_rays(
    antenna: float, target: float, distance: float
) -> None:
    found = ground_path(antenna, target, distance)
    _, foot = shortest(antenna, target, distance)
    start = np.array([0, 0, A + antenna], dtype=np.longdouble)
    way = np.array([foot[0], 0, foot[1]]) - start
    way /= np.sqrt(way @ way)
    side = np.array([0, 1, 0], dtype=np.longdouble)
    tilt = np.cross(way, side)
    at, after = reflected(start, way)
    end = at + after * np.longdouble(found.leg_m[1])
    step, ends = np.longdouble(1e-6), []
    for turn in (side, tilt):
        pair = []
        for sign in (1, -1):
            near = way + sign * step * turn
            place, out = reflected(start, near / np.sqrt(near @ near))
            pair.append(place + out * (((end - place) @ after) / (out @ after)))
        ends.append((pair[0] - pair[1]) / (2 * step))
    area = abs(np.cross(ends[0], ends[1]) @ after)  # of the tube over its solid angle
    expected = float(found.leg_m.sum() / np.sqrt(area))
    assert float(found.divergence) == pytest.approx(expected, rel=1e-6)


def test_near_the_radar_the_earth_is_flat() -> None:
    height = np.array([0.0, 1.0, 7.0])
    round_, flat = (ground_path(3.0, height, 40.0, radius) for radius in (1e12, math.inf))
    for one, other in zip(round_, flat, strict=True):
        assert np.allclose(one, other, rtol=1e-9, atol=1e-9)
    direct, via = np.hypot(40.0, height - 3.0), np.hypot(40.0, height + 3.0)
    assert np.allclose(flat.excess_m, via - direct, atol=1e-12)
    assert np.allclose(flat.grazing_rad, np.arctan2(3.0 + height, 40.0))
    assert (flat.divergence == 1).all()


def test_the_horizon_is_where_the_grazing_angle_ends() -> None:
    for antenna, target in ((15.0, 60.0), (300.0, 2.0)):
        # an arc tangent keeps the digits of acos(a / (a + h))
        limit = STANDARD_EARTH_RADIUS_M * sum(
            math.atan(math.sqrt((2 + part) * part))
            for part in (antenna / STANDARD_EARTH_RADIUS_M, target / STANDARD_EARTH_RADIUS_M)
        )
        # the textbook's sqrt(2 a h), good to h / a
        textbook = sum(math.sqrt(2 * STANDARD_EARTH_RADIUS_M * h) for h in (antenna, target))
        assert limit == pytest.approx(textbook, rel=1e-4)
        angles = ground_path(antenna, target, limit * np.array([1 - 1e-6, 1 + 1e-6])).grazing_rad
        assert angles[0] > 0 > angles[1]
        assert ground_path(antenna, target, limit * (1 - 1e-6)).divergence < 0.1
