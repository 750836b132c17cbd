# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of smooth motion: all pulses in a few 2-D transforms.

With tau_i(t) = tau_i + beta_i (t - t_b), f_n = f_c + k df and t_b the middle of a block of pulses,

    f_n tau_i(t_m) = f_c tau_i + k df tau_i + f_n (t_m - t_b) beta_i:

the first term is a phase of each path, the others are a 2-D transform of the points (tau_i, beta_i)
at the frequencies (k df, f_n (t_m - t_b)). The first of these are regular (type 1), the second are
not (type 3). Nothing is left out: range migration and the Doppler shift of every frequency are
included.

If frequencies come one after the other, each has its own time s = t_m - t_b + k dt. A ramp that
is mixed with itself also leaves K tau^2 / 2 cycles; elsewhere K is 0. Phases are taken about the
middle of all paths (`MiddleMotion`): with tau = (tau_c + beta_c s) + (x + y s) + e / c, where e is
the bend of the path from a straight line, beta = beta_c + y, f = f_c + u and F = f_c - K tau_c,

    -f tau + K tau^2 / 2 = -f_c tau_0 + K tau_0^2 / 2       of each path, tau_0 = tau_c + x
        - u x - (F + u - K beta_c s) s Y                    a transform, Y = y - x K beta / F
        - (F + u - K beta_c s) e_c / c                      in common, e_c the middle of all bends
        - (K x beta / F) (u - K beta_c s) s + K y^2 s^2 / 2 delay and rate tied together
        - (F + u - K beta_c s) (e - e_c) / c                the path's own bend
        + K (x + y s + e / 2c) e / c

and terms of s and u alone. The last three lines and amplitudes that vary are functions of pulse and
frequency that differ little from path to path: a few products of a factor of the path and a
function of both stand for them (`_separated`), each of which costs a transform of the same points.

`plan_all_pulses` chooses the blocks of pulses and estimates the cost, `all_pulses_block` forms one
block.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from ...arrays import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..motion import Rows
from .grid import (
    BLOCK,
    BurstBasis,
    SynthesisContext,
    Weights,
    chebyshev_nodes,
    lagrange,
    nodes_for,
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
#: cache and beyond; of the factors of a path, and of planning a block; of a path, a frequency and
#: the overhead of a pulse on its own. Measured, one thread, finufft 2.5 on a 2024 server; only
#: their ratios matter, and those by a factor of two or so.
_PATH_3, _TARGET_3, _GRID_3, _FAR_GRID_3, _CACHED = 3.0e-7, 8.0e-8, 2.0e-8, 3.5e-8, 1 << 18
_FACTORS_3, _BLOCK_3 = 1.0e-6, 5e-3
_PATH_1, _FREQUENCY_1, _PULSE_1 = 6.0e-8, 5.0e-8, 1.2e-4
#: More of it where frequencies come one after the other.
_RAMP_1 = 4.0
#: Largest error of a transform of a small term.
_COARSEST = 1e-3
#: Fraction of the tolerance for what the terms leave out.
_SHARE = 0.02
#: Bends of more than this are not expected to take fewer terms than pulses [rad].
_MOST_BEND_RAD = 30.0


@dataclass(frozen=True)
class SmoothRows:
    """n paths whose length is a straight line in time and a bend, each field (n,)."""

    length_m: Real  #: of the straight line at `time_s` [m]
    rate_mps: Real  #: of the straight line, twice the range rate [m/s]
    time_s: Real
    order: Real  #: pulse intervals by which the path is folded; 0 where it bends
    amplitude: Weights  #: (n,), or coefficients of T_k over the burst, (n, terms)
    bend_m: Real  #: coefficients of T_2, T_3 ... over the burst, (n, degrees); degrees 0: straight

    def __len__(self) -> int:
        return int(self.length_m.size)

    @property
    def size(self) -> Real:
        """Bound of each amplitude over the burst, (n,)."""
        size = np.abs(self.amplitude)
        return np.asarray(size if size.ndim == 1 else size.sum(axis=1))

    def select(self, rows: Rows) -> SmoothRows:
        return SmoothRows(*(getattr(self, f.name)[rows] for f in fields(self)))

    @classmethod
    def join(cls, parts: list[SmoothRows]) -> SmoothRows:
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))


