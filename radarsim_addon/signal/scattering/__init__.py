# SPDX-License-Identifier: GPL-3.0-or-later
"""The complex amplitude of a path in a channel: antenna gains, speckle. Nothing else decides
amplitudes.

In: `Paths`, a channel, pulse times [s]. Out: complex amplitudes (path, pulse) in sqrt(W), without
exp(-j 2 pi f0 tau).

`amplitudes` takes the root of the power with the gains of both antennas at each pulse (`Link`),
random phases, and the interference of paths that share scatterers. `surface_speckle` replaces the
random phases where a path's surface is known: scatterers in cells that are fixed to it;
`frame_speckle` does so for the paths of a frame, and adds the paths of rain.
"""

from .amplitudes import (
    Link,
    amplitude,
    amplitude_history,
    antenna_motion,
    interference_factors,
    path_amplitude,
    path_phasors,
    reverse_amplitudes,
    reverse_factors,
)
from .frame_speckle import (
    STILL_PLANE,
    ClutterSurfaces,
    FrameSpeckle,
    rain_paths,
    rain_rows,
    table_footprints,
)
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
