# SPDX-License-Identifier: GPL-3.0-or-later
"""A run's folder and its EXR files, opened and checked before a number of them is used.

`run` opens a folder: the plan, what is missing of it, and each render checked against its sidecar
and the plan. `exr` reads float32 images of radiance [W/m^2/sr] with one of two libraries, after it
has checked header and chunks of the file itself.
"""

from .exr import CHUNK_LINES, ZIP, ExrHeader, exr_backend, read_exr, read_header, write_exr
from .run import (
    FRAME_FIELDS,
    MissingRender,
    RadarFrame,
    Run,
    done_before_text,
    frame_findings,
    open_run,
    plan_changes,
    shared_plan,
)

__all__ = [
    "CHUNK_LINES",
    "FRAME_FIELDS",
    "ZIP",
    "ExrHeader",
    "MissingRender",
    "RadarFrame",
    "Run",
    "done_before_text",
    "exr_backend",
    "frame_findings",
    "open_run",
    "plan_changes",
    "read_exr",
    "read_header",
    "shared_plan",
    "write_exr",
]
