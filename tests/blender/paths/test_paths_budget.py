# SPDX-License-Identifier: GPL-3.0-or-later
"""Sub-pixel shifts, the error known so far, and what is refined next: no render."""

from __future__ import annotations

import math

import numpy as np
import pytest

from radarsim_addon.signal import PathFlag

pytest.importorskip("bpy")

from radarsim_addon.blender.paths.error_budget import (
    CellGrid,
    CellPowers,
    ErrorBudget,
    uncertain_objects,
)
from radarsim_addon.blender.paths.measured_tiles import QualitySums
from radarsim_addon.blender.plan import PathOptions
from radarsim_addon.blender.views import PowerBeyond
from radarsim_addon.contract import ReceiverRecord
from radarsim_addon.errors import ConfigError
from radarsim_addon.findings import merge
from radarsim_addon.signal.decoding import pixel_rays
from radarsim_addon.signal.paths import PathRows, replicate_offset_px


def test_shifts_fill_the_pixel() -> None:
    """Low discrepancy: the first n leave no square of the pixel of 3/n unvisited, none repeats."""
    replicates = np.array([replicate_offset_px(i) for i in range(256)])
    assert np.all(np.abs(replicates) <= 0.5)
    assert len({tuple(s) for s in replicates}) == 256
    assert np.all(np.abs(replicates[0]) > 0.01)  # off the centre
    for count, cells in ((64, 4), (256, 8)):
        place = np.floor((replicates[:count] + 0.5) * cells).astype(int)
        hits = np.zeros((cells, cells), dtype=int)
        np.add.at(hits, (place[:, 0], place[:, 1]), 1)
        assert hits.min() >= 2
        assert hits.max() <= 6
    # A linear function is integrated much better than by random shifts (0.29/sqrt(n)).
    assert np.abs(replicates[:64].mean(axis=0)).max() < 0.02


def rows_at(lengths: list[float], powers: list[float], objects: list[int]) -> PathRows:
    rows = PathRows.zeros(len(lengths))
    rows["length_m"], rows["power_w"], rows["last_object"] = lengths, powers, objects
    return rows


def powers_of(grid: CellGrid, replicates: list[np.ndarray]) -> CellPowers:
    """Cell powers of a tile from the rows of its shifts."""
    return grid.powers([grid.replicate_powers(rows, len(replicates)) for rows in replicates])


def many(length: float, power: float, number: int, hits: int = 400) -> np.ndarray:
    """Rows of equal power on one object."""
    return rows_at([length] * hits, [power / hits] * hits, [number] * hits)


def test_cell_powers() -> None:
    """Means and variances of the mean over the shifts, by hand."""
    grid = CellGrid(bin_m=1.0, bins=10)
    replicates = [
        rows_at([7.0, 11.0], [1.0, 2.0], [1, 2]),
        rows_at([7.4, 7.6], [3.0, 1.0], [1, 1]),
    ]
    replicates[1]["flags"][1] = PathFlag.NO_RANGE
    powers = powers_of(grid, replicates)
    found = dict(
        zip(powers.cells.tolist(), zip(powers.mean, powers.variance, strict=True), strict=True)
    )
    first_object = grid.first_object
    # A row's power is its share of two shifts: twice it is the shift's own estimate.
    assert found[3] == pytest.approx((4.0, 4.0))  # 2 and 6
    assert found[5] == pytest.approx((2.0, 4.0))  # 4 and 0
    assert found[first_object + 1] == pytest.approx((5.0, 9.0))  # 2 and 8
    assert found[first_object + 2] == pytest.approx((2.0, 4.0))
    assert set(found) == {3, 5, first_object + 1, first_object + 2}


def test_an_object_of_a_few_pixels_is_uncertain_even_where_shifts_agree() -> None:
    """A square of n grid points has n +- 0.54 n^(1/4) of them, by how the grid happens to lie."""
    grid = CellGrid(bin_m=1.0, bins=10)
    for hits in (1, 16, 400):
        powers = powers_of(grid, [many(7.0, 1.0, 1, hits)] * 2)
        place = powers.cells.tolist().index(grid.first_object + 1)
        relative = math.sqrt(powers.variance[place]) / powers.mean[place]
        assert relative == pytest.approx(0.5385 * hits**-0.75 / math.sqrt(2), rel=1e-3)


