# SPDX-License-Identifier: GPL-3.0-or-later
"""A run folder to all its products, and the `radarsim` command.

In: a run folder and options. Out: results frame by frame, files, text on the console.
"""

from ..results import FrameResult
from .cli import main
from .coverage import write_coverage
from .frame import process_frame
from .frame_processor import FrameProcessor
from .kept_frames import KeptFrame
from .options import ProcessOptions, ResolvedOptions
from .process import Progress, process_run
from .process_arguments import parse_process_arguments, process_options

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
