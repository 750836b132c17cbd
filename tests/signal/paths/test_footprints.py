# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pixel covers of range: profiles of surfaces seen at grazing, against many more rays."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

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
)
from radarsim_addon.signal.decoding import open_frame
from radarsim_addon.signal.maps import ExpectedPower, expected_power, expected_power_map
from radarsim_addon.signal.paths import (
    PathRows,
    Steps,
    TableFootprints,
    joined_places,
    replicate_offset_px,
    spread,
    steps_of,
    tiles_by_replicate,
)
from radarsim_addon.signal.paths.footprints import PixelPoints, along_steps
from tests.signal import path_runs as pr

RADAR = Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 4))
WINDOW_M = (50.0, 1150.0)
GROUND = pr.Plate("Ground", (0, 600, 0), (2000, 0, 0), (0, 590, 0))
SHIFTS = 4


def view(roll_deg: float) -> contract.ReceiverRecord:
    """16 degrees, 20 m above the ground, looking 9 degrees down."""
    pose = np.array(pr.pose((0, 0, 20.0), 0, -9))
    a = math.radians(roll_deg)
    pose[:3, :2] = pose[:3, :2] @ [[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]]
    return pr.camera(pose.tolist(), 8.0)


def shifted(camera: contract.ReceiverRecord, u: float, v: float) -> contract.ReceiverRecord:
    return dataclasses.replace(
        camera, left=camera.left + u, right=camera.right + u, bottom=camera.bottom + v,
        top=camera.top + v,
    )  # fmt: skip


def rows_of(camera: contract.ReceiverRecord, size_px: int, replicates: int) -> PathRows:
    """The ground, by the shifts that runs have; one is through the middle of the pixels."""
    pitch = (camera.right - camera.left) / size_px
    emitter = contract.TransmitterRecord(camera.matrix_world, 5.0)
    parts = []
    for shift in range(replicates):
        u, v = replicate_offset_px(shift) if replicates > 1 else (0.0, 0.0)
        rows = pr.trace([GROUND], shifted(camera, u * pitch, v * pitch), emitter, size_px)
        rows["power_w"] /= replicates
        rows["solid_angle_sr"] /= replicates
        rows["replicate"] = shift
        parts.append(rows)
    return PathRows.joined(parts)


def expected(folder: Path, rows: PathRows, camera: contract.ReceiverRecord) -> ExpectedPower:
    emitter = contract.TransmitterRecord(camera.matrix_world, 5.0)
    replicates = int(rows["replicate"].max()) + 1
    pr.write_run(
        folder, rows, ["Ground"], camera, emitter, range_limits_m=1200.0, replicates=replicates
    )
    return expected_power(
        open_frame(open_run(folder).frame(1), radar=RADAR, range_limits_m=WINDOW_M)
    )


def relative(error: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2) / np.mean(truth**2)))


def integrated(camera: contract.ReceiverRecord) -> np.ndarray:
    """The profile of the ground by integration over range and azimuth, without any pixel.

    A ring of ground dr wide at the slant range r has the solid angle h dr dphi / r^2; radiance of
    a Lambert surface lit by the emitter is E cos / (4 pi^2 r^2), cos = h / r.
    """
    height_m = camera.matrix_world[2][3]
    step_m, count = 0.25, 800
    range_m = np.arange(60.0, 1190.0, step_m)[:, None]
    # every ring has other places: else all would miss the same part at the frame's edge
    start = np.arange(range_m.size)[:, None] * 0.6180339887 % 1
    azimuths = np.radians(28.0) * ((start + np.arange(count)) / count - 0.5)
    flat_m = np.sqrt(range_m**2 - height_m**2)
    point = np.stack(
        np.broadcast_arrays(flat_m * np.sin(azimuths), flat_m * np.cos(azimuths), -height_m), -1
    )
    local = point @ np.array(camera.matrix_world)[:3, :3]
    u, v = local[..., 0] / -local[..., 2], local[..., 1] / -local[..., 2]
    seen = (u > camera.left) & (u < camera.right) & (v > camera.bottom) & (v < camera.top)
    seen &= point[..., 1] < 1190  # where the plate ends
    solid_sr = np.mean(seen, axis=1) * np.radians(28.0) * height_m * step_m / range_m[:, 0] ** 2
    radiance = 5.0 * height_m / range_m[:, 0] / (4 * math.pi**2 * range_m[:, 0] ** 2)
    paths = make_paths(radiance * solid_sr, 2 * range_m[:, 0])
    return expected_power_profile(paths, RADAR, range_limits_m=WINDOW_M, oversample=2).power


