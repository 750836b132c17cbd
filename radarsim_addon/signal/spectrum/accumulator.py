# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of moving paths, whatever the waveform.

    S[m, n] = sum_i a_i exp(j 2 pi [-f_n tau_i(t_m) + extra(tau_i(t_m))]),  f_n = start + n step

Every waveform is built on this sum, tau_i = l_i / c:

- Pulse with spectrum W(f): s_m = inverse FFT of W(f_n - f0) S[m, n].
- Stepped frequency: S itself.
- FMCW after de-chirp, chirp f0 + K t, sample n at t_n: f_n = f0 + K t_n, and
  extra(tau) = K tau^2 / 2, the residual video phase.

::

    accumulator = SpectrumAccumulator(FrequencyGrid(76.5e9, 1e6, 512), times_s, tolerance=1e-6)
    for paths in iter_path_chunks(frame):
        accumulator.add(paths.lengths, amplitudes)
    spectrum = accumulator.result()
    spectrum.values                        # (pulses, frequencies)
    print(*spectrum.report.lines(), sep="\\n")

tau_i is taken at the pulse time t_m: nothing moves while the pulse is under way. With a
`PulseShape` paths move meanwhile (`PulseMotionTransform`), and S is multiplied by the pulse's
spectrum. With a `Ramp` the frequencies come one after the other (`RampTransform`), and the residual
video phase is included.

The choice: stationary paths are transformed once for all pulses (1-D type 1). Lengths of the
others are sampled at Chebyshev nodes of the burst (`BurstBasis`). If they keep to a constant rate
within the fraction of the tolerance set aside for motion, all pulses are one 2-D type-3 transform
(`all_pulses`) where that is cheaper. Else each pulse has its transform: with lengths from the
fitted polynomial where it is within the bound, sampled at each pulse where it is not. Fitted motion
that many paths share is interpolated between a few times (`CommonMotion`) where that is cheaper.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Real
from ...errors import ConfigError, PathDataError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..motion import JoinedMotion, LinearMotion, PathMotion
from .all_pulses import AllPulses, PulsesPlan, SmoothRows
from .grid import (
    AmplitudeHistory,
    ExtraCycles,
    FrequencyGrid,
    PulseShape,
    Ramp,
    ReceiveWindow,
    SynthesisContext,
    Weights,
    check_finite,
    fit_amplitudes,
    repeat_orders,
    used_terms,
)
from .nufft import Backend, check_backend
from .pulse_sums import (
    AmplitudesAt,
    CommonMotion,
    Method,
    OrderedExecutor,
    PulseSums,
    TransformPool,
    available_threads,
    common_motions,
    interpolation_error,
    received_whole,
)
from .transform import ErrorSum, PulseBlock, PulseTransform, SynthesisReport, Transform

# -------------------------------------------------------------------------------------------------
# Spectra of moving paths: sorts them by their motion and sends each kind the way that costs least.
#
# A `Ramp` needs lengths at three times of each pulse, a pulse that is
# under way at two; they go the same ways.
#
# Amplitudes that change during the burst and that K Chebyshev terms
# follow cost K transforms of type 3 for all pulses, or pulse by pulse K products per path; the
# cheaper one is taken. Where no polynomial follows them, amplitudes and lengths are taken at every
# pulse: about ten times the cost of a transform pulse by pulse, most of it in vertices and gains.
# -------------------------------------------------------------------------------------------------

