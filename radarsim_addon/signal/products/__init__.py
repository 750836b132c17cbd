# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .frame_products import remove_stale, write_results
from .ring_products import write_products

__all__ = [
    "remove_stale",
    "write_products",
    "write_results",
]
