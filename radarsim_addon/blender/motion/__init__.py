# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of bodies, sampled in Blender and fitted to the samples.

In: the animation. Out: motion records and deforming surfaces in metres and seconds.
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
