# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar node groups, which make Cycles compute radar power, and the materials that use them.

`build` adds nodes to a tree from a definition in code. `groups` makes, finds and updates the
data-blocks. `interface` has Fresnel's equations as nodes. `radar_material` is the simple group of
the paper, with the range encoding, and the transmitter's Ring Emitter. `physical_material` has the
group of a medium at the carrier, and that of a thin sheet. During a run, these groups read custom
properties of the scene and of objects: `attributes`. `materials` puts the groups into materials and
lights. `shader_trees` finds what Cycles makes of the nodes of any material: volumes, displacement,
reflection.
"""

from .groups import DEFINITIONS, ensure_group, find_groups, group_version, refresh_groups
from .materials import (
    PRESETS,
    MaterialPreset,
    assign_radar_material,
    assign_to,
    is_radar_material,
    make_material,
    preset_material,
    setup_emitter,
)

__all__ = [
    "DEFINITIONS",
    "PRESETS",
    "MaterialPreset",
    "assign_radar_material",
    "assign_to",
    "ensure_group",
    "find_groups",
    "group_version",
    "is_radar_material",
    "make_material",
    "preset_material",
    "refresh_groups",
    "setup_emitter",
]
