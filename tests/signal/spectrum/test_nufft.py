# SPDX-License-Identifier: GPL-3.0-or-later
"""Non-uniform FFT against the sum it stands for."""

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import nufft1
from radarsim_addon.signal.spectrum import nufft, smooth_size
from radarsim_addon.signal.spectrum.nufft import LEAST_ERROR, nufft_lines


@pytest.mark.parametrize("size", [1, 2, 7, 64, 1001])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-9, 1e-13])
def test_engine_meets_its_tolerance(size: int, tolerance: float) -> None:
    rng = np.random.default_rng(size)
    points = rng.uniform(-50, 50, 400)
    values = rng.normal(size=400) + 1j * rng.normal(size=400)
    k = np.arange(size) - size // 2
    expected = (values[:, None] * np.exp(-1j * points[:, None] * k)).sum(axis=0)
    found = nufft1(points, values, size, tolerance)
    # 20 ulp for what the sum itself rounds away
    assert np.abs(found - expected).max() < (tolerance + 5e-15 * size) * np.abs(values).sum()


@pytest.mark.parametrize("engine", ["finufft", "direct"])
def test_one_point_is_a_pure_tone(engine: nufft.Backend) -> None:
    found = nufft1(np.array([0.3]), np.array([2.0]), 8, backend=engine)
    np.testing.assert_allclose(found, 2 * np.exp(-0.3j * np.arange(-4, 4)), atol=1e-8)


@pytest.mark.parametrize("size", [1, 8, 101, 500])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
def test_rows_of_points_meet_their_tolerance(size: int, tolerance: float) -> None:
    """Against the direct sum, points at both ends of the circle included."""
    rng = np.random.default_rng(size)
    points = rng.uniform(-np.pi, np.pi, (5, 60))
    points[:, :2] = np.pi, -np.pi
    values = rng.normal(size=(3, 5, 60)) + 1j * rng.normal(size=(3, 5, 60))
    k = np.arange(size) - size // 2
    expected = np.einsum("smn,mnk->smk", values, np.exp(-1j * points[:, :, None] * k))
    found = nufft.RowsType1(size, tolerance)(points, values)
    assert found.shape == expected.shape
    most = np.abs(values).sum(axis=-1).max()
    assert np.abs(found - expected).max() < (tolerance + 5e-15 * size) * most


@pytest.mark.parametrize("tolerance", [1e-3, 1e-8, 1e-9, 1e-14])
@pytest.mark.parametrize(
    ("size", "lines", "farthest"), [(1, 1, 3.0), (7, 3, 0.0), (300, 20, 400.0)]
)
def test_lines_of_targets_meet_their_tolerance(
    size: int, lines: int, farthest: float, tolerance: float
) -> None:
    """Regular along one axis, any frequency along the other, against the direct sum."""
    rng = np.random.default_rng(size)
    x, y = rng.uniform(-np.pi, np.pi, 200), rng.uniform(-1, 1, 200)
    values = rng.normal(size=(2, 200)) + 1j * rng.normal(size=(2, 200))
    u = rng.uniform(-farthest, farthest, (lines, size))
    k = np.arange(size) - size // 2
    turns = np.exp(-1j * (k[:, None] * x + u[..., None] * y))
    expected = np.einsum("sn,lkn->slk", values, turns)
    found = np.stack(list(nufft_lines(x, y, values, size, u, tolerance)))
    # as the synthesis counts on: twice the tolerance, and what the places' digits leave
    bound = 2 * max(tolerance, LEAST_ERROR)
    assert np.linalg.norm(found - expected) < bound * np.linalg.norm(expected)


def test_no_points_give_zeros() -> None:
    assert not nufft1(np.empty(0), np.empty(0), 5).any()


def test_bad_requests() -> None:
    with pytest.raises(ConfigError, match="tolerance is 0"):
        nufft1(np.zeros(1), np.zeros(1), 5, tolerance=0)
    with pytest.raises(ConfigError, match="'fftw'"):
        nufft1(np.zeros(1), np.zeros(1), 5, backend="fftw")  # type: ignore[arg-type]


def test_smooth_sizes() -> None:
    def smooth(n: int) -> bool:
        for p in (2, 3, 5):
            while n % p == 0:
                n //= p
        return n == 1

    for number in range(1, 2000):
        expected = next(n for n in range(number, 2 * number + 1) if smooth(n))
        assert smooth_size(number) == expected
