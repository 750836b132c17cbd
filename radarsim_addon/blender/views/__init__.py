# SPDX-License-Identifier: GPL-3.0-or-later
"""One render: path classes, render passes, rows of pixels.

In: a window of the receiver's image. Out: rows of the path table. `path_classes` asks for one
render after the other, so that each pixel of each holds one path at most. `view_scene` makes them,
with what `view_setup` adds to the scene; `joint_render` makes several views in one. `requests` has
what goes in and comes out of a render.
"""

from .path_classes import (
    PowerBeyond,
    TracedReplicate,
    TraceLimits,
    look_beyond,
    orders_beyond,
    pixel_numbers,
    power_seen_beyond,
    ray_origins,
    rows_of_replicate,
    trace_replicate,
)
from .requests import PathClass, Region, RenderRequest, View, ViewWindow, replicate_seed
from .view_scene import PathScene
from .view_setup import ViewCamera, set_border

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
