# SPDX-License-Identifier: GPL-3.0-or-later
"""Power of range bins, against that of the points that rows are spread over."""

from __future__ import annotations

import math

import numpy as np
import pytest

from radarsim_addon.signal.paths import (
    PathRows,
    Steps,
    power_of_range_bins,
    spread,
)

BIN_M, BINS = 0.75, 90


def rows_and_steps(count: int, largest_m: float) -> tuple[PathRows, Steps]:
    """Rows up to beyond the last bin; some do not reach anywhere, some along one axis alone."""
    chance = np.random.default_rng(5)
    rows = PathRows.zeros(count)
    rows["length_m"], rows["power_w"] = chance.uniform(1, 150, count), chance.uniform(0, 2, count)
    steps_m = chance.uniform(-largest_m, largest_m, (count, 2, 2)) ** 3 / largest_m**2
    steps_m[::3] = 0
    steps_m[1::3, 0] = 0
    steps_m[::4, :, 1] = 0  # known on one side alone
    power = chance.uniform(-0.9, 0.9, (count, 2, 2))
    return rows, Steps(steps_m, np.zeros_like(steps_m), power)


def power_of_points(rows: PathRows, steps: Steps) -> np.ndarray:
    total = np.zeros(BINS + 1)
    for part in spread(rows, steps, BIN_M, math.inf):
        place = np.clip(part.length_m / 2 / BIN_M, 0, BINS).astype(int)
        total += np.bincount(place, part.share * rows["power_w"][part.row], BINS + 1)
    return total


def one_view(rows: PathRows, steps: Steps) -> np.ndarray:
    view = np.zeros(rows.size, dtype=np.intp)
    return power_of_range_bins(rows, steps, BIN_M, BINS, view, 1)[0]


@pytest.mark.parametrize(("count", "largest_m"), [(1, 40.0), (500, 6.0), (3000, 90.0)])
def test_it_is_the_power_of_the_points(count: int, largest_m: float) -> None:
    """Up to rounding; also where there are so many points that they are coarser (the last)."""
    rows, steps = rows_and_steps(count, largest_m)
    found = one_view(rows, steps)
    assert found == pytest.approx(power_of_points(rows, steps), rel=1e-11, abs=1e-14)
    assert found.sum() == pytest.approx(rows["power_w"].sum(), rel=1e-12)


def test_views_have_sums_of_their_own() -> None:
    """Each that of its rows alone; the second of three has none."""
    rows, steps = rows_and_steps(600, 6.0)
    view = np.repeat([0, 2], [250, 350])
    found = power_of_range_bins(rows, steps, BIN_M, BINS, view, 3)
    assert not found[1].any()
    for number, some in ((0, slice(0, 250)), (2, slice(250, 600))):
        alone = one_view(rows[some], steps.part(some))
        assert found[number] == pytest.approx(alone, rel=1e-11, abs=1e-14)


def test_a_row_across_a_border_is_cut_there() -> None:
    """A quarter of a pixel's range lies beyond the border of two bins, by hand."""
    rows = PathRows.zeros(1)
    rows["length_m"], rows["power_w"] = 2 * 10 * BIN_M - 0.1, 3.0
    steps = np.zeros((1, 2, 2))
    steps[0, 1] = 0.4  # from 0.3 before the border to 0.1 after it
    found = one_view(rows, Steps(steps, 0 * steps, 0 * steps))
    assert found[9] == pytest.approx(2.25)
    assert found[10] == pytest.approx(0.75)
    assert found.sum() == pytest.approx(3.0)


def test_no_rows_have_no_power() -> None:
    """Of a view without any path."""
    steps = np.zeros((0, 2, 2))
    rows = PathRows.zeros(0)
    assert not one_view(rows, Steps(steps, steps, steps)).any()
