# SPDX-License-Identifier: GPL-3.0-or-later
"""State of the user's file: what Blender evaluates, and changes that are taken back.

`snapshot` reads all evaluated objects and instances into arrays, and brings them up to date by what
Blender reports as changed; `meshes` reads meshes. `settings_restorer` records changes of settings
and takes them back.
"""

from .meshes import (
    SurfacePoints,
    evaluated_mesh,
    marked_points,
    mesh_counts,
    read_mesh,
    read_numbers,
    surface_points,
    vertex_positions,
)
from .settings_restorer import SettingsRestorer
from .snapshot import (
    EvaluatedObject,
    Key,
    Layout,
    Shape,
    Snapshot,
    context_snapshot,
    evaluated_objects,
    evaluated_snapshot,
    follow_evaluations,
    forget_snapshot,
    ignore_evaluations,
    latest_snapshot,
    part_of_snapshot,
    read_all_again,
    slot_materials,
    take_snapshot,
    watch_evaluations,
)

__all__ = [
    "EvaluatedObject",
    "Key",
    "Layout",
    "SettingsRestorer",
    "Shape",
    "Snapshot",
    "SurfacePoints",
    "context_snapshot",
    "evaluated_mesh",
    "evaluated_objects",
    "evaluated_snapshot",
    "follow_evaluations",
    "forget_snapshot",
    "ignore_evaluations",
    "latest_snapshot",
    "marked_points",
    "mesh_counts",
    "part_of_snapshot",
    "read_all_again",
    "read_mesh",
    "read_numbers",
    "slot_materials",
    "surface_points",
    "take_snapshot",
    "vertex_positions",
    "watch_evaluations",
]
