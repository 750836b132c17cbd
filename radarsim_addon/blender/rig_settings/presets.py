# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets of a radar: applied to its settings, read from them, and saved as Blender's presets."""

from __future__ import annotations

import ast
import dataclasses
import math
import pprint
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy

from ...contract import LinkBudget
from ...errors import ConfigError
from ...options import Declared
from ...signal.radar import Burst, make_system
from ..plan import RadarPreset, merged
from ..scene import antennas_of, find_rig
from .radar import (
    ANTENNA_SETTINGS,
    RADAR_PROPERTY,
    RADAR_SETTINGS,
    WAVEFORMS,
    Settings,
    read,
    read_link_budget,
    read_measurement,
    settings,
)

_ANTENNAS = ("transmitter", "receiver")
#: Settings of the radar itself; the others say how a run is made.
_OF_RADAR = merged(Burst, LinkBudget, *WAVEFORMS.values()) | {
    name: RADAR_SETTINGS[name]
    for name in (
        "waveform_kind", "waveform_file", "use_link_budget", "range_start_m", "range_stop_m"
    )
}  # fmt: skip
_VIEW = ("width_px", "height_px")
_MOST_BYTES = 1 << 20
_HEAD = "# A radar of radarsim, in SI units. Read as data: nothing in it is executed.\npreset = "


def apply_preset(scene: bpy.types.Scene, radar: Any, preset: RadarPreset) -> None:
    """Apply a preset to a radar. All settings that presets hold are replaced.

    Settings of frames, sampling and output stay. Raises ConfigError for an unknown setting, a value
    out of bounds, or a radar that is linked from another file; SceneError if the radar has no
    camera or no transmitter.
    """
    view = settings(radar)
    rig = find_rig(scene, **antennas_of(scene, radar), any_projection=True)
    view.pulses = view.pulses  # refused here where the object is linked
    group = getattr(radar, RADAR_PROPERTY)
    _reset(group, _OF_RADAR)
    for name in _ANTENNAS:
        _reset(getattr(group, name), ANTENNA_SETTINGS)
    set_values(view, preset.settings)
    camera = rig.camera.data
    camera.type, camera.sensor_fit = "PERSP", "AUTO"
    camera.angle = math.radians(preset.field_of_view_deg)
    rig.emitter.data.energy = preset.eirp_w or _peak_eirp_w(scene, radar)


def set_values(view: Settings, values: Mapping[str, Any]) -> None:
    """Set settings by their names, in SI; a mapping has the settings of an antenna."""
    for name, value in values.items():
        setattr(view, name, value)


def _reset(group: Any, declarations: Mapping[str, Declared]) -> None:
    """Give settings their initial values."""
    for item in declarations.values():
        if item.optional:
            group.property_unset(f"use_{item.name}")
        if item.kind is not float:
            group.property_unset(item.shown_name)
        elif item.name in group:
            del group[item.name]


def _peak_eirp_w(scene: bpy.types.Scene, radar: Any) -> float:
    """Return the EIRP in the peak of the pattern by the link budget [W]; 1 W without one."""
    wavelength_m = read_measurement(scene, radar).waveform.wavelength_m
    record = read_link_budget(radar, wavelength_m)
    if record is None:
        return 1.0
    gain = make_system(record, wavelength_m).transmitter.peak_gain
    return float(record.transmit_power_w * gain / 10 ** (record.transmit_loss_db / 10))


def read_preset(scene: bpy.types.Scene, radar: Any, label: str) -> RadarPreset:
    """Return the settings of a radar as a preset with a label for the window."""
    rig = find_rig(scene, **antennas_of(scene, radar), any_projection=True)
    group = getattr(radar, RADAR_PROPERTY)
    names = {**_OF_RADAR, **{name: RADAR_SETTINGS[name] for name in _VIEW}}
    values: dict[str, Any] = {name: read(group, item) for name, item in names.items()}
    for name in _ANTENNAS:
        antenna = getattr(group, name)
        values[name] = {name: read(antenna, item) for name, item in ANTENNA_SETTINGS.items()}
    angle_deg = math.degrees(rig.camera.data.angle)
    return RadarPreset(label, "", angle_deg, values, float(rig.emitter.data.energy))


def save_preset(path: Path, preset: RadarPreset) -> None:
    """Write a preset as a file of Blender's presets, ``.py``."""
    text = pprint.pformat(dataclasses.asdict(preset), sort_dicts=False)
    path.write_text(f"{_HEAD}{text}\n", encoding="utf-8")


def load_preset(path: Path) -> RadarPreset:
    """Read a file that `save_preset` wrote. `apply_preset` checks the settings.

    The file is not executed; ConfigError if it contains anything else.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise ValueError("it is too long")
        text = path.read_text(encoding="utf-8").partition("preset =")[2]
        fields = ast.literal_eval(text.strip())
        preset = RadarPreset(**fields)
        angle, eirp_w = preset.field_of_view_deg, preset.eirp_w
        if not (0 < angle < 180 and (eirp_w is None or 0 < eirp_w < 1e30)):
            raise ValueError(f"a field of view of {angle} degrees, or a light of {eirp_w} W")
        if not isinstance(preset.settings, dict):
            raise TypeError("its settings are no dictionary")
    except (OSError, ValueError, TypeError, SyntaxError, RecursionError, MemoryError) as wrong:
        raise ConfigError(
            f"{path} holds no radar of radarsim ({wrong}). Remove it, or save the radar again: "
            "Radar > Presets > +."
        ) from wrong
    return preset
