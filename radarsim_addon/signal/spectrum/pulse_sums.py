# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of moving paths at the times of pulses, one transform each, or at a few other times."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Literal, Self

import numpy as np

from ...array_types import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .amplitudes import AMPLITUDE_NODES, used_terms
from .burst_basis import BurstBasis
from .common_motion import CommonMotion, left_out
from .grid import SynthesisContext, Weights
from .linear_motion import LinearRows
from .nufft import Backend
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
#: Lengths (rows x times) asked of a motion at a time: 16 MB.
_MAX_LENGTHS = 1 << 21
#: Fewer rows are for one thread: more would wait for the interpreter, at twice the processor time.
_FEW = 1 << 14
#: Blocks of pulses, at least: so many that threads have work, not their number, on which sums of
#: errors would hang.
_BLOCKS = 8
#: Pulses of few rows that are transformed together, at least.
_TOGETHER = 32


class PulseSums:
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
        self._linear_rows: list[LinearRows] = []
        self._smooth_rows: list[tuple[Real, Weights]] = []
        self._left_rad = [0.0]  # appended to by threads
        self._sums, self._times_s, self._tolerance = sums, times_s, tolerance
        self._method, self._backend = method, backend
        self._rows, self._lanes, self._report = rows, lanes, report
        self._added = 0
        self._way: Transform = "direct sum" if backend == "direct" else "pulse by pulse"
        transform: type[PulseTransform | RampTransform | PulseMotionTransform] = PulseTransform
        # times at which a pulse wants lengths, from its own
        self._offsets_s, first_s = np.zeros(1), 0.0
        if sums.ramp is not None:
            transform, first_s = RampTransform, -sums.ramp.half_s(sums.grid.count)
            self._offsets_s = np.array([first_s, 0.0, -first_s])
        if sums.pulse is not None:
            transform, self._offsets_s = PulseMotionTransform, np.array([0.0, sums.pulse.half_s])
        self._pool = TransformPool(lambda: transform(sums, tolerance, backend), sums.grid.count)
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

    def _left_out(self, amplitude: Weights, error: float) -> None:
        """Remember an error of all terms, relative to the amplitudes."""
        size, terms = np.abs(amplitude), self._times_s.size * self._sums.grid.count
        size = size if size.ndim == 1 else size.sum(axis=1)
        root = error * float(np.sqrt(terms))
        self.error.add(ErrorSum(root * float(np.linalg.norm(size)), root * float(size.sum()), 0.0))

    def _terms(self, pulses: slice, count: int) -> Real:
        """T_k at pulses, k < count, (pulses, count)."""
        if self._amplitude_basis is None:
            return np.ones((self._times_s[pulses].size, 1))
        return self._amplitude_basis.at(self._times_s[pulses])[:, :count]

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
        few = min(self._rows, count) < _FEW and self._backend != "direct"
        length = max(-(-pulses // _BLOCKS), _TOGETHER if few else 1)
        length = max(1, min(length, _MAX_LENGTHS // largest))
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
            for result in self._lanes.run(map(job, blocks), 1 if few else len(blocks)):
                moving[result.pulses] += result.values
                error.merge(result.error)
                cpu_s, transforms = cpu_s + result.cpu_s, transforms + result.values.shape[0]
                if order is None:
                    self.heard += result.heard
                    self.folded_pulses += result.folded
            self.error.add(error)
        self._report.count(motion, self._way, count, transforms, cpu_s)

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

    @contextmanager
    def _nodes_of(self, group: CommonMotion, amplitude: Weights) -> Iterator[Self]:
        """As this one, empty, at the nodes of a group with these amplitudes; when it is left, its
        sums are those of all pulses.
        """
        other = copy.copy(self)
        other._times_s, other.values, other.error = group.nodes_s, None, ErrorSum()
        other._way = "interpolated"
        yield other
        moving = self._matrix()
        moving += group.at_pulses(other._matrix(), self._sums, self._times_s)
        self.error.add(group.error(other.error, self._times_s.size))
        self._left_out(amplitude, left_out(self._tolerance))
