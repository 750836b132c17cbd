# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of a rigid (or stretched) body over a burst, as smooth functions in float64.

A body's pose is x -> A(t) x + T(t). Paths need the later position of a point P of it, given at the
frame's time t = 0:

    P(t) = P + [T(t) - T(0)] + [F(t) - 1] (P - T(0)),      F(t) = A(t) A(0)^-1

so P(0) = P exactly. Segments of time hold Chebyshev series of T and of either a rotation vector
(F = exp(phi) initial_orientation: a steady rotor is linear in it) or the nine numbers of F.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import overload

import numpy as np
from numpy.polynomial import chebyshev

from ...arrays import Indices, Mask, Real


def _cross_matrix(vectors: Real) -> Real:
    matrix = np.zeros((*vectors.shape, 3))
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    matrix[..., 0, 1], matrix[..., 0, 2] = -z, y
    matrix[..., 1, 0], matrix[..., 1, 2] = z, -x
    matrix[..., 2, 0], matrix[..., 2, 1] = -y, x
    return matrix


def _sine_terms(angle: Real) -> tuple[Real, Real]:
    """Return sin(a)/a and (1 - cos(a))/a^2, exact near 0."""
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return first, second


def rotation_minus_one(vectors: Real) -> Real:
    """Return exp(phi) - 1 of rotation vectors, (..., 3, 3), without cancellation (Rodrigues)."""
    first, second = _sine_terms(np.linalg.norm(vectors, axis=-1))
    k = _cross_matrix(vectors)
    result: Real = first[..., None, None] * k + second[..., None, None] * (k @ k)
    return result


def rotation_and_jacobian(vectors: Real) -> tuple[Real, Real]:
    """Return exp(phi), and J with exp(phi + d) = exp(J d) exp(phi) to first order.

    Both are (..., 3, 3).
    """
    angle = np.linalg.norm(vectors, axis=-1)
    first, second = _sine_terms(angle)
    square = np.maximum(angle**2, 1e-300)
    third = np.where(angle > 1e-3, (1 - first) / square, 1 / 6 - angle**2 / 120)
    k = _cross_matrix(vectors)
    kk, one = k @ k, np.eye(3)
    first, second, third = (term[..., None, None] for term in (first, second, third))
    return first * k + second * kk + one, one + second * k + third * kk


def rotation(vectors: Real) -> Real:
    """Return exp(phi), (..., 3, 3)."""
    return rotation_minus_one(vectors) + np.eye(3)


