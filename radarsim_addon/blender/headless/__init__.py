# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs without a window: command line, jobs, console, frames for a coordinator.

`session` opens the file of a command line, makes the job that its settings ask for, and ends the
process. `render` measures and processes, or keeps a run open for a coordinator; `coverage` draws a
diagram, and `selfcheck` tests what measurements stand on. `scripting` is the interface for Python
scripts. `scene_copy` saves a copy of the open file for `window_worker`, the process that measures
for a window. `console` silences Blender.
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
