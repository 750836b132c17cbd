# SPDX-License-Identifier: GPL-3.0-or-later
"""A white furnace: a surface under a sky of radiance 1, seen by ordinary Cycles renders."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import numpy as np

from radarsim_addon.blender.headless import quiet_blender

from .case import Bench

SIDE_PX = 32


def sky_scene(bounces: int = 64) -> Any:
    """A scene whose sky is red above the horizon (z = 0), green below it and blue everywhere."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    _settings(scene, bounces)
    world = bpy.data.worlds.new("Furnace")
    if world.node_tree is None:
        world.use_nodes = True
    scene.world = world
    world.cycles.sampling_method = "NONE"  # a map of the sky for sampling takes a second to make
    tree = world.node_tree
    tree.nodes.clear()
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    place = tree.nodes.new("ShaderNodeTexCoord")
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(place.outputs["Generated"], split.inputs[0])
    colour = tree.nodes.new("ShaderNodeCombineColor")
    colour.inputs["Blue"].default_value = 1.0
    for operation, channel in (("GREATER_THAN", "Red"), ("LESS_THAN", "Green")):
        half = tree.nodes.new("ShaderNodeMath")
        half.operation = operation
        half.inputs[1].default_value = 0.0
        tree.links.new(split.outputs["Z"], half.inputs[0])
        tree.links.new(half.outputs[0], colour.inputs[channel])
    tree.links.new(colour.outputs[0], background.inputs["Color"])
    return scene


def _settings(scene: Any, bounces: int) -> None:
    """No roulette, no clamping, no filter: every sample is a path with its whole weight."""
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = SIDE_PX
    render.resolution_percentage = 100
    render.use_compositing = render.use_sequencer = False
    image = render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format = "OPEN_EXR"
    image.color_mode, image.color_depth = "RGB", "32"
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    for name in ("max", "diffuse", "glossy", "transmission"):
        setattr(cycles, f"{name}_bounces", bounces)
    cycles.transparent_max_bounces = bounces
    cycles.min_light_bounces = cycles.min_transparent_bounces = 1024
    cycles.light_sampling_threshold = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy = 0
    cycles.caustics_reflective = True
    cycles.sampling_pattern = "TABULATED_SOBOL"
    if hasattr(cycles, "volume_biased"):
        cycles.volume_biased = True


def look_down(scene: Any, angle_deg: float) -> None:
    """A parallel camera that sees a millimetre about the origin, at this angle from +Z."""
    data = bpy.data.cameras.new("Eye")
    data.type = "ORTHO"
    data.ortho_scale = 1e-3
    data.clip_start, data.clip_end = 1e-3, 1e4
    eye = bpy.data.objects.new("Eye", data)
    angle = math.radians(angle_deg)
    eye.location = (0.0313, -10 * math.sin(angle) + 0.0177, 10 * math.cos(angle))
    eye.rotation_euler = (angle, 0.0, 0.0)
    scene.collection.objects.link(eye)
    scene.camera = eye


class Radiance(NamedTuple):
    """Mean radiance and its standard error, of what comes from the sky above, below, and both."""

    above: tuple[float, float]
    below: tuple[float, float]
    both: tuple[float, float]


def radiance(bench: Bench, scene: Any, samples: int, seed: int = 0) -> Radiance:
    """Mean radiance over the picture, and its standard error from the pixels."""
    scene.cycles.samples, scene.cycles.seed = samples, seed
    path = Path(bench.folder) / "furnace.exr"
    scene.render.filepath = str(path)
    with quiet_blender():
        bpy.ops.render.render(write_still=True, scene=scene.name)
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.name = "Non-Color"
        pixels = np.empty(image.size[0] * image.size[1] * image.channels, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        colours = pixels.reshape(-1, image.channels)[:, :3].astype(np.float64)
    finally:
        bpy.data.images.remove(image)
    errors = colours.std(axis=0, ddof=1) / math.sqrt(len(colours))
    above, below, both = zip(colours.mean(axis=0).tolist(), errors.tolist(), strict=True)
    return Radiance(above, below, both)
