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
(`linear_motion`) where that is cheaper. Else each pulse has its transform: with lengths from the
fitted polynomial where it is within the bound, sampled at each pulse where it is not. Fitted motion
that many paths share is interpolated between a few times (`CommonMotion`) where that is cheaper.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Real
from ...errors import ConfigError, PathDataError
from ..motion import JoinedMotion, PathMotion
from .amplitudes import AmplitudeHistory
from .grid import (
    ExtraCycles,
    FrequencyGrid,
    PulseShape,
    Ramp,
    ReceiveWindow,
    SynthesisContext,
    Weights,
    check_finite,
)
from .moving import MovingPathAccumulator, VaryingPathAccumulator
from .nufft import Backend, check_backend
from .pulse_sums import Method, OrderedExecutor, PulseBlock, TransformPool, available_threads
from .transform import ErrorSum, PulseTransform, SynthesisReport, Transform

__all__ = [
    "TOLERANCE",
    "ExtraCycles",
    "FrequencyGrid",
    "Method",
    "PulseShape",
    "Ramp",
    "ReceiveWindow",
    "Spectrum",
    "SpectrumAccumulator",
    "SynthesisReport",
]

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
        self._moving = MovingPathAccumulator(*shared, self._report, interval_s)
        self._varying = VaryingPathAccumulator(*shared, self._report, interval_s)

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

    def result(self) -> Spectrum:
        """Return the spectrum of all paths added so far."""
        started = time.perf_counter()
        self._flush_still()
        for part in (self._moving, self._varying):
            part.flush()
        self._lanes.close()
        self._wall_s += time.perf_counter() - started
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
        if values is not None and self._sums.ramp is not None:
            notes.append(
                "Moving paths move while the frequencies go by, to the second order in time."
            )
        if values is not None and self._sums.pulse is not None:
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
