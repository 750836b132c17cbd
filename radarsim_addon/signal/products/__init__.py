# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a frame, and the writers that make files of it, by name.

`frame_result` has `FrameResult` (echoes, profiles, maps and what was detected in them) and the
registry of writers. `frame_products` writes npz, JSON, CSV, EXR, SigMF and HDF5; `pictures`
registers the writer of pictures. Each file is written whole or not at all.
"""

from .frame_products import MOST_SUMMARY_BYTES, SUMMARY_ENDING, write_coverage_files, write_products
from .frame_result import FrameResult, frame_file, remove_stale, result_writer, write_result

__all__ = [
    "MOST_SUMMARY_BYTES",
    "SUMMARY_ENDING",
    "FrameResult",
    "frame_file",
    "remove_stale",
    "result_writer",
    "write_coverage_files",
    "write_products",
    "write_result",
]
