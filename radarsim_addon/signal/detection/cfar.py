# SPDX-License-Identifier: GPL-3.0-or-later
"""Constant false-alarm rate: thresholds from the cells around each cell of a map.

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

import dataclasses
import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Indices, Mask, Real
from ...errors import ConfigError
from ...options import check_settings, documented, setting
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
CfarKind = Literal["ca", "os"]
#: Cells whose noise is correlated with that of the tested cell by |rho|^2 of this are guard cells.
_CORRELATED = 0.01
#: Resolution cells to each side within which the main lobes of all windows lie.
_WIDEST_LOBE = 8
#: Maximum number of training cells that the ordered statistic sorts, evenly taken from the ring.
_MAX_SORTED = 96
#: Cells sorted at a time: 64 MB.
_BLOCK = 1 << 23


@documented
@dataclass(frozen=True)
class Cfar:
    """A detector."""

    kind: CfarKind = setting(
        "CFAR",
        "Find targets by a constant false-alarm rate",
        "ca",
        choices=(
            ("ca", "Cell averaging", "Mean of the training cells"),
            ("os", "Ordered statistic", "Less disturbed by neighbours and edges of clutter"),
        ),
        flag="--cfar",
    )
    pfa: float = setting(
        "False-alarm rate", "Set the false alarms per cell", 1e-6, minimum=1e-15, maximum=0.5
    )
    guard: tuple[int, int] = setting(
        "Number of guard cells",
        "Set the guard cells to each side (Doppler, range); at least the main lobe", (4, 8),
        minimum=0, maximum=4096, flag="--cfar-guard", metavar="D,R",
    )  # fmt: skip
    train: tuple[int, int] = setting(
        "Number of training cells", "Set the training cells to each side (Doppler, range)", (4, 24),
        minimum=0, maximum=4096, flag="--cfar-train", metavar="D,R",
    )  # fmt: skip
    rank: float = setting(
        "CFAR rank",
        "Set the rank of the ordered statistic as a fraction of the training cells",
        0.75,
        above=0.0,
        maximum=math.nextafter(1.0, 0.0),
        flag="--cfar-rank",
    )

    def __post_init__(self) -> None:
        check_settings(self)
        if sum(self.train) == 0:
            raise ConfigError("CFAR without training cells; give some in range or Doppler.")


@documented
@dataclass(frozen=True)
class CfarResult:
    """Thresholds of a map.

    Attributes
    ----------
    threshold
        Power above which a cell is a detection, (Doppler, ranges).
    noise
        Mean power of the surroundings, from the training cells, (Doppler, ranges).
    cells
        Training cells in the middle of the map, and the equivalent number of independent ones.
    """

    threshold: Real
    noise: Real
    cells: tuple[int, float]


def cfar_threshold(rd_map: RangeDopplerMap, cfar: Cfar) -> CfarResult:
    """Compute the threshold of every cell of a map.

    Doppler wraps around; at the range limits the training cells are on one side. Guard cells that
    do not cover the main lobe of the windows are widened to it.

    Parameters
    ----------
    rd_map
        Range-Doppler map.
    cfar
        Detector.

    Returns
    -------
    CfarResult
        Thresholds and estimated noise.

    Raises
    ------
    ConfigError
        The map is too small for the guard cells.
    """
    power = rd_map.plane_power
    cfar = widened_guard(rd_map, cfar)
    guard, train = _fitted(cfar, (power.shape[0], power.shape[1]))
    reach = guard[0] + train[0], guard[1] + train[1]
    rows, cols = np.mgrid[-reach[0] : reach[0] + 1, -reach[1] : reach[1] + 1]
    mask = (np.abs(rows) > guard[0]) | (np.abs(cols) > guard[1])
    if cfar.kind == "os":
        places = np.flatnonzero(mask)
        taken = places[:: -(-places.size // _MAX_SORTED)]
        mask = np.zeros_like(mask)
        mask.flat[taken] = True
    along = noise_correlation(rd_map, (2 * reach[0], 2 * reach[1]))
    calibration = _calibration(
        mask.shape,
        mask.tobytes(),
        *(rho.tobytes() for rho in along),
        cfar.pfa,
        cfar.rank if cfar.kind == "os" else None,
    )
    if cfar.kind == "ca":
        total, count = _ring_sums(power, guard, train)
        statistic = total / np.maximum(count, 1)
    else:
        statistic, count = _ordered(power, mask, reach, cfar.rank)
    factors = {n: calibration.factor(int(n)) if n else np.inf for n in np.unique(count)}
    factor = np.array([factors[n] for n in count])
    return CfarResult(
        statistic * factor, statistic / calibration.mean, (int(mask.sum()), calibration.independent)
    )


def widened_guard(rd_map: RangeDopplerMap, cfar: Cfar) -> Cfar:
    """Return the detector with guard cells that cover at least the main lobe of the map's windows.

    Training cells within the lobe would contain the noise and the echo of the tested cell. Then
    there would be fewer false alarms than asked for, and targets would be missed.
    """
    waveform, (rows, cols) = rd_map.radar.waveform, rd_map.plane_power.shape
    step_m = float(rd_map.range_m[1] - rd_map.range_m[0]) if cols > 1 else math.inf
    lobe = min(_WIDEST_LOBE, waveform.sample_count // 2) * waveform.sample_spacing_m / step_m
    along = noise_correlation(rd_map, (min(_WIDEST_LOBE, (rows - 1) // 2), math.ceil(lobe)))
    least = [int(np.flatnonzero(np.abs(rho) ** 2 > _CORRELATED)[-1]) for rho in along]
    guard = max(cfar.guard[0], least[0]), max(cfar.guard[1], least[1])
    return dataclasses.replace(cfar, guard=guard)


def _fitted(cfar: Cfar, shape: tuple[int, int]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the guard and training cells that fit into the map."""
    half = (shape[0] - 1) // 2
    guard0 = min(cfar.guard[0], half)
    train0 = min(cfar.train[0], half - guard0)
    guard1 = cfar.guard[1]
    if 2 * guard1 + 1 >= shape[1] and train0 == 0:
        raise ConfigError(
            f"Map of {shape} cells (Doppler, range) has no training cells beyond the guard cells "
            f"{cfar.guard}. Use fewer guard cells, more pulses or wider range limits."
        )
    return (guard0, guard1), (train0, cfar.train[1])


