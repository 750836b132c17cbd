# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .cli import main
from .process import FrameResult, ProcessOptions, Progress, process_run

__all__ = [
    "FrameResult",
    "ProcessOptions",
    "Progress",
    "main",
    "process_run",
]