@pytest.mark.parametrize("roll_deg", [0.0, 10.0])
def test_ground_at_grazing(tmp_path: Path, roll_deg: float) -> None:
    """At 600 m a pixel covers 100 m of range, 80 cells. The profile has no gaps, and its standard
    error is the error that it has."""
    errors, sigmas, truths = [], [], []
    for number, (u, v) in enumerate([(0.0, 0.0), (0.31, 0.23), (-0.2, 0.41), (0.4, -0.3)]):
        camera = shifted(view(roll_deg), 5.9e-3 * u, 5.9e-3 * v)
        truth = integrated(camera)
        found = expected(tmp_path / f"run{number}", rows_of(camera, 48, SHIFTS), camera)
        # R^2 / h times the angle of a pixel is four cells of 3 m
        assert found.gaps_from_m == pytest.approx(math.sqrt(4 * 3.0 * 20 / 5.86e-3), abs=6)
        assert [item.code for item in found.findings] == ["range-gaps-between-rays"]
        assert found.findings[0].numbers == {"range_m": found.gaps_from_m}
        errors.append(found.profile - truth)
        sigmas.append(found.profile_error)
        truths.append(truth)
    error, sigma, truth_w = np.array(errors), np.array(sigmas), np.array(truths)
    range_m = found.range_m
    for low_m, high_m, bound in ((100, 300, 0.006), (300, 500, 0.015), (500, 900, 0.05)):
        here = (range_m > low_m) & (range_m < high_m)
        assert relative(error[:, here], truth_w[:, here]) < bound
        assert relative(error[:, here], sigma[:, here]) < 1.2
        beyond = np.abs(error[:, here]) > 3 * sigma[:, here] + 1e-3 * truth_w[:, here]
        assert np.mean(beyond) < 0.05


def test_one_shift_has_no_error(tmp_path: Path) -> None:
    found = expected(tmp_path / "run", rows_of(view(0.0), 48, 1), view(0.0))
    assert np.isnan(found.profile_error).all()
    assert np.isnan(found.map_error).all()
    assert np.isfinite(found.profile).all()


def test_power_is_kept_and_the_map_holds_it_too(tmp_path: Path) -> None:
    camera = view(0.0)
    rows = rows_of(camera, 48, SHIFTS)
    for view_rows in [r for views in tiles_by_replicate(rows, SHIFTS) for r in views]:
        steps = steps_of(view_rows, camera, SHIFTS)
        share = np.zeros(view_rows.size)
        for part in spread(view_rows, steps, 1.0, np.inf):
            share += np.bincount(part.row, part.share, minlength=view_rows.size)
            assert part.share.min() > 0
        assert share == pytest.approx(np.ones(view_rows.size))
    found = expected(tmp_path / "run", rows, camera)
    # nothing moves: the still bin, smeared by the window over the pulses
    still = found.map[found.doppler_hz == 0][0]
    assert still == pytest.approx(found.profile, rel=1e-9, abs=1e-12 * found.profile.max())


def test_views_next_to_one_another_have_their_own_steps() -> None:
    """Rows of several replicates treated together: steps never lead from one to another."""
    camera = view(10.0)
    rows = rows_of(camera, 12, SHIFTS)
    views = [rows[rows["replicate"] == shift] for shift in range(SHIFTS)]
    each = [steps_of(view_rows, camera, SHIFTS) for view_rows in views]
    together = steps_of(rows, camera, SHIFTS, joined_places)
    for name in ("length_m", "range_rate_mps", "power"):
        assert np.array_equal(
            getattr(together, name), np.concatenate([getattr(steps, name) for steps in each])
        )
    assert np.array_equal(
        rows["replicate"][together.between], np.broadcast_to(
            rows["replicate"][:, None, None, None], together.between.shape
        )
    )  # fmt: skip


