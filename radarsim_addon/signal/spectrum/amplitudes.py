# SPDX-License-Identifier: GPL-3.0-or-later
"""Amplitudes of paths over a burst, and the polynomials of slow time that stand for them.

Where antenna gains change during the burst an amplitude is a(t) = sum_k c_k T_k(t): each term is
one more transform of all pulses, weighted with T_k afterwards, or one more product per path and
pulse. Amplitudes that no polynomial follows, as at nulls of a pattern, are taken at every pulse.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Mask, Real
from ..motion import Rows
from .burst_basis import BurstBasis
from .grid import Weights

#: Fraction of the tolerance for an amplitude, relative to the path's largest one: beams are also
#: looked at where they are weak, and a further digit costs two terms or so.
_SHARE = 1e-3
#: Nodes of their fit: beams have more bends than lengths.
AMPLITUDE_NODES = 32


@dataclass(frozen=True)
class AmplitudeHistory:
    """Complex amplitudes of n paths over a burst.

    Attributes
    ----------
    constant
        Amplitude where it does not vary, (n,).
    varies
        Whether it does, (n,).
    at
        From times [s] and indices of rows: amplitudes, (rows, times).
    """

    constant: Weights
    varies: Mask
    at: Callable[[Real, NDArray[np.intp]], Complex]

    @classmethod
    def of(cls, amplitude: Weights) -> AmplitudeHistory:
        """Return the history of amplitudes (n,) that do not vary."""
        return cls(
            amplitude,
            np.zeros(amplitude.shape, dtype=bool),
            lambda times_s, rows: np.repeat(amplitude[rows, None], np.size(times_s), axis=1),
        )

    def select(self, rows: Rows, factor: Real | Complex | float = 1.0) -> AmplitudeHistory:
        """Return the history of some rows, times factors of these rows, (rows,) or one."""
        index = np.arange(self.constant.size)[rows]
        factors = np.broadcast_to(factor, index.shape)
        return AmplitudeHistory(
            self.constant[index] * factors,
            self.varies[index],
            lambda times_s, own: self.at(times_s, index[own]) * factors[own, None],
        )


def fit_amplitudes(basis: BurstBasis, values: Complex, tolerance: float) -> tuple[Complex, Mask]:
    """Coefficients c_k of T_k, (rows, count), and which rows they follow, (rows,).

    `values` (rows, times) are those at ``basis.sample_times_s()``. From the first k on that no row
    that fits needs, the coefficients are 0.
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
    """Return coefficients (rows, terms) without the last ones that are 0 in all rows."""
    used = np.flatnonzero(np.abs(coefficients).max(axis=0, initial=0.0) > 0)
    count = int(used[-1]) + 1 if used.size else 1
    found: Weights = np.asarray(coefficients)[..., :count]
    return found
