# SPDX-License-Identifier: GPL-3.0-or-later
"""A run folder to all its products, and the `radarsim` command.

`options` settles how a run is processed, `frame` takes one frame from its input to its result
without a file, and `process` does so for all frames of a folder and writes the products, keeping
those that are there already. `cli` has the command `radarsim`, the processing by workers, and the
text for people, `commands` the commands that process nothing (info, objects, antennas, merge).
"""

from ..products import FrameResult
from .cli import (
    FrameProcessor,
    frame_lines,
    kept_lines,
    main,
    parse_process_arguments,
    process_options,
)
from .commands import write_coverage
from .frame import process_frame
from .options import ProcessOptions, ResolvedOptions
from .process import Progress, process_run

__all__ = [
    "FrameProcessor",
    "FrameResult",
    "ProcessOptions",
    "Progress",
    "ResolvedOptions",
    "frame_lines",
    "kept_lines",
    "main",
    "parse_process_arguments",
    "process_frame",
    "process_options",
    "process_run",
    "write_coverage",
]
