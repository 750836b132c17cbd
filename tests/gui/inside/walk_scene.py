# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that walk.py measures, and what it looks at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy


def add_objects() -> list[Any]:
    """Beside the factory scene's cube: a floor, a wall behind, a target that moves."""
    ops = bpy.ops.mesh
    made = []
    ops.primitive_plane_add(size=80.0, location=(0.0, 30.0, -2.0))
    made.append(bpy.context.object)
    ops.primitive_cube_add(size=4.0, location=(-6.0, 45.0, 0.5))
    made.append(bpy.context.object)
    ops.primitive_uv_sphere_add(radius=1.5, location=(5.0, 25.0, 0.0))
    target = bpy.context.object
    target.keyframe_insert("location", frame=1)
    target.location.y += 10.0
    target.keyframe_insert("location", frame=25)
    # At 24 frames a second: 10 m/s, receding.
    for curve in target.animation_data.action.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
        curve.extrapolation = "LINEAR"
    made.append(target)
    cube = bpy.data.objects["Cube"]
    cube.location = (-4.0, 18.0, 0.0)
    made.append(cube)
    bpy.context.scene.frame_set(1)
    return made


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def select(items: list[Any]) -> None:
    for item in bpy.context.view_layer.objects:
        item.select_set(item in items)
    bpy.context.view_layer.objects.active = items[0]
