# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of echoes whose delay changes during the pulse.

t_m is the middle of pulse m, u the time from there, w(u) the transmitted pulse, f0 the carrier and
f the baseband frequency. What is emitted at t_m + u returns after the delay tau(t_m + u), which
changes at the rate beta. The spectrum s of the echo is then

    s(t_m, f) = (1 + beta) int w(u) exp(-j 2 pi (f0 + f) [tau(t_m) + beta u]) exp(-j 2 pi f u) du

The exponential in u is interpolated between Chebyshev nodes u_j of the pulse by their Lagrange
polynomials L_j: s = sum_j W_j(f) S(tau(t_m) + beta u_j) (1 + beta), with W_j the spectrum of w L_j
and S that of stationary paths. If the phase stays within +-Phi over the pulse, M nodes leave an
error of 4 (Phi/2)^M / M! (the tail of the Jacobi-Anger series). Doppler shift, range-Doppler
coupling and the stretched envelope are included. At a constant rate only this error remains.

The wave meets the path half its delay after the emission, see :mod:`.meeting`. A code that repeats
without end (:class:`.pulse_shape.CodeShape`) is the same with u in the time of reception, and the
samples are weighted by L_j(u) instead of the spectra by W_j.
"""

from __future__ import annotations

import math

import numpy as np

from ...array_types import Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .grid import SynthesisContext, Weights, place
from .nufft import TIGHTEST, Backend
from .pulse_shape import NODES_SHARE
from .transform import EachPulse, ErrorSum, PulseResult, PulseTransform


def pulse_left_out_rad(lengths_m: Real, sums: SynthesisContext, times_s: Real) -> float:
    """Largest phase of an acceleration within pulses of lengths and rates (pulses, 2, rows).

    The acceleration is that between pulses; of a single one it is unknown.
    """
    assert sums.pulse is not None
    if times_s.size < 2:
        return 0.0
    change = np.abs(np.diff(lengths_m[:, 1], axis=0)) / np.diff(times_s)[:, None]
    # half of it over the pulse, and as much in the rate, which is that of its second half
    left_m = float(change.max(initial=0.0)) * sums.pulse.half_s**2
    return 2 * math.pi * sums.grid.highest_hz * left_m / SPEED_OF_LIGHT_MPS


def joined_error(error: ErrorSum, nodes: int, tolerance: float, count: int) -> ErrorSum:
    """Error of a sum over nodes whose spectra (count values) each have this one."""
    if nodes == 1:
        return error
    lebesgue, left = 1 + math.log(nodes), NODES_SHARE * tolerance * math.sqrt(error.energy)
    return ErrorSum(
        lebesgue * error.random + left,
        lebesgue * error.bound + left * math.sqrt(count),
        error.energy,
    )


class PulseMotionTransform(EachPulse):
    """Transform of moving paths to spectra of their echoes, the pulse's spectrum included.

    Takes path lengths in the middle of a pulse and their rates; else as
    :class:`.spectrum.transform.PulseTransform`.
    """

    def __init__(self, sums: SynthesisContext, tolerance: float, backend: Backend) -> None:
        assert sums.pulse is not None
        self._sums, self._pulse = sums, sums.pulse
        self._tolerance = TIGHTEST if backend == "direct" else tolerance
        self._transform = PulseTransform(sums, tolerance, backend)

    def __call__(
        self, length_m: Real, amplitude: Weights, order: Real | None = None
    ) -> PulseResult:
        """Lengths [m] and rates [m/s], (2, rows), or also what the lengths lost by rounding [m],
        (3, rows); with `order` all are received, folded by it.
        """
        sums, pulse = self._sums, self._pulse
        middle, rate_mps, *lost_m = length_m
        kept, count = middle.size, sums.grid.count
        if order is None:
            rows, order, kept = place(sums, middle)
            middle, rate_mps, amplitude = middle[rows], rate_mps[rows], amplitude[rows]
            lost_m = [one[rows] for one in lost_m]
        if not middle.size:
            return PulseResult(np.zeros(count, dtype=np.complex128), ErrorSum(), 0, 0)
        amplitude = amplitude * pulse.stretch(rate_mps)
        folded_s = 0.0 if order is None else order * (sums.listening.period_s or 0.0)
        nodes = pulse.nodes(rate_mps, sums.grid.highest_hz, self._tolerance)
        spectra, error = np.empty((nodes, count), dtype=np.complex128), ErrorSum()
        for spectrum, time_s in zip(spectra, pulse.times_s(nodes), strict=True):
            later_m = pulse.meeting.moved_m(middle, rate_mps, time_s - folded_s)
            found = self._transform.spectrum(middle, amplitude, order, sum(lost_m, later_m))
            spectrum[:] = found.values
            error = max(error, found.error, key=lambda one: one.random)
        error = joined_error(error, nodes, self._tolerance, count)
        return PulseResult(pulse.joined(spectra), error, kept, found.folded)
