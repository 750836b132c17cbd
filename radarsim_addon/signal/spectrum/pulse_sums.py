# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of moving paths pulse by pulse, or at a few other times of the burst, interpolated.

`PulseSums` holds the sum of all pulses and adds blocks of paths and pulses to it: `TransformPool`
makes one block, in threads of `OrderedExecutor`, whose results come in order, so that sums are the
same from run to run.

**Common motion.** The lengths of the paths of one body change at nearly one rate b [m/s]. Without
the common phase exp(-j 2 pi f_n b t / c), the sum of these paths changes slowly from pulse to
pulse. It is computed at M Chebyshev points of the burst (extrema, so that both ends are among them)
and interpolated (`common_motions`, `CommonMotion`). For a function that is at most exp(E) within
the Bernstein ellipse of parameter rho, the error of this interpolation is at most 4 exp(E) rho^(1 -
M) / (rho - 1) (Trefethen, Approximation Theory and Approximation Practice, theorem 8.2), here
relative to sum |a|. E follows from the Chebyshev coefficients c_k of the lengths: |Im T_k| <=
(rho^k - rho^-k) / 2. An amplitude that is a Chebyshev series of K terms needs K - 1 more points.
"""

from __future__ import annotations

import copy
import math
import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from typing import Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Mask, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .all_pulses import SmoothRows
from .grid import (
    AMPLITUDE_NODES,
    BurstBasis,
    ReceiveWindow,
    SynthesisContext,
    Weights,
    lagrange,
    phasor_lines,
    used_terms,
)
from .nufft import TIGHTEST, Backend
from .transform import (
    EachPulse,
    ErrorSum,
    Motion,
    PulseBlock,
    PulseMotionTransform,
    PulseTransform,
    RampTransform,
    SynthesisReport,
    Transform,
    engine_tolerance,
    pulse_left_out_rad,
    ramp_left_out_rad,
)

T = TypeVar("T")

#: More threads than this gain nothing, and each has its buffers.
_MOST_THREADS = 8


def available_threads() -> int:
    """Return the number of processors that this process may use, at most 8."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    if asked.isdecimal() and int(asked) > 0:  # 1 in the workers of a coordinator
        return min(int(asked), _MOST_THREADS)
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), _MOST_THREADS)
    return min(os.cpu_count() or 1, _MOST_THREADS)


class OrderedExecutor:
    """Runs jobs in threads, at most two each under way; results come in the jobs' order."""

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._pool: ThreadPoolExecutor | None = None

    def run(self, jobs: Iterable[Callable[[], T]], count: int) -> Iterator[T]:
        """Yield the results of all jobs, `count` of them, in order."""
        if self.threads == 1 or count == 1:
            for job in jobs:
                yield job()
            return
        pending: deque[Future[T]] = deque()
        try:
            for job in jobs:
                if self._pool is None:
                    self._pool = ThreadPoolExecutor(
                        self.threads, thread_name_prefix="radarsim-synthesis"
                    )
                pending.append(self._pool.submit(job))
                if len(pending) > 2 * self.threads:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            for future in pending:
                future.cancel()

    def close(self) -> None:
        """End the threads; `run` makes new ones."""
        if self._pool is not None:
            self._pool.shutdown(wait=True)
            self._pool = None


class TransformPool:
    """Transforms with their buffers, made when a thread finds none free."""

    def __init__(self, make: Callable[[], EachPulse], count: int) -> None:
        self._free: SimpleQueue[EachPulse] = SimpleQueue()
        self._make, self._count = make, count

    def block(
        self,
        pulses: slice,
        lengths_m: Callable[[], Real],
        amplitude: Weights | Callable[[], Weights],
        order: Real | None = None,
    ) -> PulseBlock:
        """Compute the spectra of the lengths (pulses, ...), one pulse after the other. `amplitude`
        is, or returns, (rows,) or (pulses, rows). `order` has the pulse intervals by which rows are
        folded; None: they follow from the delays.
        """
        start = time.thread_time()
        try:
            transform = self._free.get_nowait()
        except Empty:
            transform = self._make()
        try:
            lengths = lengths_m()
            weights = amplitude() if callable(amplitude) else amplitude
            values = np.empty((lengths.shape[0], self._count), dtype=np.complex128)
            error, heard, folded = ErrorSum(), 0, 0
            for pulse, found in enumerate(transform.pulses(lengths, weights, order)):
                values[pulse] = found.values
                error.merge(found.error)
                heard += found.kept
                folded += found.folded
        finally:
            self._free.put(transform)
        return PulseBlock(pulses, values, error, time.thread_time() - start, heard, folded)


