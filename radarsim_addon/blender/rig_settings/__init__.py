# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's settings in Blender: property groups that are made from the declared settings.

`radar` makes the property group of a rig from the dataclasses of the room `plan`. Its `settings`
reads and sets values in SI and float64; other functions make the checked records of a run.
`presets` applies the settings of a whole radar. `material` is the panel's view of a material.
`registration` registers all of them in Blender.
"""

from .material import MATERIAL_PROPERTY, choose_medium
from .presets import apply_preset, load_preset, read_preset, save_preset, set_values
from .radar import (
    EIRP_PROPERTY,
    PLACES,
    RADAR_PROPERTY,
    RADAR_SETTINGS,
    TEXT_CONTEXT,
    WAVEFORMS,
    Settings,
    beyond_band,
    carrier_hz,
    field_of,
    output_folder,
    own_link_budget,
    read_link_budget,
    read_measurement,
    read_path_options,
    settings,
    watts_to_dbm,
)
from .registration import MIRROR_PROPERTY, PROGRESS_PROPERTY, register, unregister

__all__ = [
    "EIRP_PROPERTY",
    "MATERIAL_PROPERTY",
    "MIRROR_PROPERTY",
    "PLACES",
    "PROGRESS_PROPERTY",
    "RADAR_PROPERTY",
    "RADAR_SETTINGS",
    "TEXT_CONTEXT",
    "WAVEFORMS",
    "Settings",
    "apply_preset",
    "beyond_band",
    "carrier_hz",
    "choose_medium",
    "field_of",
    "load_preset",
    "output_folder",
    "own_link_budget",
    "read_link_budget",
    "read_measurement",
    "read_path_options",
    "read_preset",
    "register",
    "save_preset",
    "set_values",
    "settings",
    "unregister",
    "watts_to_dbm",
]
