# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of constant range rate: all pulses at once, by 2-D type-3 transforms.

With tau_i(t) = tau_i + beta_i (t - t_b), f_n = f_c + k df and t_b the middle of a block of pulses,

    f_n tau_i(t_m) = f_c tau_i + k df tau_i + f_n (t_m - t_b) beta_i:

the first term is a phase of each path, the others are a 2-D transform of the points
(tau_i, beta_i) at the frequencies (k df, f_n (t_m - t_b)). Nothing is left out: range migration
and the Doppler shift of every frequency are in it. Where frequencies come one after the other,
each has its own time t_m + k dt, and the motion meanwhile is in it as well.
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
from .nufft import SINGLE, TIGHTEST, nufft2d3
from .phase import phasors, reduce_cycles, reduced_cycles
from .pulse_motion import joined_error
from .transform import RANDOM_STATE, ErrorSum, engine_tolerance, l2_norm
from .video_phase import VideoPhase, longest_s, negligible

#: Points of the fine grid of one transform (16 bytes each, twice over) and targets (100 bytes).
_MAX_GRID = 1 << 23
_MAX_TARGETS = 1 << 21
#: So that two threads have work; not their number, on which the result would then hang.
_LEAST_BLOCKS = 2
#: Seconds: of a path and of a target in a type-3 transform of width 9, of a point of its grid; of
#: a path, a frequency and the overhead of a pulse on its own. Measured, one thread, finufft 2.5 on
#: a 2024 server; only their ratios matter, and those by a factor of two or so.
_PATH_3, _TARGET_3, _GRID_3 = 1.0e-7, 3.0e-7, 2.0e-8
_PATH_1, _FREQUENCY_1, _PULSE_1 = 6.0e-8, 5.0e-8, 1.2e-4
#: More of it where frequencies come one after the other, and for what video phase remains.
_RAMP_1, _VIDEO_3 = 4.0, 1.5
#: Tolerance of a type 3 with the residual video phase, of that of the synthesis.
_VIDEO_MARGIN = 0.1


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
    spread_s = float(delay.max() - delay.min())
    burst_s = float(times_s.max() - times_s.min())
    if sums.ramp is not None:
        burst_s += grid.count * sums.ramp.interval_s
    if sums.pulse is not None:
        burst_s += 2 * sums.pulse.half_s
        pulses *= sums.pulse.nodes(rows.rate_mps, grid.highest_hz, tolerance)
    least = _LEAST_BLOCKS
    video = _video_phase(delay, rate, 0.0, sums)
    if video is not None:
        remains_rad = video.remains_rad(burst_s / 2, abs(grid.step_hz) * grid.count / 2)
        least = max(least, math.ceil(burst_s / 2 / longest_s(remains_rad, burst_s / 2, tolerance)))
    fast = 4 * max(abs(grid.step_hz) * grid.count * (spread_s + spread_rate * burst_s), 8.0)
    slow = 4 * grid.highest_hz * spread_rate * burst_s
    blocks = max(
        least,
        math.ceil(fast * slow / _MAX_GRID),
        math.ceil(pulses * grid.count / _MAX_TARGETS),
    )
    blocks = min(blocks, times_s.size)
    points = fast * max(slow / blocks, 32.0)
    terms = rows.amplitude.shape[1] if rows.amplitude.ndim > 1 else 1
    type3 = (
        terms
        * (1.0 if video is None else _VIDEO_3)
        * blocks
        * (_PATH_3 * len(rows) + _TARGET_3 * grid.count * pulses / blocks + _GRID_3 * points)
    )
    if points > 4 * _MAX_GRID:
        type3 = math.inf  # paths so far apart in delay that one transform does not hold them
    each = _PATH_1 * len(rows) + _FREQUENCY_1 * grid.count + _PULSE_1
    if sums.ramp is not None:
        each *= _RAMP_1
    edges = np.linspace(0, times_s.size, blocks + 1).astype(int).tolist()
    return LinearPlan([slice(a, b) for a, b in itertools.pairwise(edges)], type3, pulses * each)


