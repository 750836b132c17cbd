# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of float32 poses against the motion they were rounded from."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from radarsim_addon.signal.motion import BodyMotion, fit_body, fit_vertices, smooth_poses
from radarsim_addon.signal.motion.body_motion import (
    rotation,
    rotation_and_jacobian,
    rotation_minus_one,
    rotation_vector,
)

Z = np.array([0, 0, 1.0])
SLANTED = np.array([0.6, 0.8, 0.0])
SPAN_S = 0.0256


def pose(place: Any, axes: np.ndarray | None = None) -> np.ndarray:
    """A pose of a place and axes."""
    matrix = np.eye(4)
    matrix[:3, 3] = place
    if axes is not None:
        matrix[:3, :3] = axes
    return matrix


def limb(t: float) -> np.ndarray:
    """A limb of half a metre that swings once a second."""
    turn = rotation(0.7 * math.sin(2 * math.pi * t) * Z)
    return pose(np.array([0, 10, 0]) + turn @ [0.5, 0, 0], turn)


def blade(t: float) -> np.ndarray:
    """A blade whose origin goes round its hub, which moves."""
    turn = rotation(100 * t * Z)
    return pose(np.array([0, 100 + 5 * t, 0]) + turn @ [0.5, 0, 0], turn)


MOTIONS: dict[str, tuple[Callable[[float], np.ndarray], float, float]] = {
    "steady": (lambda t: pose([0, 100 + 10 * t, 0]), SPAN_S, 5e-7),
    "accelerated": (lambda t: pose([0, 100 + 10 * t + 100 * t * t, 0]), SPAN_S, 5e-7),
    "rotor": (lambda t: pose([0, 100, 0], rotation(100 * t * Z)), SPAN_S, 5e-9),
    "slanted rotor of eight turns": (
        lambda t: pose([0, 100, 0], rotation(100 * t * SLANTED) @ rotation(0.3 * Z)),
        0.5,
        5e-9,
    ),
    "tumbling": (
        lambda t: pose([0, 100, 0], rotation(30 * t * SLANTED) @ rotation(17 * t * Z)),
        0.1,
        2e-8,
    ),
    "blade off its hub": (blade, SPAN_S, 1e-6),
    "limb": (limb, SPAN_S, 2e-7),
    "sheared": (
        lambda t: pose([0, 1, 0], np.diag([1, 2, 1]) @ rotation(30 * t * Z) @ np.diag([1, 1, 3])),
        SPAN_S,
        1e-7,
    ),
    "growing": (lambda t: pose([0, 1, 0], np.eye(3) * (1 + 10 * t)), SPAN_S, 1e-7),
}


def fitted(
    motion: Callable[[float], np.ndarray], span_s: float, samples: int = 1025, **keywords: Any
) -> tuple[BodyMotion, np.ndarray, np.ndarray]:
    """A fit, and displacements of points at 0.5 m as fitted and as they are: (points, times, 3)."""
    times_s = np.linspace(0, span_s, samples)
    poses = np.array([motion(t) for t in times_s]).astype(np.float32).astype(np.float64)
    body = fit_body(times_s, poses, span_s, 0.5, **keywords)
    rng = np.random.default_rng(1)
    local = rng.normal(size=(9, 3))
    local *= 0.5 / np.linalg.norm(local, axis=1)[:, None]
    at = rng.uniform(0, span_s, 50)
    start = motion(0.0)
    points = local @ start[:3, :3].T + start[:3, 3]
    now = np.array([local @ motion(t)[:3, :3].T + motion(t)[:3, 3] for t in at])
    return body, body.displacement(points, at), now.transpose(1, 0, 2) - points[:, None]


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_within_its_bound(name: str) -> None:
    motion, span_s, within_m = MOTIONS[name]
    body, found, want = fitted(motion, span_s)
    error_m = np.linalg.norm(found - want, axis=-1).max()
    assert error_m < within_m
    # three standard deviations, and what rounding a float32 start of turned arms leaves
    assert error_m < 1.5 * body.displacement_error_bound_m + 2e-8
    assert len(body.segments) == 1
    # the velocity is the slope of the motion
    step_s = 1e-6
    ends = [motion(t)[:3, :3] @ [0.3, 0.2, 0.1] + motion(t)[:3, 3] for t in (-step_s, step_s)]
    slope = (ends[1] - ends[0]) / (2 * step_s)
    start = motion(0.0)
    point = start[:3, :3] @ [0.3, 0.2, 0.1] + start[:3, 3]
    np.testing.assert_allclose(body.velocity(point[None])[0], slope, atol=20 * within_m / span_s)


def test_steady_rotor_is_one_number() -> None:
    body, _, _ = fitted(MOTIONS["rotor"][0], SPAN_S)
    (segment,) = body.segments
    assert segment.rotation.shape == (1, 3) and segment.translation.shape == (1, 3)


def test_standing_still_is_exact() -> None:
    poses = np.repeat(pose([3, 100.1, 2], rotation(0.3 * Z))[None], 17, axis=0)
    body = fit_body(np.linspace(0, 1, 17), poses, 1.0, 1.0)
    assert not body.moving
    assert np.all(body.displacement(np.ones((2, 3)), np.array([0.0, 0.5])) == 0)


