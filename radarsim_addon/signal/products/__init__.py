# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a frame, and the writers that make files of it, by name.

`frame_result` has `FrameResult` (echoes, profiles, maps and what was detected in them) and the
registry of writers. `frame_products` writes npz, JSON, CSV, EXR, SigMF and HDF5; `point_clouds` the
targets of an array as PLY, PCD, Parquet and ROS 2 bag; `pictures` registers the writer of pictures.
Each file is written whole or not at all.
"""

from .frame_products import MOST_SUMMARY_BYTES, SUMMARY_ENDING, write_coverage_files, write_products
from .frame_result import FrameResult, frame_file, remove_stale, result_writer, write_result
from .point_clouds import check_cloud_packages, remove_bag, write_bag

__all__ = [
    "MOST_SUMMARY_BYTES",
    "SUMMARY_ENDING",
    "FrameResult",
    "check_cloud_packages",
    "frame_file",
    "remove_bag",
    "remove_stale",
    "result_writer",
    "write_bag",
    "write_coverage_files",
    "write_products",
    "write_result",
]
