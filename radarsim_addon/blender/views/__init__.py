# SPDX-License-Identifier: GPL-3.0-or-later
"""One render: path classes, render passes, rows of pixels.

In: a window of the receiver's image. Out: rows of the path table.
"""

from .path_classes import TracedReplicate, TraceLimits, trace_replicate
from .power_beyond import PowerBeyond, look_beyond, orders_beyond, power_seen_beyond
from .requests import PathClass, Region, RenderRequest, View
from .rows import pixel_numbers, ray_origins, rows_of_replicate
from .view_camera import ViewCamera
from .view_scene import PathScene
from .view_setup import set_border
from .window import ViewWindow, replicate_seed

__all__ = [
    "PathClass",
    "PathScene",
    "PowerBeyond",
    "Region",
    "RenderRequest",
    "TraceLimits",
    "TracedReplicate",
    "View",
    "ViewCamera",
    "ViewWindow",
    "look_beyond",
    "orders_beyond",
    "pixel_numbers",
    "power_seen_beyond",
    "ray_origins",
    "replicate_seed",
    "rows_of_replicate",
    "set_border",
    "trace_replicate",
]
