# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums over the paths of a frame, added up by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from radarsim_addon.signal.detection.statistics import StatisticsSum, statistics_findings
from radarsim_addon.signal.paths import PathCounts, PathFlag, Paths, make_paths
from radarsim_addon.signal.radar import Burst, FmcwWaveform, Radar, Waveform

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
    found = statistics_findings(total.result(0.0), RADAR, "paths", unranged_fraction=1e-4)
    assert "mixed-pixels" not in {item.code for item in found}
    (without,) = (item for item in found if item.code == "paths-without-length")
    assert (without.severity, without.numbers) == ("info", {"count": 7, "fraction": 1e-4})
    # 1e-20 of the received power is thermal noise in 2.5 Hz where a whole watt is received
    for fraction, told in ((1e-34, False), (0.9e-20, False), (1.1e-20, True)):
        codes = {
            item.code
            for item in statistics_findings(
                total.result(0.0), RADAR, "paths", unranged_fraction=fraction
            )
        }
        assert ("paths-without-length" in codes) == told
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


@pytest.mark.parametrize(
    ("limits_m", "in_maps", "severity"),
    [
        ((0.0, 1000.0), 6, ""),
        # 749.48 m are unambiguous: 760 m folds to 10.5 m, 900 m to 150.5 m
        ((0.0, 200.0), 4, "info"),
        ((140.0, 160.0), 1, "info"),
        ((110.0, 140.0), 0, "error"),
        ((320.0, 700.0), 0, "error"),
        ((2000.0, 2100.0), 0, "error"),
    ],
)
def test_an_empty_result_is_an_error(
    limits_m: tuple[float, float], in_maps: int, severity: str
) -> None:
    """Six paths at 10, 100, 300, 740, 760 and 900 m, stationary; the cell has 3 m."""
    total = StatisticsSum(RADAR, 1.0, limits_m)
    paths = dataclasses.replace(six_paths(), range_rate_mps=np.zeros(6))
    for part in (slice(0, 4), slice(4, 6)):
        total.add(paths[part])
    result = total.result(float(6 - in_maps))
    assert result.in_maps == in_maps
    found = statistics_findings(result, RADAR, "paths", limits_m)
    here = [item for item in found if "outside" in item.code]
    assert [item.severity for item in here] == ([severity] if severity else [])
    if severity == "error":
        assert here[0].code == "all-echoes-outside-ranges"
        assert here[0].numbers == {
            "count": 6, "nearest_m": 10.0, "farthest_m": 900.0,
            "start_m": limits_m[0], "stop_m": limits_m[1],
        }  # fmt: skip
        assert "10 m to 900 m" in here[0].text
        assert "--range-limits" in here[0].remedy


def test_what_comes_into_the_limits_during_the_burst_is_no_empty_result() -> None:
    """32 pulses at 200 kHz last 160 us: at 1e5 m/s a path moves 16 m."""
    for rate_mps, there in ((-1e5, True), (0.0, False)):
        total = StatisticsSum(RADAR, 1.0, (100.0, 200.0))
        total.add(make_paths(1.0, 2 * 210.0, rate_mps, 1e-6))
        assert bool(total.result(0.0).in_maps) == there


def test_all_beyond_the_band_of_an_fmcw_radar_is_an_error_too() -> None:
    """20 Msps and 10 MHz/us: f_s c / (2 K) = 300 m; complex samples hold the whole band."""
    radar = Radar(FmcwWaveform(77e9, 100e6, 200, 20e6), Burst(50e3, 16))
    limit_m = 20e6 * 299_792_458 / (2 * 100e6 / 10e-6)
    assert radar.unambiguous_range_m == pytest.approx(limit_m)
    for ranges_m, code in (([400.0, 500.0], True), ([200.0, 500.0], False)):
        total = StatisticsSum(radar, 1.0, (0.0, 1000.0))
        total.add(make_paths(np.ones(2), 2 * np.array(ranges_m), 0.0, 1e-6))
        found = statistics_findings(total.result(0.0), radar, "paths", (0.0, 1000.0))
        codes = {item.code: item.numbers for item in found}
        assert ("all-echoes-outside-ranges" in codes) == code
        if code:
            assert codes["all-echoes-outside-ranges"]["stop_m"] == pytest.approx(limit_m)


def test_paths_without_a_length_are_counted_as_a_measurement_counts_them() -> None:
    counts = PathCounts(paths=7107, range_encoding_underflow=3)
    assert counts.text == "7,110 paths, 3 of them without a length"
    assert PathCounts(paths=11).text == "11 paths"
