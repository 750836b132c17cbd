# SPDX-License-Identifier: GPL-3.0-or-later
"""The complex amplitude of a path in a channel: antenna gains, speckle.

In: `Paths`, a channel, pulse times [s]. Out: complex amplitudes (path, pulse) in sqrt(W), without
exp(-j 2 pi f0 tau). Nothing else decides amplitudes.
"""

from .amplitudes import amplitude, amplitude_history, path_amplitude
from .antenna_gains import Link, antenna_motion
from .clutter_surfaces import STILL_PLANE, ClutterSurfaces
from .frame_speckle import FrameSpeckle, table_footprints
from .interference import interference_factors
from .rain_volume import rain_paths, rain_rows
from .random_phases import path_phasors
from .reverse_paths import reverse_amplitudes, reverse_factors
from .speckle_report import SpeckleReport

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
