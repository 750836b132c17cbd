# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths over mirrors in processing: lengths, gains, elements and interference against images."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from radarsim_addon.contract import (
    ImageRecord,
)
from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import Burst, Radar, make_paths, synthesize
from radarsim_addon.signal.motion import (
    BodyMotion,
    FrameMotion,
    PathImages,
)
from radarsim_addon.signal.motion.body_motion import Segment
from radarsim_addon.signal.paths import (
    CURVED_IMAGE_DTYPE,
    IMAGE_DTYPE,
    PathRows,
    column_groups,
    images_of,
    motion_of_rows,
    open_table,
    write_table,
)
from radarsim_addon.signal.scattering import interference_factors
from tests.signal import path_runs as pr

C0_MPS = 299_792_458.0
FLOOR = ImageRecord([[0.0, 0.0, 1.0]], [-1.0], ["Floor"])
SLOPE = ImageRecord([[0.6, 0.0, 0.8]], [-2.0], ["Slope"])
BOTH = ImageRecord([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], [-1.0, -5.0], ["Floor", "Wall"])


def mirrored(point: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """A point behind a plane: twice its distance along the normal."""
    return point - 2 * (point @ normal - offset) * normal


def test_images_of_points() -> None:
    images = PathImages.of([FLOOR, SLOPE, BOTH], np.array([[0, 1], [0, 2], [0, 3], [3, 0]]))
    radar = np.array([1.0, 2.0, 3.0])
    floor, slope = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.8])
    wall = np.array([1.0, 0.0, 0.0])
    twice = mirrored(mirrored(radar, floor, -1.0), wall, -5.0)
    expected = [mirrored(radar, floor, -1.0), mirrored(radar, slope, -2.0), twice, radar]
    np.testing.assert_allclose(images.places(1, radar), expected, atol=1e-14)
    np.testing.assert_allclose(images.places(0, radar)[3], twice, atol=1e-14)
    # Unfolded scatterers are as far from the antenna as scatterers from its image.
    points = np.random.default_rng(1).normal(size=(4, 3))
    straight = np.linalg.norm(images.unfolded(1, points) - radar, axis=1)
    np.testing.assert_allclose(straight, np.linalg.norm(points - expected, axis=1), rtol=1e-14)
    # and the antenna sees them over the mirror: the way meets the plane where it is reflected
    seen = images.unfolded(1, points)[0]
    np.testing.assert_allclose(seen, mirrored(points[0], floor, -1.0), atol=1e-14)


def rows_over(images: list[tuple[int, int]], points: np.ndarray) -> np.ndarray:
    """Rows of one scattering each, with images of receiver and transmitter."""
    rows = PathRows.zeros(len(images), IMAGE_DTYPE)
    rows["first_scatterer_m"] = rows["last_scatterer_m"] = points
    rows["receiver_image"], rows["transmitter_image"] = np.array(images).T
    rows["mirrors"] = (np.array(images) > 0).sum(axis=1)
    rows["order"] = 1 + rows["mirrors"]
    rows["last_body"] = rows["first_body"] = 1
    return rows


def moving(velocity: tuple[float, float, float], place: np.ndarray) -> BodyMotion:
    """A body that moves straight for a second."""
    pose = np.eye(4)
    pose[:3, 3] = place
    half = np.array(velocity) / 2
    way = np.array([place + half, half])
    return BodyMotion(pose, (Segment(0.0, 1.0, way, np.zeros(3), np.zeros((1, 3)), np.eye(3)),))


def turning(
    spin: np.ndarray, velocity: np.ndarray, place: np.ndarray
) -> tuple[BodyMotion, Callable[[np.ndarray, float], np.ndarray]]:
    """A body that moves straight and turns for a second, and where its points then are."""
    pose = np.eye(4)
    pose[:3, 3] = place
    way = np.array([place + velocity / 2, velocity / 2])
    body = BodyMotion(pose, (Segment(0.0, 1.0, way, np.zeros(3), spin[None] / 2, np.eye(3)),))

    def later(points: np.ndarray, time_s: float) -> np.ndarray:
        angle = float(np.linalg.norm(spin)) * time_s
        axis = spin / np.linalg.norm(spin)
        arm = points - place  # Rodrigues
        along = (arm @ axis)[..., None] * axis
        turned = math.cos(angle) * (arm - along) + math.sin(angle) * np.cross(axis, arm) + along
        return np.asarray(place + velocity * time_s + turned)

    return body, later