@dataclass(frozen=True)
class PulsesPlan:
    """Blocks of pulses for type 3, and the cost of either way."""

    blocks: list[slice]
    type3_s: float  #: [s]
    pulses_s: float  #: of one transform per pulse [s]


@dataclass(frozen=True)
class AllPulses:
    """Sums of smooth rows at the pulses of a burst, whose times are in rising order. `lengths` and
    `amplitudes` are the bases of bends and of amplitudes that vary.
    """

    sums: SynthesisContext
    times_s: Real
    tolerance: float
    lengths: BurstBasis | None = None
    amplitudes: BurstBasis | None = None

    def plan(self, rows: SmoothRows) -> PulsesPlan:
        """Choose blocks for type 3, and compare the cost with one transform per pulse."""
        sums, grid, pulses = self.sums, self.sums.grid, self.times_s.size
        rate = rows.rate_mps / SPEED_OF_LIGHT_MPS
        spread_rate = float(rate.max() - rate.min())
        burst_s = float(self.times_s.max() - self.times_s.min())
        if sums.ramp is not None:
            burst_s += grid.count * sums.ramp.interval_s
        if sums.pulse is not None:
            burst_s += 2 * sums.pulse.half_s
            pulses *= sums.pulse.nodes(rows.rate_mps, grid.highest_hz, self.tolerance)
        middle = MiddleMotion.of(rows.length_m / SPEED_OF_LIGHT_MPS, rate, 0.0, sums)
        half_band_hz = abs(grid.step_hz) * grid.count / 2
        least = max(_LEAST_BLOCKS, math.ceil(pulses * grid.count / _MAX_TARGETS))
        slow = NARROW * grid.highest_hz * spread_rate * burst_s
        # a bend from its tangent in the middle of one of n blocks goes down with n^2
        k = np.arange(2, rows.bend_m.shape[1] + 2)
        apart_m = np.ptp(rows.bend_m, axis=0) / 2 * k**2 * (k**2 - 1) / 12
        bend_rad = 2 * math.pi * grid.highest_hz / SPEED_OF_LIGHT_MPS * float(apart_m.sum())
        terms = rows.amplitude.shape[1] if rows.amplitude.ndim > 1 else 1

        def cost_s(blocks: int) -> float:
            points = _FINE * grid.count * (slow / blocks + MARGIN)
            if points > _MAX_GRID and blocks < self.times_s.size:
                return math.inf
            # a path's own phases that no straight line has
            own_rad = bend_rad / blocks**2 + middle.remains_rad(burst_s / blocks / 2, half_band_hz)
            if own_rad > _MOST_BEND_RAD:
                return math.inf
            sets = nodes_for(own_rad, _SHARE * self.tolerance)
            sets += (terms - 1) * (sets if sums.pulse is not None else 1)
            grid_s = points * (_GRID_3 if points <= _CACHED else _FAR_GRID_3)
            rows_s = sets * _PATH_3 + (_FACTORS_3 if sets > 1 else 0.0)
            targets_s = sets * _TARGET_3 * grid.count * pulses / blocks
            return blocks * (rows_s * len(rows) + sets * grid_s + targets_s + _BLOCK_3)

        most = max(1, math.ceil(math.log2(self.times_s.size / least)) + 1)
        blocks = min((min(least << n, self.times_s.size) for n in range(most)), key=cost_s)
        each = _PATH_1 * len(rows) + _FREQUENCY_1 * grid.count + _PULSE_1
        if sums.ramp is not None:
            each *= _RAMP_1
        edges = np.linspace(0, self.times_s.size, blocks + 1).astype(int).tolist()
        return PulsesPlan(
            [slice(a, b) for a, b in itertools.pairwise(edges)], cost_s(blocks), pulses * each
        )

    def block(self, rows: SmoothRows, pulses: slice) -> tuple[PulseBlock, int]:
        """Compute the spectra of some pulses. Also return the number of transforms."""
        start = time.thread_time()
        sums, grid, times, nodes = self.sums, self.sums.grid, self.times_s[pulses], 1
        if sums.pulse is not None:
            k = np.arange(2, rows.bend_m.shape[1] + 2)
            half_s = 1.0 if self.lengths is None else self.lengths.half_s
            fastest_mps = np.abs(rows.rate_mps) + np.abs(rows.bend_m) @ (k**2 / half_s)
            nodes = sums.pulse.nodes(fastest_mps, grid.highest_hz, self.tolerance)
            times = (times[:, None] + sums.pulse.times_s(nodes)).ravel()
        middle_s = float(times[0] + times[-1]) / 2
        points = _Points.of(rows, self, middle_s)
        outer = np.ones((times.size, 1))  # gains are those in the middle of a pulse
        if points.outer_terms > 1 and self.amplitudes is not None:
            at_pulses = self.amplitudes.at(self.times_s[pulses])[:, : points.outer_terms]
            outer = np.repeat(at_pulses, nodes, axis=0)
        result, error, transforms = _transformed(points, times - middle_s, self.tolerance, outer)
        if sums.pulse is not None:
            result = sums.pulse.joined(result.reshape(-1, nodes, grid.count))
            error = joined_error(error.of_each(nodes), nodes, self.tolerance, grid.count)
        return PulseBlock(pulses, result, error, time.thread_time() - start), transforms


