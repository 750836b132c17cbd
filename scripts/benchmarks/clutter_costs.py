# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost of a million rows: hit points in float64, clutter, and what their pixels cover."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from radarsim_addon.arrays import take_rows
from radarsim_addon.signal.paths import PathRows, spread, steps_of

from .clock import half_range

_REPEATS = 5
#: Faces along a side of a ground of many: smaller than its pixels far away, larger close by.
_CELLS = 400


def run_clutter(folder: Path, quick: bool = False) -> dict[str, Any]:
    """Processor seconds of 1e6 rows: bistatic weights, hit points of two scenes, footprints."""
    count = 100_000 if quick else 1_000_000
    from radarsim_addon.blender.paths.clutter_weights import ClutterWeights
    from radarsim_addon.blender.paths.hit_points import Normals

    apply = ClutterWeights.apply
    found: dict[str, Any] = {}

    def timed(weights: Any, rows: PathRows, normals: Any, *places_m: Any) -> None:
        if not found:
            ones = np.resize(np.flatnonzero(rows["order"] == 1), count)
            many, known = rows[ones], Normals(count)
            known.add(np.arange(count), *(take_rows(normal, ones) for normal in normals.all()))
            found.update(_seconds("rows_s", lambda: apply(weights, many, known, *places_m), count))
        apply(weights, rows, normals, *places_m)

    with mock.patch.object(ClutterWeights, "apply", timed):
        _bistatic_run(folder / "clutter")
    for name, cells in (("hits_s", 1), ("fine_hits_s", _CELLS)):
        found |= _hit_points(name, folder / name, cells, count)
    return {**found, **_footprints(count)}


def _hit_points(name: str, folder: Path, cells: int, count: int) -> dict[str, float | None]:
    """Hit points of 1e6 rows on a ground of cells x cells faces, in parts as long as tiles."""
    from radarsim_addon.blender.paths.hit_points import HitPoints

    refine = HitPoints.refine
    found: dict[str, float | None] = {}

    def timed(hits: Any, rows: PathRows, *places_m: Any) -> Any:
        if not found:
            many = rows[np.arange(count) % rows.size]
            parts = [many[start : start + rows.size] for start in range(0, count, rows.size)]
            refine(hits, rows.copy(), *places_m)  # reads the meshes

            def move() -> None:
                for part in parts:
                    refine(hits, part, *places_m)

            found.update(_seconds(name, move, count))
        return refine(hits, rows, *places_m)

    with mock.patch.object(HitPoints, "refine", timed):
        _bistatic_run(folder, cells)
    return found


def _seconds(name: str, once: Callable[[], None], rows: int) -> dict[str, float | None]:
    """Median of repeats by 1e6 rows and half their range."""
    each = []
    for _ in range(_REPEATS):
        start_s = time.process_time()
        once()
        each.append((time.process_time() - start_s) * 1e6 / rows)
    return {name: statistics.median(each), f"{name}_error": half_range(each)}


def _bistatic_run(folder: Path, cells: int = 1) -> None:
    """A level ground of cells x cells faces 2 m below, and a transmitter to the receiver's side."""
    import bpy

    from radarsim_addon import blender as radarsim

    bpy.ops.wm.read_factory_settings(use_empty=True)
    radar = radarsim.add_radar(carrier_hz=77e9)
    radar.rotation_euler.x -= 0.2
    for lamp in (item for item in bpy.data.objects if item.type == "LIGHT"):
        lamp.location.x += 3.0
    mesh = bpy.data.meshes.new("Ground")
    x, y = np.meshgrid(np.linspace(-90, 90, cells + 1), np.linspace(1, 99, cells + 1))
    corners = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], axis=1)
    number = np.arange(x.size).reshape(x.shape)
    parts = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    faces = np.stack([part.ravel() for part in parts], axis=1)
    mesh.from_pydata(corners.tolist(), [], faces.tolist())
    ground = bpy.data.objects.new("Ground", mesh)
    bpy.context.scene.collection.objects.link(ground)
    material = radarsim.material("concrete")
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
