# SPDX-License-Identifier: GPL-3.0-or-later
"""Drafts of profile and map while a scene changes: paths of one reflection by few rays.

`scene` makes rows of a path table of the triangles that rays meet, `draft` computes
expected power [W] from these and has the messages between the window and the process that drafts,
`worker` is that process.
"""

from .draft import (
    DRAFT,
    FAULT,
    LEVELS,
    DraftLevel,
    make_draft,
    mesh_message,
    scene_message,
)
from .scene import DraftScene

__all__ = [
    "DRAFT",
    "FAULT",
    "LEVELS",
    "DraftLevel",
    "DraftScene",
    "make_draft",
    "mesh_message",
    "scene_message",
]
