# SPDX-License-Identifier: GPL-3.0-or-later
"""Speckle that belongs to the surface: its mean, its distribution, and what it is tied to."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from radarsim_addon import contract
from radarsim_addon.signal import synthesize
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.paths import PathRows
from radarsim_addon.signal.paths.paths import make_paths
from radarsim_addon.signal.runs import open_run
from radarsim_addon.signal.scattering import FrameSpeckle
from radarsim_addon.signal.scattering.surface_speckle import (
    Body,
    Roughness,
    SurfaceSpeckle,
    distinct,
)
from tests.signal import path_runs as pr
from tests.signal.scattering.speckle_scenes import (
    RESOLUTION_M,
    WAVELENGTH_M,
    WAVENUMBER,
    scene,
    speckle,
)


@pytest.mark.parametrize("count", [0, 1, 3000])
def test_distinct_keys_are_those_of_numpy(count) -> None:
    keys = np.random.default_rng(8).integers(0, 900, count).astype(np.uint64) << np.uint64(54)
    expected = np.unique(keys, return_index=True, return_inverse=True)
    for found, wanted in zip(distinct(keys), expected, strict=True):
        np.testing.assert_array_equal(found, wanted)


def factors_of(made: SurfaceSpeckle, rows: PathRows) -> tuple[np.ndarray, np.ndarray]:
    """Complex factors of the amplitudes of rows at t, and which of them are known."""
    known = made.known(rows)
    factors = np.ones(rows.size, dtype=complex)
    factors[known] = made.factors_at_rest(made.scattering(rows[known]))
    return factors, known


def field(rows: PathRows, made: SurfaceSpeckle) -> complex:
    """Sum over all paths: one resolution cell at the carrier."""
    factors, known = factors_of(made, rows)
    assert known.all()
    phase = WAVENUMBER * rows["length_m"]
    return complex(np.sum(np.sqrt(rows["power_w"]) * factors * np.exp(-1j * phase)))


def intensities(
    record: contract.PathsRecord, table: PathRows, seeds: int,
    roughness: Mapping[int, Roughness] | None = None, cell_m: float | None = None,
) -> np.ndarray:  # fmt: skip
    rows = table.copy()
    found = [
        abs(field(rows, speckle(record, table, seed, roughness, cell_m=cell_m))) ** 2
        for seed in range(seeds)
    ]
    return np.array(found)


@pytest.mark.parametrize(
    ("size_px", "tilt_deg", "rms_height_m"),
    [
        (9, 0.0, None),  # 49 paths on the plate
        (64, 0.0, None),
        (32, 50.0, None),
        (32, 0.0, 0.0),
        (32, 0.0, 0.3 / WAVENUMBER),
        (32, 0.0, 1.5 / WAVENUMBER),
        (32, 0.0, 5 / WAVENUMBER),
    ],
)
def test_mean_power_and_exponential_intensity(
    tmp_path: Path, size_px: int, tilt_deg: float, rms_height_m: float | None
) -> None:
    record, table, _ = scene(tmp_path / "run", size_px=size_px, tilt_deg=tilt_deg)
    assert table.size >= 40
    roughness = None if rms_height_m is None else {1: Roughness(rms_height_m)}
    found = intensities(record, table, 400, roughness)
    expected = float(table["power_w"].sum())
    error = found.std(ddof=1) / math.sqrt(found.size)
    assert abs(found.mean() - expected) < 3 * error
    if rms_height_m is None or rms_height_m * WAVENUMBER > 2 or rms_height_m == 0:
        assert stats.kstest(found / found.mean(), "expon").pvalue > 0.01


@pytest.mark.parametrize(("size_px", "tilt_deg"), [(12, 70.0), (48, 80.0)])
def test_energy_of_echoes_is_that_of_the_paths(
    tmp_path: Path, size_px: int, tilt_deg: float
) -> None:
    """Cells deeper than the range resolution; paths over one scatterer kept delays of their own."""
    folder = scene(tmp_path / "run", size_px=size_px, side_m=60.0, tilt_deg=tilt_deg)[2]
    frame, radar = open_frame(open_run(folder).frame(1)), open_run(folder).radar
    limits_m, found = (900.0, 1100.0), []
    raw = frame_paths(frame)
    for seed in range(60):
        made = FrameSpeckle(frame, seed)
        echoes = synthesize([made.apply(raw)], radar, range_limits_m=limits_m, speckle_seed=seed)
        found.append(np.sum(np.abs(echoes.plane[0]) ** 2))
    assert made.report().cell_m > RESOLUTION_M
    one = make_paths(raw.radiance.sum(), 2000.0, solid_angle_sr=raw.solid_angle_sr[0])
    expected = np.sum(np.abs(synthesize([one], radar, range_limits_m=limits_m).plane[0]) ** 2)
    mean, error = np.mean(found), np.std(found, ddof=1) / math.sqrt(len(found))
    assert error < 0.05 * expected
    assert abs(mean - expected) < 3 * error


@pytest.mark.parametrize("kh", [0.0, 0.3, 1.0])
def test_level_of_a_smooth_surface_does_not_grow_with_the_resolution(
    tmp_path: Path, kh: float
) -> None:
    """It did by 6 dB for each doubling, 39 dB at 128 pixels: a coherent sum over pixel centres."""
    for size_px in (16, 64):
        record, table, _ = scene(tmp_path / f"run{size_px}", side_m=3.0, size_px=size_px)
        surface = {1: Roughness(kh / WAVENUMBER)}
        ratio = intensities(record, table, 200, surface, cell_m=2.0**-4) / table["power_w"].sum()
        assert abs(ratio.mean() - 1) < 3.5 * ratio.std(ddof=1) / math.sqrt(ratio.size)
        report = speckle(record, table, 0, surface).report()
        # Ament 1953; at 1000 m the incidence on the plate is normal
        coherent = math.exp(-((2 * kh) ** 2))
        assert report.coherent_power_fraction == pytest.approx(coherent, rel=1e-4)
        (found,) = [f for f in report.findings if f.code == "coherent-part-not-formed"]
        assert found.subjects == ("Plate",)
        assert found.numbers["fraction"] == report.coherent_power_fraction


def test_rough_surfaces_have_no_coherent_part(tmp_path: Path) -> None:
    record, table, _ = scene(tmp_path / "run", size_px=128)
    for surface in (None, {1: Roughness(1.5 / WAVENUMBER)}):
        report = speckle(record, table, 0, surface).report()
        assert report.coherent_power_fraction < 2e-4
        assert report.findings == []


def test_what_is_seen_through_a_pane_has_scatterers_of_its_own(tmp_path: Path) -> None:
    """The same points seen directly and, 20 m longer, through a pane: two echoes of full power."""
    record, table, _ = scene(tmp_path / "run")
    direct = table.copy()
    pane = direct.copy()
    pane["transparent_depth"] += 2
    pane["length_m"] += 20.0
    both = PathRows.joined([direct, pane])
    for own in (direct, pane):
        found = np.array([abs(field(own, speckle(record, both, s))) ** 2 for s in range(300)])
        error = found.std(ddof=1) / math.sqrt(found.size)
        assert abs(found.mean() - own["power_w"].sum()) < 3 * error


def test_mean_does_not_depend_on_the_pixels(tmp_path: Path) -> None:
    """One surface, coarse and fine pixels, same cells: nearly the same speckle."""
    kept = []
    for size_px in (64, 128):
        record, table, _ = scene(tmp_path / f"run{size_px}", size_px=size_px)
        rows = table.copy()
        scale = 1 / math.sqrt(rows["power_w"].sum())  # pixels cut the plate's edges differently
        kept.append([scale * field(rows, speckle(record, table, s, cell_m=2.0)) for s in range(80)])
    a, b = np.array(kept)
    correlation = abs(np.vdot(a, b)) / np.linalg.norm(a) / np.linalg.norm(b)
    assert correlation > 0.97
    assert np.mean(abs(b) ** 2) / np.mean(abs(a) ** 2) == pytest.approx(1, abs=0.05)


def test_speckle_decorrelates_with_the_radars_shift(tmp_path: Path) -> None:
    """Baseline decorrelation of a uniform patch (Zebker 1992): sinc(2 b W / (lambda R))."""
    side_m, range_m = 24.0, 1000.0
    critical_m = WAVELENGTH_M * range_m / (2 * side_m)
    fields = {}
    shifts_m = (0.0, 0.25 * critical_m, 0.5 * critical_m, critical_m)
    for number, b in enumerate(shifts_m):
        record, table, _ = scene(
            tmp_path / f"run{number}", at=(b, 0, 0), side_m=side_m, range_m=range_m, size_px=60
        )
        rows = table.copy()
        made = [field(rows, speckle(record, table, s, cell_m=1.0)) for s in range(150)]
        fields[b] = np.array(made)
    first = fields[0.0]
    for b in shifts_m[1:]:
        other = fields[b]
        found = abs(np.vdot(first, other)) / np.linalg.norm(first) / np.linalg.norm(other)
        assert found == pytest.approx(abs(np.sinc(b / critical_m)), abs=0.12)


def test_speckle_moves_with_its_object(tmp_path: Path) -> None:
    """Plate and radar displaced and turned together: the same speckle, to rounding."""
    record, table, _ = scene(tmp_path / "run")
    rows = table.copy()
    turn = np.array(pr.pose((70.0, -30.0, 5.0), 33.0, -12.0)) @ np.linalg.inv(pr.pose((0, 0, 0)))
    moved = rows.copy()
    for name in ("first_scatterer_m", "last_scatterer_m"):
        moved[name] = rows[name] @ turn[:3, :3].T + turn[:3, 3]
    moved["direction"] = rows["direction"] @ turn[:3, :3].T
    matrix = (turn @ np.array(record.receiver.matrix_world)).tolist()
    there = dataclasses.replace(
        record,
        receiver=dataclasses.replace(record.receiver, matrix_world=matrix),
        transmitter=dataclasses.replace(record.transmitter, matrix_world=matrix),
    )
    own = speckle(record, table, 5)
    others = speckle(there, moved, 5, bodies={1: Body("Plate", turn)})
    a, b = factors_of(own, rows)[0], factors_of(others, moved)[0]
    # Points that lie on the border of two cells may change sides by rounding.
    assert np.mean(np.abs(a - b) < 1e-5) > 0.99
    assert np.mean(np.abs(a - factors_of(speckle(record, table, 6), rows)[0]) < 1e-5) < 0.01
    renamed = speckle(record, table, 5, bodies={1: Body("Other", np.eye(4))})
    assert np.mean(np.abs(a - factors_of(renamed, rows)[0]) < 1e-5) < 0.01


def test_neighbours_within_a_correlation_length_share_their_height(tmp_path: Path) -> None:
    record, table, _ = scene(tmp_path / "run")
    rows = table.copy()
    cells = {
        length_m: speckle(record, table, 1, {1: Roughness(1.0, length_m)}).report().cells
        for length_m in (0.0, 5.0, 40.0)
    }
    # 30 m from -15 to 15, none of whose ends is on a border: 31 cells of 1 m, 7 of 5 m each way;
    # of 40 m one across, and two up.
    assert cells == {0.0: 31**2, 5.0: 7**2, 40.0: 2}
    assert rows.size > cells[0.0] * 1.5  # two paths a cell or more by default


def test_parts_do_not_matter(tmp_path: Path) -> None:
    record, table, _ = scene(tmp_path / "run")
    rows = table.copy()
    made = speckle(record, table, 1)
    whole, _ = factors_of(made, rows)
    parts = np.concatenate(
        [factors_of(made, rows[i : i + 700])[0] for i in range(0, rows.size, 700)]
    )
    np.testing.assert_array_equal(whole, parts)


def test_too_few_scatterers_are_told(tmp_path: Path) -> None:
    record, table, _ = scene(tmp_path / "few", size_px=5)
    few = speckle(record, table, 0).report()
    assert few.undersampled_power_fraction == 1.0
    (found,) = few.findings
    assert (found.code, found.numbers["fraction"]) == ("few-scatterers", 1.0)
    record, table, _ = scene(tmp_path / "many", size_px=128)
    many = speckle(record, table, 0).report()
    assert many.undersampled_power_fraction == 0.0
    assert many.median_scatterers > 100
    assert many.findings == []


def two_bounces(record: contract.PathsRecord, rows: PathRows) -> PathRows:
    """The same paths, each by way of a second point above the first."""
    rows = rows.copy()
    rows["order"] = 2
    rows["last_scatterer_m"] = rows["first_scatterer_m"] + [0.0, -5.0, 8.0]
    emitter_m = np.array(record.transmitter.matrix_world)[:3, 3]
    rows["length_m"] = (
        np.linalg.norm(rows["first_scatterer_m"], axis=1)
        + np.linalg.norm(rows["last_scatterer_m"] - rows["first_scatterer_m"], axis=1)
        + np.linalg.norm(rows["last_scatterer_m"] - emitter_m, axis=1)
    )
    return rows


def test_two_reflections_have_two_scatterers(tmp_path: Path) -> None:
    record, table, _ = scene(tmp_path / "run")
    rows = two_bounces(record, table.copy())
    found = np.array([abs(field(rows, speckle(record, rows, seed))) ** 2 for seed in range(300)])
    error = found.std(ddof=1) / math.sqrt(found.size)
    assert abs(found.mean() - rows["power_w"].sum()) < 3 * error
    assert stats.kstest(found / found.mean(), "expon").pvalue > 0.01


def test_coherent_part_of_two_reflections_is_the_product_of_both(tmp_path: Path) -> None:
    """exp(-(k h)^2 |u_in - u_out|^2) of each surface, from the path's own three legs."""
    record, table, _ = scene(tmp_path / "run")
    rows = two_bounces(record, table.copy())
    height_m = 0.4 / WAVENUMBER
    report = speckle(record, rows, 0, {1: Roughness(height_m)}).report()
    ends = [np.array(end.matrix_world)[:3, 3] for end in (record.receiver, record.transmitter)]
    way = [ends[0] + 0 * rows["direction"], rows["first_scatterer_m"], rows["last_scatterer_m"]]
    way.append(ends[1] + 0 * rows["direction"])
    legs = [b - a for a, b in itertools.pairwise(way)]
    units = [leg / np.linalg.norm(leg, axis=1, keepdims=True) for leg in legs]
    turns2 = sum(np.sum((b - a) ** 2, axis=1) for a, b in itertools.pairwise(units))
    coherent = np.exp(-((WAVENUMBER * height_m) ** 2) * turns2)
    want = float(coherent @ rows["power_w"] / rows["power_w"].sum())
    assert 0.1 < want < 0.9
    assert report.coherent_power_fraction == pytest.approx(want, rel=1e-9)


def test_three_reflections_have_none(tmp_path: Path) -> None:
    record, table, _ = scene(tmp_path / "run")
    rows = table.copy()
    rows["order"][::2] = 3
    rows["last_scatterer_m"][1] = np.nan
    _, known = factors_of(speckle(record, rows, 0), rows)
    assert not known[::2].any()
    assert not known[1]
    assert known[3::2].all()
