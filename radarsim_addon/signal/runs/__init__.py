# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .exr import exr_backend, read_exr, write_exr
from .run import MissingRender, RadarFrame, Run, open_run

__all__ = [
    "MissingRender",
    "RadarFrame",
    "Run",
    "exr_backend",
    "open_run",
    "read_exr",
    "write_exr",
]
