# SPDX-License-Identifier: GPL-3.0-or-later
"""Animated radar scenes and echoes in continuous time, in closed form.

The oracle takes the points that were rendered at t = 0, moves them as the *animation is meant* (a
formula, not Blender's float32 curves), and adds up echoes frequency by frequency in float64.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from radarsim_addon import signal
from radarsim_addon.signal.decoding import frame_paths
from radarsim_addon.signal.paths import PathRows
from radarsim_addon.signal.radar import Burst, Waveform
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

C0_MPS = 299_792_458.0
Motion = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(points (n, 3), times (m,)) -> positions (n, m, 3)."""


def waveform(carrier_hz: float) -> Waveform:
    """150 MHz of band at a carrier."""
    return Waveform(carrier_hz, 150e6, 1e-6, 160e6)


def interpolation(item: Any, kind: str, extrapolation: str = "CONSTANT", path: str = "") -> None:
    """Set what an object's keys do between and beyond them."""
    for curve in rs.animation_curves(item.animation_data):
        if path and curve.data_path != path:
            continue
        curve.extrapolation = extrapolation
        for point in curve.keyframe_points:
            point.interpolation = kind
            if kind == "QUAD":
                point.easing = "EASE_IN"
            elif kind == "SINE":
                point.easing = "EASE_IN_OUT"


def key(item: Any, path: str, *values: tuple[int, Any]) -> None:
    """Keyframes of a property: (frame, value)..."""
    for frame, value in values:
        setattr(item, path, value)
        item.keyframe_insert(path, frame=frame)


def empty(name: str, location: tuple[float, float, float], parent: Any = None) -> Any:
    """An empty, parented without a correction of its place."""
    item = bpy.data.objects.new(name, None)
    item.location = location
    item.parent = parent
    bpy.context.scene.collection.objects.link(item)
    return item


def facets(name: str, centres: list[tuple[float, float, float]], size: float) -> Any:
    """One mesh of small squares that face -Y."""
    half = size / 2
    corners: list[tuple[float, float, float]] = []
    faces = []
    for x, y, z in centres:
        start = len(corners)
        corners += [
            (x - half, y, z - half),
            (x + half, y, z - half),
            (x + half, y, z + half),
            (x - half, y, z + half),
        ]
        faces.append(tuple(range(start, start + 4)))
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(ph.lambert(0.5))
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@contextlib.contextmanager
def handler(called: Callable[..., None]) -> Iterator[None]:
    """Have a function called before each frame."""
    bpy.app.handlers.frame_change_pre.append(called)
    try:
        yield
    finally:
        kept = [one for one in bpy.app.handlers.frame_change_pre if one is not called]
        bpy.app.handlers.frame_change_pre[:] = kept


def scene_at(distance_m: float, width_m: float) -> None:
    """A radar at the origin that sees this width at this distance along +Y."""
    rs.new_scene()
    ph.field_of_view(math.degrees(2 * math.atan(width_m / 2 / distance_m)))


def measured(
    folder: Path, carrier_hz: float, burst: Burst, frame: int = 1, **options: Any
) -> tuple[np.ndarray, signal.Paths, ph.PathRun]:
    """A small run: rows of the table, and the same as paths."""
    changes = {
        name: options.pop(name)
        for name in ("width_px", "height_px", "snapshots", "identity")
        if name in options
    }
    changes = {"width_px": 16, "height_px": 16, **changes}
    run = ph.run_paths(
        folder,
        waveform=waveform(carrier_hz),
        burst=burst,
        frames=(frame,),
        options=options,
        **changes,
    )
    paths = frame_paths(signal.open_run(folder).frame(frame))
    return run.table(frame), paths, run


def echoes(lengths_m: np.ndarray, power_w: np.ndarray, carrier_hz: float) -> np.ndarray:
    """sum_i a_i exp(-j 2 pi f tau_i(t_m)), (pulses, frequencies), term by term.

    The spectra of the received pulses over the transmitted one: by Parseval the relative L2 of
    these is that of the I/Q samples of a flat spectrum.
    """
    frequencies = carrier_hz + np.linspace(-75e6, 75e6, 24)
    total = np.zeros((lengths_m.shape[1], frequencies.size), dtype=np.complex128)
    for number, frequency_hz in enumerate(frequencies):
        phase = -2j * np.pi * frequency_hz / C0_MPS * lengths_m
        total[:, number] = np.sqrt(power_w) @ np.exp(phase)
    return total


def relative_l2(found: np.ndarray, want: np.ndarray) -> float:
    """Norm of the difference over the norm."""
    return float(np.linalg.norm(found - want) / np.linalg.norm(want))


def iq_error(
    rows: PathRows,
    paths: signal.Paths,
    carrier_hz: float,
    burst: Burst,
    motion: Motion,
    radar: Motion | None = None,
) -> float:
    """Relative L2 of the echoes against those of the rendered points moved in closed form."""
    times_s = np.arange(burst.pulses) / burst.prf_hz
    found = echoes(paths.lengths.lengths_m(times_s, slice(None)), rows["power_w"], carrier_hz)
    points = motion(rows["last_scatterer_m"], times_s)
    antenna = np.zeros((1, 1, 3))
    if radar is not None:
        antenna = radar(antenna[0], times_s)
    want_m = 2 * np.linalg.norm(points - antenna, axis=-1)
    return relative_l2(found, echoes(want_m, rows["power_w"], carrier_hz))


def turned(points: np.ndarray, centre: Any, axis: int, angles: np.ndarray) -> np.ndarray:
    """Points turned about an axis through a centre by angles, (n, angles, 3)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    arm = points - np.asarray(centre, dtype=np.float64)
    result = np.repeat(arm[:, None], len(angles), axis=1)
    result[..., i] = arm[:, i, None] * np.cos(angles) - arm[:, j, None] * np.sin(angles)
    result[..., j] = arm[:, i, None] * np.sin(angles) + arm[:, j, None] * np.cos(angles)
    return result + centre
