# SPDX-License-Identifier: GPL-3.0-or-later
"""Chebyshev series of the degree that suits samples, with an estimate of their noise.

The degree minimises the Bayesian information criterion (Schwarz 1978): higher ones fit
the rounding, lower ones miss motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from ...array_types import Real

#: Highest degree of a series.
_MAX_DEGREE = 14
#: Terms beyond a fit from which its noise is estimated.
_TERMS_BEYOND = 8
#: Standard errors by which the rate of a higher degree contradicts that of a lower one.
_CONTRADICTS = 2.0
#: Degree from which a series is likely to go on: what a higher one differs by counts, noise or not.
_MANY_TERMS = 5


@dataclass(frozen=True)
class Series:
    """A least-squares series and how it fits."""

    coefficients: Real  # (degrees, columns)
    criterion: float
    residual: Real  # (samples, columns)
    spread: float  # largest standard deviation of a displacement, for unit noise; see `spread_of`
    slow: float  # noise that a fit takes for motion, see `slow_noise`
    floor: float = np.inf  # rounding below which nothing is fitted
    rate: float = 0.0  # standard deviation of the rate at the epoch, for unit noise [1/s]
    bias: float = 0.0  # what the rate at the epoch lacks, see `_rate_bias` [1/s]

    @property
    def scatter(self) -> float:
        """Root mean square of the residual."""
        return float(np.sqrt(np.mean(self.residual**2)))


def design_matrix(times_s: Real, start_s: float, stop_s: float, degree: int) -> Real:
    """Return Chebyshev polynomials, x = -1 at start and 1 at stop, (samples, degrees)."""
    x = 2 * (times_s - start_s) / (stop_s - start_s) - 1
    return np.asarray(chebyshev.chebvander(x, degree), dtype=np.float64)


def criterion_of(squares: float, count: int, parameters: int, floor: float) -> float:
    """Return Schwarz's criterion of a fit; `floor` is unavoidable rounding."""
    variance = squares / max(count, 1) + floor**2
    return float(count * np.log(variance) + parameters * np.log(max(count, 2)))


def degrees_for(samples: int) -> range:
    """Return the degrees to try for this number of samples."""
    return range(min(_MAX_DEGREE, max((samples - 1) // 2, 0)) + 1)


class Burst(NamedTuple):
    """Times at which displacements are needed, and the one at which they are 0 [s]."""

    stop_s: float
    epoch_s: float


def spread_of(
    times_s: Real, start_s: float, stop_s: float, degree: int, burst: Burst
) -> tuple[float, float]:
    """Return the largest standard deviations of a displacement in a burst, and of the rate.

    For unit noise. The displacement is fit(t) - fit(epoch) where the fit contains the epoch, else
    both positions count; the rate is that at the epoch [1/s], 0 elsewhere.
    """
    if stop_s <= 0 or start_s >= burst.stop_s:
        return 0.0, 0.0
    design = design_matrix(times_s, start_s, stop_s, degree)
    inverse = np.linalg.pinv(design.T @ design)
    needed_s = np.linspace(max(start_s, 0.0), min(stop_s, burst.stop_s), 33)
    rows = design_matrix(needed_s, start_s, stop_s, degree)
    rate = 0.0
    if start_s <= burst.epoch_s <= stop_s:
        rows = rows - design_matrix(np.array([burst.epoch_s]), start_s, stop_s, degree)
        per_s = 2 / (stop_s - start_s)
        slopes = chebyshev.chebder(np.eye(degree + 1), axis=0)
        slope = chebyshev.chebval((burst.epoch_s - start_s) * per_s - 1, slopes) * per_s
        rate = float(np.sqrt(slope @ inverse @ slope))
    else:
        inverse = 2 * inverse
    return float(np.sqrt(np.einsum("ij,jk,ik->i", rows, inverse, rows).max())), rate


def fit_series(
    times_s: Real, values: Real, start_s: float, stop_s: float, floor: float, burst: Burst
) -> Series:
    """Fit a Chebyshev series of the degree with the least criterion to (samples, columns).

    All columns get one degree; x is -1 at `start_s` and 1 at `stop_s`. Nothing below the rounding
    `floor` is fitted.
    """
    fits: list[tuple[float, Real, Real]] = []
    offset = values[0]
    shifted = values - offset
    best = 0
    for degree in degrees_for(len(times_s)):
        design = design_matrix(times_s, start_s, stop_s, degree)
        solved = np.linalg.lstsq(design, shifted, rcond=None)[0]
        residual = shifted - design @ solved
        # one column's parameters against one column's samples, summed over columns
        criterion = criterion_of(
            float(np.sum(residual**2)), values.size, (degree + 1) * values.shape[1], floor
        )
        fits.append((criterion, solved, residual))
        best = best if fits[best][0] <= criterion else degree
        if degree - best > 3:
            break

    criterion, solved, residual = fits[best]
    solved[0] += offset
    spread, rate = spread_of(times_s, start_s, stop_s, best, burst)
    slow = slow_noise(times_s, residual, start_s, stop_s, best)
    bias = _rate_bias(times_s, shifted, start_s, stop_s, range(best, len(fits)), burst)
    return Series(solved, criterion, residual, spread, slow, floor, rate, bias)


def _rate_bias(
    times_s: Real, values: Real, start_s: float, stop_s: float, degrees: range, burst: Burst
) -> float:
    """Return how much the rate at the epoch lacks by the first of some degrees, 0 if not known to.

    A term of degree n that is lost in the noise of positions has a slope of n^2 times as much at
    the ends of a segment. Where a higher degree has another rate by more than the error of its own,
    there is such a term (Lepski 1991).
    """
    low = degrees[0]
    if low == 0 or not start_s <= burst.epoch_s <= stop_s:
        return 0.0
    terms = min(degrees[-1] + _TERMS_BEYOND, len(times_s) - 1)
    basis, upper = np.linalg.qr(design_matrix(times_s, start_s, stop_s, terms))
    parts = basis.T @ values
    per_s = 2 / (stop_s - start_s)
    slopes = chebyshev.chebder(np.eye(terms + 1), axis=0) * per_s
    at = chebyshev.chebval((burst.epoch_s - start_s) * per_s - 1, slopes)
    own = np.linalg.solve(upper.T, at)  # of polynomials that are orthogonal at the samples
    rates = np.cumsum(own[:, None] * parts, axis=0)
    bias = 0.0
    for n in degrees[1:3]:  # further ones know rates worse
        beyond = parts[n + 1 : n + 1 + _TERMS_BEYOND]
        apart = float(np.linalg.norm(rates[n] - rates[low]))
        if not len(beyond):
            break
        error = np.linalg.norm(own[: n + 1]) * np.sqrt(np.sum(beyond**2) / len(beyond))
        if low >= _MANY_TERMS or apart > _CONTRADICTS * float(error):
            bias = max(bias, apart)
    return bias


def slow_noise(times_s: Real, residual: Real, start_s: float, stop_s: float, degree: int) -> float:
    """Return the standard deviation of noise as slow as a fit: rms of the next terms.

    For white noise that is the scatter of the samples. Rounding of slow motion is a sawtooth with
    much less in the fit; motion that is not fitted adds to it.
    """
    highest = min(degree + _TERMS_BEYOND, len(times_s) - 1)
    if highest <= degree:
        return float(np.sqrt(np.mean(residual**2)))
    base = np.linalg.qr(design_matrix(times_s, start_s, stop_s, highest))[0][:, degree + 1 :]
    return float(np.sqrt(np.mean((base.T @ residual) ** 2)))
