# SPDX-License-Identifier: GPL-3.0-or-later
"""Small radar scenes and runs for the tests of the render job."""

from __future__ import annotations

import math
from collections.abc import Generator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from radarsim_addon import signal
from radarsim_addon.blender import nodes
from radarsim_addon.blender.plan import Measurement
from radarsim_addon.blender.rings import RingJob
from radarsim_addon.blender.scene import setup_rig
from radarsim_addon.blender.scene.visibility import animation_curves
from radarsim_addon.signal.radar import Burst, Waveform

WAVEFORM = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)
BURST = Burst(1000.0, 128)
#: Power of the light [W].
EIRP_W = 1e6


def new_scene() -> Any:
    """An empty scene with a radar at the origin that looks along +Y, +Z up."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    setup_rig(scene, eirp_w=EIRP_W)
    return scene


def ring_scene(pixels: int = 32) -> Any:
    """A radar with 4 m rings before a plate; the add-on must be registered."""
    made = new_scene()
    add_plate(10.0)
    settings = radar()
    settings.sampling_mode = "rings"
    settings.ring_step_m, settings.samples = 4.0, 1
    settings.width_px = settings.height_px = pixels
    return made


def radar() -> Any:
    """Return the properties of the radar's settings, as the panel shows them."""
    return bpy.data.objects["Radar"].radarsim


def finished(parts: Generator[None, None, Any]) -> Any:
    """Return what a function that yields after parts returns in the end."""
    while True:
        try:
            next(parts)
        except StopIteration as end:
            return end.value


def add_plate(
    y: float, size: float = 4.0, tilt_deg: float = 0.0, preset: str | None = "metal"
) -> Any:
    """A square plate whose centre is (0, y, 0), facing the radar, tilted back about X."""
    half = size / 2
    mesh = bpy.data.meshes.new("Plate")
    mesh.from_pydata(
        [(-half, 0, -half), (half, 0, -half), (half, 0, half), (-half, 0, half)],
        [],
        [(0, 1, 2, 3)],
    )
    plate = bpy.data.objects.new("Plate", mesh)
    plate.location = (0, y, 0)
    plate.rotation_euler = (-math.radians(tilt_deg), 0, 0)
    bpy.context.scene.collection.objects.link(plate)
    if preset is not None:
        nodes.assign_radar_material([plate], preset)
    return plate


def instance_of(
    content: Any, location: tuple[float, float, float] = (0.0, 0.0, 0.0), name: str = "Instance"
) -> Any:
    """An empty that shows a collection, or an object, which leaves the scene's collection."""
    if isinstance(content, bpy.types.Object):
        item, content = content, bpy.data.collections.new("Members")
        content.objects.link(item)
        bpy.context.scene.collection.objects.unlink(item)
    shown = bpy.data.objects.new(name, None)
    shown.instance_type, shown.instance_collection = "COLLECTION", content
    shown.location = location
    bpy.context.scene.collection.objects.link(shown)
    return shown


def move_steadily(item: Any, velocity: tuple[float, float, float], frames: int = 25) -> None:
    """Animate a straight motion [units/s] from frame 1 on, at the scene's frame rate."""
    item.keyframe_insert("location", frame=1)
    seconds = (frames - 1) / bpy.context.scene.render.fps
    start = item.location.copy()
    item.location = tuple(s + v * seconds for s, v in zip(start, velocity, strict=True))
    item.keyframe_insert("location", frame=frames)
    for curve in animation_curves(item.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    bpy.context.scene.frame_set(1)


def measurement(**changes: Any) -> Measurement:
    """One frame, automatic rings of 4 m, one pass, 32x32 at one sample, unless changed."""
    numbers: dict[str, Any] = {
        "waveform": WAVEFORM,
        "burst": BURST,
        "frames": (1,),
        "rings": 0,
        "ring_step_m": 4.0,
        "snapshots": 1,
        "width_px": 32,
        "height_px": 32,
        "samples": 1,
    }
    numbers.update(changes)
    return Measurement(**numbers)


def job_for(folder: Path, overwrite: bool = False, identity: str = "", **changes: Any) -> RingJob:
    """A job over the current scene, which resumes a run of the same `identity`."""
    scene, asked = bpy.context.scene, measurement(**changes)
    job = RingJob(scene, scene.view_layers[0], asked, folder, overwrite=overwrite)
    job.identity = identity
    return job


def run(folder: Path, overwrite: bool = False, limit: int | None = None, **changes: Any) -> RingJob:
    """Render; stop after `limit` renders if given."""
    with job_for(folder, overwrite, **changes) as job:
        for count, task in enumerate(job.pending()):
            if count == limit:
                break
            job.start(task)
            job.render(task)
            job.finish(task)
    assert job.unrestored == []
    return job


def images(folder: Path, frame: int = 1, snapshot_index: int = 0) -> list[dict[str, np.ndarray]]:
    """Channels of every ring, in float64."""
    radar_frame = signal.open_run(folder).frame(frame)
    return [
        {
            name: image.astype(np.float64)
            for name, image in radar_frame.image(ring, snapshot_index)[1].items()
        }
        for ring in range(radar_frame.rings)
    ]


def decoded(folder: Path, frame: int = 1, snapshot_index: int = 0) -> list[signal.Decoded]:
    """Every ring through the companion module."""
    radar_frame = signal.open_run(folder).frame(frame)
    return [
        signal.decode(*radar_frame.image(ring, snapshot_index)) for ring in range(radar_frame.rings)
    ]
