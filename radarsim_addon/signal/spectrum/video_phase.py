# SPDX-License-Identifier: GPL-3.0-or-later
"""Residual video phase of paths of constant rate in one type-3 transform.

A ramp that is mixed with itself leaves K tau^2 / 2 cycles. About the middle of all paths, with
tau = (tau_c + beta_c s) + (x + y s) at the time s and f = f_c + u,

    -f tau + K tau^2 / 2 = -f_c tau_0 + K tau_0^2 / 2               of each path, tau_0 = tau_c + x
        - (u - K beta_c s) x - (f - K [tau_c + beta_c s]) s y       a type-3 transform of x and y
        + K x y s + K y^2 s^2 / 2                                   delay and rate tied together

and terms of s and u alone. y (1 - K x / F) for y, F = f_c - K tau_c, takes the first of the last
two at the middle of the band and leaves -(K x y / F) s (u - K beta_c s). What remains, 1e-4 rad for
cars in a street, is added to the first order by two transforms more of the same points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...array_types import Complex, Real
from .grid import Ramp

#: Fraction of the tolerance for what the first order leaves out.
_SHARE = 0.1


@dataclass(frozen=True)
class VideoPhase:
    """The phase about the middle of paths with delays [s] and rates at the time 0.

    `delay_s` and `rate` are points of the transform, `product` and `square` the factors of s F_n
    and of s^2 of what remains, (n,) [cycles].
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
        cls, delay_s: Real, rate: Real, reference_s: float, ramp: Ramp, carrier_hz: float
    ) -> VideoPhase:
        """For delays that are counted from a reference."""
        slope = ramp.video_hz_per_s
        middle = float(delay_s.min() + delay_s.max()) / 2
        middle_rate = float(rate.min() + rate.max()) / 2
        x, y = delay_s - middle, rate - middle_rate
        carrier = carrier_hz - slope * (reference_s + middle)
        product = slope / carrier * x * y
        return cls(
            slope, reference_s + middle, middle_rate, reference_s, x, y - product,
            product, slope / 2 * y**2,
        )  # fmt: skip

    def path_cycles(self) -> Real:
        """K tau_i^2 / 2, (n,), reduced: the delays are of 1e-6 s, its whole cycles few."""
        return np.asarray(self.slope / 2 * (self.middle_s + self.delay_s) ** 2)

    def remains_rad(self, half_s: float, half_band_hz: float) -> float:
        """Largest phase that the transform leaves, for |s| <= half_s."""
        beyond_hz = half_band_hz + abs(self.slope * self.middle_rate) * half_s
        product = float(np.abs(self.product).max()) * half_s * beyond_hz
        return 2 * math.pi * (product + float(self.square.max()) * half_s**2)

    def targets_hz(self, since_s: Real, offset_hz: Real, carrier_hz: float) -> tuple[Real, Real]:
        """Frequencies of the delay, and of the rate over s."""
        fast_hz: Real = offset_hz - self.slope * self.middle_rate * since_s
        return fast_hz, fast_hz + (carrier_hz - self.slope * self.middle_s)

    def common_cycles(self, since_s: Real, offset_hz: Real, carrier_hz: float) -> Real:
        """Cycles that all paths share at s and f = carrier + offset, of their shape."""
        moved_s = self.middle_rate * since_s
        return np.asarray(
            -offset_hz * (self.middle_s - self.reference_s)
            - (carrier_hz + offset_hz) * moved_s
            + self.slope * moved_s * (self.middle_s + moved_s / 2)
        )

    def remains(self, values: Complex) -> Complex:
        """Strengths (2 sets, n) of what the transform of strengths (sets, n) leaves."""
        return np.concatenate([values * self.product, values * self.square])

    def joined(self, remains: Complex, since_s: Real, offset_hz: Real) -> Complex:
        """Their transforms (2 sets, ...) as they add to it, (sets, ...)."""
        product, square = np.split(remains, 2)
        # K x y s was taken off as s f x y K / F: too little where f is below F
        factor = -since_s * (offset_hz - self.slope * self.middle_rate * since_s)
        return np.asarray(2j * np.pi * (factor * product + since_s**2 * square))


def negligible(remains_rad: float, tolerance: float) -> bool:
    """Whether so little phase needs not be added."""
    return remains_rad <= _SHARE * tolerance


def longest_s(remains_rad: float, half_s: float, tolerance: float) -> float:
    """Half of a burst for which the first order would do, from what remains over `half_s`."""
    return half_s * min(1.0, math.sqrt(2 * _SHARE * tolerance) / max(remains_rad, 1e-300))
