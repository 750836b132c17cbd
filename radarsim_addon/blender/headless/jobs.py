# SPDX-License-Identifier: GPL-3.0-or-later
"""The job that a scene's settings ask for: rings or paths."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..paths import PathJob
from ..rig_settings import read_link_budget, read_measurement, read_path_options, settings
from ..rings import RingJob
from ..run import MeasurementJob
from ..scene import active_radar, antennas_of


def make_job(
    scene: Any,
    view_layer: Any,
    folder: Path,
    *,
    radar: Any = None,
    overwrite: bool = False,
    given: Mapping[str, Any] | None = None,
    link_budget_file: Path | None = None,
) -> MeasurementJob:
    """Make the job, unprepared.

    Parameters
    ----------
    scene : bpy.types.Scene
    view_layer : bpy.types.ViewLayer
    folder
        Output folder.
    radar : bpy.types.Object
        The rig; None: the scene's active one.
    overwrite
        Replace any run in the folder.
    given
        Values in place of the radar's settings, by their names, in SI; see `read_measurement`.
    link_budget_file
        Link budget (JSON); None: the radar's own.

    Returns
    -------
    MeasurementJob
        Job of the chosen sampling mode. `prepare` is still to be called.

    Raises
    ------
    ConfigError
        The settings do not fit together.
    SceneError
        No radar, or several of which none is chosen.
    """
    radar = active_radar(scene) if radar is None else radar
    values = dict(given or {})
    measurement = read_measurement(scene, radar, **values)
    link_budget = read_link_budget(radar, measurement.waveform.wavelength_m, link_budget_file)
    measurement = dataclasses.replace(measurement, link_budget=link_budget)
    antennas = antennas_of(scene, radar)
    if sampling_mode(radar, values) == "paths":
        options = read_path_options(radar, **values)
        return PathJob(
            scene, view_layer, measurement, folder, options, overwrite=overwrite, **antennas
        )
    return RingJob(scene, view_layer, measurement, folder, overwrite=overwrite, **antennas)


def sampling_mode(radar: Any, given: Mapping[str, Any]) -> str:
    """Return the sampling mode of a radar, unless values in place of its settings name another."""
    return str(given.get("sampling_mode", settings(radar).sampling_mode))
