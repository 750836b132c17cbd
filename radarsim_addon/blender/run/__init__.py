# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .run_job import RenderJob
from .scene_state import MeasurementSettings

__all__ = [
    "MeasurementSettings",
    "RenderJob",
]
