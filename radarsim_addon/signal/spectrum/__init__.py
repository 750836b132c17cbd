# SPDX-License-Identifier: GPL-3.0-or-later
"""From scatterers to their spectrum: non-uniform FFT, moving scatterers, error report.

In: path lengths [m], complex amplitudes and a frequency grid [Hz]. Out: complex spectra, one for
each pulse, with an estimate of their numerical error.
"""

from .accumulator import (
    TOLERANCE,
    FrequencyGrid,
    Method,
    PulseShape,
    Ramp,
    ReceiveWindow,
    Spectrum,
    SpectrumAccumulator,
    SynthesisReport,
)
from .amplitudes import AmplitudeHistory
from .grid import CodeShape, check_finite, repeat_orders
from .nufft import Backend, nufft1, smooth_size

__all__ = [
    "TOLERANCE",
    "AmplitudeHistory",
    "Backend",
    "CodeShape",
    "FrequencyGrid",
    "Method",
    "PulseShape",
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
