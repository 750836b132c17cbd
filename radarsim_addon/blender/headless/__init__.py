# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs without a window: command line, jobs, console, frames for a coordinator.

`session` opens the file of a command line, makes the job for its settings, and ends the process.
`render` measures and processes, or keeps a run open for a coordinator. `coverage` draws a coverage
diagram. `selfcheck` tests the behaviour of Cycles that measurements rely on. `scripting` is the
interface for Python scripts, and `scene_picture` draws the scene for it. `scene_copy` saves a copy
of the open file for `window_worker`, the process that measures for a window. `console` suppresses
the output of Blender.
"""

from .console import quiet_blender
from .coverage import scene_coverage
from .render import FrameRenderer
from .scene_copy import SceneCopy, expected_size, save_copy
from .session import leave_blender, make_job

__all__ = [
    "FrameRenderer",
    "SceneCopy",
    "expected_size",
    "leave_blender",
    "make_job",
    "quiet_blender",
    "save_copy",
    "scene_coverage",
]
