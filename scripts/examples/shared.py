# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scripts of example scenes share: meshes, motion, files."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import bpy

Point = Sequence[float]
FOLDER = Path(__file__).resolve().parents[2] / "blend_examples"


def add_mesh(name: str, corners: Sequence[Point], faces: list[Any], material: Any = None) -> Any:
    """Add an object made of faces."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    if material is not None:
        mesh.materials.append(material)
    return item


def add_box(name: str, low: Point, high: Point, material: Any = None) -> Any:
    """Add a closed box between two corners."""
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1])
               for z in (low[2], high[2])]  # fmt: skip
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return add_mesh(name, corners, faces, material)


def add_prism(name: str, outline: Sequence[tuple[float, float]], half_width: float) -> Any:
    """Add the solid between x = -half_width and half_width of an outline (y, z), which turns
    from +Y to +Z."""
    count = len(outline)
    corners = [(x, y, z) for x in (-half_width, half_width) for y, z in outline]
    sides = [(i, (i + 1) % count, (i + 1) % count + count, i + count) for i in range(count)]
    left, right = tuple(reversed(range(count))), tuple(range(count, 2 * count))
    return add_mesh(name, corners, [left, right, *[tuple(reversed(side)) for side in sides]])


def add_ellipsoid(name: str, centre: Point, radii: Point, material: Any) -> Any:
    """Add an ellipsoid whose mesh has its true size."""
    around, rings = 24, 12
    angles = [
        (math.pi * ring / rings, 2 * math.pi * turn / around)
        for ring in range(1, rings)
        for turn in range(around)
    ]
    units = [(math.sin(a) * math.cos(b), math.sin(a) * math.sin(b), math.cos(a)) for a, b in angles]
    top, bottom = len(units), len(units) + 1
    corners = [
        [m + r * c for m, r, c in zip(centre, radii, unit)]
        for unit in (*units, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0))
    ]
    faces: list[tuple[int, ...]] = []
    for one in range(around):
        two, last = (one + 1) % around, (rings - 2) * around
        faces += [(top, one, two), (bottom, last + two, last + one)]
        for low in range(0, last, around):
            faces.append((low + one, low + around + one, low + around + two, low + two))
    return add_mesh(name, corners, faces, material)


def coloured(material: Any, colour: tuple[float, float, float]) -> Any:
    """Give a material its colour in Blender's window and in pictures; the radar ignores it."""
    material.diffuse_color = (*colour, 1.0)
    return material


def key(item: Any, path: str, keys: Mapping[int, Point], *, linear: bool = True) -> None:
    """Animate a property: its values by frames, with constant rates between them if linear."""
    from radarsim_addon.blender.scene import animation_curves

    for frame, value in keys.items():
        setattr(item, path, value)
        item.keyframe_insert(path, frame=frame)
    for curve in animation_curves(item.animation_data) if linear else ():
        if curve.data_path == path:
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"


def move(item: Any, start: Point, velocity_mps: Point, seconds: float) -> None:
    """Move an object at a constant velocity from frame 1 on."""
    fps = bpy.context.scene.render.fps
    stop = [a + v * seconds for a, v in zip(start, velocity_mps)]
    key(item, "location", {1: start, 1 + round(seconds * fps): stop})
    item.location = start


def spin(item: Any, turns_per_second: float, seconds: float, start: float = 0.0) -> None:
    """Turn an object about its Z axis at a constant rate from frame 1 on."""
    fps = bpy.context.scene.render.fps
    stop = start + 2 * math.pi * turns_per_second * seconds
    key(item, "rotation_euler", {1: (0, 0, start), 1 + round(seconds * fps): (0, 0, stop)})


def add_person(
    name: str, place: Point, velocity_mps: Point, material: Any, seconds: float, phase: int = 0
) -> Any:
    """Add a person who walks: body and head, arms and legs that swing. Return what moves them.

    `place` is below the body, `velocity_mps` is level; a step takes 14 frames.
    """
    walker = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(walker)
    parts = [
        add_ellipsoid(f"{name} Body", (0, 0, 1.2), (0.2, 0.13, 0.36), material),
        add_ellipsoid(f"{name} Head", (0, 0, 1.68), (0.09, 0.1, 0.12), material),
    ]
    frames = round(seconds * bpy.context.scene.render.fps)
    for limb, x, top_m, length_m, swing in (
        ("Left Leg", -0.1, 0.88, 0.84, 0.4), ("Right Leg", 0.1, 0.88, 0.84, -0.4),
        ("Left Arm", -0.27, 1.42, 0.6, -0.35), ("Right Arm", 0.27, 1.42, 0.6, 0.35),
    ):  # fmt: skip
        half = 0.06 if "Leg" in limb else 0.04
        part = add_box(f"{name} {limb}", (-half, -half, -length_m), (half, half, 0), material)
        part.location = (x, 0, top_m)
        ends = range(1 - 14 + phase, 1 + frames + 28, 14)
        swings = {end: ((-1) ** turn * swing, 0, 0) for turn, end in enumerate(ends)}
        key(part, "rotation_euler", swings, linear=False)  # Bezier between the ends: a pendulum
        parts.append(part)
    for part in parts:
        part.parent = walker
    walker.rotation_euler.z = math.atan2(velocity_mps[1], velocity_mps[0]) - math.pi / 2
    move(walker, place, velocity_mps, seconds)
    return walker


def new_scene(fps: int = 25) -> Any:
    """Empty the file; return its scene, in metres and with one frame."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.unit_settings.system = "METRIC"
    scene.render.fps = fps
    scene.frame_start, scene.frame_end = 1, 1
    return scene


def write(build: Callable[[], Any], output: Path) -> None:
    """Build a scene in an empty file and save it."""
    new_scene()
    build()
    bpy.context.scene.frame_set(1)
    # Compressed, and without the preview picture, which would differ from machine to machine.
    bpy.context.preferences.filepaths.file_preview_type = "NONE"
    bpy.ops.wm.save_as_mainfile(filepath=str(output.resolve()), compress=True)
    print(f"wrote {output}")
