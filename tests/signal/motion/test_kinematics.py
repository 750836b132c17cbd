# SPDX-License-Identifier: GPL-3.0-or-later
"""Lengths of paths from the motion of bodies, against distances worked out directly."""

from __future__ import annotations

import dataclasses
import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.contract import MotionRecord
from radarsim_addon.errors import ConfigError, FrameFileError, SchemaError
from radarsim_addon.signal.motion import (
    BodyMotion,
    FrameMotion,
    Tracks,
    VertexSeries,
    body_record,
    read_motion,
    write_tracks,
)
from radarsim_addon.signal.motion.body_motion import Segment, rotation
from radarsim_addon.signal.motion.kinematics import leg_change
from radarsim_addon.signal.paths import PathRows, motion_of_rows
from radarsim_addon.typed_json import file_sha256, write_record

SPAN_S = 0.02
TIMES_S = np.linspace(0, SPAN_S, 7)


def body(
    place: tuple[float, float, float],
    velocity: tuple[float, float, float] = (0, 0, 0),
    spin: tuple[float, float, float] = (0, 0, 0),
) -> BodyMotion:
    """A body that moves and turns steadily; exact, no fit."""
    pose = np.eye(4)
    pose[:3, 3] = place
    if not (any(velocity) or any(spin)):
        return BodyMotion(pose)
    half = np.array(velocity) * SPAN_S / 2
    segment = Segment(
        0.0,
        SPAN_S,
        np.array([np.array(place) + half, half]),
        np.zeros(3),
        np.array([np.array(spin) * SPAN_S / 2]),
        np.eye(3),
    )
    return BodyMotion(pose, (segment,))


def carried(motion: BodyMotion, point: np.ndarray, time_s: float) -> np.ndarray:
    """Where a point of a steady body is, by its definition."""
    if not motion.segments:
        return point
    place = motion.pose[:3, 3]
    segment = motion.segments[0]
    velocity, spin = segment.translation[1] * 2 / SPAN_S, segment.rotation[0] * 2 / SPAN_S
    return rotation(spin * time_s) @ (point - place) + place + velocity * time_s


BODIES = [
    body((0, 0, 0)),
    body((5, 30, 1), (3, -20, 1)),
    body((-4, 25, 0), (0, 7, 0), (10, 40, -80)),
]
RECEIVER = body((0.1, 0, 2), (1, 30, 0), (0, 0, 3))
EMITTER = body((-0.2, 0, 2), (1, 30, 0))


def rows_of(*paths: tuple[list[tuple[float, float, float]], list[int]], excess: float = 0.0):  # type: ignore[no-untyped-def]
    """Rows whose vertices lie on bodies (numbers); `excess` is an optical delay."""
    rows = PathRows.zeros(len(paths))
    for at, (points, numbers) in enumerate(paths):
        row = rows[at : at + 1]
        way = [RECEIVER.pose[:3, 3], *map(np.array, points), EMITTER.pose[:3, 3]]
        row["length_m"] = excess + sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(way))
        row["order"] = len(points)
        row["first_scatterer_m"], row["last_scatterer_m"] = points[0], points[-1]
        row["first_body"], row["last_body"] = numbers[0], numbers[-1]
        row["direction"] = (way[1] - way[0]) / np.linalg.norm(way[1] - way[0])
    return rows


def true_lengths(
    points: list[tuple[float, float, float]], numbers: list[int], antennas: bool
) -> np.ndarray:
    """Lengths at all times, leg by leg."""
    lengths = []
    for time_s in TIMES_S:
        start, end = RECEIVER.pose[:3, 3], EMITTER.pose[:3, 3]
        if antennas:
            start, end = carried(RECEIVER, start, time_s), carried(EMITTER, end, time_s)
        way = [start]
        way += [
            carried(BODIES[n - 1], np.array(p), time_s)
            for p, n in zip(points, numbers, strict=True)
        ]
        way.append(end)
        lengths.append(sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(way)))
    return np.array(lengths)


