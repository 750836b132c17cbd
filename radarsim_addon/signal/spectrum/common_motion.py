# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of paths that share most of their motion: at a few times of a burst, interpolated.

The lengths of the paths of one body change at nearly one rate b [m/s]. Without the common phase
exp(-j 2 pi f_n b t / c), the sum of these paths changes slowly from pulse to pulse. It is computed
at M Chebyshev points of the burst (extrema, so that both ends are among them) and interpolated.
For a function that is at most exp(E) within the Bernstein ellipse of parameter rho, the error of
this interpolation is at most 4 exp(E) rho^(1 - M) / (rho - 1) (Trefethen, Approximation Theory and
Approximation Practice, theorem 8.2), here relative to sum |a|. E follows from the Chebyshev
coefficients c_k of the lengths: |Im T_k| <= (rho^k - rho^-k) / 2. An amplitude that is a Chebyshev
series of K terms needs K - 1 more points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .grid import SynthesisContext
from .nufft import TIGHTEST
from .phase import phasors, reduce_cycles
from .transform import ErrorSum, engine_tolerance

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
        """Spectra at pulses, (pulses, frequencies), from those at the nodes."""
        place = (times_s - self.nodes_s[0]) / (self.nodes_s[-1] - self.nodes_s[0])
        degree = self.nodes_s.size - 1
        vander = np.polynomial.chebyshev.chebvander
        weights = vander(2 * place - 1, degree) @ np.linalg.inv(vander(_lobatto(degree), degree))
        found: Complex = weights @ (spectra * self._turns(sums, self.nodes_s).conj())
        found *= self._turns(sums, times_s)
        return found

    def _turns(self, sums: SynthesisContext, times_s: Real) -> Complex:
        """The phase in common, (times, frequencies)."""
        k = np.arange(sums.grid.count) - sums.grid.count // 2
        turns_hz = (float(sums.grid.exact_centre_hz) + k * sums.grid.step_hz) * self.rate_mps
        cycles = np.outer((times_s[0] - times_s) / SPEED_OF_LIGHT_MPS, turns_hz)
        return phasors(np.ones(1), reduce_cycles(cycles), np.empty(cycles.shape, np.complex128))

    def error(self, at_nodes: ErrorSum, pulses: int) -> ErrorSum:
        """Error of the transforms at all pulses from that at all nodes.

        Random ones keep their size on average; the bound takes Lebesgue's constant.
        """
        more = pulses / self.nodes_s.size
        root = math.sqrt(more)
        lebesgue = 1 + math.log(self.nodes_s.size)
        return ErrorSum(
            root * at_nodes.random, lebesgue * root * at_nodes.bound, more * at_nodes.energy
        )


def left_out(tolerance: float) -> float:
    """Error of the interpolation relative to sum |a|."""
    return max(_NODES_SHARE * engine_tolerance(tolerance), TIGHTEST)


def common_motions(
    coefficients_m: Real, half_s: float, late_s: float, times_s: Real, terms: int,
    sums: SynthesisContext, tolerance: float,
) -> list[CommonMotion]:  # fmt: skip
    """Group rows with lengths c_k T_k, (rows, degrees), over a burst of `half_s` to either side.

    Rows are left out that bend too much, or that are not received at every pulse in their own
    window, `late_s` before or after it. Empty where pulse by pulse takes no longer.
    """
    if sums.extra_cycles is not None and sums.ramp is None:
        return []
    motion_rad = _cycle(sums.grid.highest_hz) * coefficients_m[:, 1:]
    # what motion within a pulse and until reception adds to the window
    rate_mps = np.abs(coefficients_m[:, 1:]) @ _slopes(coefficients_m.shape[1]) / half_s
    reach_m = np.abs(coefficients_m[:, 1:]).sum(axis=1)
    reach_m += rate_mps * (late_s + np.abs(coefficients_m[:, 0]) / SPEED_OF_LIGHT_MPS)
    early_s, latest_s = (
        (coefficients_m[:, 0] + sign * reach_m) / SPEED_OF_LIGHT_MPS for sign in (-1, 1)
    )
    low, high = sums.listening.orders(early_s, latest_s)
    fits = (low == 0) & (high == 0) & (np.abs(motion_rad[:, 1:]).sum(axis=1) < _LARGEST_BEND_RAD)
    fits &= (early_s > sums.listening.first_s) & (latest_s < sums.listening.last_s)
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


def _degree(
    coefficients_m: Real, middle_m: float, half_s: float, sums: SynthesisContext, tolerance: float
) -> int:
    """Degree of the polynomial in slow time that their sum is, without the rate in common."""
    size_m = np.abs(coefficients_m[:, 1:]).max(axis=0)
    apart_m = np.append(np.abs(coefficients_m[:, 1] - middle_m).max(), size_m[1:])
    turns, light = _cycle(sums.grid.highest_hz), SPEED_OF_LIGHT_MPS
    # the last ones are rounding
    tails_rad = turns * np.cumsum(apart_m[::-1])[::-1]
    used = max(int(np.count_nonzero(tails_rad > left_out(tolerance) / 2)), 1)
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
    exponent += np.log(16 / (left_out(tolerance) * (_RHO - 1)))
    return max(math.ceil(float((exponent / np.log(_RHO)).min())), 1)


def _cycle(frequency_hz: float) -> float:
    """Phase of a wave over a metre [rad/m]."""
    return 2 * math.pi * frequency_hz / SPEED_OF_LIGHT_MPS


def _slopes(degrees: int) -> Real:
    """Largest slopes of T_k within [-1, 1], 0 < k < degrees."""
    return np.arange(1, degrees, dtype=np.float64) ** 2


def _lobatto(degree: int) -> Real:
    """Extrema of T_degree in rising order, with both ends."""
    return np.asarray(-np.cos(np.pi * np.arange(degree + 1) / degree))
