# SPDX-License-Identifier: GPL-3.0-or-later
"""Ranges where rays leave gaps count if they hold some power."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from radarsim_addon.signal.maps.expected_power_map import RayGaps


@pytest.mark.parametrize(
    ("fraction", "found"),
    [(0.5, True), (1e-12, True), (4e-20, True), (1e-21, False), (1e-34, False)],
)
@pytest.mark.parametrize("level_w", [1.0, 1e-15])
def test_gaps_of_negligible_power_are_no_finding(
    fraction: float, found: bool, level_w: float
) -> None:
    """Pixels of 0.1 m to 500 m and of 20 m beyond, where a cell has 3 m and a bin 5 m."""
    range_m = np.linspace(1.0, 999.0, 1000)
    far = range_m > 500
    steps = SimpleNamespace(length_m=np.where(far, 20.0, 0.1)[:, None, None] * np.ones((1, 2, 2)))
    # in each bin beyond 500 m this fraction of the power before
    power_w = np.where(far, fraction * np.sum(~far), 1.0)
    power_w *= level_w / power_w.sum()
    each_bin = np.histogram(range_m, 200, (0.0, 1000.0), weights=power_w)[0]
    assert (each_bin[-1] / level_w > 1e-20) == found
    gaps = RayGaps((0.0, 1000.0), 3.0)
    for part in (slice(0, 300), slice(300, 1000)):
        gaps.add(
            {"length_m": 2 * range_m[part]}, SimpleNamespace(length_m=steps.length_m[part]),
            power_w[part],
        )  # fmt: skip
    start_m = gaps.start_m()
    assert start_m == pytest.approx(500, abs=5) if found else start_m == math.inf
