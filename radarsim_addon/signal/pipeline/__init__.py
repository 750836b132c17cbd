# SPDX-License-Identifier: GPL-3.0-or-later
"""A run folder to all its products, and the `radarsim` command.

In: a run folder and options. Out: results frame by frame, files, text on the console.
"""

from .cli import main
from .process import FrameResult, ProcessOptions, Progress, process_run

__all__ = [
    "FrameResult",
    "ProcessOptions",
    "Progress",
    "main",
    "process_run",
]