def _bends(basis: BurstBasis, degrees: int, times_s: Real) -> tuple[Real, Real]:
    """Return T_2, T_3 ... and their rates [1/s] at times, (times, degrees). Times may be a little
    outside the burst.
    """
    chebyshev = np.polynomial.chebyshev
    values = chebyshev.chebvander((times_s - basis.middle_s) / basis.half_s, degrees + 1)
    slopes = chebyshev.chebder(np.eye(degrees + 2), axis=0)
    rates = np.asarray(values[:, :-1] @ slopes[:, 2:] / basis.half_s, dtype=np.float64)
    return np.asarray(values[:, 2:], dtype=np.float64), rates


@dataclass(frozen=True)
class _Points:
    """Rows about a time: points of the transform, and what is left of each row beyond it."""

    rows: SmoothRows
    bases: AllPulses
    time_s: float
    middle: MiddleMotion
    phasors: Complex  #: at the time, without amplitudes, (n,)
    length_m: Real  #: at the time [m]
    rate_mps: Real  #: at the time, of the tangent [m/s]
    bend_m: Real  #: of the bend at the time [m]
    slope_mps: Real  #: of the bend at the time [m/s]
    reference_m: float  #: from which delays are counted
    middle_m: Real  #: coefficients of the middle of all bends [m]

    @classmethod
    def of(cls, rows: SmoothRows, bases: AllPulses, time_s: float) -> _Points:
        sums, period_s = bases.sums, bases.sums.listening.period_s or 0.0
        bend_m = slope_mps = np.zeros(len(rows))
        if bases.lengths is not None and rows.bend_m.shape[1]:
            values, slopes = _bends(bases.lengths, rows.bend_m.shape[1], np.array([time_s]))
            bend_m, slope_mps = rows.bend_m @ values[0], rows.bend_m @ slopes[0]
        tangent_mps = rate_mps = rows.rate_mps + slope_mps
        shift_m = rows.rate_mps * (time_s - rows.time_s) + bend_m
        length_m = rows.length_m + shift_m
        if sums.meeting is not None:
            shift_m = shift_m + sums.meeting.moved_m(length_m, rate_mps, -rows.order * period_s)
            rate_mps = sums.meeting.seen_mps(rate_mps)
        reference_m = float(rows.length_m[0])
        delay_s = (rows.length_m - reference_m + shift_m) / SPEED_OF_LIGHT_MPS
        delay_s -= rows.order * period_s
        cycles = rows.order * sums.shift_centre
        cycles -= reduced_cycles(rows.length_m, sums.centre)
        cycles -= reduced_cycles(shift_m, sums.centre)
        rate = rate_mps / SPEED_OF_LIGHT_MPS
        middle = MiddleMotion.of(delay_s, rate, reference_m / SPEED_OF_LIGHT_MPS, sums)
        cycles += middle.path_cycles()
        phasors = unit_phasors(cycles)
        middle_m = (rows.bend_m.min(axis=0) + rows.bend_m.max(axis=0)) / 2
        if sums.pulse is not None:
            phasors *= sums.pulse.stretch(tangent_mps)
        return cls(
            rows, bases, time_s, middle, phasors, length_m, tangent_mps, bend_m, slope_mps,
            reference_m, middle_m,
        )  # fmt: skip

    @property
    def outer_terms(self) -> int:
        """Terms of the amplitudes that take transforms of their own: those of pulses."""
        varies = self.bases.sums.pulse is not None and self.rows.amplitude.ndim > 1
        return self.rows.amplitude.shape[1] if varies else 1

    @property
    def straight(self) -> bool:
        return self.bases.lengths is None or not self.rows.bend_m.shape[1]

    def common_bend_m(self, since_s: Real) -> Real:
        """Return e_c at times from the middle, in their shape [m]."""
        if self.bases.lengths is None or self.straight:
            return np.zeros(since_s.shape)
        middle_m = self.middle_m
        now, slope = _bends(self.bases.lengths, middle_m.size, np.array([self.time_s]))
        later, _ = _bends(self.bases.lengths, middle_m.size, self.time_s + since_s.ravel())
        found = ((later - now) @ middle_m).reshape(since_s.shape)
        return np.asarray(found - (slope[0] @ middle_m) * since_s)

    def own_at(self, since_s: Real, offset_hz: Real) -> Callable[[Rows], Complex]:
        """Return a function of rows: what the transform leaves out of them, over their `size`,
        (rows, n), at n times from the middle and frequencies from the carrier.
        """
        middle, sums, rows = self.middle, self.bases.sums, self.rows
        beyond_hz = middle.beyond_hz(since_s, offset_hz)
        factors = np.stack([since_s**2, -since_s * beyond_hz])
        around_hz = middle.middle_hz(float(sums.grid.exact_centre_hz)) + beyond_hz
        common_s = self.common_bend_m(since_s) / SPEED_OF_LIGHT_MPS
        from_tangent = slope_of = np.empty((0, since_s.size))
        if self.bases.lengths is not None and not self.straight:
            degrees = rows.bend_m.shape[1]
            values, slopes = _bends(self.bases.lengths, degrees, self.time_s + since_s)
            now, slope_now = _bends(self.bases.lengths, degrees, np.array([self.time_s]))
            from_tangent, slope_of = (
                (values - now).T - slope_now.T * since_s,
                (slopes - slope_now).T,
            )
        gains: Real | None = None
        if rows.amplitude.ndim > 1 and self.outer_terms == 1 and self.bases.amplitudes is not None:
            # they are those in the middle of a ramp
            interval_s = 0.0 if sums.ramp is None else sums.ramp.interval_s
            pulse_s = self.time_s + since_s - offset_hz / sums.grid.step_hz * interval_s
            gains = self.bases.amplitudes.at(pulse_s)[:, : rows.amplitude.shape[1]].T

        def own(part: Rows) -> Complex:
            cycles = np.stack([middle.square[part], middle.product[part]], axis=1) @ factors
            stretch: Real | None = None  # over that of the tangent
            if from_tangent.size:
                bend_m, slope_mps = rows.bend_m[part] @ from_tangent, rows.bend_m[part] @ slope_of
                rate_mps = self.rate_mps[part, None]
                if sums.pulse is not None:
                    stretch = sums.pulse.stretch(rate_mps + slope_mps)
                    stretch = stretch / sums.pulse.stretch(rate_mps)
                if sums.meeting is not None:  # the wave meets the path where it is at another rate
                    slope_mps *= self.length_m[part, None] + rate_mps * since_s + bend_m
                    slope_mps += rate_mps * bend_m
                    slope_mps *= sums.meeting.side / (2 * SPEED_OF_LIGHT_MPS)
                    bend_m += slope_mps
                bend_m /= SPEED_OF_LIGHT_MPS
                cycles -= around_hz * (bend_m - common_s)
                if middle.slope:
                    rate = middle.rate[part] + middle.product[part]
                    away_s = bend_m / 2 + rate[:, None] * since_s + middle.delay_s[part, None]
                    away_s *= middle.slope
                    away_s *= bend_m
                    cycles += away_s
            found = unit_phasors(cycles)
            if stretch is not None:
                found *= stretch
            if gains is not None:
                found *= rows.amplitude[part] @ gains / np.maximum(rows.size[part, None], 1e-300)
            return found

        return own


