# SPDX-License-Identifier: GPL-3.0-or-later
"""Directive lobes: against quadrature over the half-space."""

from __future__ import annotations

import math

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.rough import directive_lobe, lobe_exponent, lobe_integral


def half_space(count: int = 160) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors above the plane z = 0, (n, 3), and their solid angles."""
    x, weights = np.polynomial.legendre.leggauss(count)
    up, weights = (x + 1) / 2, weights / 2
    turn = (np.arange(2 * count) + 0.5) * np.pi / count
    level = np.sqrt(1 - up**2)[:, None]
    z = np.broadcast_to(up[:, None], (count, 2 * count))
    ways = np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=-1)
    return ways.reshape(-1, 3), np.repeat(weights * np.pi / count, 2 * count)


@pytest.mark.parametrize("exponent", [1, 4, 5, 40, 1000])
def test_scattered_power_adds_up_to_one(exponent: int) -> None:
    ways, solid_angle = half_space()
    up = np.array([0.0, 0.0, 1.0])
    for incidence_deg in (0.0, 35.0, 60.0, 85.0):
        angle = math.radians(incidence_deg)
        source = np.array([math.sin(angle), 0.0, math.cos(angle)])
        mirrored = np.array([-source[0], 0.0, source[2]])
        lobe = ((1 + ways @ mirrored) / 2) ** exponent
        expected = float(lobe @ solid_angle)
        assert float(lobe_integral(exponent, source[2])) == pytest.approx(expected, rel=1e-5)
        normals, sources = (np.broadcast_to(one, ways.shape) for one in (up, source))
        found = directive_lobe(exponent, normals, sources, ways)
        assert float(found * ways[:, 2] @ solid_angle) == pytest.approx(1.0, abs=2e-5)


@pytest.mark.parametrize("value", [0, -1, 2.5, 1001, math.nan, math.inf, "wide", None, True])
def test_exponents_that_are_none_are_named(value: object) -> None:
    with pytest.raises(ConfigError, match="expected a whole number from 1"):
        lobe_exponent(value)
    assert lobe_exponent(np.float64(4.0)) == 4
