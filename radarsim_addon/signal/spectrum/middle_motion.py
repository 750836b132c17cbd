# SPDX-License-Identifier: GPL-3.0-or-later
"""Phases of paths of constant rate about the middle of them all, for one transform of all pulses.

A ramp that is mixed with itself leaves K tau^2 / 2 cycles; elsewhere K is 0. At the time s, with
tau = (tau_c + beta_c s) + (x + y s), beta = beta_c + y, f = f_c + u and F = f_c - K tau_c,

    -f tau + K tau^2 / 2 = -f_c tau_0 + K tau_0^2 / 2       of each path, tau_0 = tau_c + x
        - u x - (F + u - K beta_c s) s Y                    a transform, Y = y - x K beta / F
        - (K x beta / F) (u - K beta_c s) s + K y^2 s^2 / 2 delay and rate tied together

and terms of s and u alone. The last line, 1e-4 rad for cars in a street, is added to the first
order by two transforms more of the same points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...array_types import Complex, Real
from .phase import phasors, reduce_cycles

#: Fraction of the tolerance for what the first order leaves out.
_SHARE = 0.1
#: Frequencies next to one another whose turns are put together.
_NEAR = 32


@dataclass(frozen=True)
class MiddleMotion:
    """The phase about the middle of paths with delays [s] and rates at the time 0.

    `delay_s` and `rate` are x and Y, `product` and `square` the factors of s (u - K beta_c s) and
    of s^2 of what remains, (n,) [cycles].
    """

    slope: float
    middle_s: float
    middle_rate: float
    reference_s: float
    delay_s: Real
    rate: Real
    product: Real
    square: Real

    @classmethod
    def of(
        cls, delay_s: Real, rate: Real, reference_s: float, slope: float, carrier_hz: float
    ) -> MiddleMotion:
        """For delays that are counted from a reference, and the slope K [Hz/s]."""
        middle = float(delay_s.min() + delay_s.max()) / 2
        middle_rate = float(rate.min() + rate.max()) / 2
        x, y = delay_s - middle, rate - middle_rate
        product = slope / (carrier_hz - slope * (reference_s + middle)) * x * rate
        return cls(
            slope, reference_s + middle, middle_rate, reference_s, x, y - product,
            product, slope / 2 * y**2,
        )  # fmt: skip

    def path_cycles(self) -> Real:
        """K tau_0^2 / 2, (n,), not reduced: the delays are of 1e-6 s, its whole cycles few."""
        return np.asarray(self.slope / 2 * (self.middle_s + self.delay_s) ** 2)

    def remains_rad(self, half_s: float, half_band_hz: float) -> float:
        """Largest phase that the transform leaves, for |s| <= half_s."""
        beyond_hz = half_band_hz + abs(self.slope * self.middle_rate) * half_s
        product = float(np.abs(self.product).max()) * half_s * beyond_hz
        return 2 * math.pi * (product + float(np.abs(self.square).max()) * half_s**2)

    def middle_hz(self, carrier_hz: float) -> float:
        """F of a carrier f_c."""
        return carrier_hz - self.slope * self.middle_s

    def beyond_hz(self, since_s: Real, offset_hz: Real) -> Real:
        """u - K beta_c s at times and frequencies, of their shape."""
        return np.asarray(offset_hz - self.slope * self.middle_rate * since_s)

    def common_turns(
        self, times_s: Real, interval_s: float, step_hz: float, count: int, carrier_hz: float
    ) -> Complex:
        """exp(j 2 pi cycles) that all paths share, (times, frequencies): at s = t + k dt and
        u = k df, k from -count//2 on.

        The phase is of the second degree in k, and only the first has to do with t: it is put
        together from a few k and their distances, since a cosine takes ten times a product.
        """
        k = np.arange(-(count // 2), count - count // 2)
        moved_s, middle_hz = self.middle_rate * interval_s, self.middle_hz(carrier_hz)
        walked_s = self.middle_rate * times_s
        alone = walked_s * (self.slope / 2 * walked_s - middle_hz)
        both = walked_s * (self.slope * moved_s - step_hz)
        square = moved_s * (self.slope / 2 * moved_s - step_hz)
        of_k = k * (square * k - step_hz * (self.middle_s - self.reference_s) - middle_hz * moved_s)
        near, far = np.arange(_NEAR), k[::_NEAR]
        turns = _turns(far[:, None] * both + alone)[:, None] * _turns(near[:, None] * both)
        turns = turns.reshape(-1, times_s.size)[:count]
        turns *= _turns(of_k)[:, None]
        return np.asarray(turns.T)

    def remains(self, values: Complex) -> Complex:
        """Strengths (2 sets, n) of what the transform of strengths (sets, n) leaves."""
        values = values * 2j * np.pi
        return np.concatenate([values * self.product, values * self.square])

    def join(self, sets: Complex, remains: Complex, since_s: Real, offset_hz: Real) -> None:
        """Add their transforms (2 sets, ...), which are overwritten, to it (sets, ...)."""
        product, square = np.split(remains, 2)
        product *= -since_s * self.beyond_hz(since_s, offset_hz)
        square *= since_s**2
        sets += product
        sets += square


def _turns(cycles: Real) -> Complex:
    """exp(j 2 pi cycles), of their shape; overwrites them."""
    return phasors(np.ones(1), reduce_cycles(cycles), np.empty(cycles.shape, dtype=np.complex128))


def negligible(remains_rad: float, tolerance: float) -> bool:
    """Whether so little phase needs not be added."""
    return remains_rad <= _SHARE * tolerance


def longest_s(remains_rad: float, half_s: float, tolerance: float) -> float:
    """Half of a burst for which the first order would do, from what remains over `half_s`."""
    return half_s * min(1.0, math.sqrt(2 * _SHARE * tolerance) / max(remains_rad, 1e-300))
