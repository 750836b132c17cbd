# SPDX-License-Identifier: GPL-3.0-or-later
"""Echoes of what pixels cover: level ground at grazing incidence has no gaps between its rays."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.arrays import Real
from radarsim_addon.signal import (
    Burst,
    Radar,
    Waveform,
    expected_power_profile,
    make_paths,
    open_run,
    synthesize,
)
from radarsim_addon.signal.decoding import FrameInput, frame_paths, open_frame
from radarsim_addon.signal.maps import expected_power, range_process
from radarsim_addon.signal.motion import BodyMotion, FrameMotion, JoinedMotion, PathMotion
from radarsim_addon.signal.motion.body_motion import Segment
from radarsim_addon.signal.paths import PathRows, Paths, motion_of_rows, replicate_offset_px
from radarsim_addon.signal.paths.paths import path_power_w
from radarsim_addon.signal.scattering import FrameSpeckle, table_footprints
from tests.signal import path_runs as pr

HEIGHT_M, EIRP_W, SIZE_PX, REPLICATES = 0.5, 5.0, 128, 2
RADAR = Radar(Waveform(5.3e9, 150e6, 1e-6, 180e6), Burst(1000.0, 1))
WINDOW_M = (20.0, 150.0)
NEAR_M, FAR_M = 50, 100
CAMERA = pr.camera(pr.pose((0, 0, HEIGHT_M), 0, -2.0), 6.0)
EMITTER = contract.TransmitterRecord(CAMERA.matrix_world, EIRP_W)
GROUND = pr.Plate("Ground", (0, 600, 0), (2000, 0, 0), (0, 590, 0))


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> FrameInput:
    """The ground from 0.5 m above it: rows of pixels are up to 30 m apart at 100 m."""
    pitch, parts = (CAMERA.right - CAMERA.left) / SIZE_PX, []
    for number in range(REPLICATES):
        u, v = (pitch * x for x in replicate_offset_px(number))
        moved = dataclasses.replace(
            CAMERA, left=CAMERA.left + u, right=CAMERA.right + u, bottom=CAMERA.bottom + v,
            top=CAMERA.top + v,
        )  # fmt: skip
        rows = pr.trace([GROUND], moved, EMITTER, SIZE_PX)
        rows["power_w"] /= REPLICATES
        rows["solid_angle_sr"] /= REPLICATES
        rows["replicate"] = number
        parts.append(rows)
    folder = tmp_path_factory.mktemp("ground") / "run"
    pr.write_run(
        folder, PathRows.joined(parts), ["Ground"], CAMERA, EMITTER, range_limits_m=1400.0,
        replicates=REPLICATES,
    )  # fmt: skip
    return open_frame(open_run(folder).frame(1), radar=RADAR, range_limits_m=WINDOW_M)


def metre_bins(range_m: Real, power: Real) -> Real:
    """Mean power in each metre from 50 to 100 m."""
    number = np.floor(range_m).astype(int) - NEAR_M
    here = (number >= 0) & (number < FAR_M - NEAR_M)
    return np.asarray(np.bincount(number[here], power[here]) / np.bincount(number[here]))


def mean_power(paths: Paths) -> Real:
    """What the echoes of paths have on average over the speckle, by metres."""
    found = expected_power_profile(
        make_paths(paths.radiance, paths.length_m, solid_angle_sr=paths.solid_angle_sr),
        RADAR,
        range_limits_m=WINDOW_M,
    )
    return metre_bins(found.range_m, found.power)


def integrated() -> Real:
    """The same by integration over range and azimuth.

    A ring of ground dr wide at the slant range r has the solid angle h dr dphi / r^2; radiance of
    a Lambert surface lit by the emitter is E cos / (4 pi^2 r^2), cos = h / r.
    """
    step_m, azimuths = 0.05, np.radians(np.linspace(-9, 9, 601))
    range_m = np.arange(10.05, 250.0, step_m)[:, None]
    flat_m = np.sqrt(range_m**2 - HEIGHT_M**2)
    point = np.stack(
        np.broadcast_arrays(flat_m * np.sin(azimuths), flat_m * np.cos(azimuths), -HEIGHT_M), -1
    )
    local = point @ np.array(CAMERA.matrix_world)[:3, :3]
    u, v = local[..., 0] / -local[..., 2], local[..., 1] / -local[..., 2]
    seen = (u > CAMERA.left) & (u < CAMERA.right) & (v > CAMERA.bottom) & (v < CAMERA.top)
    solid_sr = seen.mean(axis=1) * np.ptp(azimuths) * HEIGHT_M * step_m / range_m[:, 0] ** 2
    radiance = EIRP_W * HEIGHT_M / (4 * math.pi**2 * range_m[:, 0] ** 3)
    return mean_power(make_paths(radiance, 2 * range_m[:, 0], solid_angle_sr=solid_sr))


def test_mean_of_the_echoes_has_no_comb(ground: FrameInput) -> None:
    paths, truth = frame_paths(ground), integrated()
    spread = FrameSpeckle(ground, 0).apply(paths)
    comb = mean_power(paths) / truth - 1
    assert np.sqrt(np.mean(comb**2)) > 0.5
    error = mean_power(spread) / truth - 1
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert abs(np.mean(error)) < 0.02


def test_echoes_themselves_have_none(ground: FrameInput) -> None:
    """Mean of |s|^2 over seeds; a metre has the standard error of so many exponential draws."""
    paths, seeds, total = frame_paths(ground), 8, 0.0
    for seed in range(seeds):
        spread = FrameSpeckle(ground, seed).apply(paths)
        echoes = synthesize(spread, RADAR, range_limits_m=WINDOW_M, speckle_seed=seed)
        found = range_process(echoes)
        total = total + metre_bins(found.range_m, np.abs(found.plane[0]) ** 2) / seeds
    ratio = total / integrated()
    sigma = 1 / math.sqrt(seeds)
    assert np.abs(ratio - 1).max() < 4.5 * sigma
    assert np.sqrt(np.mean((ratio - 1) ** 2)) < 1.3 * sigma
    assert abs(ratio.mean() - 1) < 4 * sigma / math.sqrt(ratio.size / 2)


def test_points_lie_on_the_surface_and_keep_the_power(ground: FrameInput) -> None:
    paths = frame_paths(ground)
    spread = FrameSpeckle(ground, 0).apply(paths)
    wavelength_m = RADAR.waveform.wavelength_m
    power, whole = path_power_w(spread, wavelength_m), path_power_w(paths, wavelength_m)
    assert power.sum() == pytest.approx(whole.sum(), rel=1e-12)
    by_row = np.bincount(spread.row, power, minlength=len(paths))
    np.testing.assert_allclose(by_row, whole, rtol=1e-12)
    geometry = spread.geometry
    assert geometry is not None
    place = geometry.last_scatterer_m
    assert np.array_equal(place, geometry.first_scatterer_m)
    assert np.abs(place[:, 2]).max() < 1e-9
    away = place - np.array([0, 0, HEIGHT_M])
    own_m = 2 * np.linalg.norm(away, axis=1)
    # paths over one scatterer have one length: the mean of their own over the power
    common_m, cell = np.unique(spread.length_m, return_inverse=True)
    mean_m = np.bincount(cell, power * own_m) / np.bincount(cell, power)
    np.testing.assert_allclose(common_m, mean_m, rtol=1e-12)
    assert 0.01 < np.abs(spread.length_m - own_m).max() < 2 * 0.125 * math.sqrt(3)
    ahead = away / np.linalg.norm(away, axis=1, keepdims=True)
    np.testing.assert_allclose(geometry.direction, ahead, atol=1e-6)
    # between 50 and 100 m points are a range resolution apart at most
    column = np.sort(own_m[np.abs(place[:, 0]) < 0.01 * place[:, 1]] / 2)
    column = column[(column > NEAR_M) & (column < FAR_M)]
    assert np.diff(column).max() < RADAR.waveform.range_resolution_m
    assert spread.phasors is not None and not np.isnan(spread.phasors).any()


def test_without_speckle_pixels_keep_their_phase(ground: FrameInput) -> None:
    paths = frame_paths(ground)
    assert FrameSpeckle(ground, None).apply(paths) is paths


def test_parts_and_the_whole_have_the_same_points(ground: FrameInput) -> None:
    """Whatever is asked for at a time: neighbours come from the table."""
    paths, speckle = frame_paths(ground), FrameSpeckle(ground, 3)
    whole = speckle.apply(paths)
    parts = Paths.join(speckle.apply(paths[n : n + 501]) for n in range(0, len(paths), 501))
    for name in ("row", "length_m", "solid_angle_sr"):
        assert np.array_equal(getattr(whole, name), getattr(parts, name))
    np.testing.assert_allclose(whole.phasors, parts.phasors, atol=1e-6)


@pytest.mark.parametrize("joined", [False, True])
def test_points_move_with_what_they_lie_on(ground: FrameInput, joined: bool) -> None:
    """A radar that drives 2 m ahead: the length of each point is that to its own scatterer."""
    pose = np.array(CAMERA.matrix_world)
    half_m, cell_m = np.array([0.0, 1.0, 0.0]), 0.01
    radar = BodyMotion(pose, (Segment(0.0, 0.1, np.stack([pose[:3, 3] + half_m, half_m])),))
    scene = FrameMotion(0.1, radar, radar, False, [BodyMotion(np.eye(4), ())])
    rows = ground.table.rows.copy()
    rows["last_body"] = rows["first_body"] = 1
    motion: PathMotion = motion_of_rows(rows, scene)
    if joined:  # as of a table that comes in several chunks
        middle = rows.size // 2
        motion = JoinedMotion((motion.select(slice(middle)), motion.select(slice(middle, None))))
    paths = dataclasses.replace(frame_paths(ground), motion=motion)
    found = FrameSpeckle(ground, 0, cell_m).apply(paths)
    assert len(found) > 2 * len(paths)
    assert found.geometry is not None
    for time_s, ahead_m in ((0.0, 0.0), (0.05, 1.0), (0.1, 2.0)):
        away = found.geometry.last_scatterer_m - [0.0, ahead_m, HEIGHT_M]
        length_m = found.lengths.lengths_m(np.array([time_s]), slice(None))[:, 0]
        # the scatterer of a point is in its cell
        assert np.abs(length_m - 2 * np.linalg.norm(away, axis=1)).max() < 4 * cell_m


def test_steps_of_the_expected_power_are_those_of_the_echoes(ground: FrameInput) -> None:
    """Found once a frame: the points have the same bits, and come again as they were."""
    table = ground.table
    own, handed = table_footprints(ground), table_footprints(ground)
    expected_power(ground, footprints=handed)
    assert len(handed._views) == table.record.replicates
    for numbers in (np.arange(table.rows.size), np.arange(3, table.rows.size, 7)):
        index, rows = own.points(numbers)
        assert index.size > 2 * numbers.size
        for again in (handed.points(numbers), handed.points(numbers), own.points(numbers)):
            assert (again[0] == index).all()
            assert all((again[1][name] == rows[name]).all() for name in table.rows.names)
