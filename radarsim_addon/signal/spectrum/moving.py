# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of moving paths: which way each kind of motion goes, and going it.

See :mod:`.spectrum.accumulator` for what is chosen. A ramp (:class:`.spectrum.grid.Ramp`) asks for
lengths at three times of each pulse, a pulse that is under way for two; they come the same ways.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..motion import LinearMotion, PathMotion
from .amplitudes import AMPLITUDE_NODES, used_terms
from .burst_basis import BurstBasis
from .grid import SynthesisContext, Weights, check_finite, repeat_orders
from .linear_motion import LinearRows, linear_block, plan_linear
from .nufft import Backend, RowsType1
from .ordered_executor import OrderedExecutor
from .pulse_blocks import PulseBlock, TransformPool
from .pulse_motion import PulseMotionTransform, pulse_left_out_rad
from .ramp import RampTransform, left_out_rad
from .report import Motion, SynthesisReport, Transform
from .transform import ErrorSum, PulseTransform

Method = Literal["auto", "type3", "per-pulse", "direct"]

#: Amplitudes (pulses, rows) of some rows at some pulses.
AmplitudesAt = Callable[[slice, slice], Weights]

#: Fraction of the tolerance for fitted motion.
_MOTION_SHARE = 0.25
#: Rate and acceleration come from two or three lengths: their errors add up to so many.
_OFFSETS_SHARE = 4.0
#: Lengths (rows x times) asked of a motion at a time: 16 MB.
_MAX_LENGTHS = 1 << 21
#: Fewer rows are for one thread: more would wait for the interpreter, at twice the processor time.
_FEW = 1 << 14
#: Blocks of pulses, at least: so many that threads have work, not their number, on which sums of
#: errors would hang.
_BLOCKS = 8
#: Rows of constant rate that wait for one transform: 25 MB.
_MAX_LINEAR = 1 << 19
#: Rows times terms of amplitudes that vary, the same: 67 MB.
_MAX_TERMS = 1 << 22


