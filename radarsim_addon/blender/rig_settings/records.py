# SPDX-License-Identifier: GPL-3.0-or-later
"""What a radar's settings ask for, as checked records: measurement, paths, link budget, folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ...contract import AntennaRecord, LinkBudget
from ...errors import ConfigError, OutputError
from ...options import declared
from ...signal.radar import (
    PATTERNS,
    AnyWaveform,
    Burst,
    Weather,
    load_radar,
    make_system,
    read_system,
    self_contained,
)
from ..plan import Measurement, PathOptions
from ..scene import active_radar
from .groups import Settings
from .radar import RADAR_SETTINGS, WAVEFORMS, settings


def read_measurement(scene: Any, radar: Any = None, **given: Any) -> Measurement:
    """Return the measurement that a radar's settings ask for, without its link budget.

    Parameters
    ----------
    scene : bpy.types.Scene
    radar : bpy.types.Object
        The rig; None: the scene's active one.
    **given
        Values in place of the radar's own, by the names of the settings, in SI; ``frames`` is a
        tuple of frames.

    Returns
    -------
    Measurement
        Checked.

    Raises
    ------
    ConfigError
        Values that do not fit together.
    SceneError
        No radar, or several of which none is chosen.
    """
    view = settings(active_radar(scene) if radar is None else radar)
    burst = view.record(Burst, **_of(Burst, given))
    waveform, burst = _radar(view, given, burst)
    numbers: dict[str, Any] = (
        {"extinction_length_m": waveform.wavelength_m}
        if given.get("extinction", view.extinction) == "wavelength"
        else {}
    )
    numbers |= _of(Measurement, given)
    numbers["frames"] = given.get("frames") or _frames(scene, view)
    numbers["weather"] = view.record(Weather, **_of(Weather, given))
    return view.record(Measurement, waveform=waveform, burst=burst, **numbers)


def _of(kind: type[Any], given: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in given.items() if name in declared(kind)}


def _radar(view: Settings, given: dict[str, Any], burst: Burst) -> tuple[AnyWaveform, Burst]:
    kind = "file" if "waveform_file" in given else given.get("waveform_kind", view.waveform_kind)
    numbers = {
        name: value
        for name, value in given.items()
        if any(name in declared(other) for other in WAVEFORMS.values())
    }
    strange = [name for name in numbers if kind == "file" or name not in declared(WAVEFORMS[kind])]
    if strange:
        flags = ", ".join(RADAR_SETTINGS[name].flag for name in strange)
        raise ConfigError(
            f"{flags} given, which a waveform of kind {kind!r} does not have. Leave it out, or "
            "choose another waveform."
        )
    if kind != "file":
        return view.record(WAVEFORMS[kind], **numbers), burst
    file = str(given.get("waveform_file") or view.waveform_file)
    if not file.strip():
        raise ConfigError("No waveform file is chosen. Choose one in Radar > Waveform.")
    found = load_radar(Path(bpy.path.abspath(file)), burst)
    return found.waveform, found.burst


def _frames(scene: Any, view: Settings) -> tuple[int, ...]:
    if view.frame_mode == "current":
        return (scene.frame_current,)
    if view.frame_mode == "scene":
        return tuple(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))
    frames = range(view.frame_start, view.frame_end + 1, view.frame_step)
    if not frames:
        raise ConfigError(
            f"Frames {view.frame_start} to {view.frame_end} are none; expected the last one not "
            "before the first one."
        )
    return tuple(frames)


def read_path_options(radar: Any, **given: Any) -> PathOptions:
    """Return how paths are followed.

    Parameters
    ----------
    radar : bpy.types.Object
        The rig.
    **given
        Values in place of the radar's own, by the names of the settings, in SI.

    Returns
    -------
    PathOptions
        Checked.

    Raises
    ------
    ConfigError
        Values that do not fit together.
    """
    return settings(radar).record(PathOptions, **_of(PathOptions, given))


def _antenna_record(view: Settings) -> AntennaRecord:
    """One antenna's settings as a record, tables read in."""
    parameters = {
        name: bpy.path.abspath(value) if name == "file" else value
        for name in declared(PATTERNS[view.kind])
        if (value := getattr(view, name)) is not None or name == "element_exponent"
    }
    return self_contained(AntennaRecord(view.kind, parameters))


def read_link_budget(
    radar: Any, wavelength_m: float, file: str | Path | None = None
) -> LinkBudget | None:
    """Return a radar's link budget.

    Parameters
    ----------
    radar : bpy.types.Object
        The rig.
    wavelength_m
        Wavelength of the carrier [m].
    file
        Link budget (JSON); None: the radar's own.

    Returns
    -------
    LinkBudget or None
        Checked; None where the radar uses none.

    Raises
    ------
    ConfigError
        Values out of bounds, or a table or file that cannot be read.
    """
    record = own_link_budget(radar) if file is None else read_system(file)
    if record is not None:
        make_system(record, wavelength_m)  # checks it
    return record


def own_link_budget(radar: Any) -> LinkBudget | None:
    """Return the link budget of a radar's settings, whose antennas are not checked.

    Parameters
    ----------
    radar : bpy.types.Object
        The rig.

    Returns
    -------
    LinkBudget or None
        None where the radar uses none.

    Raises
    ------
    ConfigError
        Values out of bounds, or a table that cannot be read.
    """
    view = settings(radar)
    if not view.use_link_budget:
        return None
    names = ("transmitter", "receiver")
    antennas = {name: _antenna_record(getattr(view, name)) for name in names}
    return view.record(LinkBudget, **antennas)


def output_folder(radar: Any) -> Path:
    """Return the output folder as an absolute path.

    Parameters
    ----------
    radar : bpy.types.Object
        The rig.

    Returns
    -------
    Path
        Absolute; it may not exist.

    Raises
    ------
    OutputError
        None is set, or it is relative to a file that was never saved.
    """
    text = settings(radar).output_folder
    if not text.strip():
        raise OutputError("No output folder is set. Choose one in Radar > Measure > Output.")
    if text.startswith("//") and not bpy.data.filepath:
        raise OutputError(
            f"The output folder {text!r} is relative to the .blend file, which was never saved. "
            "Save the file, or choose an absolute folder in Radar > Measure > Output."
        )
    return Path(bpy.path.abspath(text))
