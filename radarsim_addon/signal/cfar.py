# SPDX-License-Identifier: GPL-3.0-or-later
"""Constant false-alarm rate: thresholds from the cells around each cell of a map.

For exponential power (Gaussian noise, or speckle) and n independent training cells:

- cell averaging: threshold alpha x mean, alpha = n (Pfa^(-1/n) - 1) (Richards, Fundamentals of
  Radar Signal Processing, 6.5);
- ordered statistic: alpha x the k-th smallest, Pfa = prod_{i<k} (n - i) / (n - i + alpha) (Rohling,
  IEEE TAES 19, 608, 1983).

Neighbouring cells of a map are not independent: windows and oversampling join them. n is therefore
the number of independent cells that estimate the mean as well as the N training cells do,
N^2 / sum |rho_ij|^2, with the correlation of noise in this map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigError
from .config import check_count
from .linecompress import line_weights
from .rangedoppler import RangeDopplerMap
from .waveform import matched_filter, replica_count
from .waveform_lines import LineWaveform
from .windows import slow_time_window

Real = NDArray[np.float64]
Bools = NDArray[np.bool_]
CfarKind = Literal["ca", "os"]

#: Training cells that the ordered statistic sorts, at most; evenly taken from the ring.
_MOST_SORTED = 96
#: Cells sorted at a time: 64 MB.
_BLOCK = 1 << 23


@dataclass(frozen=True)
class Cfar:
    """A detector.

    Attributes
    ----------
    kind
        "ca" (cell averaging) or "os" (ordered statistic, which neighbours of a target and edges of
        clutter disturb less).
    pfa
        False alarms per cell of the map in noise alone.
    guard, train
        Cells (Doppler, range) to each side: none of the guard cells, all of the training cells
        beyond them are taken.
    rank
        Of the ordered statistic, as a share of the training cells.
    """

    kind: CfarKind = "ca"
    pfa: float = 1e-6
    guard: tuple[int, int] = (4, 8)
    train: tuple[int, int] = (4, 24)
    rank: float = 0.75

    def __post_init__(self) -> None:
        if self.kind not in get_args(CfarKind):
            raise ConfigError(f"CFAR {self.kind!r}; expected one of {get_args(CfarKind)}.")
        if not (isinstance(self.pfa, float) and 1e-15 <= self.pfa <= 0.5):
            raise ConfigError(f"False-alarm rate is {self.pfa!r}; expected 1e-15 to 0.5.")
        if not 0 < self.rank < 1:
            raise ConfigError(f"CFAR rank is {self.rank!r}; expected a share between 0 and 1.")
        for name, pair in (("guard", self.guard), ("training", self.train)):
            for value in pair:
                check_count(f"Number of {name} cells", value, 0, 4096)
        if sum(self.train) == 0:
            raise ConfigError("CFAR without training cells; give some in range or Doppler.")


def ca_factor(pfa: float, cells: float) -> float:
    """alpha of cell averaging: n (Pfa^(-1/n) - 1)."""
    return float(cells * math.expm1(-math.log(pfa) / cells))


def os_false_alarms(factor: float, cells: float, rank: float) -> float:
    """Pfa of the ordered statistic: threshold factor x the (rank x cells)-th smallest."""
    k = rank * cells
    return math.exp(
        math.lgamma(cells + 1)
        - math.lgamma(cells - k + 1)
        + math.lgamma(cells - k + 1 + factor)
        - math.lgamma(cells + 1 + factor)
    )


def os_factor(pfa: float, cells: float, rank: float) -> float:
    """alpha of the ordered statistic, from its Pfa by bisection."""
    low, high = 0.0, 1.0
    while os_false_alarms(high, cells, rank) > pfa:
        high *= 2
        if high > 1e12:
            raise ConfigError(
                f"{cells:.3g} independent training cells cannot reach a false-alarm rate of "
                f"{pfa:g}. Take more training cells, or a higher rate."
            )
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if os_false_alarms(middle, cells, rank) > pfa else (low, middle)
    return (low + high) / 2


def noise_correlation(rd_map: RangeDopplerMap, lags: tuple[int, int]) -> tuple[Real, Real]:
    """|rho|^2 of white noise in a map at lags of 0 ... (Doppler, range) cells."""
    radar = rd_map.radar
    waveform = radar.waveform
    pulses = rd_map.values.shape[0]
    squared = slow_time_window(rd_map.doppler_window, pulses) ** 2
    turn = np.exp(-2j * np.pi * np.outer(np.arange(lags[0] + 1), np.arange(pulses)) / pulses)
    doppler = np.abs(turn @ squared / squared.sum()) ** 2
    if isinstance(waveform, LineWaveform):
        weight = line_weights(waveform, rd_map.window)
        # the correlator's spectrum once: noise has passed it a single time
        density = weight if waveform.kind == "pmcw" else weight**2
        position = np.arange(weight.size) / weight.size
    else:
        size = 4 * replica_count(waveform)
        density = np.abs(matched_filter(waveform, size, rd_map.window)) ** 2
        position = np.fft.fftfreq(size)
    step_m = rd_map.range_m[1] - rd_map.range_m[0] if rd_map.range_m.size > 1 else 1.0
    cells = np.arange(lags[1] + 1) * float(step_m) / waveform.sample_spacing_m
    turn = np.exp(2j * np.pi * np.outer(cells, position))
    return doppler, np.abs(turn @ density / density.sum()) ** 2


def equivalent_cells(mask: Bools, doppler: Real, range_: Real) -> float:
    """Independent cells whose mean is as exact as that of these training cells.

    Parameters
    ----------
    mask
        Training cells of one cell, (Doppler, range).
    doppler, range_
        |rho|^2 at lags of 0, 1 ... cells.
    """
    shape = tuple(2 * n for n in mask.shape)
    pairs = np.fft.irfft2(np.abs(np.fft.rfft2(mask, shape)) ** 2, shape)
    lag0 = np.abs(np.fft.fftfreq(shape[0], 1 / shape[0])).astype(np.intp)
    lag1 = np.abs(np.fft.fftfreq(shape[1], 1 / shape[1])).astype(np.intp)
    pad = np.pad(doppler, (0, 1)), np.pad(range_, (0, 1))
    rho = pad[0][np.minimum(lag0, doppler.size)][:, None] * pad[1][np.minimum(lag1, range_.size)]
    count = float(mask.sum())
    return count**2 / float(np.sum(pairs * rho))


@dataclass(frozen=True)
class CfarResult:
    """Thresholds of a map.

    Attributes
    ----------
    threshold
        Power above which a cell is a detection, (Doppler, ranges).
    noise
        Mean power of the surroundings, estimated from the training cells, (Doppler, ranges).
    cells
        Training cells in the middle of the map, and how many independent ones they are worth.
    """

    threshold: Real
    noise: Real
    cells: tuple[int, float]


def _fitted(cfar: Cfar, shape: tuple[int, int]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Guard and training cells that fit into the map."""
    half = (shape[0] - 1) // 2
    guard0 = min(cfar.guard[0], half)
    train0 = min(cfar.train[0], half - guard0)
    guard1 = cfar.guard[1]
    if 2 * guard1 + 1 >= shape[1] and train0 == 0:
        raise ConfigError(
            f"Map of {shape} cells (Doppler, range) has no training cells beyond the guard cells "
            f"{cfar.guard}. Use fewer guard cells, more pulses or a longer range window."
        )
    return (guard0, guard1), (train0, cfar.train[1])