class MovingPathAccumulator:
    """Adds up the spectra of moving paths in `values` (pulses, frequencies), None where nothing
    moved.

    The first parameters are those of :class:`.spectrum.accumulator.SpectrumAccumulator`; `rows`
    paths are in one transform; `interval_s` is that from pulse to pulse, for folding in Doppler.

    `heard` and `folded_pulses` count paths in the window, and folded into it, once per pulse;
    `folded` those folded at every pulse; `fast` those that turn by more than half a cycle between
    pulses.
    """

    def __init__(
        self,
        sums: SynthesisContext,
        times_s: Real,
        tolerance: float,
        method: Method,
        backend: Backend,
        rows: int,
        lanes: OrderedExecutor,
        report: SynthesisReport,
        interval_s: float,
    ) -> None:
        self.values: Complex | None = None
        self.error = ErrorSum()
        self.heard, self.folded, self.folded_pulses, self.fast = 0, 0, 0, 0
        self._left_rad = [0.0]  # appended to by threads
        self._sums, self._times_s, self._tolerance = sums, times_s, tolerance
        self._method, self._backend = method, backend
        self._rows, self._lanes, self._report = rows, lanes, report
        self._added = 0
        self._linear_rows: list[LinearRows] = []
        self._smooth_rows: list[tuple[Real, Weights]] = []
        transform: type[PulseTransform | RampTransform | PulseMotionTransform] = PulseTransform
        # times at which a pulse wants lengths, from its own
        self._offsets_s, first_s = np.zeros(1), 0.0
        if sums.ramp is not None:
            transform, first_s = RampTransform, -sums.ramp.half_s(sums.grid.count)
            self._offsets_s = np.array([first_s, 0.0, -first_s])
        if sums.pulse is not None:
            transform, self._offsets_s = PulseMotionTransform, np.array([0.0, sums.pulse.half_s])
        self._pool = TransformPool(
            lambda: transform(sums, tolerance, backend), sums.grid.count, lanes.threads
        )
        span_s = np.array([times_s[0] + first_s, times_s[-1] + self._offsets_s[-1]])
        self._basis = BurstBasis(span_s) if span_s[1] > span_s[0] else None
        self._amplitude_basis: BurstBasis | None = None
        if times_s.size > 1:
            self._amplitude_basis = BurstBasis(times_s, AMPLITUDE_NODES)
        # a ramp shows a path where it will be
        self._shown_s = 0.0
        if sums.ramp is not None:
            carrier_hz = float(sums.grid.exact_centre_hz)
            self._shown_s = carrier_hz * sums.ramp.interval_s / sums.grid.step_hz
        self._phase_bound_rad = _MOTION_SHARE * tolerance
        # rate of a length at which the carrier turns by half a cycle from pulse to pulse
        carrier_hz = abs(sums.listening.reference_hz or float(sums.grid.exact_centre_hz))
        turns = 2 * interval_s * carrier_hz
        self._fast_mps = SPEED_OF_LIGHT_MPS / turns if turns > 0 else math.inf

    @property
    def left_out_rad(self) -> float:
        """Largest phase of the motion within a ramp or pulse that is left out [rad]."""
        return max(self._left_rad)

    def flush(self) -> None:
        """Sum up what waits."""
        self._flush_linear()
        self._flush_smooth()

    def _lengths_at(self, pulses: slice) -> Real:
        """Times at which these pulses want lengths, (pulses x offsets,) [s]."""
        return np.asarray((self._times_s[pulses, None] + self._offsets_s).ravel())

    def _by_pulses(self, lengths_m: Real) -> Real:
        """To (pulses, rows); of a ramp (pulses, 3, rows), of a pulse (pulses, 2, rows)."""
        if self._offsets_s.size == 1:
            return lengths_m
        found = lengths_m.reshape(-1, self._offsets_s.size, lengths_m.shape[1])
        if self._sums.pulse is not None:
            rate_mps = (found[:, 1] - found[:, 0]) / self._sums.pulse.half_s
            found = np.stack([found[:, 0], rate_mps], axis=1)
        return found

    def add(
        self, motion: PathMotion, rows: NDArray[np.intp], amplitude: Weights, first: int
    ) -> None:
        """Add these rows, which move; `first` is the number of the motion's row 0 in errors.

        `amplitude` is (rows,), or coefficients of T_k over the burst, (rows, AMPLITUDE_NODES).
        """
        self._added = first
        basis = self._basis
        fitted = self._method in ("auto", "type3")
        if isinstance(motion, LinearMotion):
            length_m, rate_mps = motion.length_m[rows], 2 * motion.range_rate_mps[rows]
            self._check(length_m, rows, "length")
            self._check(rate_mps, rows, "range rate")
            self.fast += self._count_fast(np.abs(rate_mps))
            self._take_linear(length_m, rate_mps, 0.0, amplitude, fitted)
            return
        wanted = self._times_s.size * self._offsets_s.size
        if basis is None or not fitted or wanted <= basis.sample_times_s().size:
            self._sampled(motion, rows, amplitude)
            return
        lengths_m = motion.lengths_m(basis.sample_times_s(), rows)
        self._check(lengths_m, rows, "length")
        fit = basis.fit(lengths_m, self._length_bound_m())
        coarse = ~fit.smooth
        if coarse.any():
            self._sampled(motion, rows[coarse], amplitude[coarse])
        self.fast += self._count_fast(fit.fastest_mps[fit.smooth])
        self._fitted(amplitude[fit.smooth])
        linear = fit.linear & self._type3_possible()
        curved = fit.smooth & ~linear
        if curved.any():
            self._smooth_rows.append((fit.coefficients_m[curved], amplitude[curved]))
            if sum(len(a) for _, a in self._smooth_rows) >= self._rows:
                self._flush_smooth()
        if linear.any():
            found = fit.coefficients_m[linear]
            rate_mps = found[:, 1] / basis.half_s
            self._take_linear(found[:, 0].copy(), rate_mps, basis.middle_s, amplitude[linear], True)

    def _length_bound_m(self) -> float:
        """Error of a length that costs the fraction of the tolerance set aside for motion [m]."""
        share = 1.0 if self._offsets_s.size == 1 else _OFFSETS_SHARE
        cycles = self._phase_bound_rad / share / (2 * np.pi)
        return cycles * SPEED_OF_LIGHT_MPS / max(self._sums.grid.highest_hz, 1.0)

    def _type3_possible(self) -> bool:
        sums = self._sums
        alone = sums.ramp is not None or sums.extra_cycles is None
        return self._backend == "finufft" and alone and RowsType1.possible()

    def _count_fast(self, rate_mps: Real) -> int:
        return int(np.count_nonzero(rate_mps > self._fast_mps))

    def _fitted(self, amplitude: Weights) -> None:
        """Remember what fitted motion may cost."""
        if not amplitude.size:
            return
        self._report.motion_error_rad = self._phase_bound_rad
        size, terms = np.abs(amplitude), self._times_s.size * self._sums.grid.count
        size = size if size.ndim == 1 else size.sum(axis=1)
        root = self._phase_bound_rad * float(np.sqrt(terms))
        self.error.add(ErrorSum(root * float(np.linalg.norm(size)), root * float(size.sum()), 0.0))

    def _take_linear(
        self,
        length_m: Real,
        rate_mps: Real,
        time_s: float,
        amplitude: Weights,
        fitted: bool,
    ) -> None:
        """Paths of constant rate: to the buffer if they stay in the window, else by pulses."""
        time = np.full(length_m.size, time_s)
        everything = LinearRows(length_m, rate_mps, time, np.zeros(time.size), amplitude)
        if not (fitted and self._type3_possible()):
            self._linear_by_pulse(everything, None)
            return
        ends = [
            (length_m + rate_mps * (t - time_s + self._shown_s)) / SPEED_OF_LIGHT_MPS
            for t in (self._times_s[0], self._times_s[-1])
        ]
        listening = self._sums.listening
        low, high = listening.orders(np.minimum(*ends), np.maximum(*ends))
        whole = np.ones(length_m.size, dtype=bool)
        for end in ends:
            low_here, high_here = listening.orders(end, end)
            whole &= (low_here == low) & (high_here == high)
        if not whole.all():
            self._linear_by_pulse(everything.select(~whole), None)
        copies = np.where(whole, high - low + 1, 0).astype(np.intp)
        heard = np.repeat(np.arange(copies.size), copies)
        order = repeat_orders(low, copies)
        self.heard += int(np.count_nonzero(copies)) * self._times_s.size
        self.folded += int(np.count_nonzero(order))
        if heard.size:
            self._linear_rows.append(replace(everything.select(heard), order=order))
        most = _MAX_LINEAR if amplitude.ndim == 1 else _MAX_TERMS
        if sum(part.amplitude.size for part in self._linear_rows) >= most:
            self._flush_linear()

    def _flush_linear(self) -> None:
        """All pulses of the rows of constant rate that wait, the cheaper way."""
        if not self._linear_rows:
            return
        rows = LinearRows.join(self._linear_rows)
        self._linear_rows = []
        terms: Real | None = None
        if rows.amplitude.ndim > 1:
            rows = replace(rows, amplitude=used_terms(rows.amplitude))
            terms = self._terms(slice(None), rows.amplitude.shape[1])
        plan = plan_linear(rows, self._sums, self._times_s, self._tolerance)
        if self._method != "type3" and plan.pulses_s < plan.type3_s:
            self._linear_by_pulse(rows, rows.order)
            return
        jobs = (
            partial(linear_block, rows, self._sums, self._times_s, pulses, self._tolerance, terms)
            for pulses in plan.blocks
        )
        moving, error, cpu_s = self._matrix(), ErrorSum(), 0.0
        for block in self._lanes.run(jobs, len(plan.blocks)):
            moving[block.pulses] += block.values
            error.beside(block.error)
            cpu_s += block.cpu_s
        self.error.add(error)
        transforms = len(plan.blocks) * (1 if terms is None else terms.shape[1])
        self._report.count("linear", "type 3", len(rows), transforms, cpu_s)

    def _terms(self, pulses: slice, count: int) -> Real:
        """T_k at pulses, k < count, (pulses, count)."""
        if self._amplitude_basis is None:
            return np.ones((self._times_s[pulses].size, 1))
        return self._amplitude_basis.at(self._times_s[pulses])[:, :count]

    def _linear_by_pulse(self, rows: LinearRows, order: Real | None) -> None:
        """Pulse by pulse at constant rates; with `order` the rows are counted already."""

        def lengths_m(part: slice, pulses: slice) -> Real:
            length_m, rate_mps, time_s = rows.length_m[part], rows.rate_mps[part], rows.time_s[part]
            if self._sums.pulse is not None:  # exact, without a difference
                middle_m = length_m + rate_mps * (self._times_s[pulses, None] - time_s)
                return np.stack([middle_m, np.broadcast_to(rate_mps, middle_m.shape)], axis=1)
            since_s = self._lengths_at(pulses)[:, None] - time_s
            return self._by_pulses(length_m + rate_mps * since_s)

        self._by_pulse("linear", lengths_m, rows.amplitude, order=order)

    def _flush_smooth(self) -> None:
        """Pulse by pulse at lengths from fitted polynomials."""
        if not self._smooth_rows or self._basis is None:
            return
        coefficients_m = np.concatenate([found for found, _ in self._smooth_rows])
        amplitude = np.concatenate([a for _, a in self._smooth_rows])
        self._smooth_rows = []
        basis = self._basis

        def lengths_m(part: slice, pulses: slice) -> Real:
            at_pulses = basis.at(self._lengths_at(pulses))
            return self._by_pulses(np.asarray(at_pulses @ coefficients_m[part].T))

        self._by_pulse("smooth", lengths_m, amplitude)

    def _sampled(
        self,
        motion: PathMotion,
        rows: NDArray[np.intp],
        amplitude: Weights,
        at: AmplitudesAt | None = None,
    ) -> None:
        """Pulse by pulse at lengths from the motion itself, and at amplitudes from `at`."""
        fast = np.zeros(rows.size, dtype=bool)

        def lengths_m(part: slice, pulses: slice) -> Real:
            wanted = slice(max(pulses.start - 1, 0), pulses.stop)  # one before, for the rate
            found = motion.lengths_m(self._lengths_at(wanted), rows[part])
            self._check(found, rows[part], "length")
            each = self._offsets_s.size
            middle_m = found[:, each // 2 :: each]
            rates = np.abs(np.diff(middle_m, axis=1) / np.diff(self._times_s[wanted]))
            if rates.shape[1]:
                fast[part] |= rates.max(axis=1) > self._fast_mps
            first = (pulses.start - wanted.start) * each
            return self._by_pulses(np.ascontiguousarray(found[:, first:].T))

        self._by_pulse("sampled", lengths_m, amplitude, ahead=True, at=at)
        self.fast += int(np.count_nonzero(fast))

    def _by_pulse(
        self,
        motion: Motion,
        lengths_m: Callable[[slice, slice], Real],
        amplitude: Weights,
        *,
        order: Real | None = None,
        ahead: bool = False,
        at: AmplitudesAt | None = None,
    ) -> None:
        """One transform for each pulse and block of rows.

        `lengths_m` gives lengths (pulses, rows) of parts of either, and `at` amplitudes; with
        `ahead` both are called in this thread alone, since a motion need not be safe in several.
        """
        count = len(amplitude)
        if at is None and amplitude.ndim > 1:
            amplitude = used_terms(amplitude)

            def at(part: slice, pulses: slice) -> Weights:
                terms = self._terms(pulses, amplitude.shape[1])
                return np.asarray(terms @ amplitude[part].T)

        pulses, moving = self._times_s.size, self._matrix()
        largest = max(self._offsets_s.size * min(self._rows, count), self._sums.grid.count)
        most = _MAX_LENGTHS // largest
        length = max(1, min(most, -(-pulses // _BLOCKS)))
        blocks = [slice(at, min(at + length, pulses)) for at in range(0, pulses, length)]
        cpu_s, transforms = 0.0, 0
        for start in range(0, count, self._rows):
            part = slice(start, min(start + self._rows, count))

            def job(block: slice, part: slice = part) -> Callable[[], PulseBlock]:
                lengths: Callable[[], Real] = partial(lengths_m, part, block)
                if ahead:
                    found = lengths()
                    lengths = lambda: found  # noqa: E731
                if self._offsets_s.size > 1 and motion != "linear":
                    lengths = partial(self._watched, lengths, block)
                folds = None if order is None else order[part]
                weights: Weights | Callable[[], Weights] = amplitude[part]
                if at is not None:
                    weights = at(part, block) if ahead else partial(at, part, block)
                return partial(self._pool.block, block, lengths, weights, folds)

            error = ErrorSum()
            few = min(self._rows, count) < _FEW and self._backend != "direct"
            for result in self._lanes.run(map(job, blocks), 1 if few else len(blocks)):
                moving[result.pulses] += result.values
                error.beside(result.error)
                cpu_s, transforms = cpu_s + result.cpu_s, transforms + result.values.shape[0]
                if order is None:
                    self.heard += result.heard
                    self.folded_pulses += result.folded
            self.error.add(error)
        way: Transform = "direct sum" if self._backend == "direct" else "pulse by pulse"
        self._report.count(motion, way, count, transforms, cpu_s)

    def _watched(self, lengths_m: Callable[[], Real], pulses: slice) -> Real:
        """These lengths; remembers what is left out of the motion within the ramps."""
        found = lengths_m()
        left_out = pulse_left_out_rad if self._sums.ramp is None else left_out_rad
        self._left_rad.append(left_out(found, self._sums, self._times_s[pulses]))
        return found

    def _matrix(self) -> Complex:
        if self.values is None:
            shape = (self._times_s.size, self._sums.grid.count)
            self.values = np.zeros(shape, dtype=np.complex128)
        return self.values

    def _check(self, values: Weights, rows: slice | NDArray[np.intp], what: str) -> None:
        check_finite(values, rows, what, self._added)
