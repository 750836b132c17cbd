# SPDX-License-Identifier: GPL-3.0-or-later
"""Drafts of profile and map while a scene changes: paths of one reflection by few rays.

In: triangles and surfaces of a scene, antennas in metres. Out: expected power [W]. The window sends
scenes to a process of its own (`worker`) as messages.
"""

from .draft import (
    DRAFT,
    FAULT,
    LEVELS,
    MOST_CELLS,
    Draft,
    DraftLevel,
    Message,
    make_draft,
    mesh_message,
    read_message,
    scene_message,
    write_message,
)
from .scene import (
    Angles,
    DraftMesh,
    DraftPolygons,
    DraftScene,
    DraftSurface,
    FirstHits,
    SceneTriangles,
    SurfaceKind,
    ViewGrid,
    draft_rows,
    first_hits,
)

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