def ring_mask(
    cfar: Cfar, shape: tuple[int, ...], row: int, col: int
) -> tuple[tuple[Indices, Indices], Mask]:
    """Return rows and columns about a cell of a map of this shape, and which of these cells, (rows,
    columns), are training cells.
    """
    guard, train = _fitted(cfar, (shape[0], shape[1]))
    reach = guard[0] + train[0], guard[1] + train[1]
    apart = np.arange(-reach[0], reach[0] + 1)
    cols = np.arange(max(0, col - reach[1]), min(shape[1], col + reach[1] + 1))
    inside = (np.abs(apart) > guard[0])[:, None] | (np.abs(cols - col) > guard[1])
    return ((row + apart) % shape[0], cols), inside


def _ring_sums(power: Real, guard: tuple[int, int], train: tuple[int, int]) -> tuple[Real, Real]:
    """Return the sum over the training cells, and their number in each column.

    The sum is taken strip by strip: the difference of two large boxes would lose the noise next to
    a strong echo.
    """
    reach = guard[0] + train[0], guard[1] + train[1]
    whole = _shifted_sum(power, -reach[1], reach[1], 1, False)
    sides = _shifted_sum(power, -reach[1], -guard[1] - 1, 1, False)
    sides += _shifted_sum(power, guard[1] + 1, reach[1], 1, False)
    total = _shifted_sum(sides, -guard[0], guard[0], 0, True)
    total += _shifted_sum(whole, -reach[0], -guard[0] - 1, 0, True)
    total += _shifted_sum(whole, guard[0] + 1, reach[0], 0, True)
    ones = np.ones((1, power.shape[1]))
    columns = _shifted_sum(ones, -reach[1], reach[1], 1, False)[0]
    inner = _shifted_sum(ones, -guard[1], guard[1], 1, False)[0]
    count = (2 * reach[0] + 1) * columns - (2 * guard[0] + 1) * inner
    return total, np.rint(count)


