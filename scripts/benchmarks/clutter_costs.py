# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost of a million rows over a clutter surface, and of what their pixels cover."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from radarsim_addon.signal.paths import PathRows, spread, steps_of

from .clock import half_range

_REPEATS = 5


def run_clutter(folder: Path, quick: bool = False) -> dict[str, Any]:
    """Processor seconds: weights of 1e6 bistatic rows, and footprints of 1e6 rows of a ground."""
    count = 100_000 if quick else 1_000_000
    from radarsim_addon.blender.paths.clutter_weights import ClutterWeights

    apply = ClutterWeights.apply
    found: dict[str, Any] = {}

    def timed(weights: Any, rows: PathRows, origin_m: Any, transmitter_m: Any) -> None:
        if not found:
            many = np.resize(rows[rows["order"] == 1], count)

            def weigh() -> None:
                apply(weights, many, origin_m, transmitter_m)

            found.update(_seconds("rows_s", weigh, count))
        apply(weights, rows, origin_m, transmitter_m)

    with mock.patch.object(ClutterWeights, "apply", timed):
        _bistatic_run(folder / "clutter")
    return {**found, **_footprints(count)}


def _seconds(name: str, once: Callable[[], None], rows: int) -> dict[str, float | None]:
    """Median of repeats by 1e6 rows and half their range."""
    each = []
    for _ in range(_REPEATS):
        start_s = time.process_time()
        once()
        each.append((time.process_time() - start_s) * 1e6 / rows)
    return {name: statistics.median(each), f"{name}_error": half_range(each)}


def _bistatic_run(folder: Path) -> None:
    """A level ground 2 m below, and a transmitter to the side of the receiver."""
    import bpy

    from radarsim_addon import blender as radarsim

    bpy.ops.wm.read_factory_settings(use_empty=True)
    radar = radarsim.add_radar()
    radar.rotation_euler.x -= 0.2
    for lamp in (item for item in bpy.data.objects if item.type == "LIGHT"):
        lamp.location.x += 3.0
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata([(-90, 1, -2), (90, 1, -2), (90, 99, -2), (-90, 99, -2)], [], [(0, 1, 2, 3)])
    ground = bpy.data.objects.new("Ground", mesh)
    bpy.context.scene.collection.objects.link(ground)
    material = radarsim.material("medium_dry_ground")
    radarsim.set_clutter(material, "constant_gamma")
    mesh.materials.append(material)
    radarsim.measure(radar, folder, width_px=256, height_px=256, replicates=1, max_reflections=1)


def _footprints(count: int) -> dict[str, float | None]:
    """Rows of a square view of a ground, spread over cells of 2.5 m."""
    from radarsim_addon.contract import TransmitterRecord
    from tests.signal import path_runs

    camera = path_runs.camera(path_runs.pose((0, 0, 0)), 10.0)
    emitter = TransmitterRecord(camera.matrix_world, 1.0)
    ground = path_runs.Plate("Ground", (0, 60, -8.0), (30, 0, 0), (0, 50, 0))
    # the ground fills three tenths of the view
    rows = path_runs.trace([ground], camera, emitter, round((count / 0.3) ** 0.5))

    def cover() -> None:
        for _ in spread(rows, steps_of(rows, camera, 1), 1.25, 0.1, 0.0):
            pass

    return _seconds("footprints_s", cover, rows.size)
