# SPDX-License-Identifier: GPL-3.0-or-later
"""A run folder and its EXR files, opened and checked.

In: a folder. Out: `Run` and `RadarFrame` records, and float32 images of radiance.
"""

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
