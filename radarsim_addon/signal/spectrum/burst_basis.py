# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion over a burst, sampled and fitted: still, linear, smooth, or none of these.

Lengths are taken at Chebyshev nodes of the burst. Their interpolating polynomial has coefficients
c_k of T_k; what lies beyond degree 1 bounds the departure from a constant range rate, for
|T_k| <= 1. Nodes are uneven, so motion that repeats itself cannot hide between them; lengths at
other times are compared with the polynomial as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ...array_types import Complex, Mask, Real

Values = TypeVar("Values", Real, Complex)

#: Nodes of the fit: a polynomial of degree 15.
NODES = 16
#: Where the polynomial is compared with the motion, as shares of the burst; no node is there.
_CHECKS = np.array([0.0, 0.137, 0.4142, 0.7391, 1.0])


@dataclass(frozen=True)
class FittedMotion:
    """Polynomials c_k T_k of the lengths, (rows, nodes) [m]; whether degree 1 or the whole
    polynomial is within the bound, and the largest rate of the length between nodes, (rows,) [m/s].
    """

    coefficients_m: Real
    linear: Mask
    smooth: Mask
    fastest_mps: Real


class BurstBasis:
    """Chebyshev polynomials of degree below `count` over the time of two or more pulses [s]."""

    def __init__(self, times_s: Real, count: int = NODES) -> None:
        self.count = count
        first_s, last_s = float(times_s.min()), float(times_s.max())
        self.middle_s = (first_s + last_s) / 2
        self.half_s = (last_s - first_s) / 2
        nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        self.nodes_s: Real = self.middle_s + self.half_s * nodes
        self.checks_s: Real = first_s + (last_s - first_s) * _CHECKS
        self._inverse = np.linalg.inv(self.at(self.nodes_s)).T
        self._at_checks = self.at(self.checks_s).T

    def at(self, times_s: Real) -> Real:
        """T_k at these times, (times, count)."""
        place = np.clip((times_s - self.middle_s) / self.half_s, -1.0, 1.0)
        return np.asarray(
            np.polynomial.chebyshev.chebvander(place, self.count - 1), dtype=np.float64
        )

    def sample_times_s(self) -> Real:
        """Times at which `fit` wants lengths: the nodes, then the checks [s]."""
        return np.concatenate([self.nodes_s, self.checks_s])

    def interpolate(self, values: Values) -> tuple[Values, Real]:
        """Coefficients c_k (rows, count) of values (rows, times) at `sample_times_s`, real or
        complex, and their largest departure at the checks, (rows,).
        """
        coefficients = np.ascontiguousarray(values[:, : self.count]) @ self._inverse
        left = np.abs(coefficients @ self._at_checks - values[:, self.count :]).max(axis=1)
        return coefficients, left

    def fit(self, lengths_m: Real, displacement_error_bound_m: float) -> FittedMotion:
        """Fit lengths at `sample_times_s`, (rows, times) [m], and sort them by
        `displacement_error_bound_m`."""
        at_nodes = lengths_m[:, : self.count]
        # from the first node, so that a long path leaves no rounding in the higher coefficients
        offset_m = at_nodes[:, :1]
        coefficients, left_m = self.interpolate(lengths_m - offset_m)
        size = np.abs(coefficients)
        unseen_m = size[:, -3:].sum(axis=1) + left_m
        smooth = unseen_m <= displacement_error_bound_m / 2
        linear = smooth & (size[:, 2:].sum(axis=1) + unseen_m <= displacement_error_bound_m)
        coefficients[:, 0] += offset_m[:, 0]
        rates = np.abs(np.diff(at_nodes, axis=1) / np.diff(self.nodes_s))
        return FittedMotion(
            coefficients_m=coefficients,
            linear=linear,
            smooth=smooth,
            fastest_mps=rates.max(axis=1),
        )
