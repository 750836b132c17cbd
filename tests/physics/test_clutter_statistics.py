# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture and velocities of clutter, against the moments and spectra of their distributions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.clutter import bragg_velocity_mps, clutter_velocities, texture

SEEDS = 400


def samples(kind: str, shape: float) -> np.ndarray:
    """Factors at places far apart, of many realisations: the field has few cosines in each."""
    places = np.stack(np.meshgrid(*[np.arange(20) * 7.3] * 2, [0.0]), -1).reshape(-1, 3)
    return np.concatenate([texture(places, kind, shape, 2.0, seed) for seed in range(SEEDS)])


@pytest.mark.parametrize("nu", [0.5, 1.0, 4.0])
def test_k_texture_has_mean_1_and_the_variance_of_its_order(nu: float) -> None:
    found = samples("k", nu)
    assert found.mean() == pytest.approx(1.0, abs=0.01)
    assert 1 / found.var() == pytest.approx(nu, rel=0.03)


def test_lognormal_texture_has_mean_1_and_its_spread() -> None:
    found = samples("lognormal", 0.8)
    assert found.mean() == pytest.approx(1.0, abs=0.01)
    assert np.log(found).std() == pytest.approx(0.8, rel=0.01)


@pytest.mark.parametrize("shape", [0.4, 0.7, 1.0])
def test_weibull_texture_over_speckle_is_weibull(shape: float) -> None:
    found = samples("weibull", shape)
    intensity = found * np.random.default_rng(1).exponential(size=found.size)
    assert intensity.mean() == pytest.approx(1.0, abs=0.03)
    few = intensity[::40]
    scale = 1 / math.gamma(1 + 1 / shape)
    assert stats.kstest(few, stats.weibull_min(shape, scale=scale).cdf).pvalue > 0.01
    for level in (0.01, 0.5, 0.99):
        quantile = stats.weibull_min(shape, scale=scale).ppf(level)
        assert np.mean(intensity < quantile) == pytest.approx(level, abs=0.006)


def test_texture_is_correlated_over_its_length_and_belongs_to_the_seed() -> None:
    """The field underneath a log-normal one has the correlation exp(-(r/L)^2)."""
    pairs = []
    for seed in range(SEEDS):
        places = np.zeros((40, 3))
        places[:, 0] = np.repeat(np.arange(20) * 50.0, 2)
        places[1::2, 1] += 3.0
        pairs.append(np.log(texture(places, "lognormal", 1.0, 4.0, seed)).reshape(-1, 2) + 0.5)
    first, second = np.concatenate(pairs).T
    assert np.mean(first * second) == pytest.approx(math.exp(-((3 / 4) ** 2)), abs=0.04)
    again = texture(np.ones((1, 3)), "k", 1.0, 4.0, 5)
    assert again == texture(np.ones((1, 3)), "k", 1.0, 4.0, 5)
    assert again != texture(np.ones((1, 3)), "k", 1.0, 4.0, 6)


def drawn(kind: str, speed_mps: float, fraction: float, count: int = 400_000) -> np.ndarray:
    rng = np.random.default_rng(3)
    draws = rng.uniform(size=count), rng.uniform(size=count)
    return clutter_velocities(kind, speed_mps, fraction, draws, np.ones(count), 0.03)


def test_exponential_motion_has_its_slope_and_its_still_part() -> None:
    found = drawn("exponential", 0.15, 0.3)
    assert np.mean(found == 0) == pytest.approx(0.3, abs=0.003)
    assert np.mean(found[found != 0] > 0) == pytest.approx(0.5, abs=0.003)
    counts, edges = np.histogram(np.abs(found[found != 0]), np.linspace(0, 0.9, 19))
    slope = np.polyfit((edges[1:] + edges[:-1]) / 2, np.log(counts), 1)[0]
    assert -1 / slope == pytest.approx(0.15, rel=0.05)


def test_gaussian_motion_has_its_spread() -> None:
    found = drawn("gaussian", 0.4, 0.0)
    assert found.std() == pytest.approx(0.4, rel=0.01)
    assert stats.kstest(found[::100], stats.norm(scale=0.4).cdf).pvalue > 0.01


def test_sea_has_both_bragg_lines() -> None:
    """At 10 GHz waves of 15 mm run at 0.231 m/s: g k = 4108, tension 7.4e-5 k^3 = 5441 (1/s^2)."""
    k = 2 * math.pi / 0.015
    line_mps = math.sqrt(9.81 * k + 7.4e-5 * k**3) / k
    assert line_mps == pytest.approx(0.233, abs=0.001)
    assert bragg_velocity_mps(0.03, 1.0) == pytest.approx(line_mps, rel=1e-12)
    found = drawn("sea", 0.02, 0.25)
    near = np.abs(found + line_mps) < 0.1
    assert np.mean(near) == pytest.approx(0.25, abs=0.003)
    assert found[near].mean() == pytest.approx(-line_mps, rel=0.01)
    assert found[~near].std() == pytest.approx(0.02, rel=0.01)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: texture(np.zeros((1, 3)), "gamma", 1, 1, 0), "Texture is 'gamma'"),
        (lambda: texture(np.zeros((1, 3)), "k", 0, 1, 0), "Shape of the texture"),
        (lambda: texture(np.zeros((1, 3)), "weibull", 1.2, 1, 0), "0.05 to 1"),
        (lambda: texture(np.zeros((1, 3)), "k", 1, 0, 0), "Length of the texture"),
        (lambda: drawn("billingsley", 1, 0, 1), "Clutter motion is 'billingsley'"),
        (lambda: drawn("gaussian", -1, 0, 1), "Speed"),
        (lambda: drawn("sea", 1, 2, 1), "Fraction"),
    ],
)
def test_wrong_numbers_are_named(call: object, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        call()  # type: ignore[operator]
