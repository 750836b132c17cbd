# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames over workers: processes of this machine, or a Dask cluster.

`run_frames` in `coordinator` takes the words of a command and the numbers of frames, shows progress
and findings, and gives each frame's answer (plain JSON) in the order of completion. `workers` has
the workers and the schedule of frames that fail or whose worker is lost. What a frame is, and how
it is done, does not matter here.
"""

from .coordinator import run_frames
from .workers import Reply

__all__ = [
    "Reply",
    "run_frames",
]
