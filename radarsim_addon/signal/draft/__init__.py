# SPDX-License-Identifier: GPL-3.0-or-later
"""Drafts of profile and map while a scene changes: paths of one reflection by few rays.

In: triangles and surfaces of a scene, antennas in metres. Out: expected power [W]. The window sends
scenes to a process of its own (`worker`) as messages.
"""

from .draft import LEVELS, MOST_CELLS, Draft, DraftLevel, make_draft
from .messages import Message, read_message, write_message
from .polygons import DraftPolygons
from .ray_hits import FirstHits, ViewGrid, first_hits
from .scene import DraftMesh, DraftScene, SceneTriangles, draft_rows
from .scene_messages import DRAFT, FAULT, mesh_message, scene_message
from .surfaces import Angles, DraftSurface, SurfaceKind

__all__ = [
    "DRAFT",
    "FAULT",
    "LEVELS",
    "MOST_CELLS",
    "Angles",
    "Draft",
    "DraftLevel",
    "DraftMesh",
    "DraftPolygons",
    "DraftScene",
    "DraftSurface",
    "FirstHits",
    "Message",
    "SceneTriangles",
    "SurfaceKind",
    "ViewGrid",
    "draft_rows",
    "first_hits",
    "make_draft",
    "mesh_message",
    "read_message",
    "scene_message",
    "write_message",
]
