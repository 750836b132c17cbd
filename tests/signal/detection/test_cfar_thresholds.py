# SPDX-License-Identifier: GPL-3.0-or-later
"""Factors of CFAR on the statistic of the training cells, against closed forms."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import Cfar, cfar_threshold
from radarsim_addon.signal.detection import cfar
from radarsim_addon.signal.detection.cfar import (
    Calibration,
    ca_factor,
    ca_factor_exact,
    drawn_factor,
    drawn_statistic,
    equivalent_cells,
    os_equivalent,
    os_factor,
    os_false_alarms,
    os_moments,
)
from tests.signal.detection.test_cfar import PMCW_RADAR, RADAR, noise_map


def test_factors_are_the_closed_forms() -> None:
    assert ca_factor(1e-6, 32) == pytest.approx(32 * (1e-6 ** (-1 / 32) - 1), rel=1e-12)
    assert ca_factor(1e-4, 1e9) == pytest.approx(-math.log(1e-4), rel=1e-6)
    # Rohling 1983: 24 cells, the 18th, Pfa by the product itself
    alpha = os_factor(1e-6, 24, 18 / 24)
    product = math.prod((24 - i) / (24 - i + alpha) for i in range(18))
    assert product == pytest.approx(1e-6, rel=1e-9)
    assert os_false_alarms(alpha, 24, 0.75) == pytest.approx(1e-6, rel=1e-9)
    with pytest.raises(ConfigError, match="cannot reach"):
        os_factor(1e-15, 1.2, 0.75)


def test_factors_of_correlated_cells_are_those_of_as_many_independent_ones() -> None:
    """Pairs of equal cells are as good as half as many."""
    alone, pairs = np.eye(12), np.kron(np.eye(12), np.ones((2, 2)))
    for covariance in (alone, pairs):
        found = ca_factor_exact(1e-5, covariance.astype(complex))
        assert found == pytest.approx(ca_factor(1e-5, 12), rel=1e-9)
        drawn = drawn_statistic(covariance.astype(complex), 9 * covariance.shape[0] // 12)
        mean, variance = os_moments(12, 0.75)
        assert drawn.mean() == pytest.approx(mean, abs=5 * math.sqrt(variance / drawn.size))
        assert drawn.var() == pytest.approx(variance, rel=0.06)
        assert drawn_factor(1e-3, drawn) == pytest.approx(os_factor(1e-3, 12, 0.75), rel=0.02)


def test_moments_of_the_ordered_statistic_are_the_closed_form() -> None:
    """x is a sum of independent exponentials of means 1/n ... 1/(n-k+1) (Renyi)."""
    mean, variance = os_moments(40, 0.75)
    terms = 1 / np.arange(11, 41)
    assert mean == pytest.approx(terms.sum(), rel=1e-4)
    assert variance == pytest.approx((terms**2).sum(), rel=1e-4)
    cells, scale = os_equivalent(3 * mean, 9 * variance, 0.75)
    assert cells == pytest.approx(40, rel=1e-6)
    assert scale == pytest.approx(3, rel=1e-6)


def test_independent_cells_count_as_many_as_they_are() -> None:
    mask = np.ones((5, 7), dtype=bool)
    mask[2, 3] = False
    alone = np.array([1.0, 0, 0, 0, 0, 0, 0])
    assert equivalent_cells(mask, alone, alone) == pytest.approx(34)
    row = np.ones((1, 8), dtype=bool)
    pairs = np.array([1.0, 1.0, 0, 0, 0, 0, 0, 0])
    assert equivalent_cells(row, alone, pairs) == pytest.approx(64 / (8 + 14))


def test_frames_of_a_run_share_their_factors(monkeypatch: pytest.MonkeyPatch) -> None:
    """The draws depend on radar, tapers, ring and rate: not on the values of a map."""
    made = []

    def counted(*numbers: Any) -> Any:
        made.append(numbers)
        return Calibration(*numbers)

    monkeypatch.setattr(cfar, "Calibration", counted)
    cfar._calibration.cache_clear()
    first, other = (noise_map(RADAR, "hamming", seed) for seed in (0, 1))
    rule = Cfar("os", 1e-3, (2, 2), (2, 3))
    apart = [cfar_threshold(rd_map, rule) for rd_map in (first, other)]
    assert len(made) == 1
    cfar._calibration.cache_clear()
    alone = cfar_threshold(other, rule)
    np.testing.assert_array_equal(apart[1].threshold, alone.threshold)
    for rd_map, changed in (
        (noise_map(RADAR, "none", 0), rule),
        (noise_map(PMCW_RADAR, "hamming", 0), rule),
        (first, dataclasses.replace(rule, pfa=1e-4)),
        (first, dataclasses.replace(rule, rank=0.5)),
        (first, dataclasses.replace(rule, kind="ca")),
        (first, dataclasses.replace(rule, guard=(1, 8))),
    ):
        before = len(made)
        cfar_threshold(rd_map, changed)
        assert len(made) == before + 1, changed
