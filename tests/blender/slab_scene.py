# SPDX-License-Identifier: GPL-3.0-or-later
"""A layer of a physical material before a Lambert wall, crossed both ways at an angle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from radarsim_addon.blender import nodes
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.nodes.materials import link_group
from radarsim_addon.blender.state import Snapshot
from radarsim_addon.signal.scene import find_walls
from tests.blender import render_helpers as rh

WALL = 10.0
CODE = 10.0


def physical_material(
    n: float, kappa: float, roughness: float = 0.0, penetrable: bool = True, **inputs: float
) -> Any:
    """The physical group with numbers, without a medium of the library."""
    import bpy

    material = bpy.data.materials.new("physical")
    node = link_group(material, nodes.ensure_group("radar_physical"), penetrable)
    values = {
        "Index of Refraction": n,
        "Extinction Coefficient": kappa,
        "Roughness": roughness,
        **inputs,
    }
    for name, value in values.items():
        node.inputs[name].default_value = value
    return material


@dataclass
class Crossing:
    """Ratio of a render with the layer to one without, and what is between them in length.

    cosine: outside, to the layer, per pixel; power: both ways; extra: one-way excess length, units.
    """

    cosine: np.ndarray
    power: np.ndarray
    extra: np.ndarray


def _picture(
    material: Any, thickness: float, angle_deg: float, wavelength: float, polarisation: int
) -> tuple[np.ndarray, np.ndarray]:
    """Rays in world space and the render; material None: without the layer."""
    scene = rh.new_scene(size=8, fov_deg=1.0)
    scene.camera.rotation_euler = (math.pi / 2, 0, 0)  # along +Y, so that V and H differ
    rh.add_emitter()
    upright = Matrix.Rotation(math.pi / 2, 4, "X")
    wall = Matrix.Translation((0, WALL, 0)) @ upright
    rh.add_plate(30, wall, rh.lambert(0.9, "wall"), name="Wall")
    if material is not None:
        box = rh.add_box(
            (-9.3, -thickness / 2, -8.1), (8.7, thickness / 2, 9.9), physical_material(*material)
        )
        # Turned about the vertical: the plane of incidence is level.
        turn = Matrix.Rotation(math.radians(angle_deg), 4, "Z")
        box.matrix_world = Matrix.Translation((0.013, WALL / 2, 0.017)) @ turn
        box[attributes.OBJECT_LAYER_NORMAL] = [0.0, 1.0, 0.0]
        scene[attributes.ATTR_SURFACE_DEPTH] = scene[attributes.ATTR_SURFACE_STOP] = 2.5
    scene[attributes.ATTR_WAVELENGTH] = wavelength
    scene[attributes.ATTR_POLARISATION] = float(polarisation)
    pixels = rh.render(scene, CODE).astype(np.float64)
    rays = rh.pixel_directions(scene)
    return np.stack([rays[..., 0], -rays[..., 2], rays[..., 1]], axis=-1), pixels


def cross(
    index: complex,
    thickness: float,
    angle_deg: float,
    wavelength: float,
    polarisation: int = 0,
) -> Crossing:
    """Send a wave through a layer and back, both faces gated: one path per pixel."""
    layer = (index.real, index.imag)
    rays, through = _picture(layer, thickness, angle_deg, wavelength, polarisation)
    _, bare = _picture(None, thickness, angle_deg, wavelength, polarisation)
    angle = math.radians(angle_deg)
    cosine = np.abs(rays @ np.array([-math.sin(angle), math.cos(angle), 0.0]))
    ratio = through / bare
    return Crossing(cosine, ratio[..., 2], -CODE * np.log(ratio[..., 0] / ratio[..., 2]) / 2)


def walls_of(item: bpy.types.Object, snapshot: Snapshot) -> Any:
    """Return the walls of an evaluated object."""
    return find_walls(snapshot.mesh_of(item), snapshot.matrix_of(item)[:3, :3])
