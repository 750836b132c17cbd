# SPDX-License-Identifier: GPL-3.0-or-later
"""Power of single reflections in the street canyon by range, by integration: no rays, no bpy.

A monostatic radar of EIRP W receives from a Lambert surface of reflectance F, over the solid angle
dOmega at range R and incidence theta, A_e F cos(theta) W / (4 pi^2 R^2) dOmega. At each azimuth
those walls are visible that rise above all nearer ones, each between two elevations, and the ground
up to the first wall. Within a range bin the integral over elevation is Gauss's; so is that over
azimuth, between the azimuths at which something jumps: corners, and walls that leave a bin.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from radarsim_addon.arrays import Real
from radarsim_addon.physics.fresnel import unpolarised_reflectance

#: Lowest and highest corner of a box.
Box = tuple[Sequence[float], Sequence[float]]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_COARSE = np.polynomial.legendre.leggauss(6)


def first_order_profile(
    boxes: Sequence[Box],
    ground_half_m: tuple[float, float],
    height_m: float,
    indices: tuple[complex, complex],
    edges_m: Real,
) -> Real:
    """Return power per A_e W in range bins of these edges [1/m^2].

    The radar is at (0, 0, height_m), outside all boxes and lower than each; `indices` are those of
    walls and ground.
    """
    total = np.zeros(len(edges_m) - 1)
    knots = _jumps(boxes, ground_half_m, edges_m)
    for start, end in itertools.pairwise(knots):
        for node, weight in zip(*_COARSE):
            azimuth = (start + end) / 2 + (end - start) / 2 * node
            total += (end - start) / 2 * weight * _one_azimuth(
                azimuth, boxes, ground_half_m, height_m, indices, edges_m
            )  # fmt: skip
    return total / (4 * math.pi**2)


def _jumps(boxes: Sequence[Box], ground_half_m: tuple[float, float], edges_m: Real) -> Real:
    """Azimuths of all corners, and those at which the plane of a wall is as far as a bin's edge."""
    ground = [tuple(sign * half for half in ground_half_m) for sign in (-1, 1)]
    azimuths = [-math.pi]
    for low, high in (*boxes, ground):
        azimuths += [math.atan2(y, x) for x in (low[0], high[0]) for y in (low[1], high[1])]
        for axis, place in ((axis, end[axis]) for end in (low, high) for axis in (0, 1)):
            for angle in np.arccos(place / edges_m[edges_m > abs(place)]):
                # measured from the axis of the plane's normal, to both sides
                at = angle if axis == 0 else math.pi / 2 - angle
                azimuths += [at, -at if axis == 0 else math.pi - at]
    turned = np.remainder(np.array(azimuths) + math.pi, 2 * math.pi) - math.pi
    return np.unique([*turned, math.pi])


def _one_azimuth(
    azimuth: float,
    boxes: Sequence[Box],
    ground_half_m: tuple[float, float],
    height_m: float,
    indices: tuple[complex, complex],
    edges_m: Real,
) -> Real:
    """Integral over elevation at one azimuth."""
    ray = math.cos(azimuth), math.sin(azimuth)
    walls = sorted(hit for box in boxes if (hit := _wall(ray, box)) is not None)
    reach_m = min(half / max(abs(r), 1e-300) for half, r in zip(ground_half_m, ray))
    seen_to_m = min(reach_m, walls[0][0]) if walls else reach_m
    found = _ground(seen_to_m, height_m, indices[1], edges_m)
    above = -math.pi / 2
    for distance_m, across, top_m in walls:
        low = max(above, -math.atan(height_m / distance_m))
        high = math.atan((top_m - height_m) / distance_m)
        if high > low:
            found += _wall_power(distance_m, across, low, high, indices[0], edges_m)
            above = high
    return found


def _wall(ray: tuple[float, float], box: Box) -> tuple[float, float, float] | None:
    """Distance to a box, cosine between ray and normal in plan, and the box's top."""
    near, far, across = 0.0, math.inf, 0.0
    for axis in (0, 1):
        if ray[axis] == 0:
            if not box[0][axis] < 0 < box[1][axis]:
                return None
            continue
        enters, leaves = sorted(float(box[end][axis]) / ray[axis] for end in (0, 1))
        if enters > near:
            near, across = enters, abs(ray[axis])
        far = min(far, leaves)
    return (near, across, float(box[1][2])) if near < far and near > 0 else None


def _wall_power(
    distance_m: float, across: float, low: float, high: float, index: complex, edges_m: Real
) -> Real:
    """Of a wall between two elevations; range grows with |elevation|, so both signs in turn."""
    found = np.zeros(len(edges_m) - 1)
    for a, b in ((max(low, 0.0), high), (max(-high, 0.0), -low)):
        if b > a:
            cosines = np.minimum(distance_m / np.maximum(edges_m, 1e-300), 1.0)
            bounds = np.clip(np.arccos(cosines), a, b)
            half, elevation = _gauss(bounds)
            cosine = np.cos(elevation) * across
            # R = d / cos(elevation), dOmega = cos(elevation) d(elevation)
            power = _lambert(cosine, index) * np.cos(elevation) ** 3 / distance_m**2
            found += half * (power @ _WEIGHTS)
    return found


def _ground(reach_m: float, height_m: float, index: complex, edges_m: Real) -> Real:
    """Of the ground up to a distance; R = h / sin(depression)."""
    least = math.atan(height_m / reach_m)
    bounds = np.arcsin(np.minimum(height_m / np.maximum(edges_m, 1e-300), 1.0))
    bounds = np.clip(bounds, least, math.pi / 2)[::-1]
    half, depression = _gauss(bounds)
    sine = np.sin(depression)
    power = _lambert(sine, index) * sine**2 / height_m**2 * np.cos(depression)
    return np.asarray((half * (power @ _WEIGHTS))[::-1])


def _gauss(bounds: Real) -> tuple[Real, Real]:
    """Half widths and nodes (n, 8) of the intervals between bounds (n + 1,)."""
    centre, half = (bounds[1:] + bounds[:-1]) / 2, np.diff(bounds) / 2
    return half, centre[:, None] + half[:, None] * _NODES


def _lambert(cosine: Real, index: complex) -> Real:
    return np.asarray(unpolarised_reflectance(index, cosine) * cosine)
