# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines of the overlays in a receiver's or transmitter's own axes: looking along -z, y up."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...array_types import Real
from ...physics.antennas import Antenna

#: Points of a circle, and of the line around a beam.
_POINTS = 96
#: Largest angle from the peak at which the edge of a beam is looked for [rad].
_WIDEST = math.radians(89.0)


class Label(NamedTuple):
    """A text and its place, in metres."""

    place: tuple[float, float, float]
    text: str


def round_length(longest_m: float) -> float:
    """Return the step of about five range rings: 1, 2 or 5 times a power of ten [m]."""
    power = 10.0 ** math.floor(math.log10(longest_m / 5))
    return max(step * power for step in (1, 2, 5) if step * power <= longest_m / 5)


def ring_ranges(longest_m: float) -> list[float]:
    """Return the ranges of the rings up to a range [m]."""
    step_m = round_length(longest_m)
    return [step_m * number for number in range(1, math.floor(longest_m / step_m + 1e-9) + 1)]


def segments(points: Real, closed: bool = False) -> Real:
    """Return the ends of a line's pieces one after the other, (2 n, 3), from its points (m, 3)."""
    following = np.roll(points, -1, axis=0) if closed else points[1:]
    return np.stack([points[: len(following)], following], axis=1).reshape(-1, 3)


def arc(range_m: float, half_angle: float) -> Real:
    """Return points of a range ring in the plane y = 0, (n, 3) [m]; pi: the whole circle."""
    angle = np.linspace(-half_angle, half_angle, _POINTS)
    return range_m * np.stack([np.sin(angle), np.zeros(_POINTS), -np.cos(angle)], axis=1)


def pyramid(edges: tuple[float, float, float, float], range_m: float) -> Real:
    """Return a field of view as line ends: four edges, and the frame on the sphere of `range_m`.

    edges: left, right, bottom, top at distance 1.
    """
    left, right, bottom, top = edges
    across, up = np.linspace(left, right, _POINTS), np.linspace(bottom, top, _POINTS)
    sides = [
        (across, np.full(_POINTS, bottom)), (np.full(_POINTS, right), up),
        (across[::-1], np.full(_POINTS, top)), (np.full(_POINTS, left), up[::-1]),
    ]  # fmt: skip
    u, v = (np.concatenate(parts) for parts in zip(*sides, strict=True))
    frame = _on_sphere(np.stack([u, v, np.full(u.size, -1.0)], axis=1), range_m)
    corners = frame[::_POINTS]
    spokes = np.stack([np.zeros((4, 3)), corners], axis=1).reshape(-1, 3)
    return np.concatenate([spokes, segments(frame, closed=True)])


def beam(antenna: Antenna, axis: Real, range_m: float) -> Real:
    """Return the line around a beam at half its peak gain, as line ends on a sphere [m].

    axis: direction of the peak. Directions in which the gain stays above half of it have no edge
    and are drawn at 89 degrees.
    """
    side = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    phi = 2 * np.pi * np.arange(_POINTS) / _POINTS
    around = np.cos(phi)[:, None] * side + np.sin(phi)[:, None] * np.cross(side, axis)
    half = 0.5 * float(antenna.gain(axis))
    # The first crossing: in steps of a beam's fraction, then by bisection.
    steps = _WIDEST * np.linspace(0.0, 1.0, 721)[1:]
    falls = np.stack([antenna.gain(_tilted(axis, around, angle)) < half for angle in steps])
    first = np.where(falls.any(axis=0), falls.argmax(axis=0), len(steps) - 1)
    high, low = steps[first], np.where(first > 0, steps[first - 1], 0.0)
    for _ in range(30):
        middle = (low + high) / 2
        below = antenna.gain(_tilted(axis, around, middle)) < half
        high, low = np.where(below, middle, high), np.where(below, low, middle)
    return segments(range_m * _tilted(axis, around, high), closed=True)


def arrow(place: Real, along: Real) -> Real:
    """Return an arrow from a place, with a head of a seventh of its length, as line ends."""
    tip = place + along
    aside = np.cross(along, [0.0, 0.0, 1.0] if np.hypot(*along[:2]) > 0 else [1.0, 0.0, 0.0])
    aside *= np.linalg.norm(along) / np.linalg.norm(aside) / 14
    back = tip - along / 7
    return np.array([place, tip, tip, back + aside, tip, back - aside])


def range_cell(place: Real, thick_m: float, half_angle: float) -> Real:
    """Return the arcs at half a range cell before and behind a place, and what joins them.

    place: in the receiver's axes [m]. The arcs have its elevation and end with the field of view.
    """
    range_m = float(np.linalg.norm(place))
    up = math.asin(place[1] / range_m) if range_m > 0 else 0.0
    angle = np.linspace(-half_angle, half_angle, _POINTS)
    unit = np.stack(
        [
            math.cos(up) * np.sin(angle),
            np.full(_POINTS, math.sin(up)),
            -math.cos(up) * np.cos(angle),
        ],
        axis=1,
    )
    near, far = max(range_m - thick_m / 2, 0.0) * unit, (range_m + thick_m / 2) * unit
    joins = np.stack([near[[0, -1]], far[[0, -1]]], axis=1).reshape(-1, 3)
    return np.concatenate([segments(near), segments(far), joins])


def _tilted(axis: Real, around: Real, angle: Real | float) -> Real:
    """Directions at angles from the axis, (n, 3)."""
    angle = np.broadcast_to(angle, len(around))[:, None]
    return np.asarray(np.cos(angle) * axis + np.sin(angle) * around)


def _on_sphere(directions: Real, range_m: float) -> Real:
    return np.asarray(range_m * directions / np.linalg.norm(directions, axis=1, keepdims=True))
