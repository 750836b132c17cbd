# SPDX-License-Identifier: GPL-3.0-or-later
"""A plate over a planar mirror, for tests of paths that go over it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

HEIGHT_M, RANGE_M = 4.0, 40.0
#: Both are 4 m over the mirror, 40 m apart: the image is 8 m below.
IMAGE_M = np.array([0.0, 0.0, -HEIGHT_M])
THREE = {"max_reflections": 3}


def scene(ground: Any = None, *, view_deg: float = 30.0, plate_m: float = 0.4) -> Any:
    """Radar and a Lambert plate at one height over a mirror; returns the plate's material."""
    rs.new_scene()
    ph.field_of_view(view_deg)
    ph.radar_at((0, 0, HEIGHT_M))
    ground_material = ph.mirror() if ground is None else ground()
    corners = [(-60, -5, 0), (60, -5, 0), (60, 90, 0), (-60, 90, 0)]
    ph.quad("Ground", corners, ground_material)
    rough = ph.rough_metal()
    half, low = plate_m / 2, HEIGHT_M - plate_m / 2
    ph.quad(
        "Plate",
        [
            (-half, RANGE_M, low),
            (half, RANGE_M, low),
            (half, RANGE_M, low + plate_m),
            (-half, RANGE_M, low + plate_m),
        ],
        rough,
    )
    return rough


def measure(folder: Path, *, pixels: int = 128, **options: Any) -> ph.PathRun:
    return ph.run_paths(
        folder,
        width_px=pixels,
        height_px=pixels,
        options={**THREE, **options},
    )


def box(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> Any:
    """A rough metal box between two corners."""
    middle, half = (np.add(low, high) / 2, np.subtract(high, low) / 2)
    bpy.ops.mesh.primitive_cube_add(size=2, location=tuple(middle))
    item = bpy.context.object
    item.name, item.scale = name, tuple(half)
    item.data.materials.append(ph.rough_metal())
    return item


def stand_apart(x: float, y: float, z: float) -> None:
    """Put the transmitter at a place of its own."""
    bpy.context.view_layer.update()
    bpy.data.objects["Radar Emitter"].matrix_world = Matrix.Translation((x, y, z))
