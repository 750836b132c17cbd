# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a radar, kept by its rig as ``object.radarsim``.

They are made from the dataclasses that declare them, and go along wherever the object goes: into
copies, other scenes, other files.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy

from ...contract import AntennaRecord, LinkBudget
from ...errors import ConfigError, SceneError
from ...options import Declared
from ...signal.radar import (
    PATTERNS,
    WAVEFORM_KINDS,
    Burst,
    Weather,
    load_radar,
)
from ..materials import refresh_materials
from ..plan import Measurement, PathOptions, RunSettings, merged, shortest_decimal
from ..scene import active_radar, is_transmitter
from .groups import Settings, property_group, write

RADAR_PROPERTY = "radarsim"
#: Kinds of waveforms with settings; samples of an arbitrary one come from a file.
WAVEFORMS = {name: kind for name, kind in WAVEFORM_KINDS.items() if name != "arbitrary"}
RADAR_SETTINGS = merged(
    RunSettings, Burst, *WAVEFORMS.values(), LinkBudget, Measurement, PathOptions, Weather
)
ANTENNA_SETTINGS = merged(AntennaRecord, *PATTERNS.values())
_ALL: dict[str, Declared | Mapping[str, Declared]] = {
    **RADAR_SETTINGS,
    "transmitter": ANTENNA_SETTINGS,
    "receiver": ANTENNA_SETTINGS,
}


def settings(radar: Any) -> Settings:
    """Return the settings of a radar by their names, in SI and float64.

    Parameters
    ----------
    radar : bpy.types.Object
        The rig.

    Returns
    -------
    Settings
        Its values are those of the panel, in SI.

    Raises
    ------
    ConfigError
        The properties are not registered.
    """
    if not hasattr(radar, RADAR_PROPERTY):
        raise ConfigError("Radars have no settings yet. Call radarsim_addon.register() first.")
    return Settings(getattr(radar, RADAR_PROPERTY), _ALL)


def carrier_hz(scene: Any) -> float:
    """Return the carrier of a scene's active radar.

    Parameters
    ----------
    scene : bpy.types.Scene

    Returns
    -------
    float
        Carrier [Hz]; without a radar, the initial one.
    """
    try:
        view = settings(active_radar(scene))
    except SceneError:
        return float(RADAR_SETTINGS["carrier_hz"].initial)
    if view.waveform_kind == "file":
        with contextlib.suppress(OSError, ConfigError):
            path = Path(bpy.path.abspath(view.waveform_file))
            return _carrier_of_file(path, path.stat().st_mtime_ns)
    return float(view.carrier_hz)


@functools.lru_cache(maxsize=8)
def _carrier_of_file(path: Path, _: int) -> float:
    """Carrier of a waveform file, read again after a change [Hz]."""
    return float(load_radar(path, Burst(1.0, 1)).waveform.carrier_hz)


def beyond_band(scene: Any) -> str:
    """Return what media do outside their band, for a scene's active radar.

    Parameters
    ----------
    scene : bpy.types.Scene

    Returns
    -------
    str
        Without a radar, the initial choice.
    """
    with contextlib.suppress(SceneError):
        return str(settings(active_radar(scene)).beyond_band)
    return "hold"


def _refresh_for_carrier(_: Any, __: Any = None) -> None:
    """Evaluate physical materials at the carrier of the active radar, and show them."""
    # What cannot be evaluated there, or lies beyond its band, is told by the panels and by the run.
    refresh_materials(carrier_hz(bpy.context.scene), beyond_band(bpy.context.scene))
    manager = bpy.context.window_manager
    for window in () if manager is None else manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()  # Blender does not draw the Material tab for a change in the sidebar


def _fm_rate(group: Any) -> float:
    numbers = Settings(group, RADAR_SETTINGS)
    return float(numbers.bandwidth_hz / numbers.chirp_duration_s * 1e-12)


def _set_fm_rate(group: Any, value: float) -> None:
    duration_us = RADAR_SETTINGS["chirp_duration_s"].to_shown(
        Settings(group, RADAR_SETTINGS).chirp_duration_s
    )
    write(group, RADAR_SETTINGS["bandwidth_hz"], swept_hz(shortest_decimal(value), duration_us))


def swept_hz(rate_mhz_per_us: float, duration_us: float) -> float:
    """Return the bandwidth [Hz] of a chirp rate; MHz/us times us round less than Hz/s times s."""
    return round(rate_mhz_per_us * duration_us * 1e6, 3)


#: Values of the three choices of quality.
_QUALITIES: tuple[dict[str, Any], ...] = (
    {"replicates": 2, "max_standard_error": 0.0, "time_limit_s": 0.0},
    {"replicates": 4, "max_standard_error": 0.0, "time_limit_s": 0.0},
    {"replicates": 4, "max_standard_error": 0.01},
)


def _quality(group: Any) -> int:
    numbers = Settings(group, RADAR_SETTINGS)
    return 2 if numbers.max_standard_error > 0 else int(numbers.replicates > 2)


def _set_quality(group: Any, number: int) -> None:
    if number != _quality(group):
        for name, value in _QUALITIES[number].items():
            write(group, RADAR_SETTINGS[name], value)


AntennaGroup = property_group("RadarAntennaSettings", ANTENNA_SETTINGS)
RadarGroup = property_group(
    "RadarSettings",
    RADAR_SETTINGS,
    {
        "camera": bpy.props.PointerProperty(
            name="Receiver",
            type=bpy.types.Object,
            poll=lambda _, item: item.type == "CAMERA",
            description="Choose the camera that receives. Empty: the one on the rig, else the "
            "scene's",
        ),
        "light": bpy.props.PointerProperty(
            name="Transmitter",
            type=bpy.types.Object,
            poll=lambda _, item: is_transmitter(item),
            description="Choose the Point light with the Ring Emitter. Empty: the one on the rig",
        ),
        "fm_rate_mhz_per_us": bpy.props.FloatProperty(
            name="FM Rate [MHz/us]",
            get=_fm_rate,
            set=_set_fm_rate,
            min=1e-6,
            precision=4,
            description="Set the bandwidth by the chirp rate K = B / T; 20 MHz/us are 20e12 Hz/s",
        ),
        "quality": bpy.props.EnumProperty(
            name="Quality",
            items=(
                ("draft", "Draft", "2 replicates of each tile, without refinement"),
                ("good", "Good", "4 replicates of each tile, without refinement"),
                ("error", "Error", "Refine tiles until the standard error is below a maximum"),
            ),
            get=_quality,
            set=_set_quality,
            description="Set replicates and refinement; Advanced has the single settings",
        ),
        "transmitter": bpy.props.PointerProperty(
            type=AntennaGroup, name="Transmitter", description="Antenna of the transmitter"
        ),
        "receiver": bpy.props.PointerProperty(
            type=AntennaGroup, name="Receiver", description="Antenna of the receiver"
        ),
    },
    dict.fromkeys(
        ("carrier_hz", "waveform_kind", "waveform_file", "beyond_band"), _refresh_for_carrier
    ),
)


def active_radar_property() -> Any:
    """Return the scene's property that says which radar is the active one."""
    return bpy.props.PointerProperty(
        name="Radar",
        type=bpy.types.Object,
        poll=lambda scene, item: (
            item.name in scene.objects
            and any(is_transmitter(child) for child in (item, *item.children))
        ),
        update=_refresh_for_carrier,
        description="Choose the radar that measures. Empty: the only one",
    )
