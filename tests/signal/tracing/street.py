# SPDX-License-Identifier: GPL-3.0-or-later
"""A street between two walls that mirror, and an image-method tracer for it written here."""

from __future__ import annotations

import itertools

import numpy as np

INDEX = 2.3 + 0.1j
RADAR = np.array([0.7, 0.0, 0.0])
#: Walls at x, facing inwards, over y and z.
WALLS = {"left": (-5.0, 1.0), "right": (4.0, -1.0)}
WALL_Y, WALL_Z = (4.0, 26.0), (-3.0, 3.0)
#: Plates across the street: x, y, z of the middle, half a side.
PLATES = [(1.0, 30.0, 0.0, 0.15), (-3.0, 44.0, 0.0, 0.2), (2.6, 37.0, 0.0, 0.2)]
CHAINS = [(), ("left",), ("right",), ("left", "right"), ("right", "left")]


def across(point: np.ndarray, wall: str) -> np.ndarray:
    """Image of a point in a wall."""
    return np.array([2 * WALLS[wall][0] - point[0], point[1], point[2]])


def ways(antenna: np.ndarray, point: np.ndarray, chain: tuple[str, ...]) -> list[np.ndarray] | None:
    """Points from an antenna over walls in their order to a point; None where there is no way."""
    images = [antenna]
    for wall in chain:
        images.append(across(images[-1], wall))
    stations, at = [point], point
    for number in range(len(chain) - 1, -1, -1):
        x, facing = WALLS[chain[number]]
        aim = images[number + 1]
        if (at[0] - x) * facing <= 1e-9 or (aim[0] - x) * facing >= 0:
            return None
        at = at + (aim - at) * (x - at[0]) / (aim[0] - at[0])
        if not (WALL_Y[0] <= at[1] <= WALL_Y[1] and WALL_Z[0] <= at[2] <= WALL_Z[1]):
            return None
        stations.append(at)
    stations.append(antenna)
    for a, b in itertools.pairwise(stations):
        for x, y, z, half in PLATES:
            if min(a[1], b[1]) + 1e-6 < y < max(a[1], b[1]) - 1e-6:
                there = a + (b - a) * (y - a[1]) / (b[1] - a[1])
                if abs(there[0] - x) < half and abs(there[2] - z) < half:
                    return None
    return stations[::-1]


def one_way(stations: list[np.ndarray]) -> tuple[float, complex]:
    """Length, and field at a plate across the street over that without spreading."""
    legs = [b - a for a, b in itertools.pairwise(stations)]
    length = float(sum(np.linalg.norm(leg) for leg in legs))
    field = complex(np.sqrt(abs(legs[-1][1]) / np.linalg.norm(legs[-1])) / length)
    for leg in legs[:-1]:
        cosine = abs(leg[0]) / np.linalg.norm(leg)
        root = np.sqrt(INDEX**2 - (1 - cosine**2))
        field *= (cosine - root) / (cosine + root)  # vertical field along the wall
    return length, field
