# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of constant range rate: all pulses in one 2-D transform.

With tau_i(t) = tau_i + beta_i (t - t_b), f_n = f_c + k df and t_b the middle of a block of pulses,

    f_n tau_i(t_m) = f_c tau_i + k df tau_i + f_n (t_m - t_b) beta_i:

the first term is a phase of each path, the others are a 2-D transform of the points (tau_i, beta_i)
at the frequencies (k df, f_n (t_m - t_b)). The first of these are regular (type 1), the second are
not (type 3). Nothing is left out: range migration and the Doppler shift of every frequency are
included.

If frequencies come one after the other, each has its own time s = t_m - t_b + k dt. A ramp that
is mixed with itself also leaves K tau^2 / 2 cycles; elsewhere K is 0. Phases are taken about the
middle of all paths (`MiddleMotion`): with tau = (tau_c + beta_c s) + (x + y s), beta = beta_c + y,
f = f_c + u and F = f_c - K tau_c,

    -f tau + K tau^2 / 2 = -f_c tau_0 + K tau_0^2 / 2       of each path, tau_0 = tau_c + x
        - u x - (F + u - K beta_c s) s Y                    a transform, Y = y - x K beta / F
        - (K x beta / F) (u - K beta_c s) s + K y^2 s^2 / 2 delay and rate tied together

and terms of s and u alone. The last line, 1e-4 rad for cars in a street, is added to the first
order by two transforms more of the same points.

`plan_linear` chooses the blocks of pulses and estimates the cost, `linear_block` forms one block.
"""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .grid import (
    SynthesisContext,
    Weights,
    phasor_lines,
    reduce_cycles,
    reduced_cycles,
    unit_phasors,
)
from .nufft import LEAST_ERROR, MARGIN, NARROW, TIGHTEST, nufft_lines
from .transform import RANDOM_STATE, ErrorSum, PulseBlock, engine_tolerance, joined_error, l2_norm

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
#: Fraction of the tolerance for what the first order leaves out.
_SHARE = 0.1


@dataclass(frozen=True)
class LinearRows:
    """n paths of constant rate, each field (n,)."""

    length_m: Real  #: at `time_s` [m]
    rate_mps: Real  #: of the length, twice the range rate [m/s]
    time_s: Real
    order: Real  #: pulse intervals by which the path is folded
    amplitude: Weights  #: (n,), or coefficients of T_k over the burst, (n, terms)

    def __len__(self) -> int:
        return int(self.length_m.size)

    def select(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> LinearRows:
        return LinearRows(*(getattr(self, f.name)[rows] for f in fields(self)))

    @classmethod
    def join(cls, parts: list[LinearRows]) -> LinearRows:
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))


@dataclass(frozen=True)
class LinearPlan:
    """Blocks of pulses for type 3, and the cost of either way."""

    blocks: list[slice]
    type3_s: float  #: [s]
    pulses_s: float  #: of one transform per pulse [s]


def plan_linear(
    rows: LinearRows, sums: SynthesisContext, times_s: Real, tolerance: float
) -> LinearPlan:
    """Choose blocks for type 3, and compare the cost with one transform per pulse."""
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
    middle = MiddleMotion.of(delay, rate, 0.0, sums)
    remains_rad = middle.remains_rad(burst_s / 2, abs(grid.step_hz) * grid.count / 2)
    # half of a burst for which the first order would do
    longest_s = burst_s / 2 * min(1.0, math.sqrt(2 * _SHARE * tolerance) / max(remains_rad, 1e-300))
    least = max(
        _LEAST_BLOCKS,
        math.ceil(burst_s / 2 / longest_s),
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


def linear_block(
    rows: LinearRows,
    sums: SynthesisContext,
    times_s: Real,
    pulses: slice,
    tolerance: float,
    terms: Real | None = None,
) -> PulseBlock:
    """Compute the spectra of some pulses by one transform; times are in rising order. Amplitudes of
    several terms take a transform each; `terms` are T_k at all pulses.
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
    return PulseBlock(pulses, result, error, time.thread_time() - start)


@dataclass(frozen=True)
class _Points:
    """Points and strengths (sets, n) of rows; delays are counted from that of `reference_m`."""

    middle: MiddleMotion
    values: Complex
    reference_m: float


def _points_at(rows: LinearRows, sums: SynthesisContext, time_s: float) -> _Points:
    """Return the points of rows at a time."""
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
    middle = MiddleMotion.of(delay_s, rate, reference_m / SPEED_OF_LIGHT_MPS, sums)
    cycles += middle.path_cycles()
    values = np.atleast_2d(amplitude.T) * unit_phasors(cycles)
    return _Points(middle, values, reference_m)


