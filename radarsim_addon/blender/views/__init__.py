# SPDX-License-Identifier: GPL-3.0-or-later
"""One render: path classes, passes, rows of pixels.

In: a window of the receiver's image. Out: rows of the path table.
"""

from .path_classes import TracedView, TraceLimits, trace_view
from .requests import Gate, RenderRequest, View
from .rows import rows_of_view
from .view_scene import PathScene
from .window import ViewWindow, view_seed

__all__ = [
    "Gate",
    "PathScene",
    "RenderRequest",
    "TraceLimits",
    "TracedView",
    "View",
    "ViewWindow",
    "rows_of_view",
    "trace_view",
    "view_seed",
]
