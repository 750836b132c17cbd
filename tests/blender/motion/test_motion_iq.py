# SPDX-License-Identifier: GPL-3.0-or-later
"""I/Q of moving scenes through Blender's animation, against echoes in continuous time."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
import pytest

from radarsim_addon.signal.radar import Burst
from tests.blender import motion_helpers as mh

FPS = 24.0
CASES = [(77e9, 10.0), (77e9, 100.0), (5.3e9, 10.0), (5.3e9, 100.0)]
NAMES = ["77 GHz 10 m", "77 GHz 100 m", "5.3 GHz 10 m", "5.3 GHz 100 m"]
BURST = Burst(10_000.0, 256)
WITHIN = 1e-3

cases = pytest.mark.parametrize(("carrier_hz", "distance_m"), CASES, ids=NAMES)


@cases
def test_static(tmp_path: Path, carrier_hz: float, distance_m: float) -> None:
    mh.scene_at(distance_m, 2.0)
    mh.facets("Target", [(0, distance_m, 0), (0.5, distance_m + 1, 0.3)], 0.6)
    rows, paths, _run = mh.measured(tmp_path, carrier_hz, BURST)
    assert not paths.lengths.moving.any()
    error = mh.iq_error(
        rows, paths, carrier_hz, BURST, lambda p, t: np.repeat(p[:, None], len(t), axis=1)
    )
    assert error < 1e-6
    assert np.all(rows["range_rate_mps"] == 0)


@cases
def test_constant_velocity_over_range_cells(
    tmp_path: Path, carrier_hz: float, distance_m: float
) -> None:
    """Four range cells in one burst, and across: keyed by two keyframes."""
    burst = Burst(2000.0, 256)
    velocity = np.array([3.1, 30.7, -2.3])
    mh.scene_at(distance_m, 2.0)
    target = mh.facets("Target", [(0.0, 0.0, 0.0), (0.4, 0.5, 0.3)], 0.5)
    start = np.array([0.0, distance_m, 0.0])
    mh.key(target, "location", (1, start), (25, start + velocity))
    mh.interpolation(target, "LINEAR")
    rows, paths, _run = mh.measured(tmp_path, carrier_hz, burst)
    assert rows.size > 20
    assert np.ptp(paths.lengths.lengths_m(np.array([0.0, 0.128]), slice(None))[0]) > 6.0

    def motion(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        return points[:, None] + times_s[:, None] * velocity

    error = mh.iq_error(rows, paths, carrier_hz, burst, motion)
    assert error < WITHIN, error
    want = rows["direction"] @ velocity
    bin_mps = 299_792_458.0 / carrier_hz * burst.prf_hz / (2 * burst.pulses)
    assert np.abs(rows["range_rate_mps"] - want).max() < 1e-3 * bin_mps
    assert bpy.context.scene.frame_current == 1


@cases
def test_constant_acceleration(tmp_path: Path, carrier_hz: float, distance_m: float) -> None:
    """Keyed with quadratic interpolation; the burst begins while it moves already."""
    mh.scene_at(distance_m, 2.0)
    target = mh.facets("Target", [(0.0, 0.0, 0.0), (0.4, 0.5, 0.3)], 0.5)
    # from frame 1 on over a second: y = start + 60 (t - t1)^2
    rise = 60.0
    back = rise * (6 / FPS) ** 2
    mh.key(
        target, "location", (1, (0, distance_m - back, 0)), (25, (0, distance_m - back + rise, 0))
    )
    mh.interpolation(target, "QUAD")
    rows, paths, _run = mh.measured(tmp_path, carrier_hz, BURST, frame=7)

    def motion(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        along = rise * ((times_s + 6 / FPS) ** 2 - (6 / FPS) ** 2)
        return points[:, None] + along[:, None] * np.array([0.0, 1.0, 0.0])

    error = mh.iq_error(rows, paths, carrier_hz, BURST, motion)
    assert error < WITHIN, error


@cases
def test_rotor_of_two_blades(tmp_path: Path, carrier_hz: float, distance_m: float) -> None:
    """Tips at 50 m/s, keyed by two keyframes that go on for ever."""
    radius, tip_mps = 0.5, 50.0
    mh.scene_at(distance_m, 1.6)
    rotor = mh.facets("Rotor", [(r, 0.0, 0.0) for r in (-0.5, -0.3, -0.15, 0.15, 0.3, 0.5)], 0.12)
    rotor.location = (0.0, distance_m, 0.0)
    mh.key(rotor, "rotation_euler", (1, (0, 0, 0.0)), (2, (0, 0, tip_mps / radius / FPS)))
    mh.interpolation(rotor, "LINEAR", "LINEAR")
    rows, paths, _run = mh.measured(tmp_path, carrier_hz, BURST, width_px=32, height_px=32)
    assert rows.size > 20

    def motion(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        return mh.turned(points, (0, distance_m, 0), 2, tip_mps / radius * times_s)

    error = mh.iq_error(rows, paths, carrier_hz, BURST, motion)
    assert error < WITHIN, error
    spin = np.cross([0, 0, tip_mps / radius], rows["last_scatterer_m"] - (0, distance_m, 0))
    want = np.sum(spin * rows["direction"], axis=1)
    bin_mps = 299_792_458.0 / carrier_hz * BURST.prf_hz / (2 * BURST.pulses)
    assert np.ptp(want) > 10
    assert np.abs(rows["range_rate_mps"] - want).max() < 1e-3 * bin_mps


@cases
def test_swinging_limb(tmp_path: Path, carrier_hz: float, distance_m: float) -> None:
    """A forearm that hangs from an elbow that hangs from a shoulder; both swing like sines."""
    mh.scene_at(distance_m, 2.4)
    shoulder = mh.empty("Shoulder", (0.0, distance_m, 0.5))
    elbow = mh.empty("Elbow", (0.0, 0.0, -0.4), shoulder)
    limb = mh.facets("Forearm", [(0.0, 0.0, -0.3), (0.05, 0.0, -0.6)], 0.2)
    limb.parent = elbow
    swing = math.radians(35)
    for joint, part in ((shoulder, 1.0), (elbow, 0.6)):
        mh.key(joint, "rotation_euler", (1, (-swing * part, 0, 0)), (13, (swing * part, 0, 0)))
        mh.interpolation(joint, "SINE")
    rows, paths, _run = mh.measured(tmp_path, carrier_hz, BURST, frame=5)

    def angle(times_s: np.ndarray, part: float) -> np.ndarray:
        return -swing * part * np.cos(np.pi * (times_s + 4 / FPS) / (12 / FPS))

    def motion(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        # into the forearm's own axes at t = 0, and out of them at t
        start = np.zeros(1)
        own = mh.turned(points, (0, distance_m, 0.5), 0, -angle(start, 1.0))[:, 0]
        own = mh.turned(own, (0, distance_m, 0.1), 0, -angle(start, 0.6))[:, 0]
        moved = np.empty((len(points), len(times_s), 3))
        for number, time_s in enumerate(times_s):
            at = np.array([time_s])
            bent = mh.turned(own, (0, distance_m, 0.1), 0, angle(at, 0.6))[:, 0]
            moved[:, number] = mh.turned(bent, (0, distance_m, 0.5), 0, angle(at, 1.0))[:, 0]
        return moved

    error = mh.iq_error(rows, paths, carrier_hz, BURST, motion)
    assert np.abs(rows["range_rate_mps"]).max() > 0.5
    assert error < WITHIN, error
