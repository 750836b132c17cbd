# SPDX-License-Identifier: GPL-3.0-or-later
"""Path sampling, one path per pixel: tiles, error estimate, table.

In: a plan and the scene. Out: the path table of each frame with its sidecar.
"""

from .path_job import PathJob

__all__ = [
    "PathJob",
]
