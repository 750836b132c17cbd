# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim coverage``: the coverage diagram of a scene's radar over its ground."""

from __future__ import annotations

import argparse
import math
import sys
import traceback
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...errors import ConfigError, RadarSimError
from ...findings import finding, finding_lines
from ...options import given
from ...physics.constants import STANDARD_EARTH_RADIUS_M
from ...signal.radar import (
    ConstantGain,
    Coverage,
    CoverageSetup,
    Mount,
    compute_coverage,
    make_system,
)
from ...terminal import error_line
from ..materials import ground_mirror
from ..plan import (
    COVERAGE_SETTINGS,
    CoverageRequest,
    check_unit_scale,
    coverage_request,
    shortest_decimal,
)
from ..rig_settings import read_link_budget, read_measurement
from ..scene import (
    GroundBelow,
    active_radar,
    antennas_of,
    check_scale,
    find_rig,
    ground_below,
    rigid_pose,
)
from ..state import evaluated_snapshot
from .console import quiet_blender
from .session import leave_blender, open_scene


def scene_coverage(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    request: CoverageRequest,
    radar: Any = None,
    *,
    values: Mapping[str, Any] | None = None,
    link_budget_file: Path | None = None,
) -> Coverage:
    """Compute the coverage diagram of a radar at the current frame.

    `radar` None is the active radar of the scene. `values` replace its settings, by their names, in
    SI. `link_budget_file` (JSON) replaces its link budget. Raises SceneError if there is no radar,
    or no level ground below it that reflects; ConfigError for values that do not fit together.
    """
    radar = active_radar(scene) if radar is None else radar
    measurement = read_measurement(scene, radar, **(values or {}))
    wavelength_m = measurement.waveform.wavelength_m
    record = read_link_budget(radar, wavelength_m, link_budget_file)
    system = None if record is None else make_system(record, wavelength_m)
    rig = find_rig(scene, **antennas_of(scene, radar), any_projection=True)
    snapshot = evaluated_snapshot(view_layer)
    units = check_unit_scale(shortest_decimal(scene.unit_settings.scale_length))
    light, camera = (snapshot.evaluated(one) for one in (rig.emitter, rig.camera))
    ground = ground_below(snapshot, np.array(camera.matrix_world)[:3, 3], request.ground)
    mounts = []
    for item, antenna in (
        (light, system and system.transmitter),
        (camera, system and system.receiver),
    ):
        check_scale(item, item.matrix_world)
        pose = rigid_pose(item.matrix_world, units)
        above_m = float(pose[2, 3]) - ground.height * units
        mounts.append(Mount(antenna or ConstantGain(), above_m, pose))
    height_m = request.rms_height_m
    if height_m is not None and not height_m >= 0:
        raise ConfigError(f"--rms-height is {height_m:g} m; expected 0 or more.")
    carrier_hz = measurement.waveform.carrier_hz
    setup = CoverageSetup(
        mounts[0],
        mounts[1],
        ground_mirror(ground.material, carrier_hz, measurement.beyond_band, height_m),
        wavelength_m,
        measurement.polarisation,
        math.inf if request.flat else STANDARD_EARTH_RADIUS_M,
    )
    found = compute_coverage(setup, request.height_m, request.range_m)
    reach_m, last_m = _reach_m(ground, mounts[1].pose, units), float(request.range_m[-1])
    if reach_m < last_m:
        ends = finding("coverage-ground-ends", ground.name, reach_m=reach_m, range_m=last_m)
        found = replace(found, findings=(*found.findings, ends))
    return found


def _reach_m(ground: GroundBelow, pose: Any, units: float) -> float:
    """Return how far the ground extends in the direction in which the radar looks [m]."""
    ahead = -pose[:2, 2] / (np.linalg.norm(pose[:2, 2]) or 1.0)
    return float(((ground.corners[:, :2] * units - pose[:2, 3]) @ ahead).max())


def run_and_leave(arguments: argparse.Namespace) -> None:
    """Draw the diagram of a command line, then end the process with the exit code."""
    try:
        with quiet_blender() as stream:
            _draw(arguments, stream)
        code = 0
    except RadarSimError as error:
        print(error_line(error), file=sys.stderr, flush=True)
        code = error.exit_code
    except Exception:
        traceback.print_exc()  # a defect; Blender would print it and quit with 0
        code = 1
    leave_blender(code)


def _draw(arguments: argparse.Namespace, stream: Any) -> None:
    from ...signal.pipeline import write_coverage  # pictures, which the other commands do without

    request = coverage_request(arguments)
    scene, view_layer, radar = open_scene(arguments)
    found = scene_coverage(
        scene,
        view_layer,
        request,
        radar,
        values=given(arguments, COVERAGE_SETTINGS),
        link_budget_file=arguments.link_budget,
    )
    folder = arguments.out or arguments.blend.absolute().parent
    for line in finding_lines(list(found.findings), (), whole=True):
        print(f"radarsim: {line}", file=stream, flush=True)
    for path in write_coverage(found, folder, request.curve_m):
        print(f"radarsim: wrote {path}", file=stream, flush=True)
