# SPDX-License-Identifier: GPL-3.0-or-later
"""Lengths and amplitudes of paths over a burst, as Chebyshev polynomials of slow time.

Values are taken at Chebyshev nodes of the burst; the interpolating polynomial has the coefficients
c_k of T_k. Since |T_k| <= 1, the coefficients beyond degree 1 bound the departure of a length from
a constant range rate. Nodes are uneven, so periodic motion cannot hide between them; values at
other times are compared with the polynomial as well.

If antenna gains change during the burst, an amplitude is a(t) = sum_k c_k T_k(t): each term is
one more transform of all pulses, weighted with T_k afterwards, or one more product per path and
pulse. Amplitudes that no polynomial follows, as at nulls of a pattern, are taken at every pulse.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Mask, Real
from ..motion import Rows
from .grid import Weights, chebyshev_nodes

Values = TypeVar("Values", Real, Complex)

#: Nodes of the fit: a polynomial of degree 15.
NODES = 16
#: Where the polynomial is compared with the motion, as shares of the burst; no node is there.
_CHECKS = np.array([0.0, 0.137, 0.4142, 0.7391, 1.0])


@dataclass(frozen=True)
class FittedMotion:
    """Lengths of rows as polynomials."""

    coefficients_m: Real  #: c_k of T_k, (rows, nodes) [m]
    linear: Mask  #: degree 1 is within the bound, (rows,)
    smooth: Mask  #: the whole polynomial is, (rows,)
    fastest_mps: Real  #: largest rate of the length between nodes, (rows,) [m/s]


class BurstBasis:
    """Chebyshev polynomials of degree below `count` over the time of two or more pulses."""

    def __init__(self, times_s: Real, count: int = NODES) -> None:
        self.count = count
        first_s, last_s = float(times_s.min()), float(times_s.max())
        self.middle_s = (first_s + last_s) / 2
        self.half_s = (last_s - first_s) / 2
        self.nodes_s: Real = self.middle_s + self.half_s * chebyshev_nodes(count)
        self.checks_s: Real = first_s + (last_s - first_s) * _CHECKS
        self._inverse = np.linalg.inv(self.at(self.nodes_s)).T
        self._at_checks = self.at(self.checks_s).T

    def at(self, times_s: Real) -> Real:
        """T_k at times [s], (times, count)."""
        place = np.clip((times_s - self.middle_s) / self.half_s, -1.0, 1.0)
        return np.asarray(
            np.polynomial.chebyshev.chebvander(place, self.count - 1), dtype=np.float64
        )

    def sample_times_s(self) -> Real:
        """Times at which `fit` needs lengths: the nodes, then the checks [s]."""
        return np.concatenate([self.nodes_s, self.checks_s])

    def interpolate(self, values: Values) -> tuple[Values, Real]:
        """Coefficients c_k (rows, count) of values (rows, times) at `sample_times_s`, and their
        largest departure at the checks, (rows,).
        """
        coefficients = np.ascontiguousarray(values[:, : self.count]) @ self._inverse
        left = np.abs(coefficients @ self._at_checks - values[:, self.count :]).max(axis=1)
        return coefficients, left

    def fit(self, lengths_m: Real, displacement_error_bound_m: float) -> FittedMotion:
        """Fit lengths at `sample_times_s`, (rows, times) [m], and sort them by the bound [m]."""
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


#: Fraction of the tolerance for an amplitude, relative to the path's largest one: beams are also
#: looked at where they are weak, and a further digit costs two terms or so.
_SHARE = 1e-3
#: Nodes of their fit: beams have more bends than lengths.
AMPLITUDE_NODES = 32


@dataclass(frozen=True)
class AmplitudeHistory:
    """Complex amplitudes of n paths over a burst."""

    constant: Weights  #: amplitude where it does not vary, (n,)
    varies: Mask  #: (n,)
    #: From times [s] and indices of rows: amplitudes, (rows, times).
    at: Callable[[Real, NDArray[np.intp]], Complex]

    @classmethod
    def of(cls, amplitude: Weights) -> AmplitudeHistory:
        """History of amplitudes (n,) that do not vary."""
        return cls(
            amplitude,
            np.zeros(amplitude.shape, dtype=bool),
            lambda times_s, rows: np.repeat(amplitude[rows, None], np.size(times_s), axis=1),
        )

    def select(self, rows: Rows, factor: Real | Complex | float = 1.0) -> AmplitudeHistory:
        """History of some rows, times a factor, (rows,) or one."""
        index = np.arange(self.constant.size)[rows]
        factors = np.broadcast_to(factor, index.shape)
        return AmplitudeHistory(
            self.constant[index] * factors,
            self.varies[index],
            lambda times_s, own: self.at(times_s, index[own]) * factors[own, None],
        )


def fit_amplitudes(basis: BurstBasis, values: Complex, tolerance: float) -> tuple[Complex, Mask]:
    """Coefficients c_k of T_k, (rows, count), of values (rows, times) at
    ``basis.sample_times_s()``, and which rows they follow, (rows,). From the first k on that no row
    that fits needs, they are 0.
    """
    coefficients, left = basis.interpolate(values)
    size = np.abs(coefficients)
    bound = _SHARE * tolerance * np.abs(values).max(axis=1)
    fits = size[:, -3:].sum(axis=1) + left <= bound / 2
    # what is dropped with the terms from k on
    tails = np.cumsum(size[:, ::-1], axis=1)[:, ::-1]
    needed = int(np.count_nonzero((tails[fits] > bound[fits, None] / 2).any(axis=0)))
    coefficients[:, max(needed, 1) :] = 0
    return np.asarray(coefficients), np.asarray(fits)


def used_terms(coefficients: Weights) -> Weights:
    """Coefficients (rows, terms) without the last ones that are 0 in all rows."""
    used = np.flatnonzero(np.abs(coefficients).max(axis=0, initial=0.0) > 0)
    count = int(used[-1]) + 1 if used.size else 1
    found: Weights = np.asarray(coefficients)[..., :count]
    return found
