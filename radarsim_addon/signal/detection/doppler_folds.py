# SPDX-License-Identifier: GPL-3.0-or-later
"""True range rates behind folded ones: a map shows v modulo lambda PRF / 2, the paths know v."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from ...array_types import Integers, Mask, Real
from ..maps import RangeDopplerMap
from ..paths import Paths, path_power_w
from ..radar import Radar
from .detections import Detection
from .peaks import Peak

_Target = TypeVar("_Target", Peak, Detection)
#: A target takes the paths within so many cells of range, and Doppler rows, of its peak.
_REACH_CELLS, _REACH_ROWS = 2, 2
#: More than any profile has.
_RANGE_CELLS = 1 << 31


class DopplerFolds:
    """Power of the moving paths by range cell and Doppler cell before folding.

    Parameters
    ----------
    radar
        Waveform and burst.
    """

    def __init__(self, radar: Radar) -> None:
        self._radar = radar
        self._rows = radar.burst.pulses
        self._interval_mps = 2 * radar.max_unambiguous_velocity_mps
        # FMCW filters out what is beyond its range, all others repeat
        fmcw = radar.waveform.kind == "fmcw"
        self._period_m = math.inf if fmcw else radar.unambiguous_range_m
        self._cell_m = radar.waveform.range_resolution_m
        #: Both cells in one number (a sort of pairs takes ten times as long), and the power and
        #: power times range rate of each.
        self._codes = np.zeros(0, dtype=np.int64)
        self._sums = np.zeros((2, 0))

    def add(self, paths: Paths) -> None:
        """Add paths; those that are stationary never fold."""
        moving = np.flatnonzero(paths.range_rate_mps)
        rate = paths.range_rate_mps[moving]
        # a peak of the map stands where its echo was in the middle of the burst
        middle_s = (self._rows - 1) / 2 / self._radar.burst.prf_hz
        cell, doppler = self._cells(paths.range_m[moving] + rate * middle_s, rate)
        power = path_power_w(paths, self._radar.waveform.wavelength_m)[moving]
        joined = np.concatenate([self._codes, doppler * _RANGE_CELLS + cell])
        self._codes, place = np.unique(joined, return_inverse=True)
        parts = np.concatenate([self._sums, [power, power * rate]], axis=1)
        self._sums = np.stack([np.bincount(place, part) for part in parts])

    def _cells(self, range_m: Real, rate_mps: Real) -> tuple[Integers, Integers]:
        """Return range cell, and Doppler cell before folding, of paths or of a peak."""
        if math.isfinite(self._period_m):
            range_m = np.mod(range_m, self._period_m)
        doppler = np.rint(rate_mps / self._interval_mps * self._rows)
        limit = _RANGE_CELLS - 1
        cell = np.clip(np.rint(range_m / self._cell_m), 0, limit).astype(np.int64)
        return cell, np.clip(doppler, -limit, limit).astype(np.int64)

    def _known(self) -> tuple[Integers, Integers, Integers]:
        """Return range cell, Doppler row and number of folds of what was added."""
        doppler, cell = np.divmod(self._codes, _RANGE_CELLS)
        return cell, doppler % self._rows, (doppler + self._rows // 2) // self._rows

    def covers(self, rd_map: RangeDopplerMap) -> Mask:
        """Return where a moving path may make a peak of a map, (Doppler, ranges)."""
        range_m, rows, count = rd_map.range_m, self._rows, rd_map.plane.shape[0]
        edges = np.zeros((count, range_m.size + 1))
        cell, known_row, order = self._known()
        centre_m = cell * self._cell_m
        # a map after a canceller has fewer rows
        row = np.rint(-known_row * count / rows).astype(np.int64) + count // 2
        reach_m = self._reach_m(order)
        first, last = (np.searchsorted(range_m, centre_m + s * reach_m) for s in (-1, 1))
        for apart in range(-_REACH_ROWS, _REACH_ROWS + 1):
            np.add.at(edges, ((row + apart) % count, first), 1)
            np.add.at(edges, ((row + apart) % count, last), -1)
        return np.asarray(edges.cumsum(axis=1)[:, :-1] > 0)

    def _reach_m(self, order: Integers) -> Real:
        """Return how far from its range a path may peak: a chirp shifts Doppler into range."""
        waveform = self._radar.waveform
        if waveform.kind not in ("lfm", "fmcw", "stepped"):
            return np.full(order.shape, _REACH_CELLS * self._cell_m)
        fastest_mps = (np.abs(order) + 0.5) * self._interval_mps
        sweep_s = waveform.duration_s * waveform.carrier_hz / waveform.bandwidth_hz
        return np.asarray(_REACH_CELLS * self._cell_m + fastest_mps * sweep_s)

    def order(self, range_m: float, velocity_mps: float) -> int | None:
        """Return how many times the strongest paths at a peak of the map have folded.

        Their range rate is `velocity_mps` plus this many intervals of lambda PRF / 2. None: no
        moving path is there.
        """
        own_cell, own_doppler = self._cells(np.array(range_m), np.array(velocity_mps))
        cell, row, order = self._known()
        apart = np.abs(row - own_doppler % self._rows)
        near = np.minimum(apart, self._rows - apart) <= _REACH_ROWS
        near &= np.abs(cell - own_cell) * self._cell_m <= self._reach_m(order)
        if not near.any():
            return None
        _, place = np.unique(order[near], return_inverse=True)
        power, moment = (np.bincount(place, part[near]) for part in self._sums)
        strongest = int(np.argmax(power))
        rate_mps = float(moment[strongest] / power[strongest]) if power[strongest] > 0 else 0.0
        return round((rate_mps - velocity_mps) / self._interval_mps)

    def unfolded(self, targets: Iterable[_Target]) -> list[_Target]:
        """Return the targets with the range rate of the paths that make them."""
        found = []
        for target in targets:
            order = self.order(target.range_m, target.velocity_mps)
            rate = None if order is None else target.velocity_mps + order * self._interval_mps
            found.append(dataclasses.replace(target, unfolded_velocity_mps=rate))
        return found


def velocity_before_folding_mps(target: Peak | Detection) -> float | None:
    """Return the true range rate of a target whose Doppler has folded.

    Parameters
    ----------
    target
        Target, from `DopplerFolds.unfolded`.

    Returns
    -------
    float or None
        Receding positive [m/s]; None: its Doppler has not folded, or its paths are unknown.
    """
    true_mps = target.unfolded_velocity_mps
    return None if true_mps is None or true_mps == target.velocity_mps else true_mps