def test_images_follow_mirrors_that_move_and_turn() -> None:
    """The plane through three points of the mirror's body at each moment, against the motion."""
    radar, target = np.array([1.0, 2.0, 3.0]), np.array([8.0, 30.0, 2.0])
    speed = np.array([0.3, -0.2, 0.1])
    rotor, later = turning(np.array([0.2, -0.3, 0.5]), np.array([1.0, 2.0, -3.0]), np.full(3, 4.0))
    fixed = BodyMotion(np.eye(4))
    antenna = moving(tuple(speed), radar)
    corners = np.array([[-5.0, 0, 0], [-5.0, 3, 0], [-5.0, 0, 2]])  # of the wall x = -5
    record = dataclasses.replace(BOTH, bodies=[1, 2])
    scene = FrameMotion(1.0, antenna, antenna, False, [fixed, rotor], images=[record, FLOOR])
    over, times_s = [(0, 1), (1, 1), (1, 0), (2, 2)], np.array([0.0, 0.4, 1.0])
    rows = rows_over(over, target)

    def length(image: tuple[int, int], time_s: float) -> float:
        a, b, c = later(corners, time_s)
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        total = 0.0
        for number in image:
            end = radar + speed * time_s
            if number:
                end = mirrored(end, np.array([0.0, 0.0, 1.0]), -1.0)
            if number == 1:
                end = mirrored(end, normal, float(a @ normal))
            total += float(np.linalg.norm(target - end))
        return total

    expected = np.array([[length(one, t) for t in times_s] for one in over])
    rows["length_m"] = expected[:, 0]
    motion = motion_of_rows(rows, scene)
    assert motion.moving.all()
    np.testing.assert_allclose(motion.lengths_m(times_s, slice(None)), expected, atol=1e-10)
    step_s = 1e-6
    slopes = [(length(one, step_s) - length(one, 0.0)) / (2 * step_s) for one in over]
    np.testing.assert_allclose(motion.range_rates_mps(), slopes, atol=2e-5)
    # with antennas that are stationary, the mirror alone changes the paths over it
    there = BodyMotion(antenna.pose)
    scene = FrameMotion(1.0, there, there, False, [fixed, rotor], images=[record, FLOOR])
    assert motion_of_rows(rows, scene).moving.tolist() == [True, True, True, False]


def test_lengths_follow_the_mirrored_antennas() -> None:
    start, speed = np.array([1.0, 2.0, 3.0]), np.array([3.0, -7.0, 0.5])
    target, target_speed = np.array([8.0, 30.0, 2.0]), np.array([-2.0, 1.0, 0.7])
    radar = moving(tuple(speed), start)
    scene = FrameMotion(
        1.0, radar, radar, False, [moving(tuple(target_speed), target)], images=[FLOOR]
    )
    rows = rows_over([(0, 1), (1, 1), (0, 0)], target)
    floor = np.array([0.0, 0.0, 1.0])
    times_s = np.array([0.0, 0.3, 1.0])

    def length(image: tuple[int, int], time_s: float) -> float:
        ends = [start + time_s * speed] * 2
        ends = [mirrored(e, floor, -1.0) if i else e for e, i in zip(ends, image, strict=True)]
        at = target + time_s * target_speed
        return float(sum(np.linalg.norm(at - end) for end in ends))

    expected = np.array([[length(i, t) for t in times_s] for i in ((0, 1), (1, 1), (0, 0))])
    rows["length_m"] = expected[:, 0]
    motion = motion_of_rows(rows, scene)
    np.testing.assert_allclose(motion.lengths_m(times_s, slice(None)), expected, atol=1e-9)
    rates = [(length(i, 1e-6) - length(i, 0.0)) / 2e-6 for i in ((0, 1), (1, 1), (0, 0))]
    np.testing.assert_allclose(motion.range_rates_mps(), rates, atol=1e-5)
    np.testing.assert_allclose(
        motion.select(np.array([1])).lengths_m(times_s, slice(None)), expected[1:2], atol=1e-9
    )


