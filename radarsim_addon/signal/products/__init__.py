# SPDX-License-Identifier: GPL-3.0-or-later
"""Writers of result files: npz, JSON, CSV, EXR, HDF5, SigMF.

In: the result of a frame. Out: files, each written whole or not at all. Importing this room
registers its writers; :func:`.results.write_result` calls them by name.
"""

from .detection_files import write_csv, write_detections
from .frame_products import write_profile_and_map, write_summary
from .hdf5 import write_hdf5
from .ring_products import write_products, write_ring_products
from .sigmf import write_sigmf, write_sigmf_recording

__all__ = [
    "write_csv",
    "write_detections",
    "write_hdf5",
    "write_products",
    "write_profile_and_map",
    "write_ring_products",
    "write_sigmf",
    "write_sigmf_recording",
    "write_summary",
]
