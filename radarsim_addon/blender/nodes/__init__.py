# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar node groups and the materials made of them.

``ensure_group(kind)``, ``refresh_groups()``
    Find, make and update the groups.
``setup_emitter(light)``
    Make a Point light the transmitter.
``make_material(...)``, ``assign_radar_material(objects, preset)``, ``PRESETS``
    Materials with the Radar Material group.
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
