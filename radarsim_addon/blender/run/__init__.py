# SPDX-License-Identifier: GPL-3.0-or-later
"""A run: job, output folder, lock, the scene's settings for a measurement."""

from .run_job import MeasurementJob
from .scene_state import MeasurementSettings
from .shared_folder import FramesHeldError, scene_text

__all__ = [
    "FramesHeldError",
    "MeasurementJob",
    "MeasurementSettings",
    "scene_text",
]
