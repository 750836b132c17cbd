# SPDX-License-Identifier: GPL-3.0-or-later
"""A run folder and its EXR files, opened and checked.

In: a folder. Out: `Run` and `RadarFrame` records, and float32 images of radiance.
"""

from .exr import exr_backend, read_exr, write_exr
from .exr_header import CHUNK_LINES, ZIP, ExrHeader, read_header
from .measured_findings import frame_findings
from .run import MissingRender, RadarFrame, Run, open_run, shared_plan

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
