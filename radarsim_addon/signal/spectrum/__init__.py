# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .accumulator import (
    TOLERANCE,
    FrequencyGrid,
    Method,
    Ramp,
    ReceiveWindow,
    Spectrum,
    SpectrumAccumulator,
    SynthesisReport,
)
from .grid import repeat_orders
from .moving import check_finite
from .nufft import Backend, nufft1, smooth_size

__all__ = [
    "TOLERANCE",
    "Backend",
    "FrequencyGrid",
    "Method",
    "Ramp",
    "ReceiveWindow",
    "Spectrum",
    "SpectrumAccumulator",
    "SynthesisReport",
    "check_finite",
    "nufft1",
    "repeat_orders",
    "smooth_size",
]