def scene(antennas: bool, orthographic: bool = False) -> FrameMotion:
    """Three bodies, one of which is stationary."""
    still = (BodyMotion(RECEIVER.pose), BodyMotion(EMITTER.pose))
    receiver, emitter = (RECEIVER, EMITTER) if antennas else still
    return FrameMotion(SPAN_S, receiver, emitter, orthographic, BODIES)


PATHS = [
    ([(0.0, 20.0, 0.0)], [1]),
    ([(5.0, 29.0, 1.0)], [2]),
    ([(-4.0, 24.0, 0.5)], [3]),
    ([(5.0, 29.0, 1.0), (-4.0, 24.0, 0.5)], [2, 3]),
    ([(0.0, 20.0, 0.0), (-4.0, 24.0, 0.5)], [1, 3]),
    # a corner reflector: three vertices on one body, the middle one not in the table
    ([(-4.0, 24.0, 0.5), (-4.5, 25.0, 0.7), (-3.8, 25.3, 0.1)], [3, 3, 3]),
]


@pytest.mark.parametrize("antennas", [False, True])
@pytest.mark.parametrize("excess_m", [0.0, 3.7])
def test_lengths_of_all_orders(antennas: bool, excess_m: float) -> None:
    """Bistatic, with turning bodies, moving antennas and a delay in a wall."""
    motion = motion_of_rows(rows_of(*PATHS, excess=excess_m), scene(antennas))
    want = np.array([true_lengths(*path, antennas) for path in PATHS]) + excess_m
    np.testing.assert_allclose(motion.lengths_m(TIMES_S, slice(None)), want, atol=1e-12)
    assert motion.moving.tolist() == [antennas, True, True, True, True, True]
    assert not motion.approximated.any() and not motion.unknown.any()
    step_s = 1e-6
    ahead = motion.lengths_m(np.array([step_s]), slice(None))[:, 0]
    slope = (ahead - motion.length_m) / step_s / 2
    np.testing.assert_allclose(motion.range_rates_mps(), slope, atol=2e-2)


def test_at_the_frames_time_it_is_the_tables_length() -> None:
    motion = motion_of_rows(rows_of(*PATHS), scene(True))
    assert np.array_equal(motion.lengths_m(np.zeros(1), slice(None))[:, 0], motion.length_m)


def test_rows_and_selection_agree() -> None:
    motion = motion_of_rows(rows_of(*PATHS), scene(True))
    every = motion.lengths_m(TIMES_S, slice(None))
    some = np.array([4, 1, 1, 3])
    np.testing.assert_array_equal(motion.lengths_m(TIMES_S, some), every[some])
    np.testing.assert_array_equal(
        motion.select(some).lengths_m(TIMES_S, slice(1, 3)), every[some][1:3]
    )
    mask = motion.length_m > 50
    np.testing.assert_array_equal(motion.lengths_m(TIMES_S, mask), every[mask])