def _shifted_sum(values: Real, first: int, last: int, axis: int, wrap: bool) -> Real:
    """Return sum_d values[i + d], d = first ... last, along an axis; zeros beyond the ends."""
    total = np.zeros_like(values)
    size = values.shape[axis]
    moved, out = np.moveaxis(values, axis, 0), np.moveaxis(total, axis, 0)
    for d in range(first, last + 1):
        if wrap:
            out += np.roll(moved, -d, axis=0)
        elif abs(d) < size:
            out[max(0, -d) : size - max(0, d)] += moved[max(0, d) : size - max(0, -d)]
    return total


def _ordered(power: Real, mask: Mask, reach: tuple[int, int], rank: float) -> tuple[Real, Real]:
    """Return the ordered statistic, and the number of training cells in each column."""
    rows, cols = (place - half for place, half in zip(np.nonzero(mask), reach, strict=True))
    size0, size1 = power.shape
    found, counts = np.empty_like(power), np.zeros(size1)
    padded = np.take(power, np.arange(-reach[0], size0 + reach[0]) % size0, axis=0)
    step = max(1, _BLOCK // (rows.size * size0))
    # columns of one group have the same training cells within the map
    inside = [c for c in range(size1) if reach[1] <= c < size1 - reach[1]]
    groups = [inside[i : i + step] for i in range(0, len(inside), step)]
    groups += [[c] for c in range(size1) if not reach[1] <= c < size1 - reach[1]]
    for group in groups:
        first, width = group[0], len(group)
        usable = (cols + first >= 0) & (cols + group[-1] < size1)
        count = int(usable.sum())
        counts[first : first + width] = count
        if count == 0:
            found[:, first : first + width] = np.inf
            continue
        stack = np.empty((count, size0, width))
        for i, (r, c) in enumerate(zip(rows[usable], cols[usable], strict=True)):
            start = reach[0] + r
            stack[i] = padded[start : start + size0, first + c : first + c + width]
        k = min(max(round(rank * count), 1), count)
        found[:, first : first + width] = np.partition(stack, k - 1, axis=0)[k - 1]
    return found, counts


@functools.lru_cache(maxsize=8)
def _calibration(
    shape: tuple[int, int],
    mask: bytes,
    doppler: bytes,
    along: bytes,
    pfa: float,
    rank: float | None,
) -> Calibration:
    """Return the calibration of a ring of training cells. It is cached, because all frames of a run
    share it and it takes most of the time.
    """
    correlation = np.frombuffer(doppler, complex), np.frombuffer(along, complex)
    return Calibration(np.frombuffer(mask, bool).reshape(shape), correlation, pfa, rank)


class Calibration:
    """Factors on the statistic of a ring of training cells: `mask` (Doppler, range) of one cell.

    `rank` is k / cells of the ordered statistic; None: cell averaging. `mean` is the mean of the
    statistic for cells of mean power 1, `independent` the equivalent number of independent cells.
    The range limits cut the ring down to half: between both the equivalent number is interpolated.
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
        """Return the number of independent cells per cell, the correction of the closed form, and
        the mean of the statistic.
        """
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
        """Return alpha if this number of training cells is available."""
        fraction = float(np.interp(count, self._counts, self._fractions))
        scale = float(np.interp(count, self._counts, self._scales))
        if self._rank is None:
            return scale * ca_factor(self._pfa, max(count * fraction, 1.0))
        k = min(max(round(self._rank * count), 1), count)
        return scale * os_factor(self._pfa, max(count * fraction, 2.0), k / count)


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
    """Return the number of independent cells whose mean is as accurate as the mean over the mask.

    `doppler` and `range_` are |rho|^2 at lags of 0, 1 ... cells.
    """
    shape = tuple(2 * n for n in mask.shape)
    pairs = np.fft.irfft2(np.abs(np.fft.rfft2(mask, shape)) ** 2, shape)
    lag0 = np.abs(np.fft.fftfreq(shape[0], 1 / shape[0])).astype(np.intp)
    lag1 = np.abs(np.fft.fftfreq(shape[1], 1 / shape[1])).astype(np.intp)
    pad = np.pad(doppler, (0, 1)), np.pad(range_, (0, 1))
    rho = pad[0][np.minimum(lag0, doppler.size)][:, None] * pad[1][np.minimum(lag1, range_.size)]
    count = float(mask.sum())
    return count**2 / float(np.sum(pairs * rho))


def ca_factor(pfa: float, cells: float) -> float:
    """Return alpha of cell averaging over n independent cells, n (Pfa^(-1/n) - 1)."""
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


def os_factor(pfa: float, cells: float, rank: float) -> float:
    """Return alpha of the ordered statistic."""
    high = 1.0
    while os_false_alarms(high, cells, rank) > pfa:
        high *= 2
        if high > 1e12:
            raise ConfigError(
                f"{cells:.3g} independent training cells cannot reach a false-alarm rate of "
                f"{pfa:g}. Take more training cells, or a higher rate."
            )
    return _bisect(lambda factor: os_false_alarms(factor, cells, rank) <= pfa, high, 80)


def os_false_alarms(factor: float, cells: float, rank: float) -> float:
    """Return Pfa of the ordered statistic, with the threshold factor x the (rank x cells)-th
    smallest power.
    """
    k = rank * cells
    return math.exp(
        math.lgamma(cells + 1)
        - math.lgamma(cells - k + 1)
        + math.lgamma(cells - k + 1 + factor)
        - math.lgamma(cells + 1 + factor)
    )


def os_moments(cells: float, rank: float) -> tuple[float, float]:
    """Return the mean and the variance of the ordered statistic of independent cells.

    They follow from the first and second derivative of log Pfa(alpha) at 0, because E exp(-alpha x)
    generates the moments.
    """
    step = 0.02
    up, down = (math.log(os_false_alarms(sign * step, cells, rank)) for sign in (1, -1))
    return (down - up) / (2 * step), (down + up) / step**2


def os_equivalent(mean: float, variance: float, rank: float) -> tuple[float, float]:
    """Return the number of independent cells, and the scale of their statistic, that give this mean
    and variance.
    """
    low, high = 1.0, 1e6
    for _ in range(60):
        middle = math.sqrt(low * high)
        own_mean, own_variance = os_moments(middle, rank)
        wide = own_variance / own_mean**2 > variance / mean**2
        low, high = (middle, high) if wide else (low, middle)
    return low, mean / os_moments(low, rank)[0]


def drawn_statistic(covariance: Complex, k: int) -> Real:
    """Draw the k-th smallest power of cells with a covariance (n, n) at random, (draws,)."""
    mixing = _root(covariance) / math.sqrt(2)
    rng = np.random.default_rng(0)
    white = rng.standard_normal((_DRAWS, 2, mixing.shape[0]))
    power = np.abs(np.einsum("ij,jk->ik", white[:, 0] + 1j * white[:, 1], mixing)) ** 2
    return np.asarray(np.partition(power, k - 1, axis=1)[:, k - 1])


def _root(covariance: Complex) -> Complex:
    """Return rows r with sum_i conj(r_i) r_i^T = C, by the Cholesky decomposition with pivots."""
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


def _bisect(enough: Callable[[float], bool], high: float, rounds: int) -> float:
    """Return the smallest sufficient factor between 0 and `high`, to 2^-rounds of the interval."""
    low = 0.0
    for _ in range(rounds):
        middle = (low + high) / 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return (low + high) / 2
