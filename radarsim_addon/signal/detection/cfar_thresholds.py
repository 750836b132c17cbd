# SPDX-License-Identifier: GPL-3.0-or-later
"""Thresholds of CFAR detectors for the correlated cells of a tapered, oversampled map.

For exponential power (Gaussian noise, or speckle) of mean 1, a threshold alpha x and a statistic x
of training cells uncorrelated with the tested cell, Pfa = E exp(-alpha x). For n independent cells

- mean: Pfa = (1 + alpha / n)^-n (Richards, Fundamentals of Radar Signal Processing, 6.5);
- k-th smallest: Pfa = prod_{i<k} (n - i) / (n - i + alpha) (Rohling, IEEE TAES 19, 608, 1983).

Tapers and oversampling correlate neighbouring cells. With the covariance C of the training cells,
that of white noise in this map, the mean is a quadratic form of Gaussians and Pfa = 1 / det(1 +
alpha C / n) exactly (Turin, Biometrika 47, 199, 1960). Large rings use the closed form above with
n^2 / sum |C_ij|^2 cells, which estimate the mean as well. The ordered statistic of correlated cells
has no closed form: it is drawn with covariance C and a fixed seed. The closed form above uses the
number of cells, and the scale, with the same mean and variance. alpha is then corrected by the
average of exp(-alpha x) over the draws at 1e-4, or at the requested Pfa if that is higher; below
1e-4 the correction grows with the logarithm of Pfa.

A BLAS rounds differently with each number of threads. Results must not, so that sums over noise go
by einsum, and factors from a library's eigenvalues are rounded.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Mask, Real
from ...errors import ConfigError
from ..maps import RangeDopplerMap, line_weights
from ..radar import LineWaveform, matched_filter, slow_time_window

#: Maximum number of training cells with an exact Pfa of the mean: eigenvalues of such a matrix.
_MAX_EXACT = 512
#: Draws of the ordered statistic: its mean to 0.1 %, its variance to 1 %.
_DRAWS = 20000
#: Smallest Pfa that so many draws determine, to some 2 %.
_MIN_DRAWN = 1e-4
#: Variance that the covariance leaves unexplained, of 1: rounding.
_RANK = 1e-9


def ca_factor(pfa: float, cells: float) -> float:
    """Return alpha of cell averaging over independent cells: n (Pfa^(-1/n) - 1)."""
    return float(cells * math.expm1(-math.log(pfa) / cells))


def ca_factor_exact(pfa: float, covariance: Complex) -> float:
    """Return alpha of cell averaging over cells of a covariance (n, n) with unit diagonal."""
    eigenvalues = np.maximum(np.linalg.eigvalsh(covariance), 0.0) / covariance.shape[0]

    def enough(factor: float) -> bool:
        return bool(np.log1p(factor * eigenvalues).sum() >= -math.log(pfa))

    high = 1.0
    while not enough(high):
        high *= 2
    return float(f"{_bisect(enough, high, 60):.10g}")


def _bisect(enough: Callable[[float], bool], high: float, rounds: int) -> float:
    """Least factor from 0 to `high` that is enough, to 2^-rounds of the interval."""
    low = 0.0
    for _ in range(rounds):
        middle = (low + high) / 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return (low + high) / 2


def os_false_alarms(factor: float, cells: float, rank: float) -> float:
    """Return Pfa of the ordered statistic: threshold factor x the (rank x cells)-th smallest."""
    k = rank * cells
    return math.exp(
        math.lgamma(cells + 1)
        - math.lgamma(cells - k + 1)
        + math.lgamma(cells - k + 1 + factor)
        - math.lgamma(cells + 1 + factor)
    )


def os_factor(pfa: float, cells: float, rank: float) -> float:
    """Return alpha of the ordered statistic, from its Pfa by bisection."""
    high = 1.0
    while os_false_alarms(high, cells, rank) > pfa:
        high *= 2
        if high > 1e12:
            raise ConfigError(
                f"{cells:.3g} independent training cells cannot reach a false-alarm rate of "
                f"{pfa:g}. Take more training cells, or a higher rate."
            )
    return _bisect(lambda factor: os_false_alarms(factor, cells, rank) <= pfa, high, 80)


def os_moments(cells: float, rank: float) -> tuple[float, float]:
    """Return mean and variance of the ordered statistic of independent cells.

    First and second derivative of log Pfa(alpha) at 0, because E exp(-alpha x) generates moments.
    """
    step = 0.02
    up, down = (math.log(os_false_alarms(sign * step, cells, rank)) for sign in (1, -1))
    return (down - up) / (2 * step), (down + up) / step**2


def os_equivalent(mean: float, variance: float, rank: float) -> tuple[float, float]:
    """Return independent cells, and the scale of their statistic, with this mean and variance."""
    low, high = 1.0, 1e6
    for _ in range(60):
        middle = math.sqrt(low * high)
        own_mean, own_variance = os_moments(middle, rank)
        wide = own_variance / own_mean**2 > variance / mean**2
        low, high = (middle, high) if wide else (low, middle)
    return low, mean / os_moments(low, rank)[0]


def drawn_statistic(covariance: Complex, k: int, seed: int = 0) -> Real:
    """Draw the k-th smallest power of cells with a covariance (n, n) at random, (draws,)."""
    mixing = _root(covariance) / math.sqrt(2)
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((_DRAWS, 2, mixing.shape[0]))
    power = np.abs(np.einsum("ij,jk->ik", white[:, 0] + 1j * white[:, 1], mixing)) ** 2
    return np.asarray(np.partition(power, k - 1, axis=1)[:, k - 1])


def _root(covariance: Complex) -> Complex:
    """Rows r with sum_i conj(r_i) r_i^T = C, by the Cholesky decomposition with pivots."""
    left = covariance.conj()
    rows: list[Complex] = []
    while left.diagonal().real.max() > _RANK:
        pivot = int(np.argmax(left.diagonal().real))
        row = left[pivot] / math.sqrt(left[pivot, pivot].real)
        left = left - np.conj(row)[:, None] * row
        rows.append(row)
        left[pivot], left[:, pivot] = 0, 0
    return np.array(rows)


def drawn_factor(pfa: float, statistic: Real) -> float:
    """Return alpha for which the average of exp(-alpha x) is Pfa."""
    high = -2 * math.log(pfa) / float(statistic.min())
    return _bisect(lambda factor: float(np.exp(-factor * statistic).mean()) <= pfa, high, 50)


def noise_correlation(rd_map: RangeDopplerMap, lags: tuple[int, int]) -> tuple[Complex, Complex]:
    """Return rho of white noise in a map at lags of 0 ... (Doppler, range) cells."""
    radar = rd_map.radar
    waveform = radar.waveform
    pulses = rd_map.values.shape[1]
    squared = slow_time_window(rd_map.doppler_taper, pulses) ** 2
    turn = np.exp(-2j * np.pi * np.outer(np.arange(lags[0] + 1), np.arange(pulses)) / pulses)
    doppler = np.einsum("ij,j->i", turn, squared) / squared.sum()
    if isinstance(waveform, LineWaveform):
        weight = line_weights(waveform, rd_map.range_taper)
        # the correlator's spectrum once: noise has passed it a single time
        density = weight if waveform.kind == "pmcw" else weight**2
        position = np.arange(weight.size) / weight.size
    else:
        size = 4 * waveform.sample_count
        density = np.abs(matched_filter(waveform, size, rd_map.range_taper)) ** 2
        position = np.fft.fftfreq(size)
    step_m = rd_map.range_m[1] - rd_map.range_m[0] if rd_map.range_m.size > 1 else 1.0
    cells = np.arange(lags[1] + 1) * float(step_m) / waveform.sample_spacing_m
    turn = np.exp(2j * np.pi * np.outer(cells, position))
    return np.asarray(doppler), np.einsum("ij,j->i", turn, density) / density.sum()


def covariance(mask: Mask, doppler: Complex, range_: Complex) -> Complex:
    """Return the covariance of the cells of a mask, from rho at lags of 0, 1 ... cells."""

    def at(rho: Complex, lag: NDArray[np.intp]) -> Complex:
        return np.where(lag < 0, np.conj(rho[np.abs(lag)]), rho[np.abs(lag)])

    rows, cols = np.nonzero(mask)
    return at(doppler, rows[:, None] - rows) * at(range_, cols[:, None] - cols)


def equivalent_cells(mask: Mask, doppler: Real, range_: Real) -> float:
    """Return the number of independent cells with a mean as exact as of these training cells.

    From their mask (Doppler, range) and |rho|^2 at lags of 0, 1 ... cells.
    """
    shape = tuple(2 * n for n in mask.shape)
    pairs = np.fft.irfft2(np.abs(np.fft.rfft2(mask, shape)) ** 2, shape)
    lag0 = np.abs(np.fft.fftfreq(shape[0], 1 / shape[0])).astype(np.intp)
    lag1 = np.abs(np.fft.fftfreq(shape[1], 1 / shape[1])).astype(np.intp)
    pad = np.pad(doppler, (0, 1)), np.pad(range_, (0, 1))
    rho = pad[0][np.minimum(lag0, doppler.size)][:, None] * pad[1][np.minimum(lag1, range_.size)]
    count = float(mask.sum())
    return count**2 / float(np.sum(pairs * rho))


class Calibration:
    """Factors on the statistic of a ring of training cells: `mask` (Doppler, range) of one cell.

    `rank` is k / cells of the ordered statistic; None: cell averaging. `mean` is the mean of the
    statistic for cells of mean power 1, `independent` the equivalent number of independent cells.
    Towards the range limits the ring is cut, down to half of it: the equivalent number of cells is
    interpolated between the two.
    """

    def __init__(
        self, mask: Mask, correlation: tuple[Complex, Complex], pfa: float, rank: float | None
    ) -> None:
        self._pfa, self._rank = pfa, rank
        half = mask.copy()
        half[:, : mask.shape[1] // 2] = False
        whole = self._worth(mask, correlation)
        self.mean, self.independent = whole[2], whole[0] * int(mask.sum())
        ends = [(int(mask.sum()), whole)]
        if 0 < half.sum() < mask.sum():
            ends.insert(0, (int(half.sum()), self._worth(half, correlation)))
        self._counts = [count for count, _ in ends]
        self._fractions = [worth[0] for _, worth in ends]
        self._scales = [worth[1] for _, worth in ends]

    def _worth(
        self, mask: Mask, correlation: tuple[Complex, Complex]
    ) -> tuple[float, float, float]:
        """Return independent cells per cell, scale of the closed form, mean of the statistic."""
        count = int(mask.sum())
        if self._rank is None:
            doppler, range_ = (np.abs(rho) ** 2 for rho in correlation)
            cells = max(equivalent_cells(mask, doppler, range_), 1.0)
            exact = plain = ca_factor(self._pfa, cells)
            if count <= _MAX_EXACT:
                exact = ca_factor_exact(self._pfa, covariance(mask, *correlation))
            return cells / count, exact / plain, 1.0
        k = min(max(round(self._rank * count), 1), count)
        drawn = drawn_statistic(covariance(mask, *correlation), k)
        mean = float(drawn.mean())
        cells, scale = os_equivalent(mean, float(drawn.var()), k / count)
        pfa = max(self._pfa, _MIN_DRAWN)
        excess = drawn_factor(pfa, drawn) * scale / os_factor(pfa, cells, k / count) - 1
        excess *= math.log(self._pfa) / math.log(pfa)
        return cells / count, (1 + excess) / scale, mean

    def factor(self, count: int) -> float:
        """Return alpha for this number of available training cells."""
        fraction = float(np.interp(count, self._counts, self._fractions))
        scale = float(np.interp(count, self._counts, self._scales))
        if self._rank is None:
            return scale * ca_factor(self._pfa, max(count * fraction, 1.0))
        k = min(max(round(self._rank * count), 1), count)
        return scale * os_factor(self._pfa, max(count * fraction, 2.0), k / count)
