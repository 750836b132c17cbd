# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors column by column against numpy's own functions, bit by bit."""

from __future__ import annotations

import numpy as np
import pytest

from radarsim_addon import arrays


@pytest.mark.parametrize("second", [(3,), (500, 3)])
def test_same_bits_as_numpy(second: tuple[int, ...]) -> None:
    """Results of both memory orders; NaN and infinity, too."""
    rng = np.random.default_rng(4)
    a = rng.normal(size=(500, 3)) * 10.0 ** rng.integers(-9, 9, (500, 1))
    a[3, 1], a[4, 2], a[5, 0] = np.nan, np.inf, -np.inf
    b = rng.normal(size=second)
    for first in (a, np.asfortranarray(a)):
        np.testing.assert_array_equal(arrays.norms(first), np.linalg.norm(a, axis=1))
        np.testing.assert_array_equal(arrays.distances(first, b), np.linalg.norm(a - b, axis=1))
        np.testing.assert_array_equal(arrays.dots(first, b), np.sum(a * b, axis=1))
        np.testing.assert_array_equal(arrays.crosses(first, b), np.cross(a, b))
        np.testing.assert_array_equal(arrays.largest(first), np.abs(a).max(axis=1))
        finite = np.isfinite(a).all(axis=1)
        np.testing.assert_array_equal(arrays.are_finite(first), finite)