#: Rate and acceleration come from two or three lengths: their errors add up to so many.
_OFFSETS_SHARE = 4.0
#: Rows of constant rate that wait for one transform: 25 MB.
_MAX_LINEAR = 1 << 19
#: Rows times terms of amplitudes that vary, the same: 67 MB. Rows that bend.
_MAX_TERMS, _MAX_SMOOTH = 1 << 22, 1 << 17
#: Seconds for a value between nodes, on the scale of `all_pulses`.
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
        """Add moving rows. In errors, row 0 of the motion has the number `first`. `amplitude` is
        (rows,), or coefficients of T_k over the burst, (rows, AMPLITUDE_NODES).
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
            if sum(len(a) for _, a in self._smooth_rows) >= _MAX_SMOOTH:
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
        """Keep paths of constant rate for one transform if they stay in the window. Add the others
        pulse by pulse.
        """
        time = np.full(length_m.size, time_s)
        nothing = np.zeros(time.size)
        everything = SmoothRows(
            length_m, rate_mps, time, nothing, amplitude, np.empty((time.size, 0))
        )
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
        """Sum up the waiting rows of constant rate at all pulses."""
        if not self._linear_rows:
            return
        rows = SmoothRows.join(self._linear_rows)
        self._linear_rows = []
        coefficients_m = np.empty((len(rows), 0))
        if self._basis is not None:
            middle_m = rows.length_m + rows.rate_mps * (self._basis.middle_s - rows.time_s)
            coefficients_m = np.stack([middle_m, rows.rate_mps * self._basis.half_s], axis=1)
        self._sum_up("linear", rows, coefficients_m)

    def _flush_smooth(self) -> None:
        """Sum up the waiting rows with fitted polynomials at all pulses."""
        if not self._smooth_rows or self._basis is None:
            return
        coefficients_m = np.concatenate([found for found, _ in self._smooth_rows])
        amplitude = np.concatenate([a for _, a in self._smooth_rows])
        self._smooth_rows = []
        whole = received_whole(
            coefficients_m, self._basis.half_s, self._late_s(), self._sums.listening
        )
        whole &= self._type3_possible()
        if not whole.all():
            self._smooth(coefficients_m[~whole], amplitude[~whole])
            coefficients_m, amplitude = coefficients_m[whole], amplitude[whole]
        if not len(amplitude):
            return
        self.heard += len(amplitude) * self._times_s.size
        # the last terms are rounding
        turns = 2 * np.pi / SPEED_OF_LIGHT_MPS * self._sums.grid.highest_hz
        tails_rad = turns * np.cumsum(np.abs(coefficients_m).max(axis=0)[::-1])[::-1]
        degrees = int(np.count_nonzero(tails_rad > interpolation_error(self._tolerance) / 2))
        rows = SmoothRows(
            coefficients_m[:, 0].copy(),
            coefficients_m[:, 1] / self._basis.half_s,
            np.full(len(amplitude), self._basis.middle_s),
            np.zeros(len(amplitude)),
            amplitude,
            coefficients_m[:, 2 : max(degrees, 2)],
        )
        self._sum_up("smooth", rows, coefficients_m)

    def _late_s(self) -> float:
        """Return the time before or after a pulse at which its paths count, at most [s]."""
        return 2 * abs(self._shown_s) + float(np.abs(self._offsets_s).max())

    def _sum_up(
        self, motion: Literal["linear", "smooth"], rows: SmoothRows, coefficients_m: Real
    ) -> None:
        """Sum up rows, which have lengths c_k T_k over the burst, the way that costs least: all
        pulses in one, groups of a common motion, or pulse by pulse.
        """
        if rows.amplitude.ndim > 1:
            rows = replace(rows, amplitude=used_terms(rows.amplitude))

        def by_pulse(sums: MovingPathAccumulator, own: NDArray[np.intp] | slice) -> None:
            if motion == "smooth":
                order = np.zeros(len(rows))[own]
                sums._smooth(coefficients_m[own], rows.amplitude[own], order)
            else:
                sums._linear_by_pulse(rows.select(own), rows.order[own])

        everything: NDArray[np.intp] | slice = slice(None)
        transforms = AllPulses(
            self._sums, self._times_s, self._tolerance, self._basis, self._amplitude_basis
        )
        plan = transforms.plan(rows)
        for group in self._groups(rows, coefficients_m, plan):
            if isinstance(everything, slice):
                everything = np.arange(len(rows))
            everything = np.setdiff1d(everything, group.rows, assume_unique=True)
            with self._nodes_of(group, rows.amplitude[group.rows]) as nodes:
                by_pulse(nodes, group.rows)
        if isinstance(everything, np.ndarray):
            if not everything.size:
                return
            plan = transforms.plan(rows.select(everything))
        forced = self._method == "type3" and motion == "linear"
        if not forced and plan.pulses_s < plan.type3_s:
            by_pulse(self, everything)
            return
        own = rows.select(everything)
        jobs = (partial(transforms.block, own, pulses) for pulses in plan.blocks)
        moving, error, cpu_s, count = self._matrix(), ErrorSum(), 0.0, 0
        for block, done in self._lanes.run(jobs, len(plan.blocks)):
            moving[block.pulses] += block.values
            error.merge(block.error)
            cpu_s, count = cpu_s + block.cpu_s, count + done
        self.error.add(error)
        self._report.count(motion, "type 3", len(own), count, cpu_s)

    def _groups(
        self, rows: SmoothRows, coefficients_m: Real, plan: PulsesPlan
    ) -> list[CommonMotion]:
        """Return groups of rows with a common motion, if these are cheapest."""
        if self._basis is None or self._method != "auto":
            return []
        terms = rows.amplitude.shape[1] if rows.amplitude.ndim > 1 else 1
        groups = common_motions(
            coefficients_m, self._basis.half_s, self._late_s(), self._times_s, terms, self._sums,
            self._tolerance,
        )  # fmt: skip
        nodes, pulses = sum(group.nodes_s.size for group in groups), self._times_s.size
        cost_s = plan.pulses_s * nodes / pulses + _INTERPOLATED * pulses * self._sums.grid.count
        return groups if cost_s < min(plan.pulses_s, plan.type3_s) else []

    def _linear_by_pulse(self, rows: SmoothRows, order: Real | None) -> None:
        """Add rows of constant rate pulse by pulse. With `order`, the rows are already counted."""

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
        """Add rows pulse by pulse, with lengths from the motion itself and amplitudes from `at`."""
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

    def add_varying(
        self,
        motion: PathMotion,
        rows: NDArray[np.intp],
        history: AmplitudeHistory,
        first: int,
    ) -> None:
        """Add rows of a motion whose amplitudes vary with time.

        `history` has the amplitudes of all rows of the motion. `first` is the number by which error
        messages name row 0 of the motion.
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


