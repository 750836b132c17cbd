# SPDX-License-Identifier: GPL-3.0-or-later
"""The Fresnel nodes alone: against multiple precision, and against Cycles' own Fresnel node."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender.nodes.build import TreeBuilder
from radarsim_addon.blender.nodes.interface import cos_incidence, reflectance, transmittance
from radarsim_addon.physics.fresnel import unpolarised_reflectance
from tests.blender import render_helpers as rh

pytestmark = pytest.mark.blender

DATA = Path(__file__).parents[2] / "data" / "fresnel_spot_values.csv"
INDICES = {"eps4": 2.0, "eps2.56": 1.6, "n=1e4(1+i)": 1e4 * (1 + 1j), "TIR n=1/1.5": 1 / 1.5}


def evaluate(cases: np.ndarray) -> np.ndarray:
    """F and T by the nodes, for rows (n, kappa, cosine): one little plate and pixel for each.

    The numbers reach the nodes as object attributes, so that the render kernel computes and not
    the compiler's constant folding.
    """
    size = max(4, math.ceil(math.sqrt(len(cases))))
    scene = rh.new_scene(size=size)
    scene.camera.data.type = "ORTHO"
    scene.camera.data.ortho_scale = size
    material = bpy.data.materials.new("Fresnel")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    build = TreeBuilder(material.node_tree)

    def attribute(name: str) -> Any:
        node = build.node("ShaderNodeAttribute", name, attribute_type="OBJECT", attribute_name=name)
        return build.node("ShaderNodeSeparateXYZ", "", {0: node.outputs["Vector"]}).outputs[0]

    n, kappa, cosine = (attribute(name) for name in ("n", "kappa", "cosine"))
    power = reflectance(build, n, kappa, cosine)
    through = transmittance(build, n, kappa, power)
    colour = build.node("ShaderNodeCombineXYZ", "out", {0: power, 1: through, 2: 1.0})
    emission = build.node("ShaderNodeEmission", "emission", {0: colour.outputs[0]})
    build.node("ShaderNodeOutputMaterial", "output", {"Surface": emission.outputs[0]})

    for number, case in enumerate(cases):
        row, column = divmod(number, size)
        place = (column + 0.5 - size / 2, size / 2 - row - 0.5, -5.0)
        plate = rh.add_plate(0.4, Matrix.Translation(place), material)
        for name, value in zip(("n", "kappa", "cosine"), case, strict=True):
            plate[name] = float(value)
    pixels = rh.render(scene).reshape(-1, 3)[: len(cases)]
    assert (pixels[:, 2] == 1).all()
    return pixels[:, :2].astype(np.float64)


def test_reflectance_against_multiple_precision() -> None:
    with open(DATA, encoding="utf-8") as stream:
        rows = [
            row
            for row in csv.DictReader(line for line in stream if not line.startswith("#"))
            if row["case"] in INDICES
        ]
    assert len(rows) == 9 * len(INDICES)
    index = np.array([complex(INDICES[row["case"]]) for row in rows])
    # 89.9999 degrees: cos is 1.7e-6, of which float32 keeps all digits as it is given here.
    cosine = np.array([math.cos(math.radians(float(row["inc_deg"]))) for row in rows])
    expected = 1 - np.array([(float(row["1-|rs|^2"]) + float(row["1-|rp|^2"])) / 2 for row in rows])
    got = evaluate(np.stack([index.real, index.imag, cosine], axis=-1))[:, 0]
    assert np.abs(got - expected).max() < 1e-6


def test_reflectance_over_the_whole_range_of_indices() -> None:
    """n to 1e4, kappa to 1e4, normal to grazing: relative 2e-5, also where F is small.

    Near a Brewster angle r_p vanishes and F with n near 1 is 1e-12: there float32's rounding of
    n and of the angle is what is left, so a floor of 1e-9 is added.
    """
    n = np.array([1.0, 1.0001, 1.01, 1.4, 3.0, 30.0, 1e3, 1e4], dtype=np.float32)
    kappa = np.array([0.0, 1e-3, 1.0, 10.0, 1e4], dtype=np.float32)
    cosine = np.array([1.0, 0.9, 0.5, 0.1, 1e-3, 1e-5], dtype=np.float32)
    grid = np.stack(np.meshgrid(n, kappa, cosine, indexing="ij"), axis=-1).reshape(-1, 3)
    wide = grid.astype(np.float64)
    expected = unpolarised_reflectance(wide[:, 0] + 1j * wide[:, 1], wide[:, 2])
    power, through = evaluate(grid).T
    assert np.abs(power / (expected + 1e-9) - expected / (expected + 1e-9)).max() < 2e-5
    vacuum = (grid[:, 0] == 1) & (grid[:, 1] == 0)
    assert (power[vacuum] == 0).all()
    assert (through[vacuum] == 1).all()
    # What is not reflected passes, or is kept out by a conductor.
    conductor = 4 * wide[:, 0] / ((wide[:, 0] + 1) ** 2 + wide[:, 1] ** 2) < 1e-3
    assert 20 < conductor.sum() < 200
    assert (through[conductor] == 0).all()
    assert np.abs(power + through - 1)[~conductor].max() < 1e-6


@pytest.mark.parametrize("n", [1.05, 1.5, 2.3, 9.0])
def test_equals_cycles_fresnel_without_extinction(n: float) -> None:
    scene = rh.new_scene(size=32, fov_deg=60)
    material = bpy.data.materials.new("Both")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    build = TreeBuilder(material.node_tree)
    ours = reflectance(build, n, 0.0, cos_incidence(build))
    theirs = build.node("ShaderNodeFresnel", "Cycles", {"IOR": n}).outputs[0]
    colour = build.node("ShaderNodeCombineXYZ", "out", {0: ours, 1: theirs, 2: 1.0})
    emission = build.node("ShaderNodeEmission", "emission", {0: colour.outputs[0]})
    build.node("ShaderNodeOutputMaterial", "output", {"Surface": emission.outputs[0]})
    # The plane's horizon is near the upper edge: angles from 30 to 88 degrees.
    pose = Matrix.Translation((0, 0, -10)) @ Matrix.Rotation(math.radians(58), 4, "X")
    rh.add_plate(500, pose, material)
    pixels = rh.render(scene)
    lit = pixels[..., 2] > 0
    assert lit.mean() > 0.9
    assert np.ptp(pixels[..., 1][lit]) > 0.1
    assert np.abs(pixels[..., 0] - pixels[..., 1])[lit].max() < 2e-6


def test_both_faces_see_the_outside_angle() -> None:
    """A back face reflects as its front does; Cycles' own node would report total reflection."""
    power = {}
    for turned in (False, True):
        scene = rh.new_scene(size=8)
        material = bpy.data.materials.new("Face")
        if material.node_tree is None:
            material.use_nodes = True
        material.node_tree.nodes.clear()
        build = TreeBuilder(material.node_tree)
        value = reflectance(build, 2.3, 0.1, cos_incidence(build))
        emission = build.node("ShaderNodeEmission", "emission", {0: value})
        build.node("ShaderNodeOutputMaterial", "output", {"Surface": emission.outputs[0]})
        angle = math.radians(60 + 180 * turned)
        pose = Matrix.Translation((0, 0, -10)) @ Matrix.Rotation(angle, 4, "X")
        rh.add_plate(100, pose, material)
        power[turned] = rh.render(scene)[..., 2]
    assert power[False].min() > 0.1
    assert np.abs(power[True] / power[False] - 1).max() < 1e-6