#: Widest group, and largest bend of a path in it [rad].
_WIDEST_RAD, _LARGEST_BEND_RAD = 8.0, 2.0
#: Error of the interpolation relative to sum |a|, over that of the transforms.
_NODES_SHARE = 0.1
#: Nodes of all groups over pulses, at most.
_FEWER = 0.5
#: Ellipses that are tried.
_RHO = np.geomspace(1.1, 1e4, 64)


@dataclass(frozen=True)
class CommonMotion:
    """Rows whose lengths change by about `rate_mps`, and where their spectra are taken [s]."""

    rows: NDArray[np.intp]
    rate_mps: float
    nodes_s: Real

    def at_pulses(self, spectra: Complex, sums: SynthesisContext, times_s: Real) -> Complex:
        """Interpolate spectra at the nodes to spectra at the pulses, (pulses, frequencies)."""
        place = (times_s - self.nodes_s[0]) / (self.nodes_s[-1] - self.nodes_s[0])
        weights = lagrange(_lobatto(self.nodes_s.size - 1), 2 * place - 1).T
        slow = np.multiply(spectra, self._turns(sums, self.nodes_s).conj(), order="C")
        # real and imaginary parts as columns: a product of real matrices is half the work
        found: Complex = (weights @ slow.view(np.float64)).view(np.complex128)
        found *= self._turns(sums, times_s)
        return found

    def _turns(self, sums: SynthesisContext, times_s: Real) -> Complex:
        """Return the phase in common, (times, frequencies)."""
        sooner_s = (times_s[0] - times_s) * (self.rate_mps / SPEED_OF_LIGHT_MPS)
        centre_hz, step_hz = float(sums.grid.exact_centre_hz), sums.grid.step_hz
        return phasor_lines(sooner_s * centre_hz, sooner_s * step_hz, sums.grid.count).T

    def error(self, at_nodes: ErrorSum, pulses: int) -> ErrorSum:
        """Return the error of the transforms at all pulses from that at all nodes. Random errors
        keep their size on average; the bound takes Lebesgue's constant.
        """
        more = pulses / self.nodes_s.size
        root = math.sqrt(more)
        lebesgue = 1 + math.log(self.nodes_s.size)
        return ErrorSum(
            root * at_nodes.random, lebesgue * root * at_nodes.bound, more * at_nodes.energy
        )


def interpolation_error(tolerance: float) -> float:
    """Return the error of the interpolation relative to sum |a|."""
    return max(_NODES_SHARE * engine_tolerance(tolerance), TIGHTEST)


def common_motions(
    coefficients_m: Real, half_s: float, late_s: float, times_s: Real, terms: int,
    sums: SynthesisContext, tolerance: float,
) -> list[CommonMotion]:  # fmt: skip
    """Group rows with lengths c_k T_k, (rows, degrees), over a burst of `half_s` to either side.
    Rows that bend too much are left out, and rows that are not received at every pulse in their own
    window, `late_s` before or after it. Empty where pulse by pulse takes no longer.
    """
    if sums.extra_cycles is not None and sums.ramp is None:
        return []
    motion_rad = _cycle(sums.grid.highest_hz) * coefficients_m[:, 1:]
    fits = received_whole(coefficients_m, half_s, late_s, sums.listening)
    fits &= np.abs(motion_rad[:, 1:]).sum(axis=1) < _LARGEST_BEND_RAD
    rows = np.flatnonzero(fits)
    number = np.floor((motion_rad[rows, 0] - motion_rad[rows, 0].min(initial=np.inf)) / _WIDEST_RAD)
    found, nodes = [], 0
    for name in np.unique(number):
        mine = rows[number == name]
        middle_m = (coefficients_m[mine, 1].min() + coefficients_m[mine, 1].max()) / 2
        degree = max(
            _degree(coefficients_m[mine], middle_m, half_s, sums, tolerance) + terms - 1, 1
        )
        nodes += degree + 1
        if nodes > _FEWER * times_s.size:
            return []
        middle_s, reach_s = (times_s[-1] + times_s[0]) / 2, (times_s[-1] - times_s[0]) / 2
        nodes_s = middle_s + reach_s * _lobatto(degree)
        nodes_s[[0, -1]] = times_s[[0, -1]]
        found.append(CommonMotion(mine, float(middle_m / half_s), nodes_s))
    return found


