# SPDX-License-Identifier: GPL-3.0-or-later
"""A run folder and its EXR files, opened and checked.

In: a folder. Out: `Run` and `RadarFrame` records, and float32 images of radiance.
"""

from .exr import CHUNK_LINES, ZIP, ExrHeader, exr_backend, read_exr, read_header, write_exr
from .run import MissingRender, RadarFrame, Run, frame_findings, open_run, shared_plan

__all__ = [
    "CHUNK_LINES",
    "ZIP",
    "ExrHeader",
    "MissingRender",
    "RadarFrame",
    "Run",
    "exr_backend",
    "frame_findings",
    "open_run",
    "read_exr",
    "read_header",
    "shared_plan",
    "write_exr",
]