def test_rounding_alone_is_no_motion() -> None:
    rng = np.random.default_rng(5)
    poses = np.repeat(pose([3, 100.1, 2])[None], 129, axis=0)
    poses[:, 1, 3] += rng.choice([0, 7.6e-6], 129)
    body = fit_body(np.linspace(0, 1, 129), poses, 1.0, 1.0)
    assert not body.moving
    assert 3e-6 < body.displacement_error_bound_m < 2e-5


@pytest.mark.parametrize("samples", [129, 1025])
def test_corner_and_jump_at_a_keyframe(samples: int) -> None:
    """Two segments that meet at the corner, where a sample is."""
    span_s, corner_s = 0.1, 0.1 * 48 / 128

    def corner(t: float) -> np.ndarray:
        return pose([0, 100 + 10 * min(t, corner_s) - 5 * max(t - corner_s, 0), 0])

    body, found, want = fitted(corner, span_s, samples, corners_s=[corner_s])
    assert len(body.segments) == 2 and body.segments[1].start_s == corner_s
    assert np.abs(found - want).max() < 3e-6

    def jump(t: float) -> np.ndarray:
        return pose([0, 100.0 + 3 * (t >= corner_s), 0])

    body, found, want = fitted(jump, span_s, samples, corners_s=[corner_s])
    assert len(body.segments) == 2
    assert np.abs(found - want).max() < 1e-6


def test_a_corner_of_the_rotation_alone_splits_the_burst() -> None:
    """A door on its hinge that starts to turn: its hinge, where it is known, does not move."""
    span_s, corner_s = 0.1, 0.1 * 48 / 128

    def door(t: float) -> np.ndarray:
        return pose([0, 100, 0], rotation(3.0 * max(t - corner_s, 0) * SLANTED))

    body, found, want = fitted(door, span_s, 129, corners_s=[corner_s])
    assert [part.start_s for part in body.segments[1:]] == [corner_s]
    assert np.abs(found - want).max() < 1e-6


def test_noise_falls_with_samples() -> None:
    motion = MOTIONS["steady"][0]
    few, _, _ = fitted(motion, SPAN_S, 33)
    many, _, _ = fitted(motion, SPAN_S, 4097)
    assert many.displacement_error_bound_m < few.displacement_error_bound_m / 4


def test_vertices_of_a_bending_mesh() -> None:
    times_s = np.linspace(0, SPAN_S, 65)
    rng = np.random.default_rng(2)
    rest = rng.uniform(-1, 1, (5000, 3))

    def bent(t: np.ndarray) -> np.ndarray:
        return rest + np.sin(3 + 20 * t[:, None, None] * rest[:, :1]) * [0, 0.1, 0]

    series, noise_m, displacement_error_bound_m = fit_vertices(
        times_s, bent(times_s).astype(np.float32), SPAN_S
    )
    at = np.array([0.0, 0.01, 0.02, SPAN_S])
    found = series.positions(np.arange(5000, dtype=np.int32), at)
    assert np.abs(found - bent(at)).max() < 3e-7
    assert noise_m < 5e-8 and displacement_error_bound_m < 2e-7
    rate = (bent(np.array([1e-7])) - bent(np.array([0.0])))[0] / 1e-7
    speeds = series.velocities(np.arange(5000, dtype=np.int32), 0.0)
    np.testing.assert_allclose(speeds, rate, atol=5e-5)


def test_cubic_through_poses_at_whole_frames() -> None:
    """A screw motion of cubic progress; the scale of the axes stays."""
    known_s = np.arange(-1, 5) / 24
    axes = rotation(np.array([0.3, -0.2, 0.1])) @ np.diag([1.0, 2.0, 0.5])

    def screw(t: float) -> np.ndarray:
        return pose([3 * t, t**2 - t**3, 1.0], rotation(4 * t * Z) @ axes)

    known = np.array([screw(t) for t in known_s])
    at = np.linspace(0.0, 3 / 24, 37)
    found = smooth_poses(known_s, known, at)
    np.testing.assert_allclose(found, [screw(t) for t in at], atol=1e-12)
    np.testing.assert_array_equal(smooth_poses(known_s[:1], known[:1], at), known[[0] * 37])
    known[:, :3, :3] *= np.array([1, 1.1, 1.2, 1.3, 1.4, 1.5])[:, None, None]
    half = smooth_poses(known_s, known, np.array([0.5 / 24]))
    np.testing.assert_allclose(half[0, :3, :3], 1.15 * screw(0.5 / 24)[:3, :3], atol=2e-4)


def test_rotations() -> None:
    rng = np.random.default_rng(4)
    axis = rng.normal(size=(400, 3))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    angle = np.concatenate([rng.uniform(0, math.pi, 300), 10.0 ** rng.uniform(-15, 0, 100)])
    vectors = axis * angle[:, None]
    np.testing.assert_allclose(rotation_vector(rotation(vectors)), vectors, atol=1e-14, rtol=1e-12)
    half = rotation(math.pi * axis)
    np.testing.assert_allclose(rotation(rotation_vector(half)), half, atol=1e-14)
    tiny = rotation_minus_one(1e-9 * axis)
    np.testing.assert_allclose(tiny[:, 2, 1] - tiny[:, 1, 2], 2e-9 * axis[:, 0], rtol=1e-9)
    step = 1e-7 * rng.normal(size=(400, 3))
    want = rotation_vector(rotation(vectors + step) @ rotation(vectors).transpose(0, 2, 1))
    got = np.einsum("nij,nj->ni", rotation_and_jacobian(vectors)[1], step)
    np.testing.assert_allclose(got, want, atol=1e-12)