def received_whole(
    coefficients_m: Real, half_s: float, late_s: float, listening: ReceiveWindow
) -> Mask:
    """Return a mask of the rows with lengths c_k T_k, (rows, degrees), over a burst of `half_s` to
    either side, that are received at every pulse in their own window, `late_s` before or after it.
    """
    # what motion within a pulse and until reception adds to the window
    rate_mps = np.abs(coefficients_m[:, 1:]) @ _slopes(coefficients_m.shape[1]) / half_s
    reach_m = np.abs(coefficients_m[:, 1:]).sum(axis=1)
    reach_m += rate_mps * (late_s + np.abs(coefficients_m[:, 0]) / SPEED_OF_LIGHT_MPS)
    early_s, latest_s = (
        (coefficients_m[:, 0] + sign * reach_m) / SPEED_OF_LIGHT_MPS for sign in (-1, 1)
    )
    low, high = listening.orders(early_s, latest_s)
    whole = (low == 0) & (high == 0)
    return np.asarray(whole & (early_s > listening.first_s) & (latest_s < listening.last_s))


def _degree(
    coefficients_m: Real, middle_m: float, half_s: float, sums: SynthesisContext, tolerance: float
) -> int:
    """Return the degree in slow time of the polynomial that the sum of rows is, without their
    common rate.
    """
    size_m = np.abs(coefficients_m[:, 1:]).max(axis=0)
    apart_m = np.append(np.abs(coefficients_m[:, 1] - middle_m).max(), size_m[1:])
    turns, light = _cycle(sums.grid.highest_hz), SPEED_OF_LIGHT_MPS
    # the last ones are rounding
    tails_rad = turns * np.cumsum(apart_m[::-1])[::-1]
    used = max(int(np.count_nonzero(tails_rad > interpolation_error(tolerance) / 2)), 1)
    size_m, apart_m = size_m[:used], apart_m[:used]
    power = _RHO[:, None] ** np.arange(1, used + 1)
    # lengths and their rates within the ellipses
    length_m, rate_mps = power @ size_m, power @ (_slopes(used + 1) * size_m) / half_s
    farthest_m = float(np.abs(coefficients_m[:, 0]).max())
    exponent = turns * ((power - 1 / power) / 2 @ apart_m)
    exponent += turns * (farthest_m + length_m) * rate_mps / light
    if sums.ramp is not None:  # its residual video phase
        video = _cycle(abs(sums.ramp.video_hz_per_s)) / light
        exponent += video * (farthest_m + length_m / 2) * length_m
    if sums.pulse is not None:  # motion within it mixes its frequencies
        exponent += _cycle(abs(sums.grid.step_hz) * sums.grid.count) * length_m
    exponent += np.log(16 / (interpolation_error(tolerance) * (_RHO - 1)))
    return max(math.ceil(float((exponent / np.log(_RHO)).min())), 1)


def _cycle(frequency_hz: float) -> float:
    """Return the phase of a wave over a metre [rad/m]."""
    return 2 * math.pi * frequency_hz / SPEED_OF_LIGHT_MPS


def _slopes(degrees: int) -> Real:
    """Return the largest slopes of T_k within [-1, 1], 0 < k < degrees."""
    return np.arange(1, degrees, dtype=np.float64) ** 2


