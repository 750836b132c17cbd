# SPDX-License-Identifier: GPL-3.0-or-later
"""From scatterers to their spectrum: sums of exp(-j 2 pi f tau) over moving paths.

In: path lengths over a burst [m], complex amplitudes, a frequency grid [Hz]. Out: complex spectra,
one per pulse, with an estimate of their numerical error.

`accumulator` sorts paths: stationary ones are transformed once, moving ones in the way that costs
least: all pulses in one transform (`all_pulses`) or pulse by pulse (`pulse_sums`). One pulse is
phases, a non-uniform FFT (`nufft`) and its error (`transform`). `grid` has the frequencies, delays
and shapes of pulses, and polynomials of slow time for lengths and amplitudes.
"""

from .accumulator import TOLERANCE, Spectrum, SpectrumAccumulator
from .grid import (
    AmplitudeHistory,
    CodeShape,
    FrequencyGrid,
    PulseShape,
    Ramp,
    ReceiveWindow,
    check_finite,
    repeat_orders,
)
from .nufft import Backend, nufft1, smooth_size
from .pulse_sums import Method
from .transform import SynthesisReport, single_spectra

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
    "single_spectra",
    "smooth_size",
]
