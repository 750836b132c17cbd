# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of the benchmark that are made for it: one street, many instances, many objects, a mirror.

python -m scripts.benchmarks.workloads car|instances|traffic|objects|city|mirror OUTPUT.blend
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import bpy

from radarsim_addon import blender as radarsim
from radarsim_addon.blender.nodes import make_material
from scripts.make_canyon import CONCRETE, GROUND, add_box, add_mesh
from scripts.make_paper_scene import make_linear

FRAMES = 100
INSTANCES = 10**5
OBJECTS = 5000
#: Buildings of the city; its ground is one object more.
BUILDINGS = 2366
CAR_MPS = 15.0


def _drive(body: Any, x: float, y: float) -> None:
    for frame in (1, FRAMES + 25):
        body.location = (x, y + CAR_MPS * (frame - 1) / bpy.context.scene.render.fps, 0.0)
        body.keyframe_insert("location", frame=frame)
    make_linear(body)


def _ground(half_x: float, half_y: float) -> None:
    corners = [(x, y, 0.0) for x, y in (
        (-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y))]  # fmt: skip
    material = make_material("Ground", *GROUND, specularity=0.0, penetrable=False)
    radarsim.assign_material(add_mesh("Ground", corners, [(0, 1, 2, 3)]), material)


def _opaque() -> Any:
    return make_material("Wall", *CONCRETE, specularity=0.0, penetrable=False)


def car() -> None:
    """A car that drives away between two walls, 100 frames of a 77 GHz FMCW radar."""
    scene = bpy.context.scene
    _ground(20.0, 150.0)
    walls = [add_box(f"Wall {x}", (x, 0.0, -1.0), (x + 1.0, 120.0, 6.0)) for x in (-9.0, 8.0)]
    radarsim.assign_material(walls, _opaque())
    body = add_box("Car", (-0.9, -2.2, 0.2), (0.9, 2.2, 1.6))
    metal = make_material("Metal", 1e4, 1e4, specularity=0.0, penetrable=False)
    radarsim.assign_material(body, metal)
    scene.frame_start, scene.frame_end, scene.render.fps = 1, FRAMES, 25
    _drive(body, 1.0, 15.0)
    radarsim.add_radar(
        (0.0, 0.0, 0.7),
        (0.0, 50.0, 0.7),
        preset="automotive_77ghz",
        field_of_view_deg=39.6,
        range_stop_m=0.0,
        sampling_mode="paths",
        frame_mode="scene",
        width_px=64,
        height_px=64,
    )


def instances() -> None:
    """A field of instances of one box on the vertices of a mesh, seen from above."""
    side = round(INSTANCES**0.5)
    places = [(2.0 * (i % side) - side, 2.0 * (i // side) + 20.0, 0.0) for i in range(INSTANCES)]
    field = add_mesh("Field", places, [])
    stone = add_box("Stone", (-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))
    stone.parent, field.instance_type = field, "VERTS"
    radarsim.assign_material(stone, _opaque())
    bpy.context.scene.frame_end = 6
    _look((0.0, 0.0, 60.0), (0.0, 300.0, 0.0), 256, frame_mode="scene")


def traffic() -> None:
    """The same field, with one box that moves over it."""
    instances()
    car = add_box("Car", (-2.0, -1.0, 2.0), (2.0, 1.0, 4.0))
    radarsim.assign_material(car, _opaque())
    _drive(car, 0.0, 100.0)


def objects() -> None:
    """Boxes of concrete, each an object with a mesh of its own and an interior."""
    boxes = []
    for i in range(OBJECTS):
        x, y = 4.0 * (i % 71) - 142.0, 4.0 * (i // 71) + 20.0
        boxes.append(add_box(f"Box {i}", (x, y, 0.0), (x + 1.5, y + 1.5, 1.0 + i % 5)))
    radarsim.assign_material(boxes, radarsim.material("itu_concrete"))
    _look((0.0, 0.0, 60.0), (0.0, 200.0, 0.0), 32)


def city() -> None:
    """Opaque buildings on a ground, a million rays."""
    _ground(800.0, 1600.0)
    boxes = []
    for i in range(BUILDINGS):
        x, y = 30.0 * (i % 50) - 745.0, 30.0 * (i // 50) + 40.0
        boxes.append(add_box(f"House {i}", (x, y, -1.0), (x + 20.0, y + 20.0, 8.0 + i * 7 % 23)))
    radarsim.assign_material(boxes, _opaque())
    _look((0.0, 0.0, 150.0), (0.0, 500.0, 0.0), 1000)


def mirror() -> None:
    """A wall that fills half of the view, over a smooth road that lies under everything."""
    corners = [(x, y, 0.0) for x, y in ((-200, -200), (200, -200), (200, 200), (-200, 200))]
    smooth = make_material("Smooth", *GROUND, specularity=1.0, roughness=0.0, penetrable=False)
    radarsim.assign_material(add_mesh("Road", corners, [(0, 1, 2, 3)]), smooth)
    radarsim.assign_material(add_box("Wall", (-80.0, 40.0, 0.1), (80.0, 41.0, 60.0)), _opaque())
    _look((0.0, 0.0, 5.0), (0.0, 40.0, 5.0), 512, max_reflections=2)


def _look(
    location: tuple[float, ...], target: tuple[float, ...], side_px: int, **values: Any
) -> None:
    radarsim.add_radar(
        location,
        target,
        field_of_view_deg=60.0,
        preset="paper",
        sampling_mode="paths",
        width_px=side_px,
        height_px=side_px,
        replicates=1,
        **values,
    )


def main(name: str, output: str) -> None:
    """Build a scene and save it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scenes = (car, instances, traffic, objects, city, mirror)
    {one.__name__: one for one in scenes}[name]()
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(output).resolve()))


if __name__ == "__main__":
    main(*sys.argv[1:])
