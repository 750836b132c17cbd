# SPDX-License-Identifier: GPL-3.0-or-later
"""Writers of result files: npz, JSON, CSV, EXR and SigMF (`frame_products`), HDF5 (`hdf5`).

Each file is written whole or not at all. Importing this room registers its writers;
:func:`.results.write_result` calls them by name.
"""

from . import frame_products, hdf5
from .frame_products import SUMMARY_ENDING, write_coverage_files, write_products

__all__ = [
    "SUMMARY_ENDING",
    "frame_products",
    "hdf5",
    "write_coverage_files",
    "write_products",
]
