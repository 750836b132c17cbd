# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving targets of a radar that drives or turns: stationary clutter has a Doppler and is none."""

import dataclasses

import numpy as np
import pytest

from radarsim_addon.signal import (
    Burst,
    FmcwWaveform,
    Paths,
    Peak,
    Radar,
    make_paths,
    range_doppler,
    range_process,
    synthesize,
)
from radarsim_addon.signal.detection import DopplerFolds, find_moving_targets
from radarsim_addon.signal.motion import BodyMotion, FrameMotion
from radarsim_addon.signal.motion.body_motion import Segment
from radarsim_addon.signal.paths import PathRows, motion_of_rows

RADAR = Radar(FmcwWaveform(77e9, 150e6, 128, 20e6), Burst(30e3, 128))
SPAN_S = 128 / 30e3
Vector = tuple[float, float, float]
#: Place [m], velocity over ground [m/s], level over one point of clutter [dB].
Target = tuple[Vector, Vector, float]
ONCOMING: Target = ((2.0, 42.0, 0.0), (0.0, -14.0, 0.0), 30.0)
AHEAD: Target = ((-1.0, 27.0, 0.0), (0.0, 13.0, 0.0), 30.0)
SAME_SPEED: Target = ((-2.0, 60.0, 0.0), (0.0, 10.0, 0.0), 30.0)


def body(place_m: Vector, velocity_mps: Vector, spin_radps: float = 0.0, arm_m: float = 0.0):  # type: ignore[no-untyped-def]
    """A body that moves steadily and turns about a vertical axis, `arm_m` behind its origin."""
    pose = np.eye(4)
    pose[:3, 3] = place_m
    start = np.array(place_m) - [0.0, arm_m, 0.0]
    half = np.array(velocity_mps) * SPAN_S / 2
    turn = np.array([[0.0, 0.0, spin_radps * SPAN_S / 2]]) if spin_radps else np.empty((0, 3))
    centre = np.array([0.0, arm_m, 0.0])
    moves = spin_radps or any(velocity_mps)
    segment = Segment(0.0, SPAN_S, np.stack([start + half, half]), centre, turn)
    return BodyMotion(pose, (segment,) if moves else ())


STATIONARY = body((0.0, 0.0, 0.6), (0.0, 0.0, 0.0))
DRIVING = body((0.0, 0.0, 0.6), (0.0, 10.0, 0.0))
TURNING = body((0.0, 0.0, 0.6), (0.0, 10.0, 0.0), 0.6, 3.0)
SPINNING = body((0.0, 0.0, 0.6), (0.0, 0.0, 0.0), 6.0)
radars = pytest.mark.parametrize(
    "platform", [STATIONARY, DRIVING, TURNING, SPINNING], ids=["still", "drives", "turns", "spins"]
)


