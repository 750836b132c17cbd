# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes and exact Cycles renders for tests: one path through each pixel's centre."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from radarsim_addon.blender import nodes
from radarsim_addon.blender.nodes import attributes

CLIP_START = 1e-6
"""Least near clip that Blender takes, in units; it shortens the first segment."""

EIRP_W = 4 * math.pi * 1e4
"""Lamp's power: radiant intensity 1e4 W/sr."""


def new_scene(size: int = 16, fov_deg: float = 20.0, max_bounces: int = 1) -> Any:
    """Empty scene with a camera at the origin looking along -Z, set for exact measurement."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    camera = bpy.data.cameras.new("Radar")
    camera.clip_start = CLIP_START
    camera.clip_end = 1e6
    camera.angle = math.radians(fov_deg)
    camera_object = bpy.data.objects.new("Radar", camera)
    scene.collection.objects.link(camera_object)
    scene.camera = camera_object
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = size
    render.resolution_percentage = 100
    render.use_persistent_data = False
    render.use_compositing = render.use_sequencer = False
    image = render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format = "OPEN_EXR"
    image.color_mode = "RGB"
    image.color_depth = "32"
    image.exr_codec = "ZIP"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = 1
    cycles.seed = 0
    cycles.use_animated_seed = False
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.pixel_filter_type = "BLACKMAN_HARRIS"
    cycles.filter_width = 0.01
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = max_bounces - 1
    cycles.transmission_bounces = 0
    cycles.transparent_max_bounces = 64
    cycles.min_light_bounces = cycles.min_transparent_bounces = 1024
    cycles.light_sampling_threshold = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy = 0
    cycles.use_light_tree = False
    cycles.caustics_reflective = True
    cycles.sampling_pattern = "TABULATED_SOBOL"
    if hasattr(cycles, "volume_biased"):
        cycles.volume_biased = True
    return scene


def add_emitter(location: Iterable[float] = (0, 0, 0), power_w: float = EIRP_W) -> Any:
    """Point lamp with the Ring Emitter."""
    light = bpy.data.lights.new("Emitter", "POINT")
    light.energy = power_w
    nodes.setup_emitter(light)
    return _link(light, "Emitter", Matrix.Translation(Vector(location)))


def add_mesh(
    name: str,
    vertices: list[tuple[float, float, float]],
    faces: Sequence[tuple[int, ...]],
    material: Any,
    matrix: Matrix | None = None,
) -> Any:
    """Mesh object with one material."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(material)
    return _link(mesh, name, matrix or Matrix.Identity(4))


def add_plate(
    half: float, matrix: Matrix | None = None, material: Any = None, name: str = "Plate"
) -> Any:
    """Square plate in its own xy plane, facing +z."""
    corners = [(-half, -half, 0.0), (half, -half, 0.0), (half, half, 0.0), (-half, half, 0.0)]
    return add_mesh(name, corners, [(0, 1, 2, 3)], material, matrix)


def add_box(low: tuple[float, ...], high: tuple[float, ...], material: Any) -> Any:
    """Closed box between two corners, normals outwards."""
    x0, y0, z0 = low
    x1, y1, z1 = high
    vertices = [
        (x0, y0, z0),
        (x1, y0, z0),
        (x1, y1, z0),
        (x0, y1, z0),
        (x0, y0, z1),
        (x1, y0, z1),
        (x1, y1, z1),
        (x0, y1, z1),
    ]
    faces = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return add_mesh("Box", vertices, faces, material)


def lambert(albedo: float, name: str = "Lambert") -> Any:
    """Plain diffuse material without any code: a target of exactly known albedo."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (albedo, albedo, albedo, 1)
    tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    return material


def pixel_directions(scene: Any) -> np.ndarray:
    """Unit ray directions in camera space through the pixel centres, (h, w, 3), row 0 on top."""
    width, height = scene.render.resolution_x, scene.render.resolution_y
    tangent = math.tan(scene.camera.data.angle / 2)
    longer = max(width, height)
    u = ((np.arange(width) + 0.5) * 2 - width) / longer * tangent
    v = (height - (np.arange(height) + 0.5) * 2) / longer * tangent
    rays = np.stack(np.broadcast_arrays(u[None, :], v[:, None], -1.0), axis=-1)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def near_clip_length(scene: Any) -> np.ndarray:
    """What the near plane cuts off each pixel's first segment, units, (h, w)."""
    return CLIP_START / -pixel_directions(scene)[..., 2]


def render(
    scene: Any,
    code_length: float = 0.0,
    ring: tuple[float, float] = (0.0, 0.0),
    extinction_length: float = 0.0,
) -> np.ndarray:
    """Render with the scene attributes of a measurement; float32 (h, w, 3) R, G, B, row 0 on top.

    An argument of 0 leaves its attribute away.
    """
    values = {
        attributes.ATTR_INVERSE_CODE_LENGTH: 1 / code_length if code_length else 0.0,
        attributes.ATTR_RING_MIN: ring[0],
        attributes.ATTR_RING_MAX: ring[1],
        attributes.ATTR_EXTINCTION_LENGTH: extinction_length,
    }
    for name, value in values.items():
        if value:
            scene[name] = float(value)
        elif name in scene:
            del scene[name]
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "frame.exr")
        scene.update_tag()
        bpy.ops.render.render(write_still=True)
        return read_exr(scene.render.filepath)


def read_exr(path: str) -> np.ndarray:
    """Pixels of a single-part float EXR by Blender itself: float32 (h, w, 3), row 0 on top."""
    image = bpy.data.images.load(path, check_existing=False)
    try:
        image.colorspace_settings.name = "Non-Color"
        image.alpha_mode = "NONE"
        width, height = image.size
        pixels = np.empty(width * height * image.channels, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(height, width, image.channels)[::-1, :, :3].copy()
    finally:
        bpy.data.images.remove(image)


def decode_length(pixels: np.ndarray, code_length: float) -> np.ndarray:
    """Total path length -k ln(R/B), units (Eq. 4), without the near clip; NaN without echo."""
    wide = pixels.astype(np.float64)
    with np.errstate(invalid="ignore"):
        return -code_length * np.log(wide[..., 0] / wide[..., 2])


def path_check(pixels: np.ndarray) -> np.ndarray:
    """G B / R^2: 1 for one path in a pixel; NaN without echo."""
    wide = pixels.astype(np.float64)
    with np.errstate(invalid="ignore"):
        return wide[..., 1] * wide[..., 2] / wide[..., 0] ** 2


def _link(data: Any, name: str, matrix: Matrix) -> Any:
    obj = bpy.data.objects.new(name, data)
    obj.matrix_world = matrix
    bpy.context.scene.collection.objects.link(obj)
    return obj