def _transformed(
    points: _Points, times_s: Real, tolerance: float, outer: Real
) -> tuple[Complex, ErrorSum, int]:
    """Sum the points at times of all frequencies, (times, frequencies). Also return the error and
    the number of transforms. `outer` are weights of the terms of amplitudes, (times, terms).
    """
    sums, middle, rows = points.bases.sums, points.middle, points.rows
    grid, interval_s = sums.grid, 0.0 if sums.ramp is None else sums.ramp.interval_s
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
    size = rows.size
    squares, total = float(np.dot(size, size)), float(size.sum())
    expected = math.sqrt(since_s.size * squares)
    for engine, left in (
        (engine_tolerance(tolerance), max(_SHARE * tolerance, TIGHTEST)),
        (TIGHTEST, TIGHTEST),
    ):
        terms = _terms_of(points, times_s, since_s, left)
        result, transforms = np.zeros(since_s.shape, dtype=np.complex128), 0
        for number, weight in enumerate(outer.T):
            amplitude = rows.amplitude if outer.shape[1] == 1 else rows.amplitude[:, number]
            values = points.phasors * (amplitude if amplitude.ndim == 1 else size)
            for found in terms.sums(values, engine * math.sqrt(squares), x, middle.rate, along):
                result += found if outer.shape[1] == 1 else found * weight[:, None]
                transforms += 1
        error = max(engine, LEAST_ERROR) * min(transforms, 2) + (left if transforms > 1 else 0.0)
        if RANDOM_STATE * error * expected <= tolerance / 3 * l2_norm(result):
            break
    result *= middle.common_turns(times_s, interval_s, grid.step_hz, grid.count, carrier_hz)
    if not points.straight:
        bend_s = points.common_bend_m(since_s) / SPEED_OF_LIGHT_MPS
        result *= unit_phasors(-bend_s * (turns_hz + middle.beyond_hz(since_s, offset_hz)))
    return result, ErrorSum.of(error, since_s.size, squares, total), transforms


