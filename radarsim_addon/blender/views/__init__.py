# SPDX-License-Identifier: GPL-3.0-or-later
"""One render: path classes, render passes, rows of pixels.

In: a window of the receiver's image. Out: rows of the path table.
"""

from .path_classes import TracedReplicate, TraceLimits, trace_replicate
from .power_beyond import PowerBeyond, look_beyond
from .requests import PathClass, RenderRequest, View
from .rows import pixel_numbers, ray_origins, rows_of_replicate
from .view_scene import PathScene
from .window import ViewWindow, replicate_seed

__all__ = [
    "PathClass",
    "PathScene",
    "PowerBeyond",
    "RenderRequest",
    "TraceLimits",
    "TracedReplicate",
    "View",
    "ViewWindow",
    "look_beyond",
    "pixel_numbers",
    "ray_origins",
    "replicate_seed",
    "rows_of_replicate",
    "trace_replicate",
]
