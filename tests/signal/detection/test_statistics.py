# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums over the paths of a frame, added up by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from radarsim_addon.signal.detection.statistics import StatisticsSum, statistics_findings
from radarsim_addon.signal.paths import PathCounts, PathFlag, Paths, make_paths
from radarsim_addon.signal.radar import Burst, Radar, Waveform

# 749 m and 2828 m/s are unambiguous.
RADAR = Radar(Waveform(5.3e9, 50e6, 0.5e-6, 60e6), Burst(200e3, 32))


def six_paths() -> Paths:
    """Ranges of 10 to 900 m, radiances 1 to 6; two are mixed."""
    paths = make_paths(
        np.arange(1.0, 7.0),
        2 * np.array([100.0, 10.0, 900.0, 300.0, 740.0, 760.0]),
        np.array([0.0, 2900.0, -2900.0, 2800.0, -2800.0, -1e4]),
        1e-6,
    )
    flags = np.zeros(6, dtype=np.uint16)
    flags[[1, 5]] = PathFlag.MIXED | PathFlag.ENCODED_LENGTH
    flags[2] = PathFlag.ENCODED_LENGTH
    return dataclasses.replace(paths, flags=flags)


def test_sums_in_parts_are_those_by_hand() -> None:
    total = StatisticsSum(RADAR, 10.0)
    for part in (slice(0, 2), slice(2, 2), slice(2, 6)):
        total.add(six_paths()[part])
    found = total.result(0.0)
    area_m2 = 10.0 * (299_792_458 / 5.3e9) ** 2 / (4 * math.pi)
    assert found.power_w == pytest.approx(21e-6 * area_m2, rel=1e-12)
    assert found.mixed_power_fraction == pytest.approx((2 + 6) / 21, rel=1e-12)
    assert (found.nearest_m, found.farthest_m) == (10.0, 900.0)
    assert found.beyond_unambiguous_range == 2
    # Approaching ones count as receding ones do.
    assert found.beyond_max_velocity == 3
    assert (found.counts.paths, found.counts.mixed) == (6, 2)
    codes = {item.code: item.numbers for item in statistics_findings(found, RADAR)}
    assert codes["doppler-ambiguous-paths"]["count"] == 3
    assert codes["range-ambiguous-paths"]["count"] == 2
    assert codes["mixed-pixels"]["fraction"] == pytest.approx(8 / 21)


def test_nothing_is_no_echo() -> None:
    found = StatisticsSum(RADAR, 1.0).result(0.0)
    assert (found.power_w, found.mixed_power_fraction, found.nearest_m) == (0.0, 0.0, None)
    assert [item.code for item in statistics_findings(found, RADAR)] == ["no-echo"]


def test_what_a_render_of_paths_has_told_is_not_told_as_of_rings() -> None:
    """Mixed pixels are in the render's findings; no ring is spoken of."""
    total = StatisticsSum(RADAR, 1.0)
    paths = six_paths()
    counts = dataclasses.replace(paths.counts, range_encoding_underflow=7)
    total.add(dataclasses.replace(paths, counts=counts))
    found = statistics_findings(total.result(0.0), RADAR, "paths")
    assert "mixed-pixels" not in {item.code for item in found}
    (without,) = (item for item in found if item.code == "paths-without-length")
    assert (without.severity, without.numbers["count"]) == ("info", 7)
    assert not any("ring" in item.message.split() for item in found)


@pytest.mark.parametrize(
    ("rejected", "single", "severity"), [(3, 2, "info"), (3, 3, "caution"), (0, 100, "info")]
)
def test_a_few_edges_without_a_range_rate_are_information(
    rejected: int, single: int, severity: str
) -> None:
    """Up to 5 % of 100 paths; a run of one snapshot knows no rate of any."""
    flags = np.zeros(100, dtype=np.uint16)
    flags[:rejected] = PathFlag.RANGE_RATE_REJECTED
    flags[rejected : rejected + single] = PathFlag.SINGLE_SNAPSHOT
    paths = make_paths(np.ones(100), 200.0, 0.0, 1e-6)
    total = StatisticsSum(RADAR, 1.0)
    total.add(dataclasses.replace(paths, flags=flags, counts=PathCounts.of(flags)))
    (found,) = statistics_findings(total.result(0.0), RADAR)
    assert (found.code, found.severity) == ("no-range-rate", severity)
