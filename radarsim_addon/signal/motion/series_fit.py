# SPDX-License-Identifier: GPL-3.0-or-later
"""Chebyshev series of the degree that suits samples, and what they say of their noise.

The degree is the one of the least Bayesian information criterion (Schwarz 1978): higher ones fit
the rounding, lower ones miss motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from ...array_types import Real

#: Highest degree of a series.
MAX_DEGREE = 14
#: Terms beyond a fit from which its noise is estimated.
_TERMS_BEYOND = 8


@dataclass(frozen=True)
class Series:
    """A least-squares series and how it fits."""

    coefficients: Real  # (degrees, columns)
    criterion: float
    residual: Real  # (samples, columns)
    spread: float  # largest standard deviation of fit(t) - fit(0), for unit noise
    slow: float  # noise that a fit takes for motion, see `slow_noise`


def design_matrix(times_s: Real, start_s: float, stop_s: float, degree: int) -> Real:
    """Chebyshev polynomials up to a degree, x = -1 and 1 at start and stop, (samples, degrees)."""
    x = 2 * (times_s - start_s) / (stop_s - start_s) - 1
    return np.asarray(chebyshev.chebvander(x, degree), dtype=np.float64)


def criterion_of(squares: float, count: int, parameters: int, floor: float) -> float:
    """Schwarz's criterion of a fit with this sum of squares; `floor` is rounding to live with."""
    variance = squares / max(count, 1) + floor**2
    return float(count * np.log(variance) + parameters * np.log(max(count, 2)))


def degrees_for(samples: int) -> range:
    """Degrees to try with so many samples."""
    return range(min(MAX_DEGREE, max((samples - 1) // 2, 0)) + 1)


def spread_of(design: Real) -> float:
    """Largest standard deviation of fit(t) - fit(first sample) for unit noise."""
    inverse = np.linalg.pinv(design.T @ design)
    difference = design - design[0]
    return float(np.sqrt(np.einsum("ij,jk,ik->i", difference, inverse, difference).max()))


def fit_series(times_s: Real, values: Real, start_s: float, stop_s: float, floor: float) -> Series:
    """Chebyshev series of the degree that the criterion chooses.

    Parameters
    ----------
    times_s
        (samples,) [s].
    values
        (samples, columns); all columns get one degree.
    start_s, stop_s
        What x = -1 and 1 stand for.
    floor
        Rounding below which nothing is fitted.
    """
    best: Series | None = None
    offset = values[0]
    shifted = values - offset
    worse = 0
    for degree in degrees_for(len(times_s)):
        design = design_matrix(times_s, start_s, stop_s, degree)
        solved = np.linalg.lstsq(design, shifted, rcond=None)[0]
        residual = shifted - design @ solved
        # one column's parameters against one column's samples, summed over columns
        criterion = criterion_of(
            float(np.sum(residual**2)), values.size, (degree + 1) * values.shape[1], floor
        )
        if best is None or criterion < best.criterion:
            solved[0] += offset
            best, worse = Series(solved, criterion, residual, 0.0, 0.0), 0
        else:
            worse += 1
            if worse > 3:
                break
    assert best is not None
    degree = len(best.coefficients) - 1
    spread = spread_of(design_matrix(times_s, start_s, stop_s, degree)) if degree else 0.0
    slow = slow_noise(times_s, best.residual, start_s, stop_s, degree)
    return Series(best.coefficients, best.criterion, best.residual, spread, slow)


def slow_noise(times_s: Real, residual: Real, start_s: float, stop_s: float, degree: int) -> float:
    """Standard deviation of noise as slow as a fit: rms of the terms that would come next.

    For white noise that is the scatter of the samples. Rounding of slow motion is a sawtooth, of
    which a fit sees much less; motion that is not fitted shows as much more.
    """
    highest = min(degree + _TERMS_BEYOND, len(times_s) - 1)
    if highest <= degree:
        return float(np.sqrt(np.mean(residual**2)))
    base = np.linalg.qr(design_matrix(times_s, start_s, stop_s, highest))[0][:, degree + 1 :]
    return float(np.sqrt(np.mean((base.T @ residual) ** 2)))
