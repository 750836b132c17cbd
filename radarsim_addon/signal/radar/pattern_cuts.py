# SPDX-License-Identifier: GPL-3.0-or-later
"""Peak, principal cuts and half-power widths of an antenna pattern."""

from __future__ import annotations

import math

import numpy as np

from ...array_types import Real
from ...physics.antennas import Antenna, angles_from_direction, direction_from_angles


def peak_direction(antenna: Antenna) -> Real:
    """Find the direction of the largest gain: a coarse search over the sphere, then finer ones.

    Parameters
    ----------
    antenna
        Pattern.

    Returns
    -------
    ndarray
        Unit vector in the antenna's frame, (3,); among equal gains the nearest to boresight.
    """
    centre, reach = (0.0, 0.0), np.pi
    for _ in range(12):
        azimuth = centre[0] + np.linspace(-reach, reach, 81)
        elevation = np.clip(centre[1] + np.linspace(-reach, reach, 81) / 2, -np.pi / 2, np.pi / 2)
        grid = np.meshgrid(azimuth, elevation, indexing="ij")
        gain = antenna.gain(direction_from_angles(*grid))
        # Among equals the one nearest to boresight: an isotropic antenna has no peak.
        near = gain * (1 - 1e-9 * (grid[0] ** 2 + grid[1] ** 2))
        best = np.unravel_index(np.argmax(near), gain.shape)
        centre, reach = (float(grid[0][best]), float(grid[1][best])), reach / 3
    return direction_from_angles(*centre)


def cut_dbi(antenna: Antenna, angle_rad: Real, plane: str, through: Real | None = None) -> Real:
    """Return the gain in a plane: "azimuth" (one elevation) or "elevation" (one azimuth).

    Parameters
    ----------
    antenna
        Pattern.
    angle_rad
        Azimuths or elevations, (n,), -pi to pi; elevations beyond 90 degrees continue behind.
    plane
        Which angle varies.
    through
        Direction that gives the other angle, (3,); None: boresight.

    Returns
    -------
    ndarray
        (n,) [dBi]; minus infinity where the gain is 0.
    """
    azimuth, elevation = angles_from_direction([0.0, 0.0, -1.0] if through is None else through)
    if plane == "azimuth":
        directions = direction_from_angles(angle_rad, np.full_like(angle_rad, elevation))
    else:
        level = direction_from_angles(azimuth, 0.0)
        directions = np.cos(angle_rad)[:, None] * level
        directions[:, 1] = np.sin(angle_rad)
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(antenna.gain(directions)), dtype=np.float64)


def half_power_width_rad(antenna: Antenna, plane: str) -> float:
    """Return the full width at half power of the cut through the peak.

    Parameters
    ----------
    antenna
        Pattern.
    plane
        "azimuth" or "elevation".

    Returns
    -------
    float
        Width [rad]; 2 pi where the gain never falls to half.
    """
    angle = np.linspace(-math.pi, math.pi, 72001)
    gain = cut_dbi(antenna, angle, plane, peak_direction(antenna))
    peak = int(np.argmax(gain - 1e-9 * np.abs(angle)))
    low = gain < gain[peak] - 10 * math.log10(2)
    right = np.flatnonzero(low[peak:])
    left = np.flatnonzero(low[peak::-1])
    if not right.size or not left.size:
        return 2 * math.pi
    return float((right[0] + left[0]) * (angle[1] - angle[0]))
