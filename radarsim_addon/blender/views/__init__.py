# SPDX-License-Identifier: GPL-3.0-or-later
"""Single renders: path classes, render passes, rows of pixels.

In: a window of the receiver's image. Out: rows of the path table. `path_classes` requests one
render after another, so that each pixel of a render holds at most one path. `view_scene` makes the
renders, with additions to the scene from `view_setup`; `joint_render` makes several views in one
render. `requests` has the records that go into a render and come out of it.
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