def test_edge_variance_is_that_of_a_square_on_a_shifted_grid() -> None:
    """The constant behind it, by trial: squares of random size, place and turn."""
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(4000):
        side, turn = rng.uniform(3, 12), rng.uniform(0, math.pi / 2)
        u, v = np.meshgrid(np.arange(-12, 13) + rng.random(), np.arange(-12, 13) + rng.random())
        x = u * math.cos(turn) + v * math.sin(turn)
        y = v * math.cos(turn) - u * math.sin(turn)
        count = np.count_nonzero((np.abs(x) < side / 2) & (np.abs(y) < side / 2))
        ratios.append((count - side**2) ** 2 / side)
    assert np.mean(ratios) == pytest.approx(0.29, rel=0.15)


def test_refinement_goes_where_the_error_is() -> None:
    """A strong tile that is known well, a faint one whose shifts disagree, one without echo."""
    grid = CellGrid(bin_m=1.0, bins=100)
    budget = ErrorBudget(grid.first_object)
    budget.powers[0] = powers_of(grid, [many(20.0, 100.0 + d, 1) for d in (0.0, 0.1)])
    budget.powers[1] = powers_of(grid, [many(90.0, 1e-3 * d, 2) for d in (1.0, 2.0)])
    budget.powers[2] = powers_of(grid, [rows_at([], [], []) for _ in range(2)])
    assert budget.worst([0, 1, 2], 0.8) == [1]
    before = budget.relative_error()
    budget.powers[1] = powers_of(grid, [many(90.0, 1.5e-3, 2) for _ in range(2)])
    assert budget.relative_error() < before
    # A small object is refined though its shifts agree, ground without number is not.
    budget.powers[1] = powers_of(grid, [many(90.0, 1.5e-3, 2, hits=2) for _ in range(2)])
    budget.powers[3] = powers_of(grid, [many(50.0, 1.0, 0) for _ in range(2)])
    assert budget.worst([0, 1, 2, 3], 0.9) == [1]
    assert budget.worst([2, 3], 1.0) == []


def test_relative_error_in_closed_form() -> None:
    """Two cells of 1 and 4 W with errors of 10 % and 20 %, weighed by the roots of their powers."""
    grid = CellGrid(bin_m=1.0, bins=100)
    budget = ErrorBudget()
    # Two shifts a +- d: variance of the mean d^2.
    rows = [
        PathRows.joined(
            [rows_at([10.0], [(1 + s * 0.1) / 2], [0]), rows_at([50.0], [(4 + s * 0.8) / 2], [0])]
        )
        for s in (1, -1)
    ]
    budget.powers[0] = powers_of(grid, rows)
    bins = [(1.0, 0.1), (4.0, 0.2), (5.0, 0.9 / 5)]  # the third is object 0
    weight = [math.sqrt(p) for p, _ in bins]
    want = math.sqrt(sum(w * e**2 for w, (_, e) in zip(weight, bins, strict=True)) / sum(weight))
    assert budget.relative_error() == pytest.approx(want)
    assert ErrorBudget().relative_error() == 0.0


def test_one_shift_tells_the_error_of_objects_alone() -> None:
    """By the edges of the object; refinement by range bins needs replicates."""
    assert (
        PathOptions(replicates=1, max_standard_error=0.05, refine_for="objects").error_scope
        == "objects"
    )
    assert PathOptions(replicates=1).error_scope == "objects"
    assert PathOptions(replicates=2).error_scope == "both"
    for asked in ({"max_standard_error": 0.05}, {"time_limit_s": 5.0, "refine_for": "ranges"}):
        with pytest.raises(
            ConfigError, match=r"no standard error of range bins.*at least 2 replicates"
        ):
            PathOptions(replicates=1, **asked)
    seen = ReceiverRecord("perspective", np.eye(4).tolist(), -0.01, 0.01, -0.01, 0.01, 0.0)
    rays = pixel_rays(seen, 20, 20)
    rows = PathRows.zeros(100)
    rows["direction"] = rays.direction[5:15, 5:15].reshape(-1, 3)
    rows["solid_angle_sr"] = rays.solid_angle_sr[5:15, 5:15].ravel()
    rows["order"], rows["last_object"], rows["power_w"], rows["length_m"] = 1, 1, 0.01, 7.0
    grid = CellGrid(bin_m=1.0, bins=10)
    powers = grid.powers([grid.replicate_powers(rows, 1, seen)])
    place = powers.cells.tolist().index(grid.first_object + 1)
    # two sides of ten pixels, each known to 1/6 of a squared pixel
    assert powers.mean[place] == pytest.approx(1.0)
    assert powers.variance[place] == pytest.approx(2 * (1 / 6) / 10**2)
    budget = ErrorBudget(grid.first_object, "objects", {0: powers})
    assert budget.relative_error() == pytest.approx(math.sqrt(1 / 3) / 10)


