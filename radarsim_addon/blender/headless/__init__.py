# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs without a window: command line, jobs, console, frames for a coordinator."""

from .console import quiet_blender
from .coverage import scene_coverage
from .render import FrameRenderer
from .session import leave_blender, make_job

__all__ = [
    "FrameRenderer",
    "leave_blender",
    "make_job",
    "quiet_blender",
    "scene_coverage",
]
