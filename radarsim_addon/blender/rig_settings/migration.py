# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that radarsim 0.1 kept in the scene move to the radars when a file is opened.

Blender keeps the values of properties that nobody declares any more: up to 4.5 among the scene's
custom properties, from 5.0 on among its system properties.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...options import Declared
from ..plan import shortest_decimal
from ..scene import ACTIVE_RADAR_PROPERTY, is_transmitter, radar_of, radars
from .groups import write
from .radar import ANTENNA_SETTINGS, RADAR_PROPERTY, RADAR_SETTINGS, swept_hz

_KEY = "radarsim"
#: Names of 0.1 -> names of today's properties, where they differ.
_RENAMED = {
    "acquisition": "sampling_mode",
    "path_shifts": "replicates",
    "path_error_percent": "max_standard_error",
    "path_refine_by": "refine_for",
    "path_budget_s": "time_limit_s",
    "path_motion": "motion",
    "path_motion_samples": "motion_samples",
    "path_renders_per_burst": "visibility_updates",
    "path_code": "range_encoding",
    "path_amplitude": "amplitude_channel",
    "chirp_length_us": "chirp_duration_us",
    "chip_ns": "chip_duration_ns",
    "barker_length": "code_length",
    "radar_file": "waveform_file",
    "passes": "snapshots",
    "delta_t_ms": "snapshot_interval_ms",
    "use_system": "use_link_budget",
    "weighting": "amplitude_model",
    "output_dir": "output_folder",
}


def _stores(scene: Any) -> list[Any]:
    """Where Blender keeps the scene's settings: both, in a file of 4.5 that 5.0 has opened."""
    system = scene.bl_system_properties_get() if bpy.app.version >= (5, 0, 0) else None
    return [store for store in (system, scene) if store is not None and _KEY in store]


def migrate_scene(scene: Any) -> bool:
    """Move the settings that radarsim 0.1 kept in a scene to the scene's radars.

    Every radar gets them. A scene without a radar keeps them until it has one.

    Parameters
    ----------
    scene : bpy.types.Scene

    Returns
    -------
    bool
        Whether anything was moved.
    """
    stores = [] if scene.library is not None else _stores(scene)
    found = [radar for radar in radars(scene) if radar.library is None]
    if not stores or not found:
        return False
    old = stores[0][_KEY].to_dict()
    chosen = old.get("emitter")
    for radar in found:
        group = getattr(radar, RADAR_PROPERTY)
        _move(old, group, RADAR_SETTINGS)
        _move_dependent(old, group)
        for name in ("transmitter", "receiver"):
            _move_antenna(old.get(f"{name}_antenna", {}), getattr(group, name))
        group.camera = old.get("camera")
        if is_transmitter(chosen) and radar_of(chosen) == radar:
            group.light = chosen
            setattr(scene, ACTIVE_RADAR_PROPERTY, radar)
    for store in stores:
        del store[_KEY]
    return True


def _move(old: Mapping[str, Any], group: Any, declarations: Mapping[str, Declared]) -> None:
    """Values that only have another name, unit or storage."""
    shown = {item.shown_name: item for item in declarations.values()}
    for name, value in old.items():
        item = shown.get(_RENAMED.get(name, name))
        if item is None:
            continue
        if item.of.choices:  # by position, in an order that is that of today
            value = item.values[value]
        elif item.kind is float:
            value = shortest_decimal(value, item.exponent)
        write(group, item, item.kind(value))


def _move_dependent(old: Mapping[str, Any], group: Any) -> None:
    """Values that were made of several settings."""
    if old.get("sweep_by") == 1:  # by the FM rate
        rate, duration = old.get("fm_rate_mhz_per_us", 20.0), old.get("chirp_length_us", 2.5)
        bandwidth_hz = swept_hz(shortest_decimal(rate), shortest_decimal(duration))
        write(group, RADAR_SETTINGS["bandwidth_hz"], bandwidth_hz)
    rings = old.get("ring_count", 21) if old.get("ring_mode") == 1 else 0
    write(group, RADAR_SETTINGS["rings"], rings)
    by_rings = old.get("acquisition", 1) == 0
    reflections = old.get("max_bounces", 0) + 1 if by_rings else old.get("path_order", 1)
    write(group, RADAR_SETTINGS["max_reflections"], reflections)


def _move_antenna(old: Mapping[str, Any], group: Any) -> None:
    _move(old, group, ANTENNA_SETTINGS)
    gain_dbi = shortest_decimal(old.get("peak_gain_dbi", 20.0)) if old.get("set_peak") else None
    write(group, ANTENNA_SETTINGS["peak_gain_dbi"], gain_dbi)


@persistent
def migrate_file(*_: Any) -> None:
    """Move the settings of all scenes of the file that was opened."""
    for scene in bpy.data.scenes:
        migrate_scene(scene)
