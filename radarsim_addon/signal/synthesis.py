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
    for paths in iter_paths(frame):
        accumulator.add(paths.lengths, amplitudes)
    spectrum = accumulator.result()
    spectrum.values                        # (pulses, frequencies)
    print(*spectrum.report.lines(), sep="\\n")

Stop and go: tau_i is taken at the pulse time t_m, nothing moves while the pulse is under way.

What is chosen: paths that stand still are transformed once for all pulses (1-D type 1). Lengths
of the others are sampled at Chebyshev nodes of the burst (:mod:`.synthesis_motion`); where they
keep to a constant rate within the share of the tolerance that is set aside for it, all pulses are
one 2-D type-3 transform (:mod:`.synthesis_linear`) if that is cheaper; else it goes pulse by
pulse, with lengths from the fitted polynomial where that is within the bound, and sampled at each
pulse where it is not.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigError, PathDataError
from ..physics.constants import SPEED_OF_LIGHT_MPS
from .nufft import Backend, choose_backend
from .pathmotion import JoinedMotion, LinearMotion, PathMotion
from .synthesis_grid import ExtraCycles, FrequencyGrid, Listening, Sums, repeat_orders
from .synthesis_lanes import Lanes, available_threads
from .synthesis_linear import LinearRows, linear_block, plan_linear
from .synthesis_motion import BurstBasis
from .synthesis_pulses import PulseBlock, TransformPool
from .synthesis_report import Motion, SynthesisReport, Transform
from .synthesis_transform import ErrorSum

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Weights = NDArray[np.inexact[Any]]
Method = Literal["auto", "type3", "per-pulse", "direct"]

__all__ = [
    "TOLERANCE",
    "ExtraCycles",
    "FrequencyGrid",
    "Listening",
    "Method",
    "Spectrum",
    "SpectrumAccumulator",
    "SynthesisReport",
]

#: Default tolerance, relative L2.
TOLERANCE = 1e-6
#: Share of the tolerance for fitted motion.
_MOTION_SHARE = 0.25
#: Blocks of paths that stand still and wait for their turn, so that threads have work.
_BLOCKS = 4
#: Lengths (rows x times) asked of a motion at a time: 16 MB.
_MAX_LENGTHS = 1 << 21
#: Rows of constant rate that wait for one transform: 25 MB.
_MAX_LINEAR = 1 << 19


