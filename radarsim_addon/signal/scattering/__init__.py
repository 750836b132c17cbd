# SPDX-License-Identifier: GPL-3.0-or-later
"""The complex amplitude of a path in a channel: antenna gains, speckle.

In: `Paths`, a channel, pulse times [s]. Out: complex amplitudes (path, pulse) in sqrt(W), without
exp(-j 2 pi f0 tau). Nothing else decides amplitudes.
"""

from .amplitudes import (
    Link,
    amplitude,
    amplitude_history,
    antenna_motion,
    path_amplitude,
    path_phasors,
)
from .frame_speckle import STILL_PLANE, ClutterSurfaces, FrameSpeckle, table_footprints
from .rain_volume import rain_paths, rain_rows
from .reverse_paths import interference_factors, reverse_amplitudes, reverse_factors
from .surface_speckle import SpeckleReport

__all__ = [
    "STILL_PLANE",
    "ClutterSurfaces",
    "FrameSpeckle",
    "Link",
    "SpeckleReport",
    "amplitude",
    "amplitude_history",
    "antenna_motion",
    "interference_factors",
    "path_amplitude",
    "path_phasors",
    "rain_paths",
    "rain_rows",
    "reverse_amplitudes",
    "reverse_factors",
    "table_footprints",
]