def paths_of(platform: BodyMotion, targets: list[Target], clutter: int = 2000) -> Paths:
    """Paths of one reflection: points of clutter in a sector of 60 degrees, and the targets."""
    rng = np.random.default_rng(1)
    range_m, azimuth = rng.uniform(5.0, 90.0, clutter), np.radians(rng.uniform(-30, 30, clutter))
    ground = np.stack([range_m * np.sin(azimuth), range_m * np.cos(azimuth), 0 * range_m], axis=1)
    places = np.concatenate([ground, np.array([t[0] for t in targets]).reshape(-1, 3)])
    bodies = [body((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), *(body(p, v) for p, v, _ in targets)]
    rows = PathRows.zeros(len(places))
    rows["order"], rows["first_scatterer_m"], rows["last_scatterer_m"] = 1, places, places
    number = np.concatenate([np.ones(clutter, int), 2 + np.arange(len(targets))])
    rows["first_body"] = rows["last_body"] = number
    rows["length_m"] = 2 * np.linalg.norm(places - platform.pose[:3, 3], axis=1)
    scene = FrameMotion(SPAN_S, platform, platform, False, bodies)
    motion = motion_of_rows(rows, scene)
    level_db = np.concatenate([np.zeros(clutter), [t[2] for t in targets]])
    paths = make_paths(10 ** (level_db / 10), rows["length_m"], motion.range_rates_mps())
    return dataclasses.replace(paths, motion=motion)


def found_in(paths: Paths) -> list[Peak]:
    folds = DopplerFolds(RADAR)
    for part in (paths[:1500], paths[1500:]):
        folds.add(part)
    echoes = synthesize(paths, RADAR, range_limits_m=(0.0, 95.0))
    rd_map = range_doppler(range_process(echoes, "hamming"), "hamming")
    return folds.unfolded(find_moving_targets(echoes, rd_map, folds=folds))


def expect(found: list[Peak], paths: Paths, count: int) -> None:
    """The last `count` paths, each once, at their range in the middle and their range rate."""
    rates = paths.range_rate_mps[-count:]
    middle_m = paths.range_m[-count:] + rates * SPAN_S / 2
    coupling_s = RADAR.waveform.duration_s * 77e9 / 150e6
    pairs = sorted(zip(middle_m + rates * coupling_s, rates, strict=True))
    shown = sorted((peak.range_m, peak.velocity_mps) for peak in found)
    assert len(shown) == count, shown
    for (range_m, rate_mps), (at_m, at_mps) in zip(pairs, shown, strict=True):
        assert at_m == pytest.approx(range_m, abs=0.1)
        assert at_mps == pytest.approx(rate_mps, abs=0.3 * RADAR.velocity_resolution_mps)


@radars
@pytest.mark.parametrize("targets", [[ONCOMING], [ONCOMING, AHEAD]], ids=["one", "two"])
def test_moving_objects_are_listed_and_nothing_else(
    platform: BodyMotion, targets: list[Target]
) -> None:
    paths = paths_of(platform, targets)
    expect(found_in(paths), paths, len(targets))


@radars
def test_stationary_clutter_is_no_moving_target(platform: BodyMotion) -> None:
    """Also where it has a Doppler: the peaks of the map are clutter."""
    paths = paths_of(platform, [])
    assert found_in(paths) == []
    echoes = synthesize(paths, RADAR, range_limits_m=(0.0, 95.0))
    rd_map = range_doppler(range_process(echoes, "hamming"), "hamming")
    moves = platform is DRIVING or platform is TURNING
    assert bool(find_moving_targets(echoes, rd_map)) == moves  # without the paths


def test_a_car_as_fast_as_the_radar_is_listed_at_0_hz() -> None:
    paths = paths_of(DRIVING, [SAME_SPEED, AHEAD])
    expect(found_in(paths), paths, 2)
    assert abs(found_in(paths)[0].doppler_hz) < 150.0 or abs(found_in(paths)[1].doppler_hz) < 150.0
    # for a stationary radar 0 Hz is what does not move
    still = paths_of(STATIONARY, [((-2.0, 60.0, 0.0), (0.0, 0.0, 0.0), 30.0), AHEAD])
    expect(found_in(still), still, 1)


@pytest.mark.parametrize(("level_db", "listed"), [(30.0, True), (-20.0, False)])
def test_a_walker_in_the_clutter_is_listed_where_it_is_stronger(
    level_db: float, listed: bool
) -> None:
    """It crosses the street, so it has nearly the Doppler of the ground next to it."""
    paths = paths_of(DRIVING, [((3.0, 30.0, 0.0), (1.4, 0.0, 0.0), level_db)], clutter=4000)
    if listed:
        expect(found_in(paths), paths, 1)
    else:
        assert found_in(paths) == []


def test_a_weak_target_between_clutter_and_its_sidelobes() -> None:
    """Clutter 70 dB stronger in the same range cell: a peak there would be its sidelobe."""
    strong = ((0.0, 42.0, 0.0), (0.0, 0.0, 0.0), 50.0)
    paths = paths_of(DRIVING, [((2.0, 42.0, 0.0), (0.0, -14.0, 0.0), -20.0), strong], clutter=1500)
    assert found_in(paths) == []
    paths = paths_of(DRIVING, [strong, ONCOMING], clutter=1500)
    expect(found_in(paths), paths, 1)


def test_of_a_range_rate_alone_it_is_not_known_who_moves() -> None:
    """Rings: all that has a Doppler is listed."""
    paths = dataclasses.replace(paths_of(DRIVING, [AHEAD], clutter=3), motion=None)
    folds = DopplerFolds(RADAR)
    folds.add(paths)
    assert not folds.radar_moves
    assert len(found_in(paths)) == 4
