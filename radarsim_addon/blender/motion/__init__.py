# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of bodies, sampled in Blender and fitted to the samples.

In: the animation. Out: motion records and deforming surfaces in metres and seconds. `burst_motion`
runs one frame: `bodies` tells on which object or instance each scatterer lies, `deforming` on which
face of a surface that deforms. `animation` finds keys and other corners of the animation, `samples`
takes poses and vertices clear of these, and `fits` fits them, until the error is small enough.
"""

from .animation import key_frames
from .bodies import Bodies
from .burst_motion import BurstMotion
from .samples import SamplingPlan

__all__ = [
    "Bodies",
    "BurstMotion",
    "SamplingPlan",
    "key_frames",
]
