# SPDX-License-Identifier: GPL-3.0-or-later
"""Phases of long paths: cycles reduced to (-1/2, 1/2] exactly, and phasors from them.

A path of 10 km at 77 GHz is 5e6 cycles; in a plain float64 product its phase has lost seven of
sixteen digits before the cosine is taken. Products here are formed in two parts (Dekker, Numer.
Math. 18, 224, 1971), so that the fraction of a cycle is that of the float64 length to about 1e-15
cycles, up to 1e10 cycles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS

#: Elements worked on at a time, so that temporaries stay in the processor's cache.
BLOCK = 1 << 13
#: Veltkamp's splitter: 2^27 + 1.
_SPLITTER = 134_217_729.0


@dataclass(frozen=True)
class CycleRate:
    """Cycles for each metre of path, head + tail, about 80 bits: `head` has the leading 26, so that
    its product with half of a float64 is exact.
    """

    head: float
    tail: float

    @property
    def rate(self) -> float:
        """Both parts as one number [1/m]."""
        return self.head + self.tail

    @classmethod
    def of(cls, frequency_hz: Fraction | float) -> CycleRate:
        """Of a frequency: f / c [1/m]."""
        exact = Fraction(frequency_hz) / Fraction(SPEED_OF_LIGHT_MPS)
        if exact == 0:
            return cls(0.0, 0.0)
        mantissa, exponent = math.frexp(float(exact))
        head = math.ldexp(round(math.ldexp(mantissa, 26)), exponent - 26)
        return cls(head, float(exact - Fraction(head)))


def reduced_cycles(length_m: Real, rate: CycleRate, out: Real | None = None) -> Real:
    """length x rate less the nearest whole number, exact to about 1e-15; any shape, into `out`."""
    high = length_m * _SPLITTER
    rest = high - length_m
    high -= rest  # leading 26 bits of the length
    np.subtract(length_m, high, out=rest)
    cycles = np.multiply(high, rate.head, out=out)  # exact
    cycles -= np.rint(cycles, out=high)
    rest *= rate.head  # exact
    cycles += rest
    np.multiply(length_m, rate.tail, out=rest)
    cycles += rest
    cycles -= np.rint(cycles, out=high)
    return cycles


def reduce_cycles(cycles: Real) -> Real:
    """Take the nearest whole number off, in place; any shape."""
    cycles -= np.rint(cycles)
    return cycles


def phasors(amplitude: NDArray[np.inexact[Any]], cycles: Real, out: Complex) -> Complex:
    """amplitude exp(j 2 pi cycles) into `out`; overwrites `cycles`, which should be reduced."""
    cycles *= 2 * np.pi
    np.cos(cycles, out=out.real)
    np.sin(cycles, out=out.imag)
    out *= amplitude
    return out
