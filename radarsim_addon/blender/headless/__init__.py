# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs without a window: command line, jobs, console."""

from .console import ProgressLine, progress_text, quiet_blender
from .jobs import make_job

__all__ = [
    "ProgressLine",
    "make_job",
    "progress_text",
    "quiet_blender",
]