def test_unknown_images_are_named() -> None:
    rows = rows_over([(0, 2)], np.zeros(3))
    with pytest.raises(ConfigError, match="image 2, its sidecar has 1"):
        images_of(rows, [FLOOR])
    assert images_of(PathRows.zeros(1), [FLOOR]) is None


def over_ball(radar: np.ndarray, target: np.ndarray) -> tuple[float, np.ndarray]:
    """Length radar, ball of 2 m around the origin, target; and the plane at the reflection."""

    def length(x: np.ndarray) -> float:
        point = 2 * x / np.linalg.norm(x)
        return float(np.linalg.norm(point - radar) + np.linalg.norm(point - target))

    found = minimize(length, radar + target, method="BFGS", options={"gtol": 1e-12})
    normal = found.x / np.linalg.norm(found.x)
    return length(normal), np.array([*normal, 2.0])


def test_rates_over_a_ball() -> None:
    """Radar and target move: rates of the lengths are those over the exact ball."""
    radar, radar_speed = np.array([9.0, 1.0, 0.5]), np.array([1.0, -4.0, 2.0])
    target, speed = np.array([3.0, 8.0, -1.0]), np.array([-5.0, 2.0, 0.5])
    rows = PathRows.zeros(3, CURVED_IMAGE_DTYPE)
    rows["first_scatterer_m"] = rows["last_scatterer_m"] = target
    rows["transmitter_image"], rows["receiver_image"] = [-1, 0, -1], [0, -1, -1]
    rows["order"] = rows["last_body"] = rows["first_body"] = 1
    away, plane = over_ball(radar, target)
    rows["transmitter_plane"] = rows["receiver_plane"] = plane
    straight = float(np.linalg.norm(target - radar))
    rows["length_m"] = [away + straight, away + straight, 2 * away]
    antenna = moving(tuple(radar_speed), radar)
    scene = FrameMotion(1.0, antenna, antenna, False, [moving(tuple(speed), target)])
    motion = motion_of_rows(rows, scene)

    def at(time_s: float) -> np.ndarray:
        ends = radar + time_s * radar_speed, target + time_s * speed
        over, direct = over_ball(*ends)[0], float(np.linalg.norm(ends[0] - ends[1]))
        return np.array([over + direct, over + direct, 2 * over])

    rates = (at(1e-3) - at(-1e-3)) / 4e-3
    np.testing.assert_allclose(motion.range_rates_mps(), rates, atol=1e-5)
    np.testing.assert_allclose(motion.select(np.array([2])).range_rates_mps(), rates[2:], atol=1e-5)
    images = images_of(rows, [])
    assert images is not None
    other = images.select(np.array([1]))
    joined = images.join([other, None, images], [1, 2, 3])
    expected = np.concatenate([images.places(0, radar)[[1]], [radar] * 2, images.places(0, radar)])
    np.testing.assert_allclose(joined.places(0, radar), expected, rtol=1e-14)
    # the antenna's image is as far from the target as the way over the ball
    assert np.linalg.norm(expected[0] - target) == pytest.approx(away, rel=1e-12)


def test_curved_images_without_planes_are_named(tmp_path: Path) -> None:
    rows = rows_over([(0, -1)], np.zeros(3))
    with pytest.raises(ConfigError, match="belong together"):
        images_of(rows, [FLOOR])
    wide = PathRows.zeros(3, CURVED_IMAGE_DTYPE)
    wide["transmitter_plane"] = np.arange(12).reshape(3, 4)
    write_table(tmp_path / "paths.npz", [wide], 3, CURVED_IMAGE_DTYPE)
    groups = column_groups(CURVED_IMAGE_DTYPE.names or ())
    back = open_table(tmp_path / "paths.npz", groups)
    np.testing.assert_array_equal(back["transmitter_plane"], wide["transmitter_plane"])


