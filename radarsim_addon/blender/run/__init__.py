# SPDX-License-Identifier: GPL-3.0-or-later
"""A run: the code that ring sampling and path tracing share.

`run_job` surveys the frames, makes the plan, and drives the renders. `scene_state` sets the user's
scene for a measurement, restores it afterwards, and chooses the device. `shared_folder` is the
output folder, in which several processes claim frames by leases.
"""

from .run_job import MeasurementJob
from .scene_state import MeasurementSettings
from .shared_folder import FramesHeldError, scene_text

__all__ = [
    "FramesHeldError",
    "MeasurementJob",
    "MeasurementSettings",
    "scene_text",
]
