# SPDX-License-Identifier: GPL-3.0-or-later
"""Constant false-alarm rate: thresholds from the cells around each cell of a map.

Cell averaging and the ordered statistic; :mod:`.detection.cfar_thresholds` has their factors,
because neighbouring cells of a map are not independent: tapers and oversampling correlate them.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...array_types import Mask, Real
from ...errors import ConfigError
from ...options import check_settings, documented, setting
from ..maps import RangeDopplerMap
from .cfar_thresholds import Calibration, noise_correlation

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


def widened_guard(rd_map: RangeDopplerMap, cfar: Cfar) -> Cfar:
    """Return the detector with guard cells that cover the main lobe of the map's windows.

    Training cells within the lobe contain the noise, and the echo, of the tested cell: false alarms
    would be rarer than asked for, and echoes missed.
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


@functools.lru_cache(maxsize=8)
def _calibration(
    shape: tuple[int, int],
    mask: bytes,
    doppler: bytes,
    along: bytes,
    pfa: float,
    rank: float | None,
) -> Calibration:
    """Calibration of a ring, kept: all frames of a run share it, and drawing it takes longest."""
    correlation = np.frombuffer(doppler, complex), np.frombuffer(along, complex)
    return Calibration(np.frombuffer(mask, bool).reshape(shape), correlation, pfa, rank)


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


def _ring_sums(power: Real, guard: tuple[int, int], train: tuple[int, int]) -> tuple[Real, Real]:
    """Return the sum over the training cells, and their number in each column.

    Strip by strip: the difference of two boxes would lose the noise next to a strong echo.
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
