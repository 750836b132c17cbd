# SPDX-License-Identifier: GPL-3.0-or-later
"""One spectrum from many paths: phases, a type-1 transform, and how far off it is."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...array_types import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .grid import SynthesisContext, Weights, place
from .nufft import TIGHTEST, Backend, Type1
from .phase import BLOCK, phasors, reduce_cycles, reduced_cycles

#: The engines get this fraction of the tolerance: a digit costs 1 % of a transform's time,
#: and what cancels in the band by 40 dB need not be done again.
_MARGIN = 0.01
#: Relative L2 error of an engine for random phases, and its largest error for one point, over the
#: tolerance it was given (measured 0.8 to 1.3 and 3 to 12 for finufft 2.5).
RANDOM_STATE, _WORST = 2.0, 15.0
#: Rounding of the points' phase at the edge of the band, per frequency.
_ROUNDING = 1e-16


def engines_for(tolerance: float, count: int, backend: Backend) -> list[tuple[float, Type1]]:
    """Engines to try one after the other, with their tolerances; of "direct" there is one."""
    engine = engine_tolerance(tolerance)
    engines = [(engine, Type1(count, engine, backend))]
    if engine > TIGHTEST and engines[0][1].backend != "direct":
        engines.append((TIGHTEST, Type1(count, TIGHTEST, backend)))
    return engines


def engine_tolerance(tolerance: float) -> float:
    """What the engines are asked for, so that the result meets `tolerance`."""
    return max(_MARGIN * tolerance, TIGHTEST)


def l2_norm(values: Complex) -> float:
    """L2 norm; by no BLAS, whose threads wait for one another."""
    return math.sqrt(float(np.sum(values.real**2) + np.sum(values.imag**2)))


@dataclass
class ErrorSum:
    """Error of a sum of transforms, in the units of their L2 norm: for phases that are random just
    outside the band, and for any paths; `energy` is the squared norm expected of random phases.
    """

    random: float = 0.0
    bound: float = 0.0
    energy: float = 0.0

    @classmethod
    def of(cls, engine: float, frequencies: int, squares: float, total: float) -> ErrorSum:
        """Of one transform: sum |c|^2 and sum |c| of its paths."""
        relative = engine + _ROUNDING * frequencies
        root = math.sqrt(frequencies)
        return cls(
            RANDOM_STATE * relative * root * math.sqrt(squares),
            _WORST * relative * root * total,
            frequencies * squares,
        )

    def add(self, other: ErrorSum) -> None:
        """Of results that are added: never less than either."""
        self.random += other.random
        self.bound += other.bound
        self.energy += other.energy

    def of_each(self, parts: int) -> ErrorSum:
        """Of one of several parts that share it evenly."""
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


class EachPulse(ABC):
    """Transforms of pulses one by one."""

    @abstractmethod
    def __call__(
        self, length_m: Real, amplitude: Weights, order: Real | None = None
    ) -> PulseResult: ...

    def pulses(
        self, lengths_m: Real, weights: Weights, order: Real | None
    ) -> Iterator[PulseResult]:
        """A call for each of several pulses; weights (rows,) or (pulses, rows)."""
        for number, length_m in enumerate(lengths_m):
            yield self(length_m, weights[number] if weights.ndim > 1 else weights, order)


class PulseTransform(EachPulse):
    """Sums of one synthesis, with buffers that are used again. For one thread at a time."""

    def __init__(self, sums: SynthesisContext, tolerance: float, backend: Backend) -> None:
        self._sums = sums
        self._tolerance = tolerance
        self._engines = engines_for(tolerance, sums.grid.count, backend)
        self._points: Real = np.empty(0)
        self._values: Complex = np.empty(0, dtype=np.complex128)

    def __call__(
        self, length_m: Real, amplitude: Weights, order: Real | None = None
    ) -> PulseResult:
        """sum_i a_i exp(j 2 pi [-f_n tau_i + extra]) over the paths that are received.

        With `order` all are, folded by that many pulse intervals.
        """
        count, kept = self._sums.grid.count, length_m.size
        if order is None:
            rows, order, kept = place(self._sums, length_m)
            length_m, amplitude = length_m[rows], amplitude[rows]
        if length_m.size == 0:
            return PulseResult(np.zeros(count, dtype=np.complex128), ErrorSum(), 0, 0)
        found = self.spectrum(length_m, amplitude, order)
        return replace(found, kept=kept)

    def spectrum(
        self,
        length_m: Real,
        amplitude: Weights,
        order: Real | None,
        moved_m: Real | None = None,
    ) -> PulseResult:
        """The same sum over all paths, folded by `order`, None: by none.

        `moved_m` adds to the lengths, without their rounding.
        """
        count = self._sums.grid.count
        squares, total = self._fill(length_m, amplitude, order, moved_m)
        points, values = self._points[: length_m.size], self._values[: length_m.size]
        expected = math.sqrt(count * squares)
        for engine, transform in self._engines:
            result = transform(points, values)
            found = float(np.linalg.norm(result))
            # what cancels in the band does not cancel in the transform's error
            if RANDOM_STATE * engine * expected <= self._tolerance / 3 * found:
                break
        if self._engines[0][1].backend == "direct":
            engine = 0.0
        folded = 0 if order is None else int(np.count_nonzero(order))
        return PulseResult(
            result, ErrorSum.of(engine, count, squares, total), length_m.size, folded
        )

    def _fill(
        self, length_m: Real, amplitude: Weights, order: Real | None, moved_m: Real | None
    ) -> tuple[float, float]:
        """Points and phasors into the buffers; returns sum |c|^2 and sum |c|."""
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