def rotation_vector(matrices: Real) -> Real:
    """Return the logarithm of rotations, (..., 3), of angle 0 to pi, from the quaternion, which is
    accurate at all angles.
    """
    m = matrices.reshape(-1, 3, 3)
    # Shepperd's method: compute the largest of the four quaternion components first.
    trace = np.trace(m, axis1=1, axis2=2)
    squares = np.stack([trace, m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]], axis=-1)
    best = np.argmax(squares, axis=-1)
    q = np.empty((len(m), 4))
    cases = set(best.tolist())
    for case in cases:
        rows = slice(None) if len(cases) == 1 else np.flatnonzero(best == case)
        a = m[rows]
        if case == 0:
            w = 1 + trace[rows]
            q[rows] = np.stack(
                [w, a[:, 2, 1] - a[:, 1, 2], a[:, 0, 2] - a[:, 2, 0], a[:, 1, 0] - a[:, 0, 1]],
                axis=-1,
            )
            continue
        i = case - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q[rows, 0] = a[:, k, j] - a[:, j, k]
        q[rows, 1 + i] = 1 + a[:, i, i] - a[:, j, j] - a[:, k, k]
        q[rows, 1 + j] = a[:, j, i] + a[:, i, j]
        q[rows, 1 + k] = a[:, k, i] + a[:, i, k]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    q *= np.where(q[:, :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(q[:, 1:], axis=-1)
    angle = 2 * np.arctan2(sine, q[:, 0])
    factor = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 2.0)
    return (q[:, 1:] * factor[:, None]).reshape(*matrices.shape[:-2], 3)


@dataclass(frozen=True)
class Segment:
    """Motion in start_s <= t < stop_s [s]; x is -1 at its start and 1 at its end.

    T(t) = c(t) + G(t) rotation_centre. G(t), relative to the pose at t = 0, is exp(phi(t))
    initial_orientation, or the series `linear`.
    """

    start_s: float
    stop_s: float
    #: Chebyshev coefficients of c, (degrees, 3) [m].
    translation: Real
    #: Origin of the body relative to its centre of rotation, (3,) [m].
    rotation_centre: Real = field(default_factory=lambda: np.zeros(3))
    #: b_k with k >= 1 of phi(t) = sum b_k (T_k(x) - T_k(-1)), (n, 3) [rad].
    rotation: Real = field(default_factory=lambda: np.empty((0, 3)))
    initial_orientation: Real = field(default_factory=lambda: np.eye(3))
    #: Coefficients of the nine numbers of G, (degrees, 9); in place of `rotation`.
    linear: Real | None = None

    def _x(self, times_s: Real) -> Real:
        return np.asarray(2 * (times_s - self.start_s) / (self.stop_s - self.start_s) - 1)

    def vector(self, times_s: Real) -> Real:
        """Return phi(t), (times, 3)."""
        if not len(self.rotation):
            return np.zeros((times_s.size, 3))
        series = np.concatenate([np.zeros((1, 3)), self.rotation])
        start = chebyshev.chebval(-1.0, series)
        return np.asarray(chebyshev.chebval(self._x(times_s), series).T - start)

    def orientation(self, times_s: Real) -> Real:
        """Return G(t), (times, 3, 3)."""
        if self.linear is not None:
            numbers = np.asarray(chebyshev.chebval(self._x(times_s), self.linear), np.float64)
            return numbers.T.reshape(-1, 3, 3)
        return np.asarray(rotation(self.vector(times_s)) @ self.initial_orientation)

    def centre(self, times_s: Real) -> Real:
        """Return c(t), (times, 3)."""
        return np.asarray(chebyshev.chebval(self._x(times_s), self.translation).T)

    def origin(self, times_s: Real) -> Real:
        """Return T(t), (times, 3)."""
        centre = self.centre(times_s)
        if self.rotation_centre.any():
            centre = centre + self.orientation(times_s) @ self.rotation_centre
        return centre

    def rates(self, time_s: float) -> tuple[Real, Real]:
        """Return dT/dt (3,) and dG/dt (3, 3) at a time."""
        per_s = 2 / (self.stop_s - self.start_s)
        at = np.array([time_s])
        x = self._x(at)[0]
        rate = chebyshev.chebval(x, chebyshev.chebder(self.translation)) * per_s
        if self.linear is not None:
            flat = chebyshev.chebval(x, chebyshev.chebder(self.linear)) * per_s
            turning = np.asarray(flat).reshape(3, 3)
        else:
            spin = np.zeros(3)
            if len(self.rotation):
                series = np.concatenate([np.zeros((1, 3)), self.rotation])
                grows = np.asarray(chebyshev.chebval(x, chebyshev.chebder(series))) * per_s
                spin = rotation_and_jacobian(self.vector(at))[1][0] @ grows
            turning = _cross_matrix(spin) @ self.orientation(at)[0]
        return rate + turning @ self.rotation_centre, turning


@dataclass(frozen=True)
class BodyMotion:
    """Motion of one body over a burst; without segments it is stationary. Noise and errors are
    those at the farthest point of the body.
    """

    #: Pose at t = 0 from Blender, (4, 4), translation in metres.
    pose: Real
    #: Segments in order of time from t = 0.
    segments: tuple[Segment, ...] = ()
    #: RMS scatter of the samples about the fit [m].
    noise_m: float = 0.0
    #: Bound of the error of a displacement [m].
    displacement_error_bound_m: float = 0.0
    #: Time of the pose and of all points [s]; 0 except for further renders of a burst. It takes the
    #: place of t = 0 in all texts of this file.
    epoch_offset_s: float = 0.0
    #: Standard error of the velocity at the epoch [m/s]. Not in files.
    rate_stderr_mps: float = 0.0
    #: Bias of the velocity at the epoch, by fits of more terms; 0 if unknown [m/s]. Not in files.
    rate_bias_mps: float = 0.0
    _start: list[Real] = field(default_factory=list, compare=False, repr=False)

    @property
    def moving(self) -> bool:
        return bool(self.segments)

    @property
    def turning(self) -> bool:
        """True if the body turns or is stretched."""
        return any(np.any(part.rotation) or part.linear is not None for part in self.segments)

    def _segment_at(self, times_s: Real | float) -> Indices:
        starts = [segment.start_s for segment in self.segments[1:]]
        return np.asarray(np.searchsorted(starts, times_s, side="right"))

    @property
    def _first(self) -> Segment:
        """The segment that contains the epoch."""
        return self.segments[int(self._segment_at(self.epoch_offset_s))]

    def _origin_and_inverse(self) -> tuple[Real, Real]:
        if not self._start:
            at = np.array([self.epoch_offset_s])
            self._start.append(self._first.origin(at)[0])
            self._start.append(np.linalg.inv(self._first.orientation(at)[0]))
        return self._start[0], self._start[1]

    @property
    def origin_m(self) -> Real:
        """Origin of the fit at t = 0, (3,) [m]."""
        return self._origin_and_inverse()[0] if self.segments else self.pose[:3, 3]

    def change(self, times_s: Real) -> tuple[Real, Real]:
        """Return F(t) - 1, (times, 3, 3), and T(t) - T(0), (times, 3) [m]."""
        times_s = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        turned = np.zeros((times_s.size, 3, 3))
        moved = np.zeros((times_s.size, 3))
        if not self.segments:
            return turned, moved
        origin, inverse = self._origin_and_inverse()
        which = self._segment_at(times_s)
        for number, segment in enumerate(self.segments):
            rows = np.flatnonzero(which == number)
            if not rows.size:
                continue
            moved[rows] = segment.origin(times_s[rows]) - origin
            turned[rows] = segment.orientation(times_s[rows]) @ inverse - np.eye(3)
        return turned, moved

    def rates(self) -> tuple[Real, Real]:
        """Return d/dt at t = 0 of F (3, 3) [1/s] and of T (3,) [m/s]."""
        if not self.segments:
            return np.zeros((3, 3)), np.zeros(3)
        moved, turned = self._first.rates(self.epoch_offset_s)
        return turned @ self._origin_and_inverse()[1], moved

    def displacement(self, points_m: Real, times_s: Real) -> Real:
        """Return P(t) - P of points on the body at t = 0, (points, times, 3) [m]."""
        turned, moved = self.change(times_s)
        arms = points_m - self.origin_m
        # (points, 3) x (3, times * 3): one matrix product
        flat = arms @ turned.transpose(2, 0, 1).reshape(3, -1)
        result: Real = flat.reshape(len(points_m), -1, 3) + moved
        return result

    def velocity(self, points_m: Real) -> Real:
        """Return the velocity at t = 0 of points on the body, (points, 3) [m/s]."""
        turned, moved = self.rates()
        result: Real = (points_m - self.origin_m) @ turned.T + moved
        return result


class BodyMotions(Sequence[BodyMotion]):
    """Motions of n bodies, most of them stationary: a stationary one has a pose, and its
    `BodyMotion` is made on access.
    """

    def __init__(
        self, poses: Real, others: Mapping[int, BodyMotion], epoch_offset_s: float = 0.0
    ) -> None:
        #: Poses of all, (n, 4, 4), translation in metres; those of `others` are in their motions.
        self.poses = poses
        #: Motions by index of bodies that may move.
        self.others = dict(others)
        self.epoch_offset_s = epoch_offset_s

    def __len__(self) -> int:
        return len(self.poses)

    @overload
    def __getitem__(self, index: int) -> BodyMotion: ...
    @overload
    def __getitem__(self, index: slice) -> BodyMotions: ...
    def __getitem__(self, index: int | slice) -> BodyMotion | BodyMotions:
        chosen = range(len(self))[index]  # an IndexError beyond the end
        if isinstance(chosen, int):
            other = self.others.get(chosen)
            return other or BodyMotion(self.poses[chosen], epoch_offset_s=self.epoch_offset_s)
        others = {chosen.index(at): one for at, one in self.others.items() if at in chosen}
        return BodyMotions(self.poses[index], others, self.epoch_offset_s)

    def __iter__(self) -> Iterator[BodyMotion]:
        return (self[at] for at in range(len(self)))


def which_move(motions: Sequence[BodyMotion]) -> Mask:
    if not isinstance(motions, BodyMotions):
        return np.array([motion.moving for motion in motions], dtype=bool)
    moves = np.zeros(len(motions), dtype=bool)
    moves[[index for index, motion in motions.others.items() if motion.moving]] = True
    return moves


@dataclass(frozen=True)
class AntennaMotion:
    """Poses of both antennas over a burst (x right, y up, z back)."""

    receiver: BodyMotion
    transmitter: BodyMotion
    #: Whether all rays leave the receiver along its boresight.
    orthographic: bool = False


def axes_of(body: BodyMotion, times_s: Real) -> Real:
    """Return the unit vectors of an antenna's axes in world space as columns, (times, 3, 3). Its
    scale has no effect.
    """
    start = body.pose[:3, :3]
    axes = start + body.change(times_s)[0] @ start
    return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True))


def places_m(body: BodyMotion, times_s: Real, offset_m: Real | None = None) -> Real:
    """Return where a point of an antenna is, (times, 3) [m]; the point is in the antenna's axes,
    (3,) [m], or its origin.
    """
    origin_m = body.pose[:3, 3]
    place: Real = origin_m + body.displacement(origin_m[None], times_s)[0]
    return place if offset_m is None else place + axes_of(body, times_s) @ offset_m