def _transformed(
    points: _Points, sums: SynthesisContext, times_s: Real, tolerance: float, terms: Real | None
) -> tuple[Complex, ErrorSum]:
    """Sum of the points at times of all frequencies, (times, frequencies), and its error; `terms`
    are weights of the sets of strengths, (times, sets).
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


@dataclass(frozen=True)
class MiddleMotion:
    """The phase about the middle of n paths with delays and rates at the time 0."""

    slope: float  #: K [Hz/s]
    middle_s: float  #: tau_c [s]
    middle_rate: float  #: beta_c
    reference_s: float  #: from which the paths' delays are counted [s]
    delay_s: Real  #: x, (n,) [s]
    rate: Real  #: Y, (n,)
    product: Real  #: factor of s (u - K beta_c s) in what remains, (n,)
    square: Real  #: factor of s^2 in what remains, (n,)

    @classmethod
    def of(
        cls, delay_s: Real, rate: Real, reference_s: float, sums: SynthesisContext
    ) -> MiddleMotion:
        """Make the middle motion of delays [s] that are counted from a reference."""
        slope = 0.0 if sums.ramp is None else sums.ramp.video_hz_per_s
        carrier_hz = float(sums.grid.exact_centre_hz)
        middle = float(delay_s.min() + delay_s.max()) / 2
        middle_rate = float(rate.min() + rate.max()) / 2
        x, y = delay_s - middle, rate - middle_rate
        product = slope / (carrier_hz - slope * (reference_s + middle)) * x * rate
        return cls(
            slope, reference_s + middle, middle_rate, reference_s, x, y - product,
            product, slope / 2 * y**2,
        )  # fmt: skip

    def path_cycles(self) -> Real:
        """Return K tau_0^2 / 2, (n,). It is not reduced: delays are some 1e-6 s, so there are few
        cycles.
        """
        return np.asarray(self.slope / 2 * (self.middle_s + self.delay_s) ** 2)

    def remains_rad(self, half_s: float, half_band_hz: float) -> float:
        """Return the largest phase that the transform leaves, for |s| <= half_s."""
        beyond_hz = half_band_hz + abs(self.slope * self.middle_rate) * half_s
        product = float(np.abs(self.product).max()) * half_s * beyond_hz
        return 2 * math.pi * (product + float(np.abs(self.square).max()) * half_s**2)

    def middle_hz(self, carrier_hz: float) -> float:  # F
        return carrier_hz - self.slope * self.middle_s

    def beyond_hz(self, since_s: Real, offset_hz: Real) -> Real:
        """Return u - K beta_c s at times and frequencies, in their shape."""
        return np.asarray(offset_hz - self.slope * self.middle_rate * since_s)

    def common_turns(
        self, times_s: Real, interval_s: float, step_hz: float, count: int, carrier_hz: float
    ) -> Complex:
        """Return exp(j 2 pi cycles) that all paths share, (times, frequencies), at s = t + k dt and
        u = k df, with k from -count//2 on. The phase is of the second degree in k, and only the
        first has to do with t.
        """
        k = np.arange(-(count // 2), count - count // 2)
        moved_s, middle_hz = self.middle_rate * interval_s, self.middle_hz(carrier_hz)
        walked_s = self.middle_rate * times_s
        alone = walked_s * (self.slope / 2 * walked_s - middle_hz)
        both = walked_s * (self.slope * moved_s - step_hz)
        square = moved_s * (self.slope / 2 * moved_s - step_hz)
        of_k = k * (square * k - step_hz * (self.middle_s - self.reference_s) - middle_hz * moved_s)
        turns = phasor_lines(alone, both, count)
        turns *= unit_phasors(of_k)[:, None]
        return np.asarray(turns.T)

    def remains(self, values: Complex) -> Complex:
        """Return the strengths (2 sets, n) of the phase that the transform of strengths (sets, n)
        leaves out.
        """
        values = values * 2j * np.pi
        return np.concatenate([values * self.product, values * self.square])

    def join(self, sets: Complex, remains: Complex, since_s: Real, offset_hz: Real) -> None:
        """Add their transforms (2 sets, ...), which are overwritten, to `sets` (sets, ...)."""
        product, square = np.split(remains, 2)
        product *= -since_s * self.beyond_hz(since_s, offset_hz)
        square *= since_s**2
        sets += product
        sets += square


def negligible(remains_rad: float, tolerance: float) -> bool:
    return remains_rad <= _SHARE * tolerance
