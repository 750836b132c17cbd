# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .cameras import PixelRays, pixel_rays
from .frame_paths import frame_paths, iter_path_chunks
from .path_class_pixels import GatePixels, Geometry, assemble_rows, log_code_ratio
from .ring_geometry import single_vertex_m
from .ring_pixels import Decoded, PixelGrid, decode, pixel_grid
from .snapshot_rate import MAX_RANGE_RATE_MPS, range_rate

__all__ = [
    "MAX_RANGE_RATE_MPS",
    "Decoded",
    "GatePixels",
    "Geometry",
    "PixelGrid",
    "PixelRays",
    "assemble_rows",
    "decode",
    "frame_paths",
    "iter_path_chunks",
    "log_code_ratio",
    "pixel_grid",
    "pixel_rays",
    "range_rate",
    "single_vertex_m",
]