def cfar_threshold(rd_map: RangeDopplerMap, cfar: Cfar) -> CfarResult:
    """Thresholds of every cell of a map.

    Doppler wraps around; at the ends of the range window the training cells are on one side.

    Raises
    ------
    ConfigError
        The map is too small for the guard cells.
    """
    power = rd_map.power
    guard, train = _fitted(cfar, (power.shape[0], power.shape[1]))
    reach = guard[0] + train[0], guard[1] + train[1]
    rows, cols = np.mgrid[-reach[0] : reach[0] + 1, -reach[1] : reach[1] + 1]
    mask = (np.abs(rows) > guard[0]) | (np.abs(cols) > guard[1])
    if cfar.kind == "os":
        places = np.flatnonzero(mask)
        taken = places[:: -(-places.size // _MOST_SORTED)]
        mask = np.zeros_like(mask)
        mask.flat[taken] = True
    rho = noise_correlation(rd_map, (2 * reach[0], 2 * reach[1]))
    worth = equivalent_cells(mask, *rho) / float(mask.sum())
    if cfar.kind == "ca":
        total, count = _ring_sums(power, guard, train)
        factors = {n: ca_factor(cfar.pfa, max(n * worth, 1.0)) for n in np.unique(count)}
        factor = np.array([factors[n] for n in count])
        noise = total / np.maximum(count, 1)
    else:
        noise, factor = _ordered(power, mask, reach, cfar, worth)
    cells = int(mask.sum())
    return CfarResult(noise * factor, noise, (cells, cells * worth))


def _shifted_sum(values: Real, first: int, last: int, axis: int, wrap: bool) -> Real:
    """sum_d values[i + d], d = first ... last, along an axis; zeros beyond the ends."""
    total = np.zeros_like(values)
    size = values.shape[axis]
    moved, out = np.moveaxis(values, axis, 0), np.moveaxis(total, axis, 0)
    for d in range(first, last + 1):
        if wrap:
            out += np.roll(moved, -d, axis=0)
        elif abs(d) < size:
            out[max(0, -d) : size - max(0, d)] += moved[max(0, d) : size - max(0, -d)]
    return total


def _ring_sums(power: Real, guard: tuple[int, int], train: tuple[int, int]) -> tuple[Real, Real]:
    """Sum over the training cells, and their number in each column.

    Strip by strip: the difference of two boxes would lose the noise beside a strong echo.
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


def _ordered(
    power: Real, mask: Bools, reach: tuple[int, int], cfar: Cfar, worth: float
) -> tuple[Real, Real]:
    """Mean noise by the ordered statistic, and the factor on it, column by column."""
    rows, cols = (place - half for place, half in zip(np.nonzero(mask), reach, strict=True))
    size0, size1 = power.shape
    noise, factor = np.empty_like(power), np.empty(size1)
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
        if count == 0:
            noise[:, first : first + width], factor[first : first + width] = np.inf, 1.0
            continue
        stack = np.empty((count, size0, width))
        for i, (r, c) in enumerate(zip(rows[usable], cols[usable], strict=True)):
            start = reach[0] + r
            stack[i] = padded[start : start + size0, first + c : first + c + width]
        k = min(max(round(cfar.rank * count), 1), count)
        value = np.partition(stack, k - 1, axis=0)[k - 1]
        # mean of the k-th smallest of n exponentials, over the mean of one
        mean = float(np.sum(1 / np.arange(count - k + 1, count + 1)))
        noise[:, first : first + width] = value / mean
        effective = max(count * worth, 2.0)
        factor[first : first + width] = mean * os_factor(cfar.pfa, effective, k / count)
    return noise, factor
