# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes as users have them, for tests of paths: other lights, instances, all their values."""

from __future__ import annotations

from typing import Any

import bpy

from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs


def furnished_scene(clutter: bool) -> None:
    """A floor, a wall and a ball of foreign materials; with clutter: lamps, sky, fog, glow."""
    rs.new_scene()
    ph.field_of_view(50)
    ph.radar_at((0, 0, 2))
    grey = ph.principled("Grey", (0.5, 0.5, 0.5))
    ph.quad("Floor", [(-20, -5, 0), (20, -5, 0), (20, 30, 0), (-20, 30, 0)], grey)
    ph.quad("Wall", [(-20, 20, 0), (20, 20, 0), (20, 20, 20), (-20, 20, 20)], grey)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(1, 10, 2), radius=1)
    bpy.context.object.data.materials.append(ph.principled("Red", (0.8, 0.1, 0.1)))
    glow = ph.principled("Glow", (0.3, 0.3, 0.3))
    ph.quad("Lamp shade", [(-3, 12, 1), (-1, 12, 1), (-1, 12, 3), (-3, 12, 3)], glow)
    image = bpy.context.scene.render.image_settings
    # Set, not as Blender starts: its unset colour space cannot be put back by anybody.
    image.file_format = "OPEN_EXR"
    image.file_format = "PNG"
    if not clutter:
        return
    surface = next(n for n in glow.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    surface.inputs["Emission Color"].default_value = (1, 0.7, 0.2, 1)
    surface.inputs["Emission Strength"].default_value = 50.0
    glow.cycles.emission_sampling = "FRONT_BACK"
    for kind, power in (("POINT", 1e6), ("AREA", 500.0), ("SUN", 5.0), ("SPOT", 1e4)):
        light = bpy.data.objects.new(kind, bpy.data.lights.new(kind, kind))
        light.data.energy = power
        light.location = (3, 8, 6)
        bpy.context.scene.collection.objects.link(light)
    world = bpy.data.worlds.new("Sky")
    if world.node_tree is None:
        world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    sky = tree.nodes.new("ShaderNodeBackground")
    noise = tree.nodes.new("ShaderNodeTexNoise")  # a sky that must be sampled, like a picture
    tree.links.new(noise.outputs["Color"], sky.inputs["Color"])
    haze = tree.nodes.new("ShaderNodeVolumeScatter")
    haze.inputs["Density"].default_value = 0.05
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(sky.outputs[0], output.inputs["Surface"])
    tree.links.new(haze.outputs[0], output.inputs["Volume"])
    bpy.context.scene.world = world
    fog = bpy.data.materials.new("Fog")
    if fog.node_tree is None:
        fog.use_nodes = True
    fog.node_tree.nodes.clear()
    mist = fog.node_tree.nodes.new("ShaderNodeVolumePrincipled")
    end = fog.node_tree.nodes.new("ShaderNodeOutputMaterial")
    fog.node_tree.links.new(mist.outputs[0], end.inputs["Volume"])
    bpy.ops.mesh.primitive_cube_add(location=(0, 6, 2), size=4)
    bpy.context.object.name = "Zz fog"
    bpy.context.object.data.materials.append(fog)


def plate_collection(y: float = 0.0) -> Any:
    """A collection that is not in the scene, with one plate."""
    collection = bpy.data.collections.new("Plates")
    plate = ph.plate_at(y, 2.0, ph.rough_metal())
    bpy.context.scene.collection.objects.unlink(plate)
    collection.objects.link(plate)
    return collection


#: Where the plates stand that the tests of instances use.
PLACES = [(-3.0, 10.0, 0.0), (0.0, 14.0, 0.0), (4.0, 18.0, 0.0)]
