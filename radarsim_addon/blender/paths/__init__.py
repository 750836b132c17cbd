# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .path_job import PathJob

__all__ = [
    "PathJob",
]
