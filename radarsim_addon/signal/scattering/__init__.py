# SPDX-License-Identifier: GPL-3.0-or-later
"""The complex amplitude of a path: antenna gains, speckle.

In: `Paths` and the radar. Out: `Paths` with gains and phasors. Nothing else decides amplitudes.
"""

from .antenna_gains import Link
from .frame_speckle import FrameSpeckle
from .random_phases import path_phasors
from .surface_speckle import SpeckleReport

__all__ = [
    "FrameSpeckle",
    "Link",
    "SpeckleReport",
    "path_phasors",
]