def test_paths_of_one_point_interfere() -> None:
    """Four paths of a point, direct and over a mirror: |a + b|^4 by hand, others alone."""
    carrier_hz = 10e9
    wave = 2 * math.pi * carrier_hz / C0_MPS
    rows = PathRows.zeros(6, IMAGE_DTYPE)
    rows["point"] = [7, 0, 7, 7, 7, 9]
    way, ratio, turn = 0.0123, 0.8, 2.5
    rows["length_m"] = [100, 100.003, 100 + way, 100 + way, 100 + 2 * way, 100]
    rows["power_w"] = [1.0, 5.0, ratio**2, ratio**2, ratio**4, 3.0]
    rows["mirror_phase_rad"] = [0, 0, turn, turn, 2 * turn, 0]
    factors = interference_factors(rows, rows["power_w"], carrier_hz, 1e6)
    one_way = 1 + ratio * np.exp(1j * (turn - wave * way))
    of_point = rows["point"] == 7
    total = float(np.sum((rows["power_w"] * factors)[of_point]))
    assert total == pytest.approx(abs(one_way) ** 4, rel=1e-6)
    np.testing.assert_array_equal(factors[~of_point], 1.0)
    # Another tile or replicate is another point, and what range tells apart does not interfere.
    rows["replicate"][2:4] = 1
    rows["tile"][4] = 3
    apart = interference_factors(rows, rows["power_w"], carrier_hz, 1e6)
    pair = float(np.sum((rows["power_w"] * apart)[2:4]))
    assert pair == pytest.approx((2 * ratio) ** 2, rel=1e-9)
    assert apart[[0, 1, 4, 5]].tolist() == [1, 1, 1, 1]
    rows["replicate"] = rows["tile"] = 0
    rows["length_m"][4] += 40 * 0.5  # 40 range cells beyond
    resolved = interference_factors(rows, rows["power_w"], carrier_hz, 0.5, "hamming")
    assert resolved[4] == pytest.approx(1.0, abs=0.02)


def test_overlap_of_responses() -> None:
    """Two paths in phase, a fraction of a range cell apart: the sinc of a flat band."""
    rows = PathRows.zeros(2, IMAGE_DTYPE)
    rows["point"] = 1
    carrier_hz, resolution_m = 10e9, 0.75
    steps = round(0.4 * 2 * resolution_m / (C0_MPS / carrier_hz))
    apart_m = steps * C0_MPS / carrier_hz
    rows["length_m"] = [100.0, 100.0 + apart_m]
    rows["power_w"] = 1.0
    factors = interference_factors(rows, rows["power_w"], carrier_hz, resolution_m)
    expected = 1 + np.sinc(apart_m / (2 * resolution_m))
    np.testing.assert_allclose(factors, expected, rtol=1e-4)
    # a Hann taper on the amplitude: the transform of cos^4, 3/8 + cos(2 pi x)/2 + cos(4 pi x)/8
    for turns, overlap in ((1, 2 / 3), (2, 1 / 6), (3, 0.0)):
        cell_m = apart_m / (2 * turns)
        tapered = interference_factors(rows, rows["power_w"], carrier_hz, cell_m, "hann")
        np.testing.assert_allclose(tapered, 1 + overlap, atol=1e-4)


@pytest.mark.parametrize("sign", [1, -1])
def test_mirror_phase_is_that_of_echoes(sign: int) -> None:
    """A quarter wavelength more delays by 90 degrees: a mirror's +90 makes up for it, -90 makes the
    echoes cancel; so do the powers that are expected."""
    radar = Radar(pr.WAVEFORM, Burst(1000.0, 1))
    quarter_m = radar.waveform.wavelength_m / 4
    paths = dataclasses.replace(
        make_paths(np.array([1e-6, 1e-6]), np.array([1200.0, 1200.0 + quarter_m])),
        mirror_phase_rad=np.array([0.0, sign * math.pi / 2]),
    )
    alone, both = (
        np.abs(synthesize(one, radar, range_limits_m=(0.0, 700.0)).plane).max()
        for one in (paths.select(np.array([0])), paths)
    )
    assert both / alone == pytest.approx(1 + sign, abs=0.01)  # 25 MHz of 5.3 GHz
    rows = PathRows.zeros(2, IMAGE_DTYPE)
    rows["point"], rows["power_w"] = 1, 1e-6
    rows["length_m"], rows["mirror_phase_rad"] = paths.length_m, paths.mirror_phase_rad
    factors = interference_factors(rows, rows["power_w"], radar.waveform.carrier_hz, 3.0)
    np.testing.assert_allclose(factors, 1 + sign, atol=1e-4)
