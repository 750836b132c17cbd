# SPDX-License-Identifier: GPL-3.0-or-later
"""Make radarsim_addon/blender/assets: the materials for Blender's Asset Browser, with previews.

    python scripts/make_asset_library.py [--out DIR]

Needs bpy; use the oldest Blender that is supported, so that the newer ones can open the file. The
previews are small Cycles renders of a ball on a chequered floor; same Blender, same pictures.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
SIZE_PX = 96


def preview_scene(bpy: Any) -> Any:
    """A ball on a floor under a soft light; returns the ball."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = SIZE_PX
    scene.render.film_transparent = True
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGBA"
    scene.view_settings.view_transform = "Standard"
    cycles = scene.cycles
    cycles.samples, cycles.seed, cycles.use_denoising = 64, 0, False
    cycles.use_adaptive_sampling = False
    world = bpy.data.worlds.new("Preview")
    scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.25, 0.25, 0.25, 1)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32)
    ball = bpy.context.object
    for polygon in ball.data.polygons:
        polygon.use_smooth = True
    bpy.ops.mesh.primitive_plane_add(size=8, location=(0, 0, -1.01))
    floor = bpy.data.materials.new("Floor")
    if floor.node_tree is None:
        floor.use_nodes = True
    shader = next(n for n in floor.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    chequers = floor.node_tree.nodes.new("ShaderNodeTexChecker")
    chequers.inputs["Scale"].default_value = 24.0
    floor.node_tree.links.new(chequers.outputs["Color"], shader.inputs["Base Color"])
    bpy.context.object.data.materials.append(floor)
    light = bpy.data.lights.new("Key", "AREA")
    light.energy, light.size = 900.0, 3.0
    key = bpy.data.objects.new("Key", light)
    key.location, key.rotation_euler = (3, -3, 4), (math.radians(45), 0, math.radians(45))
    scene.collection.objects.link(key)
    camera = bpy.data.objects.new("View", bpy.data.cameras.new("View"))
    camera.location, camera.rotation_euler = (0, -5, 1.2), (math.radians(78), 0, 0)
    camera.data.lens = 60
    scene.collection.objects.link(camera)
    scene.camera = camera
    return ball


def add_preview(bpy: Any, ball: Any, material: Any, folder: Path) -> None:
    """Render a material on the ball and make that its preview."""
    ball.data.materials.clear()
    ball.data.materials.append(material)
    path = str(folder / "preview.png")
    bpy.context.scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path, check_existing=False)
    preview = material.preview_ensure()
    preview.image_size = (SIZE_PX, SIZE_PX)
    preview.image_pixels_float.foreach_set(list(image.pixels))
    bpy.data.images.remove(image)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=None, help="folder; default: the package's")
    options = parser.parse_args()
    sys.path.insert(0, str(ROOT))  # from a checkout, installed or not
    import bpy

    from radarsim_addon.blender.ui import material_panel

    out = options.out or material_panel.FOLDER
    out.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    ball = preview_scene(bpy)
    materials = material_panel.make_assets()
    with tempfile.TemporaryDirectory() as folder:
        for material in materials:
            add_preview(bpy, ball, material, Path(folder))
    ball.data.materials.clear()
    blend = out / material_panel.BLEND.name
    part = blend.with_suffix(".part.blend")
    bpy.data.libraries.write(str(part), set(materials), fake_user=True, compress=True)
    os.replace(part, blend)
    catalogues = out / material_panel.CATALOGUES.name
    catalogues.write_text(material_panel.catalogue_text(), encoding="utf-8", newline="\n")
    print(f"{len(materials)} materials, {blend.stat().st_size / 1e3:.0f} kB: {blend}")
    sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
