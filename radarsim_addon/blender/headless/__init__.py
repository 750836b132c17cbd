# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs without a window: command line, jobs, console, frames for a coordinator.

`session` opens the file of a command line, makes the job that its settings ask for, and ends the
process. `render` measures and processes, or keeps a run open for a coordinator; `coverage` draws a
diagram, and `selfcheck` tests what measurements stand on. `scripting` is the interface for Python
scripts. `console` silences Blender.
"""

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
