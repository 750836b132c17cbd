# SPDX-License-Identifier: GPL-3.0-or-later
"""From pixels to paths: camera models, range encoding, path classes, two-snapshot range rates.

In: the colour channels of renders, the folder of a frame. Out: path lengths [m], range rates [m/s],
`Paths`, and `FrameInput`: a frame opened once.
"""

from .cameras import PixelRays, pixel_rays
from .path_class_pixels import PathClassPixels, TileReplicate, assemble_rows, log_encoding_ratio
from .paths_of_frame import (
    FrameInput,
    FrameTable,
    as_input,
    frame_paths,
    iter_path_chunks,
    open_frame,
    table_paths,
)
from .ring_pixels import (
    MAX_RANGE_RATE_MPS,
    Decoded,
    PixelGrid,
    decode,
    pixel_grid,
    range_rate,
    single_vertex_m,
)

__all__ = [
    "MAX_RANGE_RATE_MPS",
    "Decoded",
    "FrameInput",
    "FrameTable",
    "PathClassPixels",
    "PixelGrid",
    "PixelRays",
    "TileReplicate",
    "as_input",
    "assemble_rows",
    "decode",
    "frame_paths",
    "iter_path_chunks",
    "log_encoding_ratio",
    "open_frame",
    "pixel_grid",
    "pixel_rays",
    "range_rate",
    "single_vertex_m",
    "table_paths",
]
