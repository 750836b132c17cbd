# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's settings as Blender properties, and their way into plan records.

In: panel values in GHz, MHz, us, ms. Out: checked records in SI, float64.
"""

from .link_budget import ANTENNA_SETTINGS, read_system_settings
from .material import MATERIAL_PROPERTY, carrier_hz, choose_medium
from .paths import read_path_options
from .radar import PROGRESS_PROPERTY, SCENE_PROPERTY
from .waveform import WAVEFORM_SETTINGS

__all__ = [
    "ANTENNA_SETTINGS",
    "MATERIAL_PROPERTY",
    "PROGRESS_PROPERTY",
    "SCENE_PROPERTY",
    "WAVEFORM_SETTINGS",
    "carrier_hz",
    "choose_medium",
    "read_path_options",
    "read_system_settings",
]