@dataclass(frozen=True)
class _Terms:
    """Factors of n paths, (n, terms), and the functions that they multiply: values at Chebyshev
    nodes, (terms, nodes in time, nodes in frequency), and the nodes' polynomials at all times and
    frequencies, (nodes, ...). Empty factors stand for 1.
    """

    factors: Complex
    functions: Complex
    of_times: Real
    of_frequencies: Real

    def sums(
        self, values: Complex, error: float, x: Real, y: Real, along: Real
    ) -> Iterator[Complex]:
        """Yield parts of the sum of values (n,) at points x, y, (times, frequencies). Small terms
        are transformed coarsely, so that each has the same error.
        """
        size = along.shape[1]
        if not self.factors.size:
            engine = max(error / max(l2_norm(values), 1e-300), TIGHTEST)
            yield next(nufft_lines(x, y, values[None], size, along, engine))
            return
        strengths = self.factors.T * values
        largest = np.abs(self.functions).max(axis=(1, 2))
        wanted = [
            min(error / max(l2_norm(one) * most, 1e-300), _COARSEST)
            for one, most in zip(strengths, largest, strict=True)
        ]
        # few plans: each sorts the points
        steps = np.floor(np.log10(np.maximum(wanted, TIGHTEST)) / 2)
        for step in np.unique(steps):
            same = np.flatnonzero(steps == step)
            engine = max(min(wanted[number] for number in same), TIGHTEST)
            found = nufft_lines(x, y, strengths[same], size, along, engine)
            for number, part in zip(same, found, strict=True):
                part *= self.of_times.T @ self.functions[number] @ self.of_frequencies
                yield part


