# SPDX-License-Identifier: GPL-3.0-or-later
"""From pixels to paths: the files of a frame become `Paths` with lengths [m] and range rates [m/s].

`paths_of_frame` opens a frame once (`FrameInput`) and yields its paths: rows of a path table, or
decoded rings. `ring_pixels` has the rays and solid angles of pixels; it turns the colours of a ring
into range and radiance, and two snapshots into range rates. `path_class_pixels` makes rows of the
path table from gated renders.
"""

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
    PixelRays,
    decode,
    image_places,
    in_view,
    pixel_grid,
    pixel_rays,
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
    "image_places",
    "in_view",
    "iter_path_chunks",
    "log_encoding_ratio",
    "open_frame",
    "pixel_grid",
    "pixel_rays",
    "range_rate",
    "single_vertex_m",
    "table_paths",
]