def test_replicates_together_have_the_powers_of_each() -> None:
    seen = ReceiverRecord("perspective", np.eye(4).tolist(), -0.01, 0.01, -0.01, 0.01, 0.0)
    rays = pixel_rays(seen, 20, 20)
    random, views = np.random.default_rng(3), []
    for replicate in range(3):
        rows, column = PathRows.zeros(400), np.arange(400) % 20
        rows["direction"] = rays.direction.reshape(-1, 3)
        rows["solid_angle_sr"] = rays.solid_angle_sr.ravel() / 3
        rows["order"], rows["replicate"] = 1, replicate
        rows["last_object"] = 1 + (column > 7 + replicate)
        rows["power_w"] = random.uniform(0.5, 1.0, 400)
        rows["length_m"] = 7.0 + 0.3 * (np.arange(400) // 20) + 0.1 * random.uniform(size=400)
        rows["flags"][3 * 20 + 4] = PathFlag.NO_RANGE
        views.append(rows[replicate:])
    views.insert(1, views[0][:0])  # a replicate that sees nothing
    for ranges in (True, False):
        grid = CellGrid(bin_m=0.25, bins=30, ranges=ranges)
        together = grid.powers_of_views(views, 4, seen)
        for rows, found in zip(views, together, strict=True):
            alone = grid.replicate_powers(rows, 4, seen)
            assert np.array_equal(found.cells, alone.cells)
            assert found.power == pytest.approx(alone.power, rel=1e-14)
            for name in ("hits", "edges"):
                own, other = getattr(alone, name), getattr(found, name)
                assert np.array_equal(own, other[: own.size]) and not other[own.size :].any()


def test_objects_beyond_the_target_are_named() -> None:
    """The target is a mean over all objects: those far from it are not passed over in silence."""
    budget = ErrorBudget(10, "objects")
    cells = np.array([3, 11, 12, 13])
    budget.powers[0] = CellPowers(
        cells, np.array([1.0, 2.0, 4.0, 1e-12]), np.array([0.0, 0.01, 0.01, 1.0])
    )
    errors = budget.object_errors()
    assert errors == pytest.approx({1: 0.05, 2: 0.025})  # the third one is too faint to count
    names = ["Strip", "Square", "Faint"]
    assert uncertain_objects(errors, names, 0.03) == []
    (found,) = uncertain_objects(errors, names, 0.02)
    assert (found.code, found.subjects) == ("object-error-above-target", ("Strip",))
    assert found.numbers == {
        "stderr_fraction": pytest.approx(0.05),
        "target_fraction": 0.02,
    }
    many = {n: 0.5 + n / 100 for n in range(1, 9)}
    (found,) = merge(uncertain_objects(many, [str(n) for n in many], 0.1))
    assert found.subjects == tuple("87654321")
    assert found.numbers["stderr_fraction"] == (0.51, 0.58)
    assert "'8', '7', '6' and 5 more has" in found.text


def test_standard_error_of_truncated_reflections_in_watts() -> None:
    """Its square goes as the square of the power: what the sums scatter by, in any unit."""
    rng = np.random.default_rng(9)
    watts_per_unit, tiles = 3e-7, 40
    mean, sigma = 2.0, 0.5
    for unit in (watts_per_unit, 1.0, 1e5):
        powers, reported = [], []
        for _ in range(400):
            sums = QualitySums()
            for beyond in rng.normal(mean, sigma, tiles):
                sums.add_beyond(PowerBeyond(float(beyond), sigma**2), unit)
            powers.append(sums.truncated_reflections_w)
            # without other power the fraction is of the truncated power itself
            reported.append(sums.truncated_reflections_stderr * sums.total_w)
        assert np.mean(reported) == pytest.approx(np.std(powers, ddof=1), rel=0.12)
        assert np.mean(powers) == pytest.approx(tiles * mean * unit, rel=0.01)
