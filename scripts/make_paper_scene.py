#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make blend_examples/paper_scene.blend: the experiment of Costa et al., from its Table I.

A monostatic radar 100 m above a square plane; two large, partly transparent immobile blocks whose
near faces lie at exactly 1000 m and 2500 m; between them a small metal target, level with the
radar, that recedes at 10 m/s along the line of sight. One Blender unit is 100 m.

    python scripts/make_paper_scene.py [OUTPUT.blend]

What the paper leaves open is chosen here, and said in blend_examples/README.md: the azimuths of
the blocks (each face is perpendicular to the line from the radar, so that its nearest point is
exactly at the stated range), their sizes, and the normalising length of the extinction (the scene's
depth, 5250 m).
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Any

if __package__ in (None, ""):  # run from a checkout: the package lies next to scripts/
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy

METRES_PER_UNIT = 100.0
RADAR_HEIGHT = 1.0  # units: 100 m
FRAMES_PER_SECOND = 24
ANIMATION_S = 10

# name, near face range, azimuth (left positive), width, height, depth: units and degrees
BLOCKS = (
    ("Block 1 km", 10.0, -9.0, 2.8, 2.0, 3.0),
    ("Block 2.5 km", 25.0, 4.5, 9.0, 2.0, 3.0),
)
TARGET_RANGE = 17.5
TARGET_AZIMUTH_DEG = 1.5
TARGET_EDGE = 0.24
TARGET_SPEED = 0.1  # units per second: 10 m/s

# The blocks stand this far above the plane: exactly coincident faces confuse Cycles' volume stack.
LIFT = 1e-4


def add_box(
    name: str,
    near_range: float,
    azimuth_deg: float,
    width: float,
    height: float,
    depth: float,
    bottom: float,
) -> Any:
    """A closed box whose near face is perpendicular to the radar's line of sight."""
    half = width / 2
    corners = [
        (x, y, z)
        for x in (near_range, near_range + depth)
        for y in (-half, half)
        for z in (bottom, bottom + height)
    ]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    centre = (near_range + depth / 2, 0.0, bottom + height / 2)
    mesh.from_pydata([tuple(c - m for c, m in zip(p, centre)) for p in corners], [], faces)
    mesh.validate()
    box = bpy.data.objects.new(name, mesh)
    azimuth = math.radians(azimuth_deg)
    box.location = (
        centre[0] * math.cos(azimuth),
        centre[0] * math.sin(azimuth),
        centre[2],
    )
    box.rotation_euler = (0, 0, azimuth)
    bpy.context.scene.collection.objects.link(box)
    return box


def build() -> None:
    """Build the scene in the current, empty file."""
    from radarsim_addon import blender as radarsim
    from radarsim_addon.blender.nodes import make_material

    scene = bpy.context.scene
    scene.unit_settings.system = "METRIC"
    scene.unit_settings.scale_length = METRES_PER_UNIT
    scene.render.fps, scene.render.fps_base = FRAMES_PER_SECOND, 1.0
    scene.frame_start, scene.frame_end = 1, 1

    reflective = make_material(
        "Highly reflective", n=1e4, kappa=1e4, specularity=0.5, roughness=0.6
    )
    lossy = make_material(
        "Partly transparent 1.4 + j1.0", n=1.4, kappa=1.0, specularity=0.5, roughness=0.6
    )

    half = 30.0
    plane_mesh = bpy.data.meshes.new("Plane")
    plane_mesh.from_pydata(
        [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)],
        [],
        [(0, 1, 2, 3)],
    )
    plane = bpy.data.objects.new("Plane", plane_mesh)
    plane.location = (26.0, 0.0, 0.0)
    scene.collection.objects.link(plane)
    plane.data.materials.append(reflective)

    for name, near_range, azimuth, width, height, depth in BLOCKS:
        add_box(name, near_range, azimuth, width, height, depth, LIFT).data.materials.append(lossy)

    target = add_box(
        "Target",
        TARGET_RANGE,
        TARGET_AZIMUTH_DEG,
        TARGET_EDGE,
        TARGET_EDGE,
        TARGET_EDGE,
        RADAR_HEIGHT - TARGET_EDGE / 2,
    )
    target.data.materials.append(reflective)
    animate(target)

    radar = radarsim.add_radar(
        (0, 0, RADAR_HEIGHT),
        preset="paper",
        sampling_mode="rings",
        ring_step_m=250.0,
        rings=21,
        snapshots=2,
        snapshot_interval_s=0.01,
        extinction_length_m=21 * 250.0,
        width_px=960,
        height_px=540,
        samples=1,
    )
    radar.rotation_euler = (math.pi / 2, 0, -math.pi / 2)  # boresight along +X, level
    scene.camera.data.sensor_fit = "HORIZONTAL"
    scene.camera.data.angle = math.radians(40)


def animate(target: Any) -> None:
    """Straight motion away from the radar at constant speed over the animation."""
    azimuth = math.radians(TARGET_AZIMUTH_DEG)
    start = target.location.copy()
    target.keyframe_insert("location", frame=1)
    travel = TARGET_SPEED * ANIMATION_S
    target.location = (
        start.x + travel * math.cos(azimuth),
        start.y + travel * math.sin(azimuth),
        start.z,
    )
    target.keyframe_insert("location", frame=1 + ANIMATION_S * FRAMES_PER_SECOND)
    make_linear(target)
    bpy.context.scene.frame_set(1)


def make_linear(item: Any) -> None:
    """Interpolate between the keys of an object on straight lines."""
    from radarsim_addon.blender.scene import animation_curves

    for curve in animation_curves(item.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = Path(__file__).resolve().parents[1] / "blend_examples" / "paper_scene.blend"
    parser.add_argument("output", nargs="?", type=Path, default=default)
    output = parser.parse_args(argv).output

    from radarsim_addon.blender import rig_settings as properties

    bpy.ops.wm.read_factory_settings(use_empty=True)
    properties.register()
    try:
        build()
        # Compressed, and without the preview picture, which would differ from machine to machine.
        bpy.context.preferences.filepaths.file_preview_type = "NONE"
        bpy.ops.wm.save_as_mainfile(filepath=str(output.resolve()), compress=True)
    finally:
        properties.unregister()
    print(f"wrote {output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
