# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths between two points over a smooth round Earth: direct, and via the ground.

Refraction of the standard atmosphere is that of straight rays over an Earth of 4/3 of its radius.
Heights are above the ground, distances along it.

At the point of reflection both grazing angles are equal. Their difference falls along the ground,
so that Newton's method within a shrinking interval always finds the point. The divergence is that
of a narrow tube of rays at a sphere, both of its main curvatures kept (D. E. Kerr, Propagation of
Short Radio Waves, 1951, 5.2).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Real, reals
from .constants import STANDARD_EARTH_RADIUS_M

#: Steps of the search for the point of reflection; most points take less than eight.
_MOST_STEPS = 80
#: The point of reflection is found to this part of the distance.
_PRECISION = 1e-13


class GroundPath(NamedTuple):
    """The direct path and the path via the ground between an antenna and points; all (...).

    Attributes
    ----------
    direct_m : length of the direct path [m]
    leg_m : lengths from the antenna to the point of reflection, and on from there, (2, ...) [m]
    grazing_rad : grazing angle at the point of reflection [rad]; below 0: the Earth is in the way
    direct_elevation_rad, ground_elevation_rad
        Elevations of the target and of the point of reflection, seen from the antenna [rad].
    divergence : factor of the Earth's curvature on the amplitude that is reflected, at most 1
    """

    direct_m: Real
    leg_m: Real
    grazing_rad: Real
    direct_elevation_rad: Real
    ground_elevation_rad: Real
    divergence: Real

    @property
    def excess_m(self) -> Real:
        """Length of the path via the ground less that of the direct one [m], without rounding."""
        first, second = self.leg_m
        product = 4 * first * second * np.sin(self.grazing_rad) ** 2
        return np.asarray(product / (first + second + self.direct_m))

    @property
    def spreading(self) -> Real:
        """Amplitude that spreads along the path via the ground, over that of the direct one."""
        return np.asarray(self.direct_m / self.leg_m.sum(axis=0))


def ground_path(
    antenna_m: float,
    target_m: ArrayLike,
    distance_m: ArrayLike,
    radius_m: float = STANDARD_EARTH_RADIUS_M,
) -> GroundPath:
    """Return the direct path and the path via the ground.

    Parameters
    ----------
    antenna_m : height of the antenna, above 0 [m]
    target_m : heights of targets, 0 or more [m]
    distance_m : distances along the ground, above 0 [m]
    radius_m : radius of the Earth with its refraction [m]; ``math.inf``: flat

    Returns
    -------
    GroundPath
    """
    height, x = np.broadcast_arrays(*reals(target_m, distance_m))
    curvature = 0.0 if math.isinf(radius_m) else 1 / radius_m
    first = _reflection_distance(antenna_m, height, x, curvature)
    up_1, out_1 = _seen(antenna_m, first, curvature)
    up_2, out_2 = _seen(height, x - first, curvature)
    legs = np.stack([np.hypot(up_1, out_1), np.hypot(up_2, out_2)])
    grazing = np.arctan2(up_1, out_1)
    chord_m = x * np.sinc(curvature * x / (2 * np.pi))
    rounded = (1 + curvature * antenna_m) * (1 + curvature * height)
    direct = np.sqrt((height - antenna_m) ** 2 + rounded * chord_m**2)
    target_up, target_out = _seen(height, x, curvature)
    foot_up, foot_out = _seen(0.0, first, curvature)
    sine = np.maximum(np.sin(grazing), 0.0)
    bend = 2 * curvature * legs[0] * legs[1] / legs.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(bend > 0, 1 + bend / sine, 1.0)
    return GroundPath(
        direct,
        legs,
        grazing,
        np.arctan2(target_up - antenna_m, target_out),
        np.arctan2(foot_up - antenna_m, foot_out),
        1 / np.sqrt(along * (1 + bend * sine)),
    )


def least_grazing_rad(wavelength_m: float, radius_m: float) -> float:
    """Return the grazing angle below which rays do not describe the field over a round Earth.

    (lambda / (2 pi a))^(1/3): where the divergence of rays ends (Kerr, 2.2).

    Parameters
    ----------
    wavelength_m, radius_m : lambda and a [m]

    Returns
    -------
    float : [rad]; 0 over a flat Earth
    """
    return float((wavelength_m / (2 * math.pi * radius_m)) ** (1 / 3))


def _seen(height: Real | float, distance: Real, curvature: float) -> tuple[Real, Real]:
    """Return the height of points above the tangent plane, and their distance in it, seen from the
    ground [m].
    """
    chord = distance * np.sinc(curvature * distance / (2 * np.pi))
    up = height * np.cos(curvature * distance) - curvature / 2 * chord**2
    out = (1 + curvature * height) * distance * np.sinc(curvature * distance / np.pi)
    return np.asarray(up), np.asarray(out)


def _reflection_distance(antenna: float, height: Real, x: Real, curvature: float) -> Real:
    """Return the distance from the foot of the antenna to the point of reflection [m]."""
    low, high = np.zeros(x.shape), x.copy()
    at = x * antenna / (antenna + height)
    for _ in range(_MOST_STEPS):
        (up_1, out_1), (up_2, out_2) = (
            _seen(antenna, at, curvature),
            _seen(height, x - at, curvature),
        )
        off = np.arctan2(up_1, out_1) - np.arctan2(up_2, out_2)
        low, high = np.where(off > 0, at, low), np.where(off > 0, high, at)
        with np.errstate(divide="ignore", invalid="ignore"):
            fall = 2 * curvature + up_1 / (up_1**2 + out_1**2) + up_2 / (up_2**2 + out_2**2)
            step = at + off / fall
        inside = (step > low) & (step < high)
        after = np.where(inside, step, (low + high) / 2)
        moved = np.abs(after - at)
        at = after
        if np.all(moved <= _PRECISION * x):
            break
    return at