def test_blocks_do_not_change_lengths(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = motion_of_rows(rows_of(*PATHS), scene(True))
    every = motion.lengths_m(TIMES_S, slice(None))
    monkeypatch.setattr("radarsim_addon.signal.motion.kinematics._BLOCK", 8)
    np.testing.assert_allclose(motion.lengths_m(TIMES_S, slice(None)), every, atol=1e-14)


def test_orthographic_receivers_measure_from_their_plane() -> None:
    """Crossing along the plane changes nothing of the first leg, turning the plane does."""
    rows = rows_of(([(5.0, 29.0, 1.0)], [2]))
    rows["direction"] = (0, 1, 0)
    times = np.array([SPAN_S])
    moved = carried(BODIES[1], np.array([5.0, 29.0, 1.0]), SPAN_S)
    still = motion_of_rows(rows, scene(False, True)).lengths_m(times, slice(None))[0, 0]
    back = [np.linalg.norm(p - EMITTER.pose[:3, 3]) for p in (rows["last_scatterer_m"][0], moved)]
    assert still - rows["length_m"][0] == pytest.approx(-20 * SPAN_S + back[1] - back[0], abs=1e-12)
    turning = motion_of_rows(rows, scene(True, True))
    bore = rotation(np.array([0, 0, 3.0]) * SPAN_S) @ [0, 1, 0]
    receiver, emitter = (
        carried(antenna, antenna.pose[:3, 3], SPAN_S) for antenna in (RECEIVER, EMITTER)
    )
    first = bore @ (moved - receiver) - (29.0 - RECEIVER.pose[1, 3])
    want = first + np.linalg.norm(moved - emitter) - back[0]
    found = turning.lengths_m(times, slice(None))[0, 0] - rows["length_m"][0]
    assert found == pytest.approx(want, abs=1e-12)
    step_s = 1e-6
    ahead = turning.lengths_m(np.array([step_s]), slice(None))[:, 0]
    slope = (ahead - rows["length_m"]) / step_s / 2
    np.testing.assert_allclose(turning.range_rates_mps(), slope, atol=1e-2)


def test_what_is_not_known_is_counted() -> None:
    rows = rows_of(
        ([(5.0, 29.0, 1.0), (0.0, 20.0, 0.0), (-4.0, 24.0, 0.5)], [2, 1, 3]),
        ([(5.0, 29.0, 1.0), (0.0, 20.0, 0.0)], [2, 0]),
        ([(5.0, 29.0, 1.0), (0.0, 20.0, 0.0)], [2, 1]),
    )
    rows["first_scatterer_m"][2] = np.nan
    motion = motion_of_rows(rows, scene(True))
    assert motion.approximated.tolist() == [True, False, False]
    assert motion.unknown.tolist() == [False, True, True]
    assert motion.moving.tolist() == [True, True, False]
    assert np.ptp(motion.lengths_m(TIMES_S, slice(None))[2]) == 0
    assert motion.range_rates_mps()[2] == 0


def test_changes_far_away_do_not_cancel() -> None:
    """A nanometre at 1000 km."""
    change = leg_change(np.array([[0, 1e6, 0.0]]), np.array([[[0, 1e-9, 0], [1e-3, 0, 0]]]))
    np.testing.assert_allclose(change, [[1e-9, 1e-6 / 2e6]], rtol=1e-9)


def test_times_outside_the_burst() -> None:
    motion = motion_of_rows(rows_of(*PATHS), scene(True))
    with pytest.raises(ConfigError, match=r"sampled from 0 to 0\.02 s"):
        motion.lengths_m(np.array([0.03]), slice(None))


def test_numbers_that_are_not_there() -> None:
    rows = rows_of(*PATHS)
    rows["last_body"][0] = 9
    with pytest.raises(ConfigError, match="names last_body 9, the motion file has 3"):
        motion_of_rows(rows, scene(True))
    rows = rows_of(*PATHS)
    rows["last_surface_point"][0] = 1
    with pytest.raises(ConfigError, match="last_surface_point"):
        motion_of_rows(rows, scene(True))


# -- files -----------------------------------------------------------------------------------------


def tracks() -> Tracks:
    """One track on the second body: a face whose corners move apart."""
    series = np.zeros((1, 2, 3, 3))
    series[0, 0] = [(0, -1, 0), (1, -1, 0), (0, -1, 1)]
    series[0, 1] = [(0, 0.01, 0), (0, 0.02, 0), (0, 0.03, 0)]
    return Tracks(
        np.array([2], dtype=np.int32),
        np.array([[0, 1, 2]], dtype=np.int32),
        np.array([[0.5, 0.25, 0.25]]),
        {2: VertexSeries(np.array([0.0, SPAN_S]), series)},
    )


def written(folder: Path) -> str:
    """A motion file with tracks; returns its hash."""
    path = write_tracks(folder, tracks())
    record = MotionRecord(
        frame=1,
        time_s=0.0,
        duration_s=SPAN_S,
        samples=17,
        receiver_kind="perspective",
        antennas=[body_record("C", "", RECEIVER, False), body_record("T", "", EMITTER, False)],
        bodies=[body_record(f"B{n}", "", b, n == 1) for n, b in enumerate(BODIES)],
        displacement_error_bound_m=0.0,
        displacement_error_bound_wavelengths=0.0,
        approximated_motion_fraction=0.0,
        unknown_motion_fraction=0.0,
        deforming_surfaces_file=path.name,
        deforming_surfaces_sha256=file_sha256(path),
    )
    write_record(folder / contract.MOTION_FILE, record)
    return file_sha256(folder / contract.MOTION_FILE)


def test_files_hold_all_of_it(tmp_path: Path) -> None:
    read = read_motion(tmp_path, 1, written(tmp_path))
    rows = rows_of(*PATHS)
    want = motion_of_rows(rows, scene(True)).lengths_m(TIMES_S, slice(None))
    np.testing.assert_array_equal(motion_of_rows(rows, read).lengths_m(TIMES_S, slice(None)), want)


def test_tracks_move_with_face_and_body(tmp_path: Path) -> None:
    read = read_motion(tmp_path, 1, written(tmp_path))
    point = BODIES[1].pose[:3, 3] + (0.25, -1.0 - 0.0175, 0.25)
    rows = rows_of(([tuple(point)], [2]))
    rows["last_surface_point"] = rows["first_surface_point"] = 1
    motion = motion_of_rows(rows, read)
    assert motion.moving.all()
    lengths = motion.lengths_m(TIMES_S, slice(None))[0]
    for time_s, length_m in zip(TIMES_S, lengths, strict=True):
        along = 0.0175 * 2 * time_s / SPAN_S
        now = carried(BODIES[1], point, time_s) + np.array([0, along, 0])
        want = np.linalg.norm(now - carried(RECEIVER, RECEIVER.pose[:3, 3], time_s))
        want += np.linalg.norm(now - carried(EMITTER, EMITTER.pose[:3, 3], time_s))
        assert length_m == pytest.approx(want, abs=1e-12)
    ahead = motion.lengths_m(np.array([1e-6]), slice(None))[:, 0]
    slope = (ahead - rows["length_m"]) / 2e-6
    np.testing.assert_allclose(motion.range_rates_mps(), slope, atol=2e-3)


def test_points_on_a_deforming_body_that_turns() -> None:
    """Velocity v + w x p + dp/dt, and the same in the lengths: antennas are stationary."""
    bends = tracks()
    bends = dataclasses.replace(
        bends, body=np.array([3], dtype=np.int32), series={3: bends.series[2]}
    )
    motion = BODIES[2]
    local = np.array([0.25, -1.0 - 0.0175, 0.25])
    point = motion.pose[:3, 3] + local
    rows = rows_of(([tuple(point)], [3]))
    rows["last_surface_point"] = rows["first_surface_point"] = 1
    found = motion_of_rows(rows, dataclasses.replace(scene(False), tracks=bends))
    antennas = RECEIVER.pose[:3, 3], EMITTER.pose[:3, 3]
    bend = np.array([0, 0.0175 * 2 / SPAN_S, 0])
    velocity = np.array([0, 7, 0]) + np.cross([10, 40, -80], local) + bend
    rate_mps = sum(velocity @ (point - at) / np.linalg.norm(point - at) for at in antennas) / 2
    assert found.range_rates_mps()[0] == pytest.approx(rate_mps, rel=1e-12)
    lengths = found.lengths_m(TIMES_S, slice(None))[0]
    for time_s, length_m in zip(TIMES_S, lengths, strict=True):
        now = carried(motion, point + bend * time_s, time_s)
        want = sum(np.linalg.norm(now - at) for at in antennas)
        assert length_m == pytest.approx(want, abs=1e-12)


def test_a_deforming_point_is_where_a_later_render_saw_it() -> None:
    """Rows of a render in the middle of the burst have their lengths there."""
    epoch_s, bend_mps = SPAN_S / 2, 0.0175 * 2 / SPAN_S
    still = [BODIES[0], BodyMotion(BODIES[1].pose), BODIES[2]]
    point = BODIES[1].pose[:3, 3] + (0.25, -1.0 - 0.0175 + bend_mps * epoch_s, 0.25)
    rows = rows_of(([tuple(point)], [2]))
    rows["last_surface_point"] = rows["first_surface_point"] = 1
    later = dataclasses.replace(scene(False), bodies=still, tracks=tracks(), epoch_offset_s=epoch_s)
    lengths = motion_of_rows(rows, later).lengths_m(TIMES_S, slice(None))[0]
    for time_s, length_m in zip(TIMES_S, lengths, strict=True):
        now = point + np.array([0, bend_mps * (time_s - epoch_s), 0])
        want = sum(np.linalg.norm(now - end.pose[:3, 3]) for end in (RECEIVER, EMITTER))
        assert length_m == pytest.approx(want, abs=1e-12)


def test_damaged_files_are_named(tmp_path: Path) -> None:
    digest = written(tmp_path)
    with pytest.raises(SchemaError, match="does not belong"):
        read_motion(tmp_path, 2, digest)
    with pytest.raises(SchemaError, match="does not belong"):
        read_motion(tmp_path, 1, "0" * 64)
    npz = tmp_path / contract.DEFORMING_SURFACES_FILE
    data = npz.read_bytes()
    npz.write_bytes(data[:-100])
    with pytest.raises(
        FrameFileError, match=r"cannot be read as deforming.*\. Render the run again: "
    ):
        read_motion(tmp_path, 1, digest)
    npz.unlink()
    with pytest.raises(FrameFileError, match=r"is missing\. Render the run again: "):
        read_motion(tmp_path, 1, digest)
    write_tracks(tmp_path, dataclasses.replace(tracks(), weights=np.zeros((1, 3))))
    with pytest.raises(SchemaError, match=r"was changed, or .*frame\. Render the run again: "):
        read_motion(tmp_path, 1, digest)
    write_tracks(tmp_path, dataclasses.replace(tracks(), vertices=np.array([[0, 1, 7]], np.int32)))
    with pytest.raises(FrameFileError, match="vertices up to 7"):
        read_motion(tmp_path, 1, digest)
    edges = VertexSeries(np.array([False, True]), tracks().series[2].series[:1])
    write_tracks(tmp_path, dataclasses.replace(tracks(), series={2: edges}))
    with pytest.raises(FrameFileError, match="edges_s_2 holds values of type bool"):
        read_motion(tmp_path, 1, digest)


def test_no_pickle_in_tracks(tmp_path: Path) -> None:
    digest = written(tmp_path)
    path = tmp_path / contract.DEFORMING_SURFACES_FILE
    np.savez(path, track_body=np.array([{}], dtype=object))
    with pytest.raises(FrameFileError, match="objects"):
        read_motion(tmp_path, 1, digest)


def test_speed_is_of_use() -> None:
    """A rate in closed form: a rotor's tip at 50 m/s towards the radar."""
    rotor = body((0, 10, 0), spin=(0, 0, 100))
    still = BodyMotion(np.eye(4))
    frame = FrameMotion(SPAN_S, still, still, False, [rotor])
    rows = PathRows.zeros(1)
    rows["order"], rows["last_body"] = 1, 1
    rows["last_scatterer_m"], rows["length_m"] = (0.5, 10, 0), 2 * math.hypot(0.5, 10)
    want = 50 * 10 / math.hypot(0.5, 10)
    assert motion_of_rows(rows, frame).range_rates_mps()[0] == pytest.approx(want, rel=1e-12)
