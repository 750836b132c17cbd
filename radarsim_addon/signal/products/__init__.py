# SPDX-License-Identifier: GPL-3.0-or-later
"""Writers of result files: HDF5, SigMF, npz, JSON, CSV, EXR.

In: the result of a frame. Out: files, each written whole or not at all.
"""

from .frame_products import remove_stale, write_results
from .ring_products import write_products

__all__ = [
    "remove_stale",
    "write_products",
    "write_results",
]
