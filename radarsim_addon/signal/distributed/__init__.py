# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames over workers: processes of this machine, or a Dask cluster.

In: the words of a command and the numbers of frames. Out: what each frame's worker answered (plain
JSON), in the order of completion. What a frame is, and how it is done, does not matter here.
"""

from .coordinator import run_frames
from .workers import Reply

__all__ = [
    "Reply",
    "run_frames",
]
