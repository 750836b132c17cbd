# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a frame, and the writers that make files of it, by name.

`FrameResult` holds echoes, profiles, maps and what was detected in them. The rooms that write files
register their writers here.
"""

from .frame_result import FrameResult, frame_file, remove_stale, result_writer, write_result

__all__ = [
    "FrameResult",
    "frame_file",
    "remove_stale",
    "result_writer",
    "write_result",
]
