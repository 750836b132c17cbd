# SPDX-License-Identifier: GPL-3.0-or-later
"""One spectrum from many paths: phases, a type-1 transform, and its error.

In: lengths of n paths at one pulse [m] and amplitudes. Out: `PulseResult`. Three transforms with
the same interface: `PulseTransform` (no path moves during a pulse), `PulseMotionTransform` (paths
move during the pulse), `RampTransform` (the frequencies of a ramp, one after the other).
`single_spectra` has the spectrum of each path by itself.
`SynthesisReport` says which methods were used, their cost and their errors.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...arrays import Complex, Mask, Real
from ...findings import Finding, finding
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .grid import (
    BLOCK,
    NODES_SHARE,
    RECEPTION,
    FrequencyGrid,
    PulseShape,
    ReceiveWindow,
    SynthesisContext,
    Weights,
    chebyshev_nodes,
    lagrange,
    nodes_for,
    phasor_lines,
    phasors,
    received_rows,
    reduce_cycles,
    reduced_cycles,
)
from .nufft import TIGHTEST, Backend, RowsType1, Type1

#: The engines get this fraction of the tolerance: a digit costs 1 % of a transform's time,
#: and what cancels in the band by 40 dB need not be done again.
_MARGIN = 0.01
#: Relative L2 error of an engine for random phases, and its largest error for one point, over the
#: tolerance it was given (measured 0.8 to 1.3 and 3 to 12 for finufft 2.5).
RANDOM_STATE, _WORST = 2.0, 15.0
#: Rounding of the points' phase at the edge of the band, per frequency.
_ROUNDING = 1e-16


def engines_for(tolerance: float, count: int, backend: Backend) -> list[tuple[float, Type1]]:
    """Return the engines to try one after the other, with their tolerances. There is one for
    "direct".
    """
    engine = engine_tolerance(tolerance)
    engines = [(engine, Type1(count, engine, backend))]
    if engine > TIGHTEST and engines[0][1].backend != "direct":
        engines.append((TIGHTEST, Type1(count, TIGHTEST, backend)))
    return engines


def engine_tolerance(tolerance: float) -> float:
    """Return the tolerance of the engines with which the result meets `tolerance`."""
    return max(_MARGIN * tolerance, TIGHTEST)


def l2_norm(values: Complex) -> float:
    """Return the L2 norm without BLAS, whose threads wait for one another."""
    return math.sqrt(float(np.sum(values.real**2) + np.sum(values.imag**2)))


@dataclass
class ErrorSum:
    """Error of a sum of transforms, in the units of their L2 norm."""

    random: float = 0.0  #: for phases that are random just outside the band
    bound: float = 0.0  #: for any paths
    energy: float = 0.0  #: squared norm of the sum expected of random phases

    @classmethod
    def of(cls, engine: float, frequencies: int, squares: float, total: float) -> ErrorSum:
        """Return the error of one transform, from sum |c|^2 and sum |c| of its paths."""
        relative = engine + _ROUNDING * frequencies
        root = math.sqrt(frequencies)
        return cls(
            RANDOM_STATE * relative * root * math.sqrt(squares),
            _WORST * relative * root * total,
            frequencies * squares,
        )

    def add(self, other: ErrorSum) -> None:
        """Add the error of a result that is added: never less than either."""
        self.random += other.random
        self.bound += other.bound
        self.energy += other.energy

    def of_each(self, parts: int) -> ErrorSum:
        """Return the error of one of several parts that share it evenly."""
        return ErrorSum(
            self.random / math.sqrt(parts), self.bound / math.sqrt(parts), self.energy / parts
        )

    def merge(self, other: ErrorSum) -> None:
        """Add the error of results of other pulses."""
        self.random = math.hypot(self.random, other.random)
        self.bound = math.hypot(self.bound, other.bound)
        self.energy += other.energy


@dataclass
class PulseResult:
    """Spectrum of one pulse; `kept` rows were received, `folded` of them in a later window."""

    values: Complex
    error: ErrorSum
    kept: int
    folded: int


@dataclass(frozen=True)
class PulseBlock:
    """Spectra of some pulses, (pulses, frequencies); `heard` and `folded` count paths once per
    pulse.
    """

    pulses: slice
    values: Complex
    error: ErrorSum
    cpu_s: float
    heard: int = 0
    folded: int = 0


class EachPulse(ABC):
    """Transforms of pulses one by one. For one thread at a time."""

    @abstractmethod
    def __call__(
        self, length_m: Real, amplitude: Weights, order: Real | None = None
    ) -> PulseResult: ...

    def pulses(
        self, lengths_m: Real, weights: Weights, order: Real | None
    ) -> Iterator[PulseResult]:
        """Transform each of several pulses; weights are (rows,) or (pulses, rows)."""
        for number, length_m in enumerate(lengths_m):
            yield self(length_m, weights[number] if weights.ndim > 1 else weights, order)


class PulseTransform(EachPulse):
    """Sums of one synthesis, with buffers that are used again."""

    def __init__(self, sums: SynthesisContext, tolerance: float, backend: Backend) -> None:
        self._sums = sums
        self._tolerance = tolerance
        self._engines = engines_for(tolerance, sums.grid.count, backend)
        self._points: Real = np.empty(0)
        self._values: Complex = np.empty(0, dtype=np.complex128)

    def __call__(
        self, length_m: Real, amplitude: Weights, order: Real | None = None
    ) -> PulseResult:
        """Return sum_i a_i exp(j 2 pi [-f_n tau_i + extra]) over the received paths. With `order`,
        all paths are received, folded by that many pulse intervals.
        """
        count, kept = self._sums.grid.count, length_m.size
        if order is None:
            rows, order, kept = received_rows(self._sums, length_m)
            length_m, amplitude = length_m[rows], amplitude[rows]
        if length_m.size == 0:
            return PulseResult(np.zeros(count, dtype=np.complex128), ErrorSum(), 0, 0)
        squares, total = self._fill(length_m, amplitude, order, None)
        values, error = self._transformed(slice(0, length_m.size), squares, total)
        folded = 0 if order is None else int(np.count_nonzero(order))
        return PulseResult(values, error, kept, folded)

    def spectra(
        self, length_m: Real, amplitude: Weights, order: Real | None, moved_m: Real
    ) -> Iterator[tuple[Complex, ErrorSum]]:
        """Yield the same sum over all n paths, folded by `order` (None: by none), for each of
        several places of them: `moved_m`, (places, n), is added to the lengths without rounding.
        """
        rows = length_m.size
        # of few paths numpy is all overhead: they are treated together at several places
        together = max(BLOCK // rows, 1)
        for first in range(0, len(moved_m), together):
            here = moved_m[first : first + together]
            places = len(here)
            folds = None if order is None else np.tile(order, places)
            sums = self._fill(
                np.tile(length_m, places), np.tile(amplitude, places), folds, here.ravel()
            )
            squares, total = (one / places for one in sums)
            for place in range(places):
                part = slice(place * rows, (place + 1) * rows)
                yield self._transformed(part, squares, total)

    def _transformed(self, part: slice, squares: float, total: float) -> tuple[Complex, ErrorSum]:
        """Return the sum over a part of the buffers, and its error."""
        count, points, values = self._sums.grid.count, self._points[part], self._values[part]
        expected = math.sqrt(count * squares)
        for engine, transform in self._engines:
            result = transform(points, values)
            found = float(np.linalg.norm(result))
            # what cancels in the band does not cancel in the transform's error
            if RANDOM_STATE * engine * expected <= self._tolerance / 3 * found:
                break
        if self._engines[0][1].backend == "direct":
            engine = 0.0
        return result, ErrorSum.of(engine, count, squares, total)

    def _fill(
        self, length_m: Real, amplitude: Weights, order: Real | None, moved_m: Real | None
    ) -> tuple[float, float]:
        """Write points and phasors to the buffers. Return sum |c|^2 and sum |c|."""
        size = length_m.size
        if self._points.size < size:
            self._points = np.empty(size)
            self._values = np.empty(size, dtype=np.complex128)
        sums, squares, total = self._sums, 0.0, 0.0
        for start in range(0, size, BLOCK):
            part = slice(start, min(start + BLOCK, size))
            length, a = length_m[part], amplitude[part]
            points = reduced_cycles(length, sums.step, self._points[part])
            cycles = reduced_cycles(length, sums.centre)
            np.negative(cycles, out=cycles)
            if moved_m is not None:
                cycles -= moved_m[part] * sums.centre.rate
                points += moved_m[part] * sums.step.rate
            if order is not None:
                cycles += reduce_cycles(order[part] * sums.shift_centre)
                points -= order[part] * sums.shift_step
            if moved_m is not None or order is not None:
                reduce_cycles(points)
                reduce_cycles(cycles)
            if sums.extra_cycles is not None:
                cycles += sums.extra_cycles(length / SPEED_OF_LIGHT_MPS)
                reduce_cycles(cycles)
            points *= 2 * np.pi
            np.clip(points, -np.pi, np.pi, out=points)
            phasors(a, cycles, self._values[part])
            size_of = np.abs(a)
            total += float(size_of.sum())
            squares += float(np.dot(size_of, size_of))
        return squares, total


# -------------------------------------------------------------------------------------------------
# Spectra of echoes whose delay changes during the pulse.
#
# t_m is the middle of pulse m, u the time from there, w(u) the transmitted pulse, f0 the carrier
# and f the baseband frequency. What is emitted at t_m + u returns after the delay tau(t_m + u),
# which changes at the rate beta. The spectrum s of the echo is then
#
#     s(t_m, f) = (1 + beta) int w(u) exp(-j 2 pi (f0 + f) [tau(t_m) + beta u]) exp(-j 2 pi f u) du
#
# The exponential in u is interpolated between Chebyshev nodes u_j of the pulse by their Lagrange
# polynomials L_j: s = sum_j W_j(f) S(tau(t_m) + beta u_j) (1 + beta), with W_j the spectrum of w
# L_j and S that of stationary paths. Doppler shift, range-Doppler coupling and the stretched
# envelope are included. At a constant rate only the error of the interpolation remains. A code that
# repeats without end (`CodeShape`) is the same with u in the time of reception; its samples are
# weighted by L_j(u) instead of the spectra by W_j.
# -------------------------------------------------------------------------------------------------


class PulseMotionTransform(EachPulse):
    """Sums as `PulseTransform` forms them, for paths that move during the pulse. The input is the
    length in the middle of a pulse and its rate. The spectra include that of the pulse.
    """

    def __init__(self, sums: SynthesisContext, tolerance: float, backend: Backend) -> None:
        assert sums.pulse is not None
        self._sums, self._pulse = sums, sums.pulse
        self._tolerance = TIGHTEST if backend == "direct" else tolerance
        self._transform = PulseTransform(sums, tolerance, backend)

    def __call__(
        self, length_m: Real, amplitude: Weights, order: Real | None = None
    ) -> PulseResult:
        """Take lengths [m] and rates [m/s], (2, rows), and optionally the rounding of the lengths
        [m], (3, rows). With `order`, all rows are received, folded by it.
        """
        sums, pulse = self._sums, self._pulse
        middle, rate_mps, *lost_m = length_m
        kept, count = middle.size, sums.grid.count
        if order is None:
            rows, order, kept = received_rows(sums, middle)
            middle, rate_mps, amplitude = middle[rows], rate_mps[rows], amplitude[rows]
            lost_m = [one[rows] for one in lost_m]
        if not middle.size:
            return PulseResult(np.zeros(count, dtype=np.complex128), ErrorSum(), 0, 0)
        amplitude = amplitude * pulse.stretch(rate_mps)
        folded_s = 0.0 if order is None else order * (sums.listening.period_s or 0.0)
        nodes = pulse.nodes(rate_mps, sums.grid.highest_hz, self._tolerance)
        later_s = pulse.times_s(nodes)[:, None] - folded_s
        moved_m = sum(lost_m, pulse.meeting.moved_m(middle, rate_mps, later_s))
        spectra, errors = zip(
            *self._transform.spectra(middle, amplitude, order, moved_m), strict=True
        )
        worst = max(errors, key=lambda one: one.random)
        error = joined_error(worst, nodes, self._tolerance, count)
        folded = 0 if order is None else int(np.count_nonzero(order))
        return PulseResult(pulse.joined(np.stack(spectra)), error, kept, folded)


def single_spectra(
    grid: FrequencyGrid,
    window: ReceiveWindow,
    pulse: PulseShape,
    length_m: Real,
    rate_mps: Real,
    later_s: Real,
) -> Complex:
    """Return the spectrum of each of n paths of amplitude 1 by itself, term by term, (n,
    frequencies). A path has its length [m] and its rate [m/s] `later_s` before the middle of the
    pulse.
    """
    sums = SynthesisContext.of(grid, window, None, pulse=pulse)
    rows, order, _ = received_rows(sums, length_m + rate_mps * later_s)
    number = np.arange(length_m.size)[rows]
    order = np.zeros(number.size) if order is None else order
    nodes = pulse.nodes(rate_mps, grid.highest_hz, TIGHTEST)
    found = np.zeros((length_m.size, grid.count), dtype=np.complex128)
    step = max(_MAX_TERMS // (nodes * grid.count), 1)
    for start in range(0, number.size, step):
        own, folds = number[start : start + step], order[start : start + step, None]
        length, rate, later = (one[own, None] for one in (length_m, rate_mps, later_s))
        meets_s = later + pulse.times_s(nodes) - folds * (window.period_s or 0.0)
        moved_m = pulse.meeting.moved_m(length, rate, meets_s)
        cycles = reduce_cycles(folds * sums.shift_centre) - reduced_cycles(length, sums.centre)
        points = reduced_cycles(length, sums.step) - folds * sums.shift_step
        cycles = cycles - moved_m * sums.centre.rate
        points = points + moved_m * sums.step.rate
        spectra = phasor_lines(cycles.ravel(), -points.ravel(), grid.count).T
        spectra = spectra.reshape(-1, nodes, grid.count)
        np.add.at(found, own, pulse.stretch(rate) * pulse.joined(spectra))
    return found


def pulse_left_out_rad(lengths_m: Real, sums: SynthesisContext, times_s: Real) -> float:
    """Return the largest phase of an acceleration within pulses, from lengths and rates (pulses, 2,
    rows). The acceleration is that between pulses; for a single pulse it is unknown.
    """
    assert sums.pulse is not None
    if times_s.size < 2:
        return 0.0
    change = np.abs(np.diff(lengths_m[:, 1], axis=0)) / np.diff(times_s)[:, None]
    # half of it over the pulse, and as much in the rate, which is that of its second half
    left_m = float(change.max(initial=0.0)) * sums.pulse.half_s**2
    return 2 * math.pi * sums.grid.highest_hz * left_m / SPEED_OF_LIGHT_MPS


def joined_error(error: ErrorSum, nodes: int, tolerance: float, count: int) -> ErrorSum:
    """Return the error of a sum over nodes whose spectra (count values) each have this error."""
    if nodes == 1:
        return error
    lebesgue, left = 1 + math.log(nodes), NODES_SHARE * tolerance * math.sqrt(error.energy)
    return ErrorSum(
        lebesgue * error.random + left,
        lebesgue * error.bound + left * math.sqrt(count),
        error.energy,
    )


# -------------------------------------------------------------------------------------------------
# One spectrum of moving paths whose frequencies come one after the other.
#
# Frequency f_n = f_c + n df is sampled at t_m + n dt, n = k - count//2. With the delay to the
# second order over the ramp, tau(n dt) = tau_0 + b n + g n^2 / 2, and the residual video phase,
#
#     f_n tau - K tau^2 / 2 = f_c tau_0 - K tau_0^2 / 2 + n [df tau_0 + (f_c - K tau_0) b]
#         + n^2 [df b + (f_c - K tau_0) g / 2 - K b^2 / 2]
#
# and terms in n^3, see `ramp_left_out_rad`. Times are of reception (`Meeting`). The second term is
# the range-Doppler coupling of such radars: a moving target appears where it will be f_c/(df/dt)
# later. The third bends the phase, by B T v / 2c cycles at the ends of the ramp, 0.009 rad for 1
# GHz, 50 us and 17 m/s. It is interpolated: spectra with n^2 held at Chebyshev nodes q_j of its
# range, weighted by the Lagrange polynomials of n^2 (`nodes_for` has the error). Paths that are
# bent by more go in groups.
# -------------------------------------------------------------------------------------------------


#: Largest bend of a group's paths from their mean [rad]; 16 nodes for 5e-8.
_WIDEST_RAD = 4.0
#: Error of the interpolation over that of the transforms: a node costs a transform.
_NODES_SHARE = 5.0
#: Largest of |t^3 - t| for |t| <= 1: what is left of a cube by the parabola through -1, 0, 1.
_CUBE_LEFT = 2 / (3 * math.sqrt(3))
#: Pulses of up to so many rows are transformed together: of more, one by one takes no longer.
_FEW_ROWS = 1 << 12
#: Terms of the direct sum held at a time.
_MAX_TERMS = 1 << 20


class RampTransform(EachPulse):
    """Sums as `PulseTransform` forms them, for lengths at three times of each ramp."""

    def __init__(self, sums: SynthesisContext, tolerance: float, backend: Backend) -> None:
        assert sums.ramp is not None
        self._sums, self._ramp, self._tolerance = sums, sums.ramp, tolerance
        count = sums.grid.count
        self._engines = engines_for(tolerance, count, backend)
        self._n: Real = np.arange(count, dtype=np.float64) - count // 2
        self._square = self._n**2
        self._half = float(self._square.max()) / 2
        self._bases: dict[int, tuple[Real, Real]] = {}
        self._rows: RowsType1 | None = None
        if self._engines[0][1].backend == "finufft":
            self._rows = RowsType1(count, self._engines[0][0])

    def __call__(
        self, length_m: Real, amplitude: Weights, order: Real | None = None
    ) -> PulseResult:
        """Transform lengths (3, rows): `Ramp.half_s` before the middle, in the middle, and after it
        [m]. `order` is 0 if given, because a ramp does not fold in delay.
        """
        grid = self._sums.grid
        points, cycles, curve, heard = self._turns(length_m)
        kept = int(np.count_nonzero(heard))
        if kept < heard.size:
            points, cycles, curve = points[heard], cycles[heard], curve[heard]
            amplitude = amplitude[heard]
        if not kept:
            return PulseResult(np.zeros(grid.count, dtype=np.complex128), ErrorSum(), 0, 0)
        size = np.abs(amplitude)
        squares, total = float(np.dot(size, size)), float(size.sum())
        if self._engines[0][1].backend == "direct":
            values = self._directly(points, cycles, curve, amplitude)
            return PulseResult(values, ErrorSum.of(0.0, grid.count, squares, total), kept, 0)
        points = _angles(points)
        expected = math.sqrt(grid.count * squares)
        for engine, transform in self._engines:
            result, nodes = self._bent(transform, engine, points, cycles, curve, amplitude)
            error = _with_nodes(engine, nodes)
            if RANDOM_STATE * error * expected <= self._tolerance / 3 * float(
                np.linalg.norm(result)
            ):
                break
        return PulseResult(result, ErrorSum.of(error, grid.count, squares, total), kept, 0)

    def pulses(
        self, lengths_m: Real, weights: Weights, order: Real | None
    ) -> Iterator[PulseResult]:
        """Transform several pulses as the base class does; lengths are (pulses, 3, rows). Pulses of
        few rows are transformed together.
        """
        shape = lengths_m.shape[0], lengths_m.shape[2]
        together = self._rows is not None and shape[0] > 1 and 0 < shape[1] <= _FEW_ROWS
        if together:
            turns = self._turns(lengths_m.transpose(1, 0, 2).reshape(3, -1))
            together = not self._group(turns[2]).any()
        if not together:
            yield from super().pulses(lengths_m, weights, order)
            return
        points, cycles, curve = (part.reshape(shape) for part in turns[:3])
        heard = turns[3].reshape(shape)
        amplitude, engine = weights * heard, self._engines[0][0]
        size, count = np.abs(amplitude), self._n.size
        squares, total = np.sum(size**2, axis=1), np.sum(size, axis=1)
        spectra, nodes = self._straight(_angles(points), cycles, curve, amplitude)
        error = _with_nodes(engine, nodes)
        expected, found = np.sqrt(count * squares), np.linalg.norm(spectra, axis=1)
        enough = RANDOM_STATE * error * expected <= self._tolerance / 3 * found
        for number, values in enumerate(spectra):
            if not enough[number]:
                own = weights[number] if weights.ndim > 1 else weights
                yield self(lengths_m[number], own, order)
                continue
            kept = int(np.count_nonzero(heard[number]))
            part = ErrorSum.of(error, count, float(squares[number]), float(total[number]))
            yield PulseResult(values, part, kept, 0)

    def _turns(self, length_m: Real) -> tuple[Real, Real, Real, Mask]:
        """Return, for lengths (3, n), the cycles per frequency, at the middle, and per squared
        frequency, and a mask of the received paths, (n,) each.
        """
        sums, grid, ramp = self._sums, self._sums.grid, self._ramp
        first, middle, last = _received(length_m, ramp.half_s(grid.count))
        share = ramp.interval_s / ramp.half_s(grid.count)
        delay_s = middle / SPEED_OF_LIGHT_MPS
        carrier_hz = float(grid.exact_centre_hz) - ramp.video_hz_per_s * delay_s
        change_s = (last - first) * (share / 2 / SPEED_OF_LIGHT_MPS)
        bend_s = ((last - middle) - (middle - first)) * (share**2 / SPEED_OF_LIGHT_MPS)
        slide = carrier_hz * change_s
        curve = carrier_hz * bend_s / 2 + change_s * (
            grid.step_hz - ramp.video_hz_per_s / 2 * change_s
        )
        points = reduced_cycles(middle, sums.step) + slide
        cycles = -reduced_cycles(middle, sums.centre)
        if sums.extra_cycles is not None:
            cycles += sums.extra_cycles(delay_s)
        seen_s = delay_s + slide / grid.step_hz  # the delay that the beat's frequency shows
        heard = (seen_s > sums.listening.first_s) & (seen_s < sums.listening.last_s)
        return reduce_cycles(points), reduce_cycles(cycles), curve, heard

    def _group(self, curve: Real) -> Real:
        """Number of the group of bends that each path belongs to, (n,)."""
        return np.asarray(np.rint(curve * (np.pi * self._half / _WIDEST_RAD)))

    def _straight(
        self, points: Real, cycles: Real, curve: Real, amplitude: Weights
    ) -> tuple[Complex, int]:
        """Compute `_bent` for rows of points in one group, (pulses, n). Return the number of nodes,
        too.
        """
        assert self._rows is not None
        mean = (curve.min(axis=1) + curve.max(axis=1))[:, None] / 2
        bends = curve - mean
        widest_rad = 2 * np.pi * self._half * float(np.abs(bends).max())
        tolerance = _NODES_SHARE * self._engines[0][0]
        places, weights = self._basis(nodes_for(widest_rad, tolerance))
        values = np.empty((places.size, *points.shape), dtype=np.complex128)
        for at, into in zip(places, values, strict=True):
            phasors(amplitude, reduce_cycles(cycles - bends * at), into)
        spectra = np.einsum("pk,pmk->mk", weights, self._rows(points, values))
        spectra *= np.exp(-2j * np.pi * reduce_cycles(mean * self._square))
        return spectra, places.size

    def _bent(
        self,
        transform: Type1,
        tolerance: float,
        points: Real,
        cycles: Real,
        curve: Real,
        amplitude: Weights,
    ) -> tuple[Complex, int]:
        """Sum of a exp(j 2 pi [cycles - curve n^2]) exp(-j n x), and the most nodes of a group."""
        group = self._group(curve)
        names = np.unique(group)
        total, most = np.zeros(self._n.size, dtype=np.complex128), 1
        for name in names:
            rows = slice(None) if names.size == 1 else np.flatnonzero(group == name)
            own, bends = points[rows], curve[rows]
            mean = float(bends.min() + bends.max()) / 2
            bends = bends - mean
            widest_rad = 2 * np.pi * self._half * float(np.abs(bends).max())
            places, weights = self._basis(nodes_for(widest_rad, _NODES_SHARE * tolerance))
            found = np.zeros(self._n.size, dtype=np.complex128)
            values = np.empty((places.size, own.size), dtype=np.complex128)
            for at, into in zip(places, values, strict=True):
                phasors(amplitude[rows], reduce_cycles(cycles[rows] - bends * at), into)
            for weight, spectrum in zip(weights, transform(own, values), strict=True):
                found += weight * spectrum
            total += found * np.exp(-2j * np.pi * reduce_cycles(mean * self._square))
            most = max(most, places.size)
        return total, most

    def _basis(self, nodes: int) -> tuple[Real, Real]:
        """Return the interpolation nodes of n^2, and the value of each Lagrange polynomial at each
        n, (nodes, count).
        """
        if nodes not in self._bases:
            at = chebyshev_nodes(nodes)
            weights = lagrange(at, self._square / self._half - 1)
            self._bases[nodes] = (self._half * (1 + at), np.ascontiguousarray(weights))
        return self._bases[nodes]

    def _directly(self, points: Real, cycles: Real, curve: Real, amplitude: Weights) -> Complex:
        total = np.zeros(self._n.size, dtype=np.complex128)
        block = max(1, _MAX_TERMS // self._n.size)
        for start in range(0, points.size, block):
            part = slice(start, start + block)
            phase = cycles[part, None] - np.outer(points[part], self._n)
            phase -= np.outer(curve[part], self._square)
            total += amplitude[part] @ np.exp(2j * np.pi * reduce_cycles(phase))
        return total


def _angles(cycles: Real) -> Real:
    """Convert reduced cycles to angles within [-pi, pi], in place."""
    cycles *= 2 * np.pi
    return np.clip(cycles, -np.pi, np.pi, out=cycles)


def _with_nodes(engine: float, nodes: int) -> float:
    """Return the error of an engine's transforms at nodes: Lebesgue's constant, and the
    interpolation.
    """
    return engine * (1 + math.log(nodes) + (_NODES_SHARE if nodes > 1 else 0))


def _received(lengths_m: Real, half_s: float) -> Real:
    """Return c tau at reception from lengths (3, rows) at times that are half_s apart [m]."""
    first, middle, last = lengths_m
    rate_mps = (last - first) / (2 * half_s)
    change_mps = ((last - middle) - (middle - first)) / half_s
    rates_mps = np.stack([rate_mps - change_mps, rate_mps, rate_mps + change_mps])
    return lengths_m + RECEPTION.moved_m(lengths_m, rates_mps)


def ramp_left_out_rad(lengths_m: Real, sums: SynthesisContext, times_s: Real) -> float:
    """Return about the largest phase of the motion (pulses, 3, rows) [m] that `RampTransform`
    leaves out. It has two terms. The first is in n^3: f_c times the change of the acceleration
    between pulses (unknown for a single pulse), reduced by the part that the parabola through three
    lengths contains. The second is n df times half the acceleration.
    """
    assert sums.ramp is not None
    first, middle, last = (lengths_m[:, i] for i in range(3))
    bend_m = (last - middle) - (middle - first)
    half_s = sums.ramp.half_s(sums.grid.count)
    band_hz = abs(sums.grid.step_hz) * sums.grid.count
    left = band_hz / 4 * float(np.abs(bend_m).max(initial=0.0))
    if times_s.size > 1:
        change = np.abs(np.diff(bend_m, axis=0)) / np.diff(times_s)[:, None]
        cube_m = float(change.max(initial=0.0)) * half_s / 6 * _CUBE_LEFT
        left += abs(float(sums.grid.exact_centre_hz)) * cube_m
    return 2 * math.pi * left / SPEED_OF_LIGHT_MPS


Motion = Literal["still", "linear", "smooth", "sampled"]
Transform = Literal["once", "type 3", "pulse by pulse", "interpolated", "direct sum"]

#: Phase left out of the motion within a ramp that is worth a word: sidelobes at -66 dB.
_RAMP_SLACK_RAD = 1e-3


@dataclass
class SynthesisStep:
    """Paths (twice where folded into the window twice) of one kind of motion that went one way."""

    #: "linear": constant range rate within the bound; "smooth": a polynomial fitted within it;
    #: "sampled": lengths are taken at every pulse.
    motion: Motion
    #: "once": one 1-D type 1 for all pulses; "type 3": 2-D over frequency and pulse; "pulse by
    #: pulse": a 1-D type 1 each; "interpolated": the same at a few times, from which all follow.
    transform: Transform
    paths: int = 0
    transforms: int = 0
    cpu_s: float = 0.0


@dataclass
class SynthesisReport:
    """How a spectrum was formed.

    Attributes
    ----------
    backend
        "finufft" or "direct".
    tolerance
        Relative L2 error that was asked for.
    paths
        Rows added.
    pulses, frequencies
        Size of the result.
    steps
        Ways that were chosen, for how many paths, and their cost.
    error_estimate
        Relative L2 error to the direct sum, for phases that are random just outside the band, with
        that of fitted motion; cancellation within the band counts. 0 where there is no echo.
    error_bound
        The same for any paths.
    cancellation_db
        Energy of the result over that of paths with random phases; at -60 dB three digits are lost.
    motion_error_rad
        Largest error of phase that fitted motion was allowed.
    outside
        Paths outside the window, counted once a pulse and divided by pulses.
    range_ambiguous_count
        Paths that stand in the window by folding (delay beyond the pulse interval).
    doppler_ambiguous_count
        Moving paths whose phase turns by more than half a cycle from pulse to pulse.
    ramp_residual_phase_rad
        If frequencies come one after the other: phase of the motion meanwhile beyond the second
        order in time, about [rad].
    wall_s
        Time spent in all [s].
    notes
        Remarks on the steps, in whole sentences.
    """

    backend: str
    tolerance: float
    paths: int = 0
    pulses: int = 0
    frequencies: int = 0
    steps: list[SynthesisStep] = field(default_factory=list)
    error_estimate: float = 0.0
    error_bound: float = 0.0
    cancellation_db: float | None = None
    motion_error_rad: float = 0.0
    outside: float = 0.0
    range_ambiguous_count: int = 0
    doppler_ambiguous_count: int = 0
    ramp_residual_phase_rad: float = 0.0
    wall_s: float = 0.0
    notes: list[str] = field(default_factory=list)

    def count(
        self, motion: Motion, transform: Transform, paths: int, transforms: int, cpu_s: float
    ) -> None:
        """Add to the step of this kind."""
        for step in self.steps:
            if (step.motion, step.transform) == (motion, transform):
                break
        else:
            step = SynthesisStep(motion, transform)
            self.steps.append(step)
        step.paths += paths
        step.transforms += transforms
        step.cpu_s += cpu_s

    def accuracy_findings(self) -> list[Finding]:
        """Find reasons why the samples may miss the tolerance or the motion."""
        found = []
        if self.error_estimate > self.tolerance:
            found.append(
                finding(
                    "echoes-cancel",
                    cancellation_db=self.cancellation_db or 0.0,
                    error_estimate=self.error_estimate,
                    tolerance=self.tolerance,
                )
            )
        if self.ramp_residual_phase_rad > _RAMP_SLACK_RAD:
            found.append(finding("uneven-motion-in-sweep", phase_rad=self.ramp_residual_phase_rad))
        return found

    def lines(self) -> list[str]:
        """Return the report for people, one line per entry."""
        found = [
            f"{step.paths} paths {step.motion}, {step.transform}: {step.transforms} transforms, "
            f"{step.cpu_s:.3g} s of processor time"
            for step in self.steps
        ]
        found.extend(self.notes)
        found.append(
            f"{self.backend}, relative error {self.error_estimate:.1e} "
            f"(asked {self.tolerance:g}), {self.wall_s:.3g} s"
        )
        return found