@dataclass(frozen=True)
class Spectrum:
    """S[m, n], in two parts.

    Attributes
    ----------
    still
        Of paths that do not move, the same at every pulse, (frequencies,).
    moving
        Of the others, (pulses, frequencies); None where nothing moves.
    grid
        Frequencies.
    times_s
        Pulse times, (pulses,) [s].
    report
        What was chosen, its cost and its error.
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
        Pulse times in rising order, counted from the time of the paths' lengths, (pulses,) [s].
    tolerance
        Relative L2 error of the result against the direct sum, 1e-13 to 1e-2. See
        :class:`.synthesis_report.SynthesisReport` for what is known of it afterwards.
    method
        "auto" chooses by bound and cost. "type3": constant rates by type 3 whatever the cost.
        "per-pulse": every moving path pulse by pulse, at lengths sampled at every pulse.
        "direct": the same, term by term; slow, for checks.
    backend
        Engine of the type-1 transforms; "numpy" has no type 3 and goes pulse by pulse.
    extra_cycles
        Further phase, in cycles, as a function of delay [s] (vectorised); see the module.
    listening
        Delays that are heard, and folding of echoes of earlier pulses. None: all delays, after
        their own pulse. The spectrum repeats itself in delay with 1/step: what is heard should be
        shorter than that.
    chunk
        Paths in one transform.
    threads
        Threads; None: as many as there are processors. The result does not depend on it.

    Raises
    ------
    ConfigError
        Numbers out of their range.
    MissingDependencyError
        finufft is asked for and not installed.
    """

    def __init__(
        self,
        grid: FrequencyGrid,
        times_s: Real,
        *,
        tolerance: float = TOLERANCE,
        method: Method = "auto",
        backend: Backend = "auto",
        extra_cycles: ExtraCycles | None = None,
        listening: Listening | None = None,
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
        self._sums = Sums.of(grid, listening or Listening(), extra_cycles)
        self._tolerance = tolerance
        self._method: Method = method
        self._backend = choose_backend("direct" if method == "direct" else backend)
        self._chunk = chunk
        # a transform of few paths is all FFT
        self._block = max(chunk, 2 * grid.count) if chunk > 1 << 10 else chunk
        self._rows = min(self._block, max(1 << 15, 4 * grid.count))
        self._lanes = Lanes(threads or available_threads())
        self._pool = TransformPool(self._sums, tolerance, self._backend, self._lanes.threads)
        self._basis = BurstBasis(times_s) if times_s.size > 1 else None
        self._phase_bound_rad = _MOTION_SHARE * tolerance
        self._still = np.zeros(grid.count, dtype=np.complex128)
        self._moving: Complex | None = None
        self._still_rows: list[tuple[Real, Weights]] = []
        self._linear_rows: list[LinearRows] = []
        self._smooth_rows: list[tuple[Real, Weights]] = []
        self._still_error, self._moving_error = ErrorSum(), ErrorSum()
        self._added, self._heard, self._folded, self._fast = 0, 0, 0, 0
        self._folded_pulses, self._wall_s = 0, 0.0
        # rate of a length at which the carrier turns by half a cycle from pulse to pulse
        interval_s = float(np.diff(times_s).min()) if times_s.size > 1 else 0.0
        carrier_hz = abs(self._sums.listening.reference_hz or float(grid.exact_centre_hz))
        turns = 2 * interval_s * carrier_hz
        self._fast_mps = SPEED_OF_LIGHT_MPS / turns if turns > 0 else math.inf
        self._report = SynthesisReport(
            self._backend, tolerance, pulses=times_s.size, frequencies=grid.count
        )

    def add(self, motion: PathMotion, amplitude: Weights) -> None:
        """Add paths.

        Parameters
        ----------
        motion
            Their lengths over the burst: ``paths.lengths``.
        amplitude
            a_i, real or complex, (n,).

        Raises
        ------
        PathDataError
            A length or an amplitude is NaN or infinite; says in which row.
        """
        started = time.perf_counter()
        amplitude = np.asarray(amplitude)
        if isinstance(motion, JoinedMotion):
            first = 0
            for joined in motion.parts:
                self.add(joined, amplitude[first : first + joined.moving.size])
                first += joined.moving.size
            return
        moving = motion.moving
        if amplitude.shape != moving.shape:
            raise PathDataError(
                f"{amplitude.size} amplitudes for {moving.size} paths; expected one for each."
            )
        self._check(amplitude, slice(0, amplitude.size), "amplitude")
        one_pulse = self.times_s.size == 1
        for start in range(0, moving.size, self._block):
            part = slice(start, min(start + self._block, moving.size))
            here = moving[part]
            if one_pulse or not here.any():
                self._add_still(motion, part, amplitude[part])
                continue
            rows = start + np.flatnonzero(here)
            if rows.size < here.size:
                still = start + np.flatnonzero(~here)
                self._add_still(motion, still, amplitude[still])
            self._add_moving(motion, rows, amplitude[rows])
        # what waits must not hang on arrays of the caller
        self._still_rows = [(r, np.array(a)) for r, a in self._still_rows]
        self._added += moving.size
        self._wall_s += time.perf_counter() - started

    def result(self) -> Spectrum:
        """Spectrum of all paths added so far."""
        started = time.perf_counter()
        self._flush_still()
        self._flush_linear()
        self._flush_smooth()
        self._lanes.close()
        self._wall_s += time.perf_counter() - started
        return Spectrum(self._still, self._moving, self.grid, self.times_s, self._finish())

    def _check(self, values: Weights, rows: slice | NDArray[np.intp], what: str) -> None:
        """Raise where one of the values is NaN or infinite; rows along the first axis."""
        bad = ~np.isfinite(values)
        if not bad.any():
            return
        place = int(np.argwhere(bad)[0][0])
        number = place + rows.start if isinstance(rows, slice) else int(rows[place])
        value = values[place][bad[place]].flat[0]
        raise PathDataError(
            f"Row {self._added + number} of the paths has {what} {value}; expected a finite "
            "number. Leave the row out, or mend the run that it comes from."
        )

    def _add_still(
        self, motion: PathMotion, rows: slice | NDArray[np.intp], amplitude: Weights
    ) -> None:
        length_m = motion.lengths_m(self.times_s[:1], rows)[:, 0]
        self._check(length_m, rows, "length")
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

    def _add_moving(self, motion: PathMotion, rows: NDArray[np.intp], amplitude: Weights) -> None:
        basis = self._basis
        fitted = self._method in ("auto", "type3")
        if isinstance(motion, LinearMotion):
            length_m, rate_mps = motion.length_m[rows], 2 * motion.range_rate_mps[rows]
            self._check(length_m, rows, "length")
            self._check(rate_mps, rows, "range rate")
            self._fast += self._count_fast(np.abs(rate_mps))
            self._take_linear(length_m, rate_mps, 0.0, amplitude, fitted)
            return
        if basis is None or not fitted or self.times_s.size <= basis.sample_times_s().size:
            self._sampled(motion, rows, amplitude)
            return
        lengths_m = motion.lengths_m(basis.sample_times_s(), rows)
        self._check(lengths_m, rows, "length")
        fit = basis.fit(lengths_m, self._length_bound_m())
        coarse = ~fit.smooth
        if coarse.any():
            self._sampled(motion, rows[coarse], amplitude[coarse])
        self._fast += self._count_fast(fit.fastest_mps[fit.smooth])
        self._fitted(amplitude[fit.smooth])
        linear = fit.linear & self._type3_possible()
        curved = fit.smooth & ~linear
        if curved.any():
            self._smooth_rows.append((fit.coefficients_m[curved], amplitude[curved]))
            if sum(a.size for _, a in self._smooth_rows) >= self._rows:
                self._flush_smooth()
        if linear.any():
            found = fit.coefficients_m[linear]
            rate_mps = found[:, 1] / basis.half_s
            self._take_linear(found[:, 0].copy(), rate_mps, basis.middle_s, amplitude[linear], True)

    def _length_bound_m(self) -> float:
        """Error of a length that costs the share of the tolerance set aside for motion [m]."""
        cycles = self._phase_bound_rad / (2 * np.pi)
        return cycles * SPEED_OF_LIGHT_MPS / max(self.grid.highest_hz, 1.0)

    def _type3_possible(self) -> bool:
        return self._backend == "finufft" and self._sums.extra_cycles is None

    def _count_fast(self, rate_mps: Real) -> int:
        return int(np.count_nonzero(rate_mps > self._fast_mps))

    def _fitted(self, amplitude: Weights) -> None:
        """Remember what fitted motion may cost."""
        if not amplitude.size:
            return
        self._report.motion_error_rad = self._phase_bound_rad
        size, terms = np.abs(amplitude), self.times_s.size * self.grid.count
        root = self._phase_bound_rad * float(np.sqrt(terms))
        self._moving_error.add(
            ErrorSum(root * float(np.linalg.norm(size)), root * float(size.sum()), 0.0)
        )

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
            (length_m + rate_mps * (t - time_s)) / SPEED_OF_LIGHT_MPS
            for t in (self.times_s[0], self.times_s[-1])
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
        self._heard += int(np.count_nonzero(copies)) * self.times_s.size
        self._folded += int(np.count_nonzero(order))
        if heard.size:
            self._linear_rows.append(replace(everything.select(heard), order=order))
        if sum(len(part) for part in self._linear_rows) >= _MAX_LINEAR:
            self._flush_linear()

    def _flush_linear(self) -> None:
        """All pulses of the rows of constant rate that wait, the cheaper way."""
        if not self._linear_rows:
            return
        rows = LinearRows.join(self._linear_rows)
        self._linear_rows = []
        plan = plan_linear(rows, self._sums, self.times_s)
        if self._method != "type3" and plan.pulses_s < plan.type3_s:
            self._linear_by_pulse(rows, rows.order)
            return
        jobs = (
            partial(linear_block, rows, self._sums, self.times_s, pulses, self._tolerance)
            for pulses in plan.blocks
        )
        moving, error, cpu_s = self._moving_matrix(), ErrorSum(), 0.0
        for block in self._lanes.run(jobs, len(plan.blocks)):
            moving[block.pulses] += block.values
            error.beside(block.error)
            cpu_s += block.cpu_s
        self._moving_error.add(error)
        self._report.count("linear", "type 3", len(rows), len(plan.blocks), cpu_s)

    def _linear_by_pulse(self, rows: LinearRows, order: Real | None) -> None:
        """Pulse by pulse at constant rates; with `order` the rows are counted already."""

        def lengths_m(part: slice, pulses: slice) -> Real:
            since_s = self.times_s[pulses, None] - rows.time_s[part]
            return np.asarray(rows.length_m[part] + rows.rate_mps[part] * since_s)

        self._by_pulse("linear", lengths_m, rows.amplitude, order=order)

    def _flush_smooth(self) -> None:
        """Pulse by pulse at lengths from fitted polynomials."""
        if not self._smooth_rows or self._basis is None:
            return
        coefficients_m = np.concatenate([found for found, _ in self._smooth_rows])
        amplitude = np.concatenate([a for _, a in self._smooth_rows])
        self._smooth_rows = []
        at_pulses = self._basis.at(self.times_s)

        def lengths_m(part: slice, pulses: slice) -> Real:
            return np.asarray(at_pulses[pulses] @ coefficients_m[part].T)

        self._by_pulse("smooth", lengths_m, amplitude)

    def _sampled(self, motion: PathMotion, rows: NDArray[np.intp], amplitude: Weights) -> None:
        """Pulse by pulse at lengths from the motion itself."""
        fast = np.zeros(rows.size, dtype=bool)

        def lengths_m(part: slice, pulses: slice) -> Real:
            wanted = slice(max(pulses.start - 1, 0), pulses.stop)  # one before, for the rate
            found = motion.lengths_m(self.times_s[wanted], rows[part])
            self._check(found, rows[part], "length")
            rates = np.abs(np.diff(found, axis=1) / np.diff(self.times_s[wanted]))
            if rates.shape[1]:
                fast[part] |= rates.max(axis=1) > self._fast_mps
            return np.ascontiguousarray(found[:, pulses.start - wanted.start :].T)

        self._by_pulse("sampled", lengths_m, amplitude, ahead=True)
        self._fast += int(np.count_nonzero(fast))

    def _by_pulse(
        self,
        motion: Motion,
        lengths_m: Callable[[slice, slice], Real],
        amplitude: Weights,
        *,
        order: Real | None = None,
        ahead: bool = False,
    ) -> None:
        """One transform for each pulse and block of rows.

        `lengths_m` gives lengths (pulses, rows) of parts of either; with `ahead` it is called in
        this thread alone, since a motion need not be safe in several.
        """
        pulses, moving = self.times_s.size, self._moving_matrix()
        most = min(_MAX_LENGTHS // min(self._rows, amplitude.size), _MAX_LENGTHS // self.grid.count)
        length = max(1, min(most, -(-pulses // self._lanes.threads)))
        blocks = [slice(at, min(at + length, pulses)) for at in range(0, pulses, length)]
        cpu_s, transforms = 0.0, 0
        for start in range(0, amplitude.size, self._rows):
            part = slice(start, min(start + self._rows, amplitude.size))

            def job(block: slice, part: slice = part) -> Callable[[], PulseBlock]:
                lengths: Callable[[], Real] = partial(lengths_m, part, block)
                if ahead:
                    found = lengths()
                    lengths = lambda: found  # noqa: E731
                folds = None if order is None else order[part]
                return partial(self._pool.block, block, lengths, amplitude[part], folds)

            error = ErrorSum()
            for result in self._lanes.run(map(job, blocks), len(blocks)):
                moving[result.pulses] += result.values
                error.beside(result.error)
                cpu_s, transforms = cpu_s + result.cpu_s, transforms + result.values.shape[0]
                if order is None:
                    self._heard += result.heard
                    self._folded_pulses += result.folded
            self._moving_error.add(error)
        way: Transform = "direct sum" if self._backend == "direct" else "pulse by pulse"
        self._report.count(motion, way, amplitude.size, transforms, cpu_s)

    def _moving_matrix(self) -> Complex:
        if self._moving is None:
            self._moving = np.zeros((self.times_s.size, self.grid.count), dtype=np.complex128)
        return self._moving

    def _finish(self) -> SynthesisReport:
        """The report, as things are now."""
        pulses = self.times_s.size
        energy = 0.0
        for pulse in range(pulses if self._moving is not None else 1):
            line = self._still if self._moving is None else self._still + self._moving[pulse]
            energy += float(np.vdot(line, line).real)
        if self._moving is None:
            energy *= pulses
        still, moving = self._still_error, self._moving_error
        norm, root = float(np.sqrt(energy)), float(np.sqrt(pulses))
        expected = pulses * still.energy + moving.energy
        heard = norm > 0 and expected > 0
        return replace(
            self._report,
            steps=[replace(step) for step in self._report.steps],
            paths=self._added,
            error_estimate=(root * still.random + moving.random) / norm if heard else 0.0,
            error_bound=(root * still.bound + moving.bound) / norm if heard else 0.0,
            cancellation_db=10 * float(np.log10(energy / expected)) if heard else None,
            outside=max(self._added - self._heard / pulses, 0.0),
            folded_range=self._folded + -(-self._folded_pulses // pulses),
            folded_doppler=self._fast,
            wall_s=self._wall_s,
        ).with_warnings()
