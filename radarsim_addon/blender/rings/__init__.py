# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .exr_check import verify_exr
from .render_result import save_render

__all__ = [
    "save_render",
    "verify_exr",
]
