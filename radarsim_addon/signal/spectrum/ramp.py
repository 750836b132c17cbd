# SPDX-License-Identifier: GPL-3.0-or-later
"""One spectrum of moving paths whose frequencies come one after the other.

Frequency f_n = f_c + n df is sampled at t_m + n dt, n = k - count//2. With the delay to the second
order over the ramp, tau(n dt) = tau_0 + b n + g n^2 / 2, and the residual video phase,

    f_n tau - K tau^2 / 2 = f_c tau_0 - K tau_0^2 / 2 + n [df tau_0 + (f_c - K tau_0) b]
        + n^2 [df b + (f_c - K tau_0) g / 2 - K b^2 / 2]

and terms in n^3, see `left_out_rad`. Times are of reception, half a delay after the wave met the
path (:mod:`.meeting`). The second term is the range-Doppler coupling of such radars: a moving
target appears where it will be f_c / (df / dt) later. The third bends the phase, by B T v / 2c
cycles at the ends of the ramp, 0.009 rad for 1 GHz, 50 us and 17 m/s. It is interpolated:
spectra with n^2 held at Chebyshev nodes q_j of its range, weighted by the Lagrange polynomials of
n^2. For phases within +-L of the mean M nodes leave 4 (L/2)^M / M! (the tail of the Jacobi-Anger
series). Paths that are bent by more go in groups.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ...array_types import Complex, Mask, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .grid import SynthesisContext, Weights
from .meeting import RECEPTION
from .nufft import Backend, RowsType1, Type1
from .phase import phasors, reduce_cycles, reduced_cycles
from .pulse_shape import nodes_for
from .transform import RANDOM_STATE, EachPulse, ErrorSum, PulseResult, engines_for

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
    """As :class:`.spectrum.transform.PulseTransform`, for lengths at three times of each ramp."""

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
        if self._engines[0][1].backend == "finufft" and RowsType1.possible():
            self._rows = RowsType1(count, self._engines[0][0])

    def __call__(
        self, length_m: Real, amplitude: Weights, order: Real | None = None
    ) -> PulseResult:
        """Lengths (3, rows), `Ramp.half_s` before the middle, in the middle, and after it [m].

        `order` is 0 where it is given: a ramp does not fold in delay.
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
        """As a call for each of several pulses, (pulses, 3, rows); weights (rows,) or (pulses,
        rows). Pulses of few rows are transformed together.
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
        """Cycles for each frequency, at the middle, and for its square, and which are received,
        (n,), of lengths (3, n).
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
        """As `_bent` for rows of points in one group, (pulses, n), and the number of nodes."""
        assert self._rows is not None
        mean = (curve.min(axis=1) + curve.max(axis=1))[:, None] / 2
        bends = curve - mean
        widest_rad = 2 * np.pi * self._half * float(np.abs(bends).max())
        tolerance = _NODES_SHARE * self._engines[0][0]
        places, weights = self._basis(nodes_for(widest_rad, tolerance))
        values = np.empty((places.size, *points.shape), dtype=np.complex128)
        for place, into in zip(places, values, strict=True):
            phasors(amplitude, reduce_cycles(cycles - bends * place), into)
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
            for place, into in zip(places, values, strict=True):
                phasors(amplitude[rows], reduce_cycles(cycles[rows] - bends * place), into)
            for weight, spectrum in zip(weights, transform(own, values), strict=True):
                found += weight * spectrum
            total += found * np.exp(-2j * np.pi * reduce_cycles(mean * self._square))
            most = max(most, places.size)
        return total, most

    def _basis(self, nodes: int) -> tuple[Real, Real]:
        """Nodes of n^2, and their Lagrange polynomials at every n, (nodes, count)."""
        if nodes not in self._bases:
            at = np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
            vander = np.polynomial.chebyshev.chebvander
            everywhere = vander(self._square / self._half - 1, nodes - 1)
            weights = np.asarray(everywhere @ np.linalg.inv(vander(at, nodes - 1))).T
            self._bases[nodes] = (self._half * (1 + at), np.ascontiguousarray(weights))
        return self._bases[nodes]

    def _directly(self, points: Real, cycles: Real, curve: Real, amplitude: Weights) -> Complex:
        """Term by term."""
        total = np.zeros(self._n.size, dtype=np.complex128)
        block = max(1, _MAX_TERMS // self._n.size)
        for start in range(0, points.size, block):
            part = slice(start, start + block)
            phase = cycles[part, None] - np.outer(points[part], self._n)
            phase -= np.outer(curve[part], self._square)
            total += amplitude[part] @ np.exp(2j * np.pi * reduce_cycles(phase))
        return total


def _angles(cycles: Real) -> Real:
    """Reduced cycles as angles within [-pi, pi]; overwrites them."""
    cycles *= 2 * np.pi
    return np.clip(cycles, -np.pi, np.pi, out=cycles)


def _with_nodes(engine: float, nodes: int) -> float:
    """Error of transforms of an engine at nodes: Lebesgue's constant, and the interpolation."""
    return engine * (1 + math.log(nodes) + (_NODES_SHARE if nodes > 1 else 0))


def _received(lengths_m: Real, half_s: float) -> Real:
    """c tau of what is received, from lengths (3, rows) at times that are half_s apart [m]."""
    first, middle, last = lengths_m
    rate_mps = (last - first) / (2 * half_s)
    change_mps = ((last - middle) - (middle - first)) / half_s
    rates_mps = np.stack([rate_mps - change_mps, rate_mps, rate_mps + change_mps])
    return lengths_m + RECEPTION.moved_m(lengths_m, rates_mps)


def left_out_rad(lengths_m: Real, sums: SynthesisContext, times_s: Real) -> float:
    """Largest phase that the motion (pulses, 3, rows) [m] has beyond `RampTransform`, about.

    In n^3: f_c times the change of the acceleration (between pulses; unknown for a single one),
    less what the parabola through three lengths takes off, and n df times half the acceleration.
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