def _video_phase(
    delay_s: Real, rate: Real, reference_s: float, sums: SynthesisContext
) -> VideoPhase | None:
    """That of a ramp that has one, of delays counted from a reference."""
    if sums.ramp is None or sums.ramp.video_hz_per_s == 0:
        return None
    return VideoPhase.of(delay_s, rate, reference_s, sums.ramp, float(sums.grid.exact_centre_hz))


@dataclass(frozen=True)
class _Points:
    """Points (delay since that of `reference_m`, its rate) and strengths (sets, n) of rows."""

    delay_s: Real
    rate: Real
    values: Complex
    reference_m: float
    video: VideoPhase | None


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
    video = _video_phase(delay_s, rate, reference_m / SPEED_OF_LIGHT_MPS, sums)
    if video is not None:
        delay_s, rate = video.delay_s, video.rate
        cycles += video.path_cycles()
    turns = phasors(np.ones(1), reduce_cycles(cycles), np.empty(len(rows), dtype=np.complex128))
    return _Points(delay_s, rate, np.atleast_2d(amplitude.T) * turns, reference_m, video)


def _transformed(
    points: _Points, sums: SynthesisContext, since_s: Real, tolerance: float, terms: Real | None
) -> tuple[Complex, ErrorSum]:
    """Their sum at times `since_s` of all frequencies, (times, frequencies), and its error.

    `terms` are weights of the sets of strengths, (times, sets).
    """
    grid, video, remains_rad = sums.grid, points.video, 0.0
    k = np.arange(grid.count) - grid.count // 2
    carrier_hz, offset_hz = float(grid.exact_centre_hz), np.asarray(k * grid.step_hz, np.float64)
    fast_hz: Real = np.broadcast_to(offset_hz, since_s.shape)
    slow_hz, engines = carrier_hz + offset_hz, [engine_tolerance(tolerance), TIGHTEST]
    # delays are counted from the first path's
    fraction = float(reduced_cycles(np.array([points.reference_m]), sums.step)[0])
    turn = np.asarray(-k * fraction, dtype=np.float64)
    if video is not None:
        fast_hz, slow_hz = video.targets_hz(since_s, offset_hz, carrier_hz)
        remains_rad = video.remains_rad(float(np.abs(since_s).max()), abs(offset_hz[0]))
        turn = turn + video.common_cycles(since_s, offset_hz, carrier_hz)
        # the transforms of single pulses err by so much, too
        engines.insert(0, max(engines[0], _VIDEO_MARGIN * tolerance))
    at = (2 * np.pi * fast_hz).ravel(), (2 * np.pi * since_s * slow_hz).ravel()

    def transform(values: Complex, engine: float, single: bool = False) -> Complex:
        found = nufft2d3(points.delay_s, points.rate, values, *at, engine, single=single)
        return found.reshape(-1, *since_s.shape)

    size = np.abs(points.values).sum(axis=0)
    squares, total = float(np.dot(size, size)), float(size.sum())
    expected = math.sqrt(since_s.size * squares)
    for engine in engines:
        sets = transform(points.values, engine)
        if video is not None and not negligible(remains_rad, tolerance):
            single = negligible(remains_rad * SINGLE, tolerance)
            left = transform(video.remains(points.values), engine, single)
            sets += video.joined(left, since_s, offset_hz)
        if terms is not None:
            sets *= terms.T[:, :, None]
        result = sets.sum(axis=0) if len(sets) > 1 else sets[0]
        if RANDOM_STATE * engine * expected <= tolerance / 3 * l2_norm(result):
            break
    result *= np.exp(2j * np.pi * reduce_cycles(turn))
    return result, ErrorSum.of(engine, since_s.size, squares, total)


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
    since_s = np.repeat((times - middle_s)[:, None], grid.count, axis=1)
    if sums.ramp is not None:
        since_s += (np.arange(grid.count) - grid.count // 2) * sums.ramp.interval_s
    weights = None if terms is None else np.repeat(terms[pulses], nodes, axis=0)
    points = _points_at(rows, sums, middle_s)
    result, error = _transformed(points, sums, since_s, tolerance, weights)
    if sums.pulse is not None:
        result = sums.pulse.joined(result.reshape(-1, nodes, grid.count))
        error = joined_error(error.of_each(nodes), nodes, tolerance, grid.count)
    return BlockResult(pulses, result, error, time.thread_time() - start)
