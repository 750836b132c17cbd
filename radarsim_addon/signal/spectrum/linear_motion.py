# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of constant range rate: all pulses at once, by 2-D transforms.

With tau_i(t) = tau_i + beta_i (t - t_b), f_n = f_c + k df and t_b the middle of a block of pulses,

    f_n tau_i(t_m) = f_c tau_i + k df tau_i + f_n (t_m - t_b) beta_i:

the first term is a phase of each path, the others are a 2-D transform of the points
(tau_i, beta_i) at the frequencies (k df, f_n (t_m - t_b)), of which the first are regular (type 1)
and the second are not (type 3). Nothing is left out: range migration and the Doppler shift of every
frequency are in it. Where frequencies come one after the other, each has its own time t_m + k dt:
k f_c dt beta_i, which is regular as well, goes with the first.
"""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .grid import SynthesisContext, Weights
from .middle_motion import MiddleMotion, longest_s, negligible
from .mixed_nufft import LEAST_ERROR, MARGIN, NARROW, nufft_lines
from .nufft import TIGHTEST
from .phase import phasors, reduce_cycles, reduced_cycles
from .pulse_motion import joined_error
from .transform import RANDOM_STATE, ErrorSum, engine_tolerance, l2_norm

#: Points of the fine grids of one block (16 bytes each), points of it for one of the coarse grid,
#: and targets (100 bytes).
_MAX_GRID, _FINE = 1 << 23, 1.6
_MAX_TARGETS = 1 << 21
#: So that two threads have work; not their number, on which the result would then hang.
_LEAST_BLOCKS = 2
#: Seconds: of a path and of a target in a transform of width 9, of a point of its grid, within the
#: cache and beyond; of a path, a frequency and the overhead of a pulse on its own. Measured, one
#: thread, finufft 2.5 on a 2024 server; only their ratios matter, and those by a factor of two or
#: so.
_PATH_3, _TARGET_3, _GRID_3, _FAR_GRID_3, _CACHED = 3.0e-7, 8.0e-8, 2.0e-8, 3.5e-8, 1 << 18
_PATH_1, _FREQUENCY_1, _PULSE_1 = 6.0e-8, 5.0e-8, 1.2e-4
#: More of it where frequencies come one after the other.
_RAMP_1 = 4.0
#: Largest error of a transform of what remains.
_COARSEST = 1e-3


@dataclass(frozen=True)
class LinearRows:
    """Paths whose length is `length_m` at `time_s` and changes by `rate_mps` (twice the range
    rate), folded by `order` pulse intervals, each (n,); `amplitude` is (n,), or coefficients of T_k
    over the burst, (n, terms).
    """

    length_m: Real
    rate_mps: Real
    time_s: Real
    order: Real
    amplitude: Weights

    def __len__(self) -> int:
        return int(self.length_m.size)

    def select(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> LinearRows:
        """Some of them."""
        return LinearRows(*(getattr(self, f.name)[rows] for f in fields(self)))

    @classmethod
    def join(cls, parts: list[LinearRows]) -> LinearRows:
        """One of several."""
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))


@dataclass(frozen=True)
class BlockResult:
    """Spectra of the pulses `pulses`, with their error, processor time and tightness."""

    pulses: slice
    values: Complex
    error: ErrorSum
    cpu_s: float


@dataclass(frozen=True)
class LinearPlan:
    """Blocks of pulses for type 3, and what either way would cost [s]."""

    blocks: list[slice]
    type3_s: float
    pulses_s: float


def plan_linear(
    rows: LinearRows, sums: SynthesisContext, times_s: Real, tolerance: float
) -> LinearPlan:
    """How type 3 would be done, and what it costs compared with one transform per pulse."""
    grid = sums.grid
    pulses = times_s.size
    rate = rows.rate_mps / SPEED_OF_LIGHT_MPS
    spread_rate = float(rate.max() - rate.min())
    delay = rows.length_m / SPEED_OF_LIGHT_MPS
    burst_s = float(times_s.max() - times_s.min())
    if sums.ramp is not None:
        burst_s += grid.count * sums.ramp.interval_s
    if sums.pulse is not None:
        burst_s += 2 * sums.pulse.half_s
        pulses *= sums.pulse.nodes(rows.rate_mps, grid.highest_hz, tolerance)
    middle = _middle_motion(delay, rate, 0.0, sums)
    remains_rad = middle.remains_rad(burst_s / 2, abs(grid.step_hz) * grid.count / 2)
    least = max(
        _LEAST_BLOCKS,
        math.ceil(burst_s / 2 / longest_s(remains_rad, burst_s / 2, tolerance)),
        math.ceil(pulses * grid.count / _MAX_TARGETS),
    )
    sets = rows.amplitude.shape[1] if rows.amplitude.ndim > 1 else 1
    if not negligible(remains_rad, tolerance):
        sets *= 3
    slow = NARROW * grid.highest_hz * spread_rate * burst_s

    def cost_s(blocks: int) -> float:
        points = _FINE * grid.count * (slow / blocks + MARGIN)
        if sets * points > _MAX_GRID and blocks < times_s.size:
            return math.inf
        grid_s = points * (_GRID_3 if points <= _CACHED else _FAR_GRID_3)
        return blocks * sets * (_PATH_3 * len(rows) + grid_s)

    most = max(1, math.ceil(math.log2(times_s.size / least)) + 1)
    blocks = min((min(least << n, times_s.size) for n in range(most)), key=cost_s)
    type3 = cost_s(blocks) + sets * _TARGET_3 * grid.count * pulses
    each = _PATH_1 * len(rows) + _FREQUENCY_1 * grid.count + _PULSE_1
    if sums.ramp is not None:
        each *= _RAMP_1
    edges = np.linspace(0, times_s.size, blocks + 1).astype(int).tolist()
    return LinearPlan([slice(a, b) for a, b in itertools.pairwise(edges)], type3, pulses * each)


def _middle_motion(
    delay_s: Real, rate: Real, reference_s: float, sums: SynthesisContext
) -> MiddleMotion:
    """Of delays counted from a reference."""
    slope = 0.0 if sums.ramp is None else sums.ramp.video_hz_per_s
    return MiddleMotion.of(delay_s, rate, reference_s, slope, float(sums.grid.exact_centre_hz))


@dataclass(frozen=True)
class _Points:
    """Points and strengths (sets, n) of rows; delays are counted from that of `reference_m`."""

    middle: MiddleMotion
    values: Complex
    reference_m: float


def _points_at(rows: LinearRows, sums: SynthesisContext, time_s: float) -> _Points:
    """Rows as they are at a time."""
    period_s = sums.listening.period_s or 0.0
    amplitude, rate_mps, later_s = rows.amplitude, rows.rate_mps, time_s - rows.time_s
    shift_m = rate_mps * later_s
    if sums.pulse is not None:
        amplitude = (amplitude.T * sums.pulse.stretch(rate_mps)).T
    if sums.meeting is not None:
        shift_m = sums.meeting.moved_m(rows.length_m, rate_mps, later_s - rows.order * period_s)
        rate_mps = sums.meeting.seen_mps(rate_mps)
    reference_m = float(rows.length_m[0])
    delay_s = (rows.length_m - reference_m + shift_m) / SPEED_OF_LIGHT_MPS - rows.order * period_s
    rate = rate_mps / SPEED_OF_LIGHT_MPS
    cycles = rows.order * sums.shift_centre
    cycles -= reduced_cycles(rows.length_m, sums.centre)
    cycles -= reduced_cycles(shift_m, sums.centre)
    middle = _middle_motion(delay_s, rate, reference_m / SPEED_OF_LIGHT_MPS, sums)
    cycles += middle.path_cycles()
    turns = phasors(np.ones(1), reduce_cycles(cycles), np.empty(len(rows), dtype=np.complex128))
    return _Points(middle, np.atleast_2d(amplitude.T) * turns, reference_m)


def _transformed(
    points: _Points, sums: SynthesisContext, times_s: Real, tolerance: float, terms: Real | None
) -> tuple[Complex, ErrorSum]:
    """Their sum at times of all frequencies, (times, frequencies), and its error.

    `terms` are weights of the sets of strengths, (times, sets).
    """
    grid, middle = sums.grid, points.middle
    interval_s = 0.0 if sums.ramp is None else sums.ramp.interval_s
    k = np.arange(grid.count) - grid.count // 2
    since_s = (times_s + k[:, None] * interval_s).T  # in the order of the transform's result
    carrier_hz, offset_hz = float(grid.exact_centre_hz), np.asarray(k * grid.step_hz, np.float64)
    turns_hz = middle.middle_hz(carrier_hz)
    along = since_s * (middle.beyond_hz(since_s, offset_hz) + turns_hz)
    along -= k * (interval_s * turns_hz)
    cycles = middle.delay_s * grid.step_hz + middle.rate * (interval_s * turns_hz)
    # delays are counted from the first path's
    cycles += float(reduced_cycles(np.array([points.reference_m]), sums.step)[0])
    x, along = 2 * np.pi * reduce_cycles(cycles), 2 * np.pi * along

    def transform(values: Complex, engine: float) -> Complex:
        return nufft_lines(x, middle.rate, values, grid.count, along, engine)

    remains_rad = middle.remains_rad(float(np.abs(since_s).max()), abs(offset_hz[0]))
    size = np.abs(points.values).sum(axis=0)
    squares, total = float(np.dot(size, size)), float(size.sum())
    expected = math.sqrt(since_s.size * squares)
    for engine in (engine_tolerance(tolerance), TIGHTEST):
        sets = transform(points.values, engine)
        if not negligible(remains_rad, tolerance):
            coarse = min(max(engine, engine / remains_rad), _COARSEST)
            left = transform(middle.remains(points.values), coarse)
            middle.join(sets, left, since_s, offset_hz)
        if terms is not None:
            sets *= terms.T[:, :, None]
        result = sets.sum(axis=0) if len(sets) > 1 else sets[0]
        if RANDOM_STATE * engine * expected <= tolerance / 3 * l2_norm(result):
            break
    result *= middle.common_turns(times_s, interval_s, grid.step_hz, grid.count, carrier_hz)
    return result, ErrorSum.of(max(engine, LEAST_ERROR), since_s.size, squares, total)


def linear_block(
    rows: LinearRows,
    sums: SynthesisContext,
    times_s: Real,
    pulses: slice,
    tolerance: float,
    terms: Real | None = None,
) -> BlockResult:
    """Spectra of some pulses by one transform; times are in rising order.

    Amplitudes of several terms take a transform each; `terms` are T_k at all pulses.
    """
    start = time.thread_time()
    grid, times, nodes = sums.grid, times_s[pulses], 1
    if sums.pulse is not None:
        nodes = sums.pulse.nodes(rows.rate_mps, grid.highest_hz, tolerance)
        times = (times[:, None] + sums.pulse.times_s(nodes)).ravel()
    middle_s = float(times[0] + times[-1]) / 2
    weights = None if terms is None else np.repeat(terms[pulses], nodes, axis=0)
    points = _points_at(rows, sums, middle_s)
    result, error = _transformed(points, sums, times - middle_s, tolerance, weights)
    if sums.pulse is not None:
        result = sums.pulse.joined(result.reshape(-1, nodes, grid.count))
        error = joined_error(error.of_each(nodes), nodes, tolerance, grid.count)
    return BlockResult(pulses, result, error, time.thread_time() - start)