def _lobatto(degree: int) -> Real:
    """Return extrema of T_degree in rising order, with both ends."""
    return np.asarray(-np.cos(np.pi * np.arange(degree + 1) / degree))


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
    """Adds up the spectra of moving paths. Parameters as of `SpectrumAccumulator`; `rows` paths are
    in one transform; `interval_s` is the time from pulse to pulse, for folding in Doppler; `span_s`
    are the times between which motion is fitted.
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
        span_s: tuple[float, float],
    ) -> None:
        #: (pulses, frequencies); None where nothing moved.
        self.values: Complex | None = None
        self.error = ErrorSum()
        #: Paths in the window, and folded into it, once per pulse.
        self.heard, self.folded_pulses = 0, 0
        #: Paths folded at every pulse; those that turn by more than half a cycle between pulses.
        self.folded, self.fast = 0, 0
        self._linear_rows: list[SmoothRows] = []
        self._smooth_rows: list[tuple[Real, Weights]] = []
        self._left_rad = [0.0]  # appended to by threads
        self._sums, self._times_s, self._tolerance = sums, times_s, tolerance
        self._method, self._backend = method, backend
        self._rows, self._lanes, self._report = rows, lanes, report
        self._added = 0
        self._way: Transform = "direct sum" if backend == "direct" else "pulse by pulse"
        transform: type[PulseTransform | RampTransform | PulseMotionTransform] = PulseTransform
        # times at which a pulse needs lengths, from its own
        self._offsets_s, first_s = np.zeros(1), 0.0
        if sums.ramp is not None:
            transform, first_s = RampTransform, -sums.ramp.half_s(sums.grid.count)
            self._offsets_s = np.array([first_s, 0.0, -first_s])
        if sums.pulse is not None:
            transform, self._offsets_s = PulseMotionTransform, np.array([0.0, sums.pulse.half_s])
        self._pool = TransformPool(lambda: transform(sums, tolerance, backend), sums.grid.count)
        whole_s = np.array([span_s[0] + first_s, span_s[1] + self._offsets_s[-1]])
        self._basis = BurstBasis(whole_s) if whole_s[1] > whole_s[0] else None
        self._amplitude_basis: BurstBasis | None = None
        if times_s.size > 1:
            self._amplitude_basis = BurstBasis(np.array(span_s), AMPLITUDE_NODES)
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
        """Return times at which these pulses need lengths, (pulses x offsets,) [s]."""
        return np.asarray((self._times_s[pulses, None] + self._offsets_s).ravel())

    def _by_pulses(self, lengths_m: Real) -> Real:
        """Reshape lengths (pulses x offsets, rows) to (pulses, rows). For a ramp they become
        (pulses, 3, rows), for a pulse lengths and rates (pulses, 2, rows).
        """
        if self._offsets_s.size == 1:
            return lengths_m
        found = lengths_m.reshape(-1, self._offsets_s.size, lengths_m.shape[1])
        if self._sums.pulse is not None:
            rate_mps = (found[:, 1] - found[:, 0]) / self._sums.pulse.half_s
            found = np.stack([found[:, 0], rate_mps], axis=1)
        return found

    def _add_phase_error(self, amplitude: Weights, error: float) -> None:
        """Add an error to the error estimate. `error` is the error of each term of the sum, as a
        fraction of its amplitude.
        """
        size, terms = np.abs(amplitude), self._times_s.size * self._sums.grid.count
        size = size if size.ndim == 1 else size.sum(axis=1)
        root = error * float(np.sqrt(terms))
        self.error.add(ErrorSum(root * float(np.linalg.norm(size)), root * float(size.sum()), 0.0))

    def _terms(self, pulses: slice, count: int) -> Real:
        """Return T_k at pulses, k < count, (pulses, count)."""
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
        """Do one transform for each pulse and block of rows. `lengths_m` gives the lengths (pulses,
        rows) of parts of either, `at` the amplitudes. With `ahead`, both are called in this thread
        alone, since a motion need not be safe in several.
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
        """Return these lengths. Keep the phase of their motion that is left out."""
        found = lengths_m()
        left_out = pulse_left_out_rad if self._sums.ramp is None else ramp_left_out_rad
        self._left_rad.append(left_out(found, self._sums, self._times_s[pulses]))
        return found

    def _matrix(self) -> Complex:
        if self.values is None:
            shape = (self._times_s.size, self._sums.grid.count)
            self.values = np.zeros(shape, dtype=np.complex128)
        return self.values

    @contextmanager
    def _nodes_of(self, group: CommonMotion, amplitude: Weights) -> Iterator[Self]:
        """Return a copy of this sum that is empty and has the nodes of a group as its pulses. On
        exit, its sums are interpolated and added at all pulses.
        """
        other = copy.copy(self)
        other._times_s, other.values, other.error = group.nodes_s, None, ErrorSum()
        other._way = "interpolated"
        yield other
        moving = self._matrix()
        moving += group.at_pulses(other._matrix(), self._sums, self._times_s)
        self.error.add(group.error(other.error, self._times_s.size))
        self._add_phase_error(amplitude, interpolation_error(self._tolerance))
