# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of moving paths: sorts them by their motion and sends each kind the way that costs least.

`accumulator` has the choice. A `Ramp` needs lengths at three times of each pulse, a pulse that is
under way at two; they go the same ways.

Amplitudes that change during the burst (`VaryingPathAccumulator`) and that K Chebyshev terms follow
cost K transforms of type 3 for all pulses, or pulse by pulse K products per path; the cheaper one
is taken. Where no polynomial follows them, amplitudes and lengths are taken at every pulse: about
ten times the cost of a transform pulse by pulse, most of it in vertices and gains.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...arrays import Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..motion import LinearMotion, PathMotion
from .amplitudes import AmplitudeHistory, fit_amplitudes, used_terms
from .grid import Weights, check_finite, repeat_orders
from .linear_motion import LinearPlan, LinearRows, linear_block, plan_linear
from .pulse_sums import AmplitudesAt, CommonMotion, PulseSums, common_motions
from .transform import ErrorSum

#: Rate and acceleration come from two or three lengths: their errors add up to so many.
_OFFSETS_SHARE = 4.0
#: Rows of constant rate that wait for one transform: 25 MB.
_MAX_LINEAR = 1 << 19
#: Rows times terms of amplitudes that vary, the same: 67 MB.
_MAX_TERMS = 1 << 22
#: Seconds for a value between nodes, on the scale of `linear_motion`.
_INTERPOLATED = 1e-7