def test_small_tables_in_one_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The expected power is that of one view after the other, up to rounding."""
    camera = view(0.0)
    rows = rows_of(camera, 24, SHIFTS)
    rows["range_rate_mps"] = np.linspace(-4.0, 4.0, rows.size)
    together = expected(tmp_path / "together", rows, camera)
    monkeypatch.setattr(expected_power_map, "_SMALL_TABLE", 0)
    apart = expected(tmp_path / "apart", rows, camera)
    for name in ("profile", "profile_error", "map", "map_error"):
        truth = getattr(apart, name)
        assert getattr(together, name) == pytest.approx(truth, abs=1e-12 * truth.max())
    assert together.gaps_from_m == apart.gaps_from_m


def test_steps_of_a_plane() -> None:
    """Differences of the lengths, along both axes, with the end of the surface as what is beside
    it."""
    camera = view(0.0)
    rows = rows_of(camera, 24, 1)
    rows = rows[rows["length_m"] < 600]
    steps = steps_of(rows, camera, 1)
    shape = (-1, 24)
    length, power = rows["length_m"].reshape(shape), rows["power_w"].reshape(shape)
    by_length = steps.length_m.reshape(*length.shape, 2, 2)
    by_power = steps.power.reshape(*length.shape, 2, 2)
    up = length[:-1] - length[1:]  # rows of an image go down
    assert by_length[1:, :, 1, 1] == pytest.approx(up)
    assert by_length[:-1, :, 1, 0] == pytest.approx(up)
    # at the ends: far away the ground recedes on, near the radar nothing lies before its ray
    assert by_length[0, :, 1, 1] == pytest.approx(up[1])
    assert not by_length[-1, :, 1, 0].any()
    relative_power = (power[:-1] - power[1:]) / power[1:]
    assert by_power[1:, :, 1, 1] == pytest.approx(np.clip(relative_power, -0.9, 0.9))
    # across, the middle is nearest: lengths grow to both sides
    across = np.diff(length, axis=1)
    assert by_length[:, 1:11, 0, 0] == pytest.approx(across[:, 0:10])
    assert by_length[:, 1:11, 0, 1] == pytest.approx(across[:, 1:11])


def test_points_have_the_lengths_of_their_places(tmp_path: Path) -> None:
    """Antennas 60 m apart: a point of a row is as long as the ways from its place to both, and
    rows keep their power."""
    camera = view(10.0)
    emitter = contract.TransmitterRecord(pr.pose((-40.0, 30.0, 55.0)), 5.0)
    rows = pr.trace([GROUND], camera, emitter, 16)
    pr.write_run(tmp_path / "run", rows, ["Ground"], camera, emitter, range_limits_m=1200.0)
    table = open_frame(open_run(tmp_path / "run").frame(1)).table
    footprints = TableFootprints(table.record, table.rows, 3.0, 1.0)
    index, points = footprints.points(np.arange(rows.size))
    assert len(index) > 2 * rows.size
    place = np.asarray(points["last_scatterer_m"])
    ways = [place - np.array(one.matrix_world)[:3, 3] for one in (camera, emitter)]
    back_m, there_m = (np.linalg.norm(way, axis=1) for way in ways)
    np.testing.assert_allclose(points["length_m"], back_m + there_m, atol=1e-6)
    np.testing.assert_allclose(points["direction"], ways[0] / back_m[:, None], atol=1e-9)
    np.testing.assert_array_equal(points["first_scatterer_m"], place)
    for name in ("power_w", "solid_angle_sr"):
        np.testing.assert_allclose(np.bincount(index, points[name]), rows[name], rtol=1e-9)


def test_where_nothing_is_spread() -> None:
    """Orders left to chance, unknown objects, the nearest point of a body, steps in depth."""
    camera = view(0.0)
    rows = rows_of(camera, 24, 1)
    rows = rows[rows["length_m"] < 300]
    for name, value in (("order", 2), ("last_object", 0)):
        other = rows.copy()
        other[name] = value
        assert not steps_of(other, camera, 1).length_m.any()
    ridge = rows.copy()
    place = np.arange(rows.size) % 24
    ridge["length_m"] = 100 + 3.0 * np.abs(place - 12)
    steps = steps_of(ridge, camera, 1).length_m
    assert not steps[place == 12].any()
    assert np.abs(steps[place == 5, 0]) == pytest.approx(3.0)
    cliff = rows.copy()
    cliff["length_m"] = 100 + 3.0 * place + 500.0 * (place > 12)
    assert np.abs(steps_of(cliff, camera, 1).length_m[:, 0]).max() == pytest.approx(3.0)
    # two bodies of one object (instances) have an end where they meet
    cliff["last_body"] = place > 12
    assert np.abs(steps_of(cliff, camera, 1).length_m[:, 0]).max() == pytest.approx(3.0)
    alternate = rows.copy()
    alternate["last_body"] = np.arange(rows.size) % 2
    assert not steps_of(alternate, camera, 1).length_m[:, 0].any()


def test_points_are_bounded() -> None:
    """Kilometres in cells of a millimetre: coarser points, a bounded number of them."""
    count = 1000
    rows = PathRows.zeros(count)
    rows["length_m"], rows["power_w"] = 1000.0, 1.0
    steps = Steps(*np.zeros((3, count, 2, 2)))
    steps.length_m[:] = 5000.0
    parts = list(spread(rows, steps, 1e-3, np.inf))
    assert sum(part.row.size for part in parts) <= 1 << 17
    lengths = np.concatenate([part.length_m for part in parts])
    assert lengths.min() > 1000 - 5000 and lengths.max() < 1000 + 5000
    assert list(spread(rows[:0], Steps(*np.zeros((3, 0, 2, 2))), 1.0, 1.0)) == []
    # one view's worth of rows that reach nowhere stays as it is
    still = next(spread(rows, Steps(*np.zeros((3, count, 2, 2))), 1.0, 1.0))
    assert np.array_equal(still.row, np.arange(count))
    assert np.array_equal(still.length_m, rows["length_m"])


def test_range_rates_are_spread_over_doppler(tmp_path: Path) -> None:
    """A moving radar: the ground of one pixel has many range rates, and fills the map between."""
    camera = view(0.0)
    rows = rows_of(camera, 48, SHIFTS)
    down = -rows["direction"][:, 1]
    rows["range_rate_mps"] = 8.0 * down  # 8 m/s ahead; a bin is 7.07 m/s
    radar = Radar(RADAR.waveform, Burst(4000.0, 64))  # a bin is 1.77 m/s
    emitter = contract.TransmitterRecord(camera.matrix_world, 5.0)
    folder = tmp_path / "run"
    pr.write_run(
        folder, rows, ["Ground"], camera, emitter, range_limits_m=1200.0, replicates=SHIFTS
    )
    found = expected_power(
        open_frame(open_run(folder).frame(1), radar=radar, range_limits_m=WINDOW_M),
        doppler_taper="none",
    )
    # Without a taper all Doppler bins together are the profile, by Parseval.
    assert found.profile.max() > 1e-12
    np.testing.assert_allclose(found.map.sum(axis=0), found.profile, rtol=1e-9)
    strongest = found.doppler_hz[np.argmax(found.map.sum(axis=1))]
    expected_hz = 2 * 8.0 / RADAR.waveform.wavelength_m
    assert strongest == pytest.approx(expected_hz, abs=4000 / 64)


def test_walls_at_grazing_incidence_bend() -> None:
    """Columns of pixels along a wall 10 m away: ranges grow faster and faster between the rays."""
    pitch, far_m = 4.4e-3, 10.0
    angle = 0.15 + pitch * np.arange(60)

    def power(at: Real) -> Real:
        return np.asarray(np.sin(at) ** 4)

    rows = PathRows.zeros(angle.size)
    rows["length_m"], rows["power_w"] = 2 * far_m / np.sin(angle), power(angle)
    steps = np.zeros((angle.size, 2, 2))
    length, share = steps.copy(), steps.copy()
    for values, into in ((rows["length_m"], length), (rows["power_w"], share)):
        into[1:, 0, 0] = into[:-1, 0, 1] = np.diff(values)
        into[0, 0, 0], into[-1, 0, 1] = into[0, 0, 1], into[-1, 0, 0]
    share /= rows["power_w"][:, None, None]
    fine = np.arange(angle[0] - pitch / 2, angle[-1] + pitch / 2, pitch / 400) + pitch / 800
    edges_m = np.arange(30.0, 62.0)
    exact = np.histogram(far_m / np.sin(fine), edges_m, weights=power(fine) / 400)[0]
    found = np.zeros(edges_m.size - 1)
    for part in spread(rows, Steps(length, 0 * length, share), 0.05, np.inf):
        weights = rows["power_w"][part.row] * part.share
        found += np.histogram(part.length_m / 2, edges_m, weights=weights)[0]
    error = found / exact - 1
    # straight lines between the rays: 3.4e-3 and 9.9e-3
    assert np.sqrt(np.mean(error**2)) < 1.2e-3
    assert np.abs(error).max() < 3.5e-3


def test_values_along_a_parabola_are_exact() -> None:
    """As long as both neighbours are known; the side of one alone is straight."""

    def value(x: Real) -> Real:
        return np.asarray(3 * x + 0.5 * x**2)

    before, after = value(np.zeros(1)) - value(-np.ones(1)), value(np.ones(1))
    steps = np.zeros((2, 2, 2))
    steps[0, 0] = before[0], after[0]
    steps[1, 1] = before[0], 0.0
    points = PixelPoints.of(np.array([[9, 2], [3, 8]]))
    x, y = (lines.place[lines.of_point] for lines in points.lines)
    found = along_steps(steps, points)
    first = points.row == 0
    np.testing.assert_allclose(found[first], value(x[first]), atol=1e-15)
    alone = np.where(y < 0, before * y, 0.0)
    np.testing.assert_allclose(found[~first], alone[~first], atol=1e-15)


def test_points_fill_pixels_evenly() -> None:
    """From below, and from left to right."""
    points = PixelPoints.of(np.array([[3, 2], [1, 1], [1, 4]]))
    assert points.row.tolist() == [0] * 6 + [1] + [2] * 4
    for lines in points.lines:
        assert np.array_equal(lines.row[lines.of_point], points.row)
    x, y = (lines.place[lines.of_point] for lines in points.lines)
    assert x[:6] == pytest.approx(np.tile([-1 / 3, 0, 1 / 3], 2))
    assert y[:6] == pytest.approx(np.repeat([-0.25, 0.25], 3))
    assert x[6:].tolist() == [0.0] * 5
    assert y[6:].tolist() == [0.0, -0.375, -0.125, 0.125, 0.375]
    assert PixelPoints.of(np.zeros((0, 2), dtype=np.intp)).row.size == 0
