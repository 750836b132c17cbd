# SPDX-License-Identifier: GPL-3.0-or-later
"""Delays of waves that meet a moving path before or after the time that counts.

A wave meets the path half its delay after it was emitted, and as much before it is received. For a
two-way length l(t) = l + r (t - t_m), r > 0 receding, that is

    c tau = l(t_m + s tau / 2),    tau = l / (c - s r / 2)

with s = 1 where t_m is a time of emission, -1 where it is one of reception. It is exact for a
constant rate, one reflection and antennas at one place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...array_types import Real
from ...physics.constants import SPEED_OF_LIGHT_MPS


@dataclass(frozen=True)
class Meeting:
    """When the wave meets the path: `side` 1 after its emission, -1 before its reception."""

    side: float

    def _halfway(self, rate_mps: Real) -> Real:
        """Half the rate over c, which takes the length to where the wave meets the path."""
        return self.side * rate_mps / (2 * SPEED_OF_LIGHT_MPS)

    def seen_mps(self, rate_mps: Real) -> Real:
        """c times the rate of the delay, of lengths that change at these rates, (n,) [m/s]."""
        return np.asarray(rate_mps / (1 - self._halfway(rate_mps)))

    def moved_m(self, length_m: Real, rate_mps: Real, later_s: Real | float = 0.0) -> Real:
        """c tau `later_s` later, less the length, (n,) [m]."""
        halfway = self._halfway(rate_mps)
        return np.asarray((rate_mps * later_s + length_m * halfway) / (1 - halfway))


EMISSION, RECEPTION = Meeting(1.0), Meeting(-1.0)
