# SPDX-License-Identifier: GPL-3.0-or-later
"""The job that a scene's settings ask for: rings or paths."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from ..paths import PathJob
from ..rings import RingJob
from ..run import MeasurementJob
from ..settings import radar as properties
from ..settings import read_path_options, read_system_settings


def make_job(
    scene: Any,
    view_layer: Any,
    folder: Path,
    *,
    overwrite: bool = False,
    sampling_mode: str | None = None,
    overrides: dict[str, Any] | None = None,
    path_overrides: dict[str, Any] | None = None,
    system_file: Path | None = None,
) -> MeasurementJob:
    """Make the job, unprepared.

    Parameters
    ----------
    scene : bpy.types.Scene
    view_layer : bpy.types.ViewLayer
    folder
        Output folder.
    overwrite
        Remove another run's frames.
    sampling_mode
        "rings" or "paths"; None: the scene's setting.
    overrides, path_overrides
        Numbers from a command line, see `read_measurement` and `read_path_options`.
    system_file
        Power budget (JSON); None: the scene's own.

    Raises
    ------
    ConfigError
        The settings do not fit together.
    """
    settings = getattr(scene, properties.SCENE_PROPERTY)
    measurement = properties.read_measurement(scene, **(overrides or {}))
    system = read_system_settings(settings, measurement.waveform.wavelength_m, system_file)
    measurement = dataclasses.replace(measurement, system=system)
    antennas = {"camera": settings.camera, "emitter": settings.emitter}
    kind = sampling_mode or settings.sampling_mode.lower()
    if kind == "paths":
        options = read_path_options(settings, **(path_overrides or {}))
        return PathJob(
            scene, view_layer, measurement, folder, options, overwrite=overwrite, **antennas
        )
    return RingJob(scene, view_layer, measurement, folder, overwrite=overwrite, **antennas)
