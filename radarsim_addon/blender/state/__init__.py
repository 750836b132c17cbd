# SPDX-License-Identifier: GPL-3.0-or-later
"""State of the user's file: what Blender evaluates, and changes that are taken back.

`snapshot` reads all evaluated objects and instances into arrays, and brings them up to date by what
Blender reports as changed. `settings_restorer` records changes of settings and takes them back.
"""

from .settings_restorer import SettingsRestorer
from .snapshot import (
    EvaluatedObject,
    Key,
    Layout,
    Shape,
    Snapshot,
    evaluated_depsgraph,
    evaluated_mesh,
    evaluated_objects,
    follow_evaluations,
    ignore_evaluations,
    read_all_again,
    read_numbers,
    read_triangles,
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
    "evaluated_depsgraph",
    "evaluated_mesh",
    "evaluated_objects",
    "follow_evaluations",
    "ignore_evaluations",
    "read_all_again",
    "read_numbers",
    "read_triangles",
    "slot_materials",
    "take_snapshot",
    "watch_evaluations",
]