def _terms_of(points: _Points, times_s: Real, since_s: Real, left: float) -> _Terms:
    """Separate what the transform leaves out of all rows, to `left` of each row's size."""
    sums, middle = points.bases.sums, points.middle
    count, half_s = sums.grid.count, float(times_s[-1] - times_s[0]) / 2
    half_band_hz = abs(sums.grid.step_hz) * count / 2
    remains_rad = middle.remains_rad(float(np.abs(since_s).max()), half_band_hz)
    plain = points.rows.amplitude.ndim == 1 or points.outer_terms > 1
    if remains_rad <= left and points.straight and plain:
        none = np.empty((0, 0))
        return _Terms(none.astype(np.complex128), none.astype(np.complex128), none, none)
    k = np.arange(count) - count // 2
    half = max(count // 2, 1)
    interval_s = 0.0 if sums.ramp is None else sums.ramp.interval_s

    def values(time: Real, frequency: Real) -> Callable[[Rows], Complex]:
        offset = half * frequency
        return points.own_at(half_s * time + offset * interval_s, offset * sums.grid.step_hz)

    rows, extremes = points.rows, [middle.product, middle.square, *points.rows.bend_m.T]
    if not plain:
        extremes += [*np.abs(rows.amplitude.T / np.maximum(rows.size, 1e-300))]
    samples = [np.linspace(0, len(rows) - 1, _SAMPLES).astype(np.intp)]
    samples += [np.array([one.argmin(), one.argmax()]) for one in extremes]
    factors, functions = _separated(values, len(rows), np.unique(np.concatenate(samples)), left)
    places = times_s / half_s if half_s > 0 else np.zeros(times_s.size)
    return _Terms(
        factors,
        functions,
        lagrange(chebyshev_nodes(functions.shape[1]), places),
        lagrange(chebyshev_nodes(functions.shape[2]), k / half),
    )


#: Rows that show what all are like, nodes in time and frequency that are tried first, and at most.
_SAMPLES, _FIRST_NODES, _MOST_NODES = 128, (16, 8), 256
#: Other places at which each row is checked.
_CHECKS = 4


def _separated(
    values: Callable[[Real, Real], Callable[[Rows], Complex]],
    count: int,
    sample: NDArray[np.intp],
    left: float,
) -> tuple[Complex, Complex]:
    """Write n functions of two places within [-1, 1] as sums of few products: factors (n, terms),
    and functions common to all by their values at Chebyshev nodes, (terms, nodes, nodes). They miss
    each by a root mean square of about `left`. `values` at places gives those of rows.

    The common functions are the right singular vectors of sampled rows. What factors a row has
    follows from its values at as many of the nodes (an interpolative decomposition: Cheng et al.,
    SIAM J. Sci. Comput. 26, 1389, 2005). Rows that are missed join the sample.
    """
    tried = _FIRST_NODES
    while True:
        found = values(*_cells(tried))(sample).reshape(-1, *tried)
        inverses = [
            np.linalg.inv(np.polynomial.chebyshev.chebvander(chebyshev_nodes(n), n - 1))
            for n in tried
        ]
        size = np.abs(np.einsum("nab,ca,db->ncd", found, *inverses)).max(axis=0)
        nodes = [
            int(np.count_nonzero(np.cumsum(size.sum(axis=1 - axis)[::-1])[::-1] > left / 4))
            for axis in (0, 1)
        ]
        more = [n > most - 3 and most < _MOST_NODES for n, most in zip(nodes, tried, strict=True)]
        if not any(more):
            break
        tried = tried[0] << more[0], tried[1] << more[1]
    shape = max(nodes[0], 1), max(nodes[1], 1)
    times, frequencies = _cells(shape)
    bound = left * math.sqrt(times.size)
    while True:
        found = values(times, frequencies)(sample)
        _, sizes, common = np.linalg.svd(found, full_matrices=False)
        used = max(int(np.count_nonzero(sizes > bound)), 1)
        _, upper, order = scipy.linalg.qr(found, mode="economic", pivoting=True)
        chosen, others = order[:used], order[used : used + _CHECKS]
        # of all nodes from the chosen ones, (used, nodes)
        spread = np.empty((used, times.size), dtype=np.complex128)
        spread[:, order] = np.linalg.solve(upper[:used, :used], upper[:used])
        turned = spread @ common[:used].conj().T
        checked = np.concatenate([chosen, others])
        own_at, own = values(times[checked], frequencies[checked]), spread[:, others]
        factors, missed = np.empty((count, used), dtype=np.complex128), np.zeros(count)
        for start in range(0, count, BLOCK):
            part = slice(start, min(start + BLOCK, count))
            here = own_at(part)
            factors[part] = here[:, :used] @ turned
            if others.size:
                away = np.abs(here[:, :used] @ own - here[:, used:])
                missed[part] = away.max(axis=1)
        bad = np.flatnonzero(missed > 4 * bound)
        if not bad.size or used == times.size:
            return factors, common[:used].reshape(used, *shape)
        sample = np.union1d(sample, bad[np.argsort(missed[bad])[-_SAMPLES:]])


def _cells(nodes: tuple[int, int]) -> tuple[Real, Real]:
    """Return the places of all pairs of Chebyshev nodes, (nodes x nodes,) each."""
    one, other = chebyshev_nodes(nodes[0]), chebyshev_nodes(nodes[1])
    return np.repeat(one, other.size), np.tile(other, one.size)


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
