# SPDX-License-Identifier: GPL-3.0-or-later
"""Thin panes as one face, with interference, against the coherent closed form of a slab."""

from __future__ import annotations

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender.materials import physical_materials as pm
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.physics.fresnel import excess_path_m, slab_power
from radarsim_addon.physics.materials import material as library
from tests.blender import render_helpers as rh

pytestmark = pytest.mark.blender

CODE = 10.0


def behind_pane(
    medium: dict[str, float], thickness: float, angle_deg: float, carrier_hz: float, pol: int
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of a wall at y = 10 behind a pane (thickness 0: without), and the cosines."""
    scene = rh.new_scene(size=8, fov_deg=1.0)
    scene.camera.rotation_euler = (math.pi / 2, 0, 0)
    rh.add_emitter()
    upright = Matrix.Rotation(math.pi / 2, 4, "X")
    wall = Matrix.Translation((0, 10, 0)) @ upright
    rh.add_plate(30, wall, rh.lambert(0.9, "wall"), name="Wall")
    turn = Matrix.Rotation(math.radians(angle_deg), 4, "Z")
    if thickness:
        pane = pm.make_physical_material(
            "Pane", "index", carrier_hz=carrier_hz, sheet_thickness_m=thickness, **medium
        )
        pose = Matrix.Translation((0.013, 5, 0.017)) @ turn @ upright
        rh.add_plate(8, pose, pane, name="Pane")
        scene[attributes.ATTR_SURFACE_DEPTH] = scene[attributes.ATTR_SURFACE_STOP] = 1.5
    scene[attributes.ATTR_WAVELENGTH] = 299_792_458.0 / carrier_hz
    scene[attributes.ATTR_POLARISATION] = float(pol)
    pixels = rh.render(scene, CODE).astype(np.float64)
    rays = rh.pixel_directions(scene)
    rays = np.stack([rays[..., 0], -rays[..., 2], rays[..., 1]], axis=-1)
    angle = math.radians(angle_deg)
    return pixels, np.abs(rays @ np.array([-math.sin(angle), math.cos(angle), 0.0]))


@pytest.mark.parametrize("angle", [0, 30, 60])
@pytest.mark.parametrize(
    ("index", "thickness", "polarisation"),
    [
        (2.5 + 0.0j, 4e-3, 0),
        (2.5 + 0.0227j, 6e-3, 0),
        (2.5 + 0.0227j, 6e-3, 1),
        (2.5 + 0.0227j, 6e-3, 2),
        (1.4 + 0.03j, 2e-2, 0),
        (6.0 + 3.0j, 1e-3, 1),
    ],
)
def test_pane_both_ways(index: complex, thickness: float, polarisation: int, angle: float) -> None:
    carrier = 10e9
    medium = {"n": index.real, "k": index.imag}
    pixels, cosine = behind_pane(medium, thickness, angle, carrier, polarisation)
    bare, _ = behind_pane(medium, 0.0, angle, carrier, polarisation)
    slab = slab_power(index, thickness, 299_792_458.0 / carrier, cosine, "coherent")
    one_way = (slab.transmitted, slab.transmitted_s, slab.transmitted_p)[polarisation]
    ratio = pixels / bare
    assert np.abs(10 * np.log10(ratio[..., 2] / one_way**2)).max() < 5e-3
    extra = -CODE * np.log(ratio[..., 0] / ratio[..., 2]) / 2
    assert np.abs(extra - excess_path_m(index, thickness, cosine)).max() < 1e-5


def test_pane_in_a_furnace_gives_everything_back() -> None:
    """A lossless pane reflects what it does not pass, at resonance and off it."""
    for thickness in (3e-3, 6e-3, 7.5e-3):
        scene = rh.new_scene(size=8, fov_deg=30)
        scene.world = bpy.data.worlds.new("Furnace")
        if scene.world.node_tree is None:
            scene.world.use_nodes = True
        scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
        scene.cycles.max_bounces = scene.cycles.glossy_bounces = 4
        pane = pm.make_physical_material(
            "Pane", "index", carrier_hz=10e9, sheet_thickness_m=thickness, n=2.5
        )
        tilt = Matrix.Rotation(math.radians(50), 4, "X")
        rh.add_plate(90, Matrix.Translation((0.03, 0.05, -5)) @ tilt, pane)
        scene[attributes.ATTR_WAVELENGTH] = 299_792_458.0 / 10e9
        assert np.abs(rh.render(scene) - 1).max() < 1e-5


def test_thickness_follows_the_carrier() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    pane = pm.make_physical_material("Pane", "glass", carrier_hz=10e9, sheet_thickness_m=4e-3)
    assert pm.is_physical(pane) and pm.is_sheet(pane)
    pm.update_materials(24e9)
    inputs = pm.group_node(pane).inputs
    assert inputs["Thickness"].default_value == pytest.approx(4e-3 * 24e9 / 299_792_458, rel=1e-6)
    assert inputs["Index of Refraction"].default_value == pytest.approx(
        float(library("glass", 24e9).real), rel=1e-6
    )
