# SPDX-License-Identifier: GPL-3.0-or-later
"""Path table: range rate from two passes (Eq. 12), flags, power and amplitude."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import typed_json
from radarsim_addon.errors import ConfigError, SchemaError
from radarsim_addon.signal import (
    PathFlag,
    Paths,
    frame_paths,
    iter_path_chunks,
    make_paths,
    open_run,
    path_amplitude,
    path_power_w,
    pixel_grid,
)
from tests.signal.synthetic import Setup, empty, points, write_run

SETUP = Setup()
#: What float32 costs a range rate: four roundings of 3e-8, k/2 each, over 10 ms.
RATE_SLACK_MPS = 4 * 3e-8 * SETUP.range_encoding_length_m / 2 / SETUP.snapshot_interval_s * 1.5


def test_receding_is_positive_approaching_negative_standing_still_exactly_zero(
    tmp_path: Path,
) -> None:
    echoes = [(1, 1, 300.0, 10.0, 2.0), (2, 2, 400.0, -7.0, 1.0), (3, 3, 123.4, 0.0, 1.0)]
    run = open_run(write_run(tmp_path, SETUP, points(SETUP, echoes)))
    paths = frame_paths(run.frame(1))
    order = np.argsort(paths.row)
    assert paths.row[order].tolist() == [1, 2, 3]
    assert paths.ring[order].tolist() == [1, 1, 0]
    np.testing.assert_allclose(paths.range_m[order], [300.0, 400.0, 123.4], atol=1e-4)
    np.testing.assert_allclose(paths.range_rate_mps[order], [10.0, -7.0, 0.0], atol=RATE_SLACK_MPS)
    assert paths.range_rate_mps[order][2] == 0.0
    assert not paths.flags.any()
    grid = pixel_grid(SETUP.camera(), SETUP.width_px, SETUP.height_px)
    np.testing.assert_array_equal(paths.solid_angle_sr, grid.solid_angle_sr[paths.row, paths.col])
    np.testing.assert_allclose(paths.radiance[order], [2.0, 1.0, 1.0], rtol=1e-7)


@pytest.mark.parametrize("frame", [0, 1, 32, 250, 10_000, -1, -32, -10_000])
def test_rates_at_any_frame_are_those_of_the_times_blender_evaluates(
    tmp_path: Path, frame: int
) -> None:
    """At frame 10 000 Blender renders 10 ms as 10.0098 ms: 0.04 m/s of a rate of 40 m/s."""
    setup = dataclasses.replace(SETUP, frames=(frame,))
    run = open_run(write_run(tmp_path, setup, points(setup, [(1, 1, 300.0, 40.0, 2.0)])))
    (rate_mps,) = frame_paths(run.frame(frame)).range_rate_mps
    assert rate_mps == pytest.approx(40.0, abs=RATE_SLACK_MPS)


@pytest.mark.parametrize(("start_m", "rate_mps"), [(499.95, 10.0), (500.05, -10.0)])
def test_echo_that_crossed_into_the_neighbouring_ring(
    tmp_path: Path, start_m: float, rate_mps: float
) -> None:
    run = open_run(write_run(tmp_path, SETUP, points(SETUP, [(4, 4, start_m, rate_mps, 1.0)])))
    paths = frame_paths(run.frame(1))
    assert len(paths) == 1
    assert paths.range_rate_mps[0] == pytest.approx(rate_mps, abs=RATE_SLACK_MPS)
    assert paths.flags[0] == PathFlag.CROSSED_SHELL
    assert paths.counts.crossed_shell == 1


def test_neighbour_that_was_there_before_is_not_taken(tmp_path: Path) -> None:
    """The target of ring 1 vanishes; what stands in ring 2 at the same pixel stood there at t."""

    def picture(frame: int, ring: int, snapshot_index: int) -> tuple[np.ndarray, np.ndarray]:
        range_m, radiance = empty(SETUP)
        if ring == 2 or (ring == 1 and snapshot_index == 0):
            range_m[5, 5], radiance[5, 5] = (499.5 if ring == 1 else 501.0), 1.0
        return range_m, radiance

    paths = frame_paths(open_run(write_run(tmp_path, SETUP, picture)).frame(1))
    assert paths.ring.tolist() == [1, 2]
    assert paths.flags.tolist() == [PathFlag.SINGLE_SNAPSHOT, 0]
    assert paths.range_rate_mps.tolist() == [0.0, 0.0]


def test_silhouette_counts_as_standing_still_and_is_flagged(tmp_path: Path) -> None:
    """Target at t, ground behind it at t + delta t: 60 m in 10 ms."""

    def picture(frame: int, ring: int, snapshot_index: int) -> tuple[np.ndarray, np.ndarray]:
        range_m, radiance = empty(SETUP)
        if ring == 1:
            range_m[5, 5], radiance[5, 5] = (400.0, 460.0)[snapshot_index], 1.0
        return range_m, radiance

    frame = open_run(write_run(tmp_path, SETUP, picture)).frame(1)
    paths = frame_paths(frame)
    assert paths.flags.tolist() == [PathFlag.RANGE_RATE_REJECTED]
    assert paths.range_rate_mps.tolist() == [0.0]
    assert paths.counts.range_rate_rejected == 1
    fast = frame_paths(frame, max_range_rate_mps=7000.0)
    assert fast.range_rate_mps[0] == pytest.approx(6000.0, rel=1e-5)


def test_one_pass_only_knows_no_rate(tmp_path: Path) -> None:
    setup = Setup(snapshots=1)
    run = open_run(write_run(tmp_path, setup, points(setup, [(1, 1, 300.0, 10.0, 1.0)])))
    paths = frame_paths(run.frame(1))
    assert paths.range_rate_mps.tolist() == [0.0]
    assert paths.flags.tolist() == [PathFlag.SINGLE_SNAPSHOT]


def test_mixed_pixel_is_flagged(tmp_path: Path) -> None:
    from radarsim_addon.signal.runs import write_exr

    run = open_run(
        write_run(tmp_path, SETUP, points(SETUP, [(1, 1, 300.0, 0, 1.0), (2, 2, 300.0, 0, 1.0)]))
    )
    for snapshot_index in (0, 1):
        path = run.frame(1).path / f"ring_001_t{snapshot_index}.exr"
        record, channels = run.frame(1).image(1, snapshot_index)
        spread = (10.0 / SETUP.range_encoding_length_m) ** 2  # 10 m rms of the path's length
        channels["G"][2, 2] *= 1 + spread
        write_exr(path, channels)
        typed_json.write_record(
            path.with_suffix(".json"),
            dataclasses.replace(record, exr_sha256=typed_json.file_sha256(path)),
        )
    paths = frame_paths(run.frame(1))
    assert paths.flags.tolist() == [0, PathFlag.MIXED]
    assert paths.counts.mixed == 1


def test_passes_at_times_that_do_not_fit(tmp_path: Path) -> None:
    run = open_run(write_run(tmp_path, SETUP, points(SETUP, [])))
    for ring in range(SETUP.rings):
        record = dataclasses.replace(run.frame(1).image(ring, 1)[0], time_s=99.0)
        typed_json.write_record(run.frame(1).path / f"ring_{ring:03d}_t1.json", record)
    with pytest.raises(SchemaError, match=r"the run's plan has 0\.01 s"):
        frame_paths(run.frame(1))


def test_rings_come_one_by_one_and_join_to_the_whole(tmp_path: Path) -> None:
    echoes = [(r, r, 100.0 + 90 * r, 1.0, 1.0 + r) for r in range(10)]
    run = open_run(write_run(tmp_path, SETUP, points(SETUP, echoes)))
    parts = list(iter_path_chunks(run.frame(1)))
    assert [set(part.ring.tolist()) for part in parts] == [{0}, {1}, {2}, {3}]
    whole = Paths.join(parts)
    assert len(whole) == 10
    assert whole.counts.paths == 10
    assert len(Paths.join([])) == 0
    assert whole.select(whole.ring == 1).counts.paths == len(parts[1])


def test_power_of_a_lambert_plate_is_the_radar_equation(tmp_path: Path) -> None:
    """Plate of area A facing the radar: sigma = 4 rho A, P = EIRP lambda^2 sigma/((4 pi)^3 R^4)."""
    setup = Setup(width_px=64, height_px=64, half_width=0.02, half_height=0.02)
    grid = pixel_grid(setup.camera(), 64, 64)
    depth_m, eirp_w, albedo = 600.0, 3.0, 0.8
    slant_m = depth_m * np.sqrt(1 + grid.u[None, :] ** 2 + grid.v[:, None] ** 2)
    cosine = depth_m / slant_m
    radiance = albedo / math.pi * eirp_w / (4 * math.pi * slant_m**2) * cosine

    def picture(frame: int, ring: int, snapshot_index: int) -> tuple[np.ndarray, np.ndarray]:
        return (slant_m, radiance) if ring == 2 else empty(setup)

    paths = frame_paths(open_run(write_run(tmp_path, setup, picture)).frame(1))
    wavelength_m = setup.radar.waveform.wavelength_m
    area_m2 = (2 * 0.02 * depth_m) ** 2
    expected_w = eirp_w * wavelength_m**2 * 4 * albedo * area_m2 / ((4 * math.pi) ** 3 * depth_m**4)
    # the plate is 2.3 degrees wide: cos^5/R^4 falls by 1e-3 towards its corners
    assert path_power_w(paths, wavelength_m).sum() == pytest.approx(expected_w, rel=2e-3)
    gained = path_power_w(paths, wavelength_m, receiver_gain=100.0)
    assert gained.sum() == pytest.approx(100 * expected_w, rel=2e-3)


def test_amplitudes_of_both_weightings() -> None:
    paths = make_paths(np.array([4.0, 9.0]), np.array([20.0, 60.0]), solid_angle_sr=2.0)
    power = np.array([4.0, 9.0]) * 2 * 0.5**2 / (4 * math.pi)
    np.testing.assert_allclose(path_amplitude(paths, 0.5) ** 2, power, rtol=1e-15)
    np.testing.assert_allclose(path_amplitude(paths, 0.5, "paper"), [4 * 100.0, 9 * 900.0])
    with pytest.raises(ConfigError, match="'paper'"):
        path_amplitude(paths, 0.5, "other")  # type: ignore[arg-type]


def test_paper_weighting_does_not_depend_on_the_unit(tmp_path: Path) -> None:
    """B r^2 in Blender units (B per unit^2) is the same number as in SI."""
    for scale in (1.0, 100.0):
        setup = Setup(metres_per_unit=scale)
        folder = write_run(tmp_path / str(scale), setup, points(setup, [(1, 1, 300.0, 0, 2.0)]))
        frame = open_run(folder).frame(1)
        blue = float(frame.image(1)[1]["B"][1, 1])
        paths = frame_paths(frame)
        in_units = blue * (300.0 / scale) ** 2
        assert path_amplitude(paths, 0.05, "paper")[0] == pytest.approx(in_units, rel=1e-6)
