# SPDX-License-Identifier: GPL-3.0-or-later
"""True range rates behind folded ones: a map shows v modulo lambda PRF / 2, the paths know v."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from ...array_types import Integers, Mask, Real
from ..maps import RangeDopplerMap, Recording, point_response
from ..motion import mean_over_burst
from ..paths import Paths, path_power_w
from ..radar import Radar, slow_time_window
from .detections import Detection
from .peaks import Peak
from .response_shapes import doppler_line

_Target = TypeVar("_Target", Peak, Detection)
#: A target takes the paths within so many cells of range, and Doppler rows, of its peak.
_REACH_CELLS, _REACH_ROWS = 2, 2
#: More than any profile has.
_RANGE_CELLS = 1 << 31
#: Rounding of a convolution by Fourier transforms, of its largest value.
_ROUNDING = 1e-14


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
        #: Both cells in one number (a sort of pairs takes ten times as long), and of each the
        #: power, power times range rate, and power of what moves because the radar does.
        self._codes = np.zeros(0, dtype=np.int64)
        self._sums = np.zeros((3, 0))

    def add(self, paths: Paths) -> None:
        """Add paths; where neither the radar nor the scatterers move, they never fold."""
        rated = paths.range_rate_mps != 0
        clutter = np.zeros(len(paths), dtype=bool)
        if paths.motion is not None:
            rated = rated | paths.motion.moving
            clutter = paths.motion.moving & ~paths.motion.scatterers_move
        moving = np.flatnonzero(rated)
        range_m, rate = paths.range_m[moving], paths.range_rate_mps[moving]
        if self._rows > 1:
            burst_s = (self._rows - 1) / self._radar.burst.prf_hz
            range_m, rate = mean_over_burst(paths.lengths, burst_s, moving)
        cell, doppler = self._cells(range_m, rate)
        power = path_power_w(paths, self._radar.waveform.wavelength_m)[moving]
        joined = np.concatenate([self._codes, doppler * _RANGE_CELLS + cell])
        self._codes, place = np.unique(joined, return_inverse=True)
        own = [power, power * rate, power * clutter[moving]]
        parts = np.concatenate([self._sums, own], axis=1)
        self._sums = np.stack([np.bincount(place, part) for part in parts])

    def _cells(self, range_m: Real, rate_mps: Real) -> tuple[Integers, Integers]:
        """Return range cell, and Doppler cell before folding, of paths or of a peak."""
        if math.isfinite(self._period_m):
            range_m = np.mod(range_m, self._period_m)
        doppler = np.rint(rate_mps / self._interval_mps * self._rows)
        limit = _RANGE_CELLS - 1
        cell = np.clip(np.rint(range_m / self._cell_m), 0, limit).astype(np.int64)
        return cell, np.clip(doppler, -limit, limit).astype(np.int64)

    @property
    def radar_moves(self) -> bool:
        """Whether stationary scatterers have a Doppler, because an antenna moves."""
        return bool(self._sums[2].any())

    def _known(self) -> tuple[Integers, Integers, Integers]:
        """Return range cell, Doppler row and number of folds of what was added."""
        doppler, cell = np.divmod(self._codes, _RANGE_CELLS)
        return cell, doppler % self._rows, (doppler + self._rows // 2) // self._rows

    def exceed_clutter(self, recording: Recording) -> Mask:
        """Return where moving scatterers give a map more power than stationary ones do.

        Parameters
        ----------
        recording
            The map.

        Returns
        -------
        ndarray
            (Doppler, ranges). Powers are those of the paths, spread by the sidelobes of the map
            over Doppler and over range: a target may be below the clutter of another Doppler.
        """
        rd_map = recording.rd_map
        (count, size), range_m = rd_map.plane.shape, rd_map.range_m
        cell, known_row, _ = self._known()
        power, moment, clutter = self._sums
        rate = np.divide(moment, power, out=np.zeros_like(power), where=power > 0)
        row = np.rint(-known_row * count / self._rows).astype(np.int64) + count // 2
        shown_m = cell * self._cell_m + rate * self._later_s
        spacing_m = float(range_m[1] - range_m[0]) if size > 1 else self._cell_m
        col = np.rint((shown_m - range_m[0]) / spacing_m).astype(np.int64)
        inside = (col >= 0) & (col < size)
        parts = np.zeros((2, count, size))
        for part, own in zip(parts, (power - clutter, clutter), strict=True):
            np.add.at(part, (row[inside] % count, col[inside]), own[inside])
        middle, weight = size // 2, slow_time_window(rd_map.doppler_taper, count)
        echo = np.abs(point_response(recording, float(range_m[middle]), 0.0).ranges[0]) ** 2
        line = np.abs(doppler_line(weight, 0.0)) ** 2
        moving = _spread(parts[0], line, echo)
        # places within cells are not known: of clutter the sidelobes count, not the nulls between
        between = [np.abs(doppler_line(weight, cells)) ** 2 for cells in (-0.5, 0.5)]
        reach = math.ceil(self._radar.waveform.sample_spacing_m / spacing_m / 2)
        around = np.pad(echo, reach)
        shifted = [around[n : n + size] for n in range(2 * reach + 1)]
        stationary = _spread(parts[1], np.max([line, *between], axis=0), np.max(shifted, axis=0))
        return np.asarray(moving > stationary + _ROUNDING * float(parts.max(initial=0.0)))

    def covers(self, rd_map: RangeDopplerMap) -> Mask:
        """Return where a path of a moving scatterer may make a peak of a map, (Doppler, ranges)."""
        range_m, rows, count = rd_map.range_m, self._rows, rd_map.plane.shape[0]
        edges = np.zeros((count, range_m.size + 1))
        power, _, clutter = self._sums
        cell, known_row, order = (part[clutter < power] for part in self._known())
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
        fastest_mps = (np.abs(order) + 0.5) * self._interval_mps
        return np.asarray(_REACH_CELLS * self._cell_m + fastest_mps * self._later_s)

    @property
    def _later_s(self) -> float:
        """How much later an echo would be where a chirp shows it, f0 / K [s]; 0 without chirp."""
        waveform = self._radar.waveform
        if waveform.kind not in ("lfm", "fmcw", "stepped"):
            return 0.0
        return float(waveform.duration_s * waveform.carrier_hz / waveform.bandwidth_hz)

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
        power, moment = (np.bincount(place, part[near]) for part in self._sums[:2])
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


def _spread(power: Real, line: Real, echo: Real) -> Real:
    """Convolve (Doppler, ranges) with responses about the middle; Doppler wraps, range does not."""
    count, size = power.shape
    spectrum = np.fft.rfft(np.fft.ifftshift(line))[:, None]
    power = np.fft.irfft(np.fft.rfft(power, axis=0) * spectrum, count, axis=0)
    spectrum = np.fft.rfft(echo, 2 * size)
    power = np.fft.irfft(np.fft.rfft(power, 2 * size) * spectrum, 2 * size)
    return np.asarray(power[:, size // 2 : size // 2 + size])


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
