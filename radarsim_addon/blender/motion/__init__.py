# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .burst_motion import BurstMotion
from .samples import SamplingPlan

__all__ = [
    "BurstMotion",
    "SamplingPlan",
]