#: Default tolerance, relative L2.
TOLERANCE = 1e-6
#: Blocks of stationary paths that wait for their turn, so that threads have work.
_BLOCKS = 4
#: Values whose energy is summed at a time.
_SUMMED = 1 << 13


@dataclass(frozen=True)
class Spectrum:
    """S[m, n], in two parts.

    Attributes
    ----------
    still
        Sum of the paths that do not move, the same at every pulse, (frequencies,).
    moving
        Sum of the others, (pulses, frequencies); None where nothing moves.
    grid
        Frequencies.
    times_s
        Pulse times, (pulses,) [s].
    report
        Ways that were chosen, their cost and error.
    """

    still: Complex
    moving: Complex | None
    grid: FrequencyGrid
    times_s: Real
    report: SynthesisReport

    @property
    def values(self) -> Complex:
        """(pulses, frequencies)."""
        if self.moving is None:
            return np.tile(self.still, (self.times_s.size, 1))
        return np.asarray(self.moving + self.still)


class SpectrumAccumulator:
    """Adds up the spectra of paths that come in parts.

    Parameters
    ----------
    grid
        Frequencies, carrier included.
    times_s
        Pulse times in rising order, from the time of the paths' lengths, (pulses,) [s].
    tolerance
        Relative L2 error to the direct sum, 1e-13 to 1e-2; see `SynthesisReport`.
    method
        "auto" chooses by bound and cost. "type3": constant rates by type 3 whatever the cost.
        "per-pulse": lengths sampled at every pulse. "direct": the same, term by term; for checks.
    backend
        "finufft", or "direct" for the sum term by term, pulse by pulse.
    extra_cycles
        Further phase, in cycles, as a function of delay [s] (vectorised); see the module.
    listening
        Delays that are received, and folding; None: all, each after its own pulse. The spectrum
        repeats itself in delay with 1/step: the window should be shorter than that.
    ramp
        Frequencies come one after the other; `times_s` are then those of frequency count//2 of
        each pulse. None: all at once. Not with `extra_cycles` or folding in range.
    pulse
        The transmitted pulse, for motion while it is under way: values are then those of the
        received pulses. None: nothing moves meanwhile. Not with `ramp` or `extra_cycles`.
    interval_s
        From pulse to pulse, for folding in Doppler; None: the shortest of `times_s` [s].
    span_s
        Times between which motion and amplitudes are fitted: those of all channels of an array, so
        that these ask for lengths at the same times; None: those of the pulses [s].
    chunk
        Paths in one transform.
    threads
        None: as many as there are processors. The result does not depend on it.

    Raises
    ------
    ConfigError
        Numbers out of their range.
    """

    def __init__(
        self,
        grid: FrequencyGrid,
        times_s: Real,
        *,
        tolerance: float = TOLERANCE,
        method: Method = "auto",
        backend: Backend = "finufft",
        extra_cycles: ExtraCycles | None = None,
        listening: ReceiveWindow | None = None,
        ramp: Ramp | None = None,
        pulse: PulseShape | None = None,
        interval_s: float | None = None,
        span_s: tuple[float, float] | None = None,
        chunk: int = 1 << 17,
        threads: int | None = None,
    ) -> None:
        if chunk < 1:
            raise ConfigError(f"Chunk of {chunk!r} paths; expected 1 or more.")
        if not 1e-13 <= tolerance <= 1e-2:
            raise ConfigError(f"Tolerance is {tolerance!r}; expected 1e-13 to 1e-2.")
        if method not in get_args(Method):
            raise ConfigError(f"Synthesis {method!r}; expected one of {get_args(Method)}.")
        times_s = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        if times_s.ndim != 1 or not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any():
            raise ConfigError("Pulse times must be finite numbers in rising order.")
        self.grid, self.times_s = grid, times_s
        self._sums = SynthesisContext.of(
            grid, listening or ReceiveWindow(), extra_cycles, ramp, pulse
        )
        self._tolerance = tolerance
        self._method: Method = method
        self._backend = check_backend("direct" if method == "direct" else backend)
        self._chunk = chunk
        # a transform of few paths is all FFT
        self._block = max(chunk, 2 * grid.count) if chunk > 1 << 10 else chunk
        self._lanes = OrderedExecutor(threads or available_threads())
        self._pool = TransformPool(
            partial(PulseTransform, self._sums, tolerance, self._backend), grid.count
        )
        self._still = np.zeros(grid.count, dtype=np.complex128)
        self._still_rows: list[tuple[Real, Weights]] = []
        self._still_error = ErrorSum()
        self._added, self._heard, self._folded, self._wall_s = 0, 0, 0, 0.0
        self._report = SynthesisReport(
            self._backend, tolerance, pulses=times_s.size, frequencies=grid.count
        )
        if interval_s is None:
            interval_s = float(np.diff(times_s).min()) if times_s.size > 1 else 0.0
        rows = min(self._block, max(1 << 15, 4 * grid.count))
        shared = self._sums, times_s, tolerance, method, self._backend, rows, self._lanes
        span_s = span_s or (float(times_s[0]), float(times_s[-1]))
        self._moving = MovingPathAccumulator(*shared, self._report, interval_s, span_s)
        self._varying = MovingPathAccumulator(*shared, self._report, interval_s, span_s)

    def add(self, motion: PathMotion, amplitude: Weights | AmplitudeHistory) -> None:
        """Add paths by their lengths over the burst and their amplitudes a_i, (n,) or their
        history. A value that is not finite is a `PathDataError`, which names the row.
        """
        started = time.perf_counter()
        history = amplitude
        if not isinstance(history, AmplitudeHistory):
            history = AmplitudeHistory.of(np.asarray(history))
        amplitude, varies = history.constant, history.varies
        if isinstance(motion, JoinedMotion):
            first = 0
            for joined in motion.parts:
                self.add(joined, history.select(slice(first, first + joined.moving.size)))
                first += joined.moving.size
            return
        moving = motion.moving
        if amplitude.shape != moving.shape:
            raise PathDataError(
                f"{amplitude.size} amplitudes for {moving.size} paths; expected one for each."
            )
        check_finite(amplitude, slice(0, amplitude.size), "amplitude", self._added)
        # one pulse sees no motion unless it takes its time
        frozen = self.times_s.size == 1 and self._sums.ramp is None and self._sums.pulse is None
        for start in range(0, moving.size, self._block):
            part = slice(start, min(start + self._block, moving.size))
            here = moving[part] | varies[part]
            if frozen or not here.any():
                self._add_still(motion, part, amplitude[part])
                continue
            if not here.all():
                still = start + np.flatnonzero(~here)
                self._add_still(motion, still, amplitude[still])
            rows = start + np.flatnonzero(moving[part] & ~varies[part])
            if rows.size:
                self._moving.add(motion, rows, amplitude[rows], self._added)
            rows = start + np.flatnonzero(varies[part])
            if rows.size:
                self._varying.add_varying(motion, rows, history, self._added)
        # what waits must not hang on arrays of the caller
        self._still_rows = [(r, np.array(a)) for r, a in self._still_rows]
        self._added += moving.size
        self._wall_s += time.perf_counter() - started

    def flush(self) -> None:
        """Sum up the paths that wait for others of their kind."""
        started = time.perf_counter()
        self._flush_still()
        for part in (self._moving, self._varying):
            part.flush()
        self._lanes.close()
        self._wall_s += time.perf_counter() - started

    def result(self) -> Spectrum:
        """Return the spectrum of all paths added so far."""
        self.flush()
        found = [p.values for p in (self._moving, self._varying) if p.values is not None]
        values, still = sum(found[1:], found[0]) if found else None, self._still
        if self._sums.pulse is not None:
            still = still * self._sums.pulse.spectrum
        return Spectrum(still, values, self.grid, self.times_s, self._finish(still, values))

    def _add_still(
        self, motion: PathMotion, rows: slice | NDArray[np.intp], amplitude: Weights
    ) -> None:
        length_m = motion.lengths_m(self.times_s[:1], rows)[:, 0]
        check_finite(length_m, rows, "length", self._added)
        self._still_rows.append((length_m, amplitude))
        if sum(a.size for _, a in self._still_rows) >= _BLOCKS * self._block:
            self._flush_still()

    def _flush_still(self) -> None:
        if not self._still_rows:
            return
        parts, self._still_rows = self._still_rows, []
        length_m = np.concatenate([p[0] for p in parts]) if len(parts) > 1 else parts[0][0]
        amplitude = np.concatenate([p[1] for p in parts]) if len(parts) > 1 else parts[0][1]
        blocks = [
            slice(start, start + self._block) for start in range(0, length_m.size, self._block)
        ]

        def job(part: slice) -> Callable[[], PulseBlock]:
            return partial(
                self._pool.block, slice(0, 1), lambda: length_m[None, part], amplitude[part]
            )

        pulses, cpu_s = self.times_s.size, 0.0
        for found in self._lanes.run(map(job, blocks), len(blocks)):
            self._still += found.values[0]
            self._still_error.add(found.error)
            self._heard += found.heard * pulses
            self._folded += found.folded
            cpu_s += found.cpu_s
        way: Transform = "direct sum" if self._backend == "direct" else "once"
        self._report.count("still", way, length_m.size, len(blocks), cpu_s)

    def _finish(self, still_values: Complex, values: Complex | None) -> SynthesisReport:
        pulses, energy = self.times_s.size, 0.0
        # in parts: a BLAS would share larger sums among threads, and no copy of them all is made
        step = max(_SUMMED // self.grid.count, 1)
        for first in range(0, pulses if values is not None else 1, step):
            lines = still_values if values is None else still_values + values[first : first + step]
            energy += float(np.vdot(lines, lines).real)
        if self._sums.pulse is not None:
            energy /= self._sums.pulse.rms**2
        if values is None:
            energy *= pulses
        still, parts = self._still_error, (self._moving, self._varying)
        moving = ErrorSum()
        for part in parts:
            moving.add(part.error)
        norm, root = float(np.sqrt(energy)), float(np.sqrt(pulses))
        expected = pulses * still.energy + moving.energy
        heard = norm > 0 and expected > 0
        notes = []
        by_pulse = any(
            step.transform in ("pulse by pulse", "interpolated") for step in self._report.steps
        )
        if by_pulse and self._sums.ramp is not None:
            notes.append(
                "Moving paths move while the frequencies go by, to the second order in time."
            )
        if by_pulse and self._sums.pulse is not None:
            notes.append("Paths move while a pulse is under way, at a constant rate.")
        if self._varying.values is not None:
            notes.append(
                "Antenna gains change during the burst: amplitudes are those of every pulse."
            )
        return replace(
            self._report,
            steps=[replace(step) for step in self._report.steps],
            paths=self._added,
            error_estimate=(root * still.random + moving.random) / norm if heard else 0.0,
            error_bound=(root * still.bound + moving.bound) / norm if heard else 0.0,
            cancellation_db=10 * float(np.log10(energy / expected)) if heard else None,
            outside=self._added - (self._heard + sum(p.heard for p in parts)) / pulses,
            range_ambiguous_count=self._folded
            + sum(p.folded - (-p.folded_pulses // pulses) for p in parts),
            doppler_ambiguous_count=sum(p.fast for p in parts),
            ramp_residual_phase_rad=max(p.left_out_rad for p in parts),
            wall_s=self._wall_s,
            notes=notes,
        )
