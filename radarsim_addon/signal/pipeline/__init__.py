# SPDX-License-Identifier: GPL-3.0-or-later
"""A run folder to all its products, and the `radarsim` command.

In: a run folder and options. Out: results frame by frame, files, text on the console.
"""

from ..results import FrameResult
from .cli import FrameProcessor, main, parse_process_arguments, process_options
from .commands import write_coverage
from .frame import process_frame
from .options import ProcessOptions, ResolvedOptions
from .process import KeptFrame, Progress, process_run

__all__ = [
    "FrameProcessor",
    "FrameResult",
    "KeptFrame",
    "ProcessOptions",
    "Progress",
    "ResolvedOptions",
    "main",
    "parse_process_arguments",
    "process_frame",
    "process_options",
    "process_run",
    "write_coverage",
]