class MovingPathAccumulator(PulseSums):
    """Sorts rows by their motion and sends each the way that suits it."""

    def flush(self) -> None:
        """Sum up the rows that wait."""
        self._flush_linear()
        self._flush_smooth()

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
        # error of a length that costs the fraction of the tolerance set aside for motion
        cycles = self._phase_bound_rad / (1.0 if self._offsets_s.size == 1 else _OFFSETS_SHARE)
        cycles /= 2 * np.pi
        bound_m = cycles * SPEED_OF_LIGHT_MPS / max(self._sums.grid.highest_hz, 1.0)
        fit = basis.fit(lengths_m, bound_m)
        coarse = ~fit.smooth
        if coarse.any():
            self._sampled(motion, rows[coarse], amplitude[coarse])
        self.fast += self._count_fast(fit.fastest_mps[fit.smooth])
        if fit.smooth.any():
            self._report.motion_error_rad = self._phase_bound_rad
            self._add_phase_error(amplitude[fit.smooth], self._phase_bound_rad)
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

    def _type3_possible(self) -> bool:
        sums = self._sums
        alone = sums.ramp is not None or sums.extra_cycles is None
        return self._backend == "finufft" and alone

    def _count_fast(self, rate_mps: Real) -> int:
        return int(np.count_nonzero(rate_mps > self._fast_mps))

    def _take_linear(
        self, length_m: Real, rate_mps: Real, time_s: float, amplitude: Weights, fitted: bool
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
        if rows.amplitude.ndim > 1:
            rows = replace(rows, amplitude=used_terms(rows.amplitude))
        plan = plan_linear(rows, self._sums, self._times_s, self._tolerance)
        groups = self._linear_groups(rows, plan)
        if groups:
            alone = np.ones(len(rows), dtype=bool)
            for group in groups:
                own, alone[group.rows] = rows.select(group.rows), False
                with self._nodes_of(group, own.amplitude) as nodes:
                    nodes._linear_by_pulse(own, own.order)
            rows = rows.select(alone)
            if not len(rows):
                return
            plan = plan_linear(rows, self._sums, self._times_s, self._tolerance)
        if self._method != "type3" and plan.pulses_s < plan.type3_s:
            self._linear_by_pulse(rows, rows.order)
            return
        terms: Real | None = None
        if rows.amplitude.ndim > 1:
            terms = self._terms(slice(None), rows.amplitude.shape[1])
        jobs = (
            partial(linear_block, rows, self._sums, self._times_s, pulses, self._tolerance, terms)
            for pulses in plan.blocks
        )
        moving, error, cpu_s = self._matrix(), ErrorSum(), 0.0
        for block in self._lanes.run(jobs, len(plan.blocks)):
            moving[block.pulses] += block.values
            error.merge(block.error)
            cpu_s += block.cpu_s
        self.error.add(error)
        transforms = len(plan.blocks) * (1 if terms is None else terms.shape[1])
        self._report.count("linear", "type 3", len(rows), transforms, cpu_s)

    def _linear_groups(self, rows: LinearRows, plan: LinearPlan) -> list[CommonMotion]:
        """Rows of a common motion, where that is cheapest."""
        if self._basis is None:
            return []
        middle_m = rows.length_m + rows.rate_mps * (self._basis.middle_s - rows.time_s)
        lengths_m = np.stack([middle_m, rows.rate_mps * self._basis.half_s], axis=1)
        groups = self._groups(lengths_m, rows.amplitude)
        nodes, pulses = sum(group.nodes_s.size for group in groups), self._times_s.size
        cost_s = plan.pulses_s * nodes / pulses + _INTERPOLATED * pulses * self._sums.grid.count
        return groups if cost_s < min(plan.pulses_s, plan.type3_s) else []

    def _linear_by_pulse(self, rows: LinearRows, order: Real | None) -> None:
        """Pulse by pulse at constant rates; with `order` the rows are counted already."""

        def lengths_m(part: slice, pulses: slice) -> Real:
            length_m, rate_mps, time_s = rows.length_m[part], rows.rate_mps[part], rows.time_s[part]
            if self._sums.pulse is not None:  # exact, without a difference
                moved_m = rate_mps * (self._times_s[pulses, None] - time_s)
                middle_m = length_m + moved_m
                lost_m = moved_m - (middle_m - length_m)  # by rounding: Dekker, 1971, eq. 4.14
                return np.stack([middle_m, np.broadcast_to(rate_mps, middle_m.shape), lost_m], 1)
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
        alone = np.ones(len(amplitude), dtype=bool)
        for group in self._groups(coefficients_m, amplitude):
            alone[group.rows] = False
            self.heard += group.rows.size * self._times_s.size
            own_m, weights = coefficients_m[group.rows], amplitude[group.rows]
            with self._nodes_of(group, weights) as nodes:
                nodes._smooth(own_m, weights, np.zeros(len(weights)))
        if alone.any():
            self._smooth(coefficients_m[alone], amplitude[alone])

    def _groups(self, coefficients_m: Real, amplitude: Weights) -> list[CommonMotion]:
        """Rows of a common motion, with lengths and amplitudes c_k T_k over the burst."""
        if self._basis is None or self._method != "auto":
            return []
        terms = used_terms(amplitude).shape[1] if amplitude.ndim > 1 else 1
        late_s = 2 * abs(self._shown_s) + float(np.abs(self._offsets_s).max())
        return common_motions(
            coefficients_m, self._basis.half_s, late_s, self._times_s, terms, self._sums,
            self._tolerance,
        )  # fmt: skip

    def _smooth(self, coefficients_m: Real, amplitude: Weights, order: Real | None = None) -> None:
        basis = self._basis
        assert basis is not None

        def lengths_m(part: slice, pulses: slice) -> Real:
            at_pulses = basis.at(self._lengths_at(pulses))
            return self._by_pulses(np.asarray(at_pulses @ coefficients_m[part].T))

        self._by_pulse("smooth", lengths_m, amplitude, order=order)

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

    def _check(self, values: Weights, rows: slice | NDArray[np.intp], what: str) -> None:
        check_finite(values, rows, what, self._added)


class VaryingPathAccumulator(MovingPathAccumulator):
    """As `MovingPathAccumulator`, for amplitudes that vary."""

    def add_varying(
        self,
        motion: PathMotion,
        rows: NDArray[np.intp],
        history: AmplitudeHistory,
        first: int,
    ) -> None:
        """Add rows of a motion; `history` is of all its rows, `first` the number of its row 0 in
        errors.
        """
        basis, times_s = self._amplitude_basis, self._times_s
        follows = np.zeros(rows.size, dtype=bool)
        if basis is not None and times_s.size > basis.sample_times_s().size:
            values = history.at(basis.sample_times_s(), rows)
            check_finite(values, rows, "amplitude", first)
            terms, follows = fit_amplitudes(basis, values, self._tolerance)
            if follows.any():
                self.add(motion, rows[follows], terms[follows], first)
        if follows.all():
            return
        own, self._added = rows[~follows], first

        def at(part: slice, pulses: slice) -> Weights:
            found = history.at(times_s[pulses], own[part])
            check_finite(found, own[part], "amplitude", first)
            return np.ascontiguousarray(found.T)

        self._sampled(motion, own, np.zeros(own.size), at)
