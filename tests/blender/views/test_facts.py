# SPDX-License-Identifier: GPL-3.0-or-later
"""What the simulator relies on in Cycles, measured: a Blender that changes a fact fails here."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender import nodes
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.nodes.build import TreeBuilder
from tests.blender import render_helpers as rh

pytestmark = pytest.mark.blender


def shader(name: str, draw: Any) -> Any:
    """Material whose surface is what `draw` returns for a TreeBuilder."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    build = TreeBuilder(material.node_tree)
    build.node("ShaderNodeOutputMaterial", "output", {"Surface": draw(build)})
    return material


def emission(build: TreeBuilder, colour: Any) -> Any:
    return build.node("ShaderNodeEmission", "emission", {0: colour}).outputs[0]


def down(distance: float) -> Matrix:
    return Matrix.Translation((0, 0, -distance))


def seen_positions(seed: int, filter_type: str, filter_width: float) -> np.ndarray:
    """Where each pixel's ray meets the plane z = -1, x and y, (16, 16, 2)."""
    scene = rh.new_scene(size=16, fov_deg=90)
    scene.cycles.seed = seed
    scene.cycles.pixel_filter_type = filter_type
    scene.cycles.filter_width = filter_width

    def draw(build: TreeBuilder) -> Any:
        place = build.node("ShaderNodeNewGeometry", "Geometry").outputs["Position"]
        # Emission must not be negative.
        moved = build.node("ShaderNodeVectorMath", "+2", {0: place, 1: (2, 2, 2)})
        return emission(build, moved.outputs[0])

    rh.add_plate(5, down(1), shader("Position", draw))
    return rh.render(scene)[..., :2].astype(np.float64) - 2


def test_first_sample_is_at_the_pixel_centre_whatever_the_seed() -> None:
    scene = rh.new_scene(size=16, fov_deg=90)
    rays = rh.pixel_directions(scene)
    expected = rays[..., :2] / -rays[..., 2:]
    pitch = 2 / 16
    for seed in (0, 1, 12345):
        error_px = (seen_positions(seed, "BLACKMAN_HARRIS", 0.01) - expected) / pitch
        assert np.abs(error_px).max() < 3e-5
    # BOX of one pixel is off by half of 1/1024 px, right and up: why it is not used for one sample.
    error_px = (seen_positions(0, "BOX", 1.0) - expected) / pitch
    assert np.abs(error_px - 1 / 2048).max() < 5e-5


def test_ray_length_is_the_last_segment_and_runs_on_through_transparency() -> None:
    """Camera, mirror (at 45 degrees) at 10, screen 15 further: 15, with panes or without."""

    def draw(build: TreeBuilder) -> Any:
        length = build.node("ShaderNodeLightPath", "Light Path").outputs["Ray Length"]
        return emission(build, length)

    def mirror(build: TreeBuilder) -> Any:
        inputs = {"Color": (1, 1, 1, 1), "Roughness": 0.0}
        return build.node("ShaderNodeBsdfAnisotropic", "mirror", inputs).outputs[0]

    def pane(build: TreeBuilder) -> Any:
        return build.node("ShaderNodeBsdfTransparent", "pane", {0: (1, 1, 1, 1)}).outputs[0]

    for with_panes in (False, True):
        scene = rh.new_scene(size=5, max_bounces=2)
        turned = Matrix.Rotation(math.radians(45), 4, "Y")
        rh.add_plate(3, down(10) @ turned, shader("Mirror", mirror))
        screen = Matrix.Translation((15, 0, -10)) @ Matrix.Rotation(math.radians(-90), 4, "Y")
        rh.add_plate(9, screen, shader("Screen", draw))
        if with_panes:
            glass = shader("Pane", pane)
            rh.add_plate(3, down(4), glass)
            aside = Matrix.Translation((7, 0, -10)) @ Matrix.Rotation(math.radians(-90), 4, "Y")
            rh.add_plate(9, aside, glass)
        middle = rh.render(scene)[2, 2, 0]
        assert middle == pytest.approx(15, rel=1e-6)


@pytest.mark.parametrize("clip_start", [0.1, 1e-6])
def test_near_clip_shortens_the_first_segment(clip_start: float) -> None:
    """By clip_start / cos(off-axis), which the reader adds back."""
    scene = rh.new_scene(fov_deg=60)
    scene.camera.data.clip_start = clip_start
    rh.add_emitter()
    rh.add_plate(20, down(10), nodes.make_material("m", 1e4, 1e4, 0.0, penetrable=False))
    measured = rh.decode_length(rh.render(scene, 10), 10)
    axial = -rh.pixel_directions(scene)[..., 2]
    assert np.abs(measured - (20 - clip_start) / axial).max() < 1e-5


@pytest.mark.parametrize("value", [0.1, 1 / 3, 1e-7, 12345.678])
def test_scene_attribute_reaches_shaders_exactly(value: float) -> None:
    """As the nearest float32. An absent one reads 0."""
    for name in (attributes.ATTR_RING_MAX, "radarsim_absent"):
        scene = rh.new_scene(size=4)
        scene[attributes.ATTR_RING_MAX] = value

        def draw(build: TreeBuilder, name: str = name) -> Any:
            return emission(build, build.scene_attribute(name))

        rh.add_plate(20, down(5), shader("Attribute", draw))
        pixels = rh.render(scene, ring=(0.0, value))
        wanted = np.float32(value) if name == attributes.ATTR_RING_MAX else 0
        assert (pixels == wanted).all()


def test_attribute_changes_are_seen_under_persistent_data() -> None:
    """The render job keeps the scene in Cycles between rings."""
    scene = rh.new_scene(size=8)
    scene.render.use_persistent_data = True
    rh.add_emitter()
    rh.add_plate(20, down(10), nodes.make_material("m", 1.4, 0.3))
    lit = [bool(rh.render(scene, 10, ring).max() > 0) for ring in ((5, 8), (8, 12), (5, 8))]
    assert lit == [False, True, False]
    codes = [float(rh.render(scene, k, (8, 12))[4, 4, 0]) for k in (10, 20, 10)]
    assert codes[0] == codes[2] < codes[1]

    # The extinction length reaches the interior of a slab before a wall, likewise.
    scene = rh.new_scene(size=8)
    scene.render.use_persistent_data = True
    rh.add_emitter()
    rh.add_plate(20, down(10), rh.lambert(0.8))
    rh.add_box((-9.3, -8.1, -7.0), (8.7, 9.9, -5.0), nodes.make_material("slab", 1.0, 0.005))
    thin, thick, again = (rh.render(scene, 0, (9, 12), x)[4, 4, 2] for x in (1.0, 0.25, 1.0))
    path = 4 / -rh.pixel_directions(scene)[4, 4, 2]
    assert thin == again
    expected = math.exp(-4 * math.pi * 0.005 * path * (4 - 1))
    assert thick / thin == pytest.approx(expected, rel=1e-5)


def sheets(min_transparent_bounces: int) -> np.ndarray:
    """Amplitude of a Lambert plate behind six grey transparent sheets."""
    scene = rh.new_scene(size=16)
    scene.cycles.min_transparent_bounces = min_transparent_bounces
    scene.cycles.min_light_bounces = min_transparent_bounces

    def grey(build: TreeBuilder) -> Any:
        return build.node("ShaderNodeBsdfTransparent", "grey", {0: (0.5, 0.5, 0.5, 1)}).outputs[0]

    rh.add_emitter()
    material = shader("Grey", grey)
    for number in range(6):
        # Off centre: a pixel must not look along the faces' diagonals.
        rh.add_plate(20, Matrix.Translation((0.7, 0.3, -3.0 - number)), material)
    rh.add_plate(30, down(10), rh.lambert(0.8))
    axial = -rh.pixel_directions(scene)[..., 2]
    bare = 0.8 / math.pi * rh.EIRP_W / (4 * math.pi) * axial**3 / 100
    return rh.render(scene)[..., 2] / bare


def test_russian_roulette_must_be_off() -> None:
    """With 1024 least bounces amplitudes are exact; with none, random by tens of percent."""
    assert np.abs(sheets(1024) * 2.0**12 - 1).max() < 1e-5
    assert np.std(sheets(0) * 2.0**12) > 0.1


def test_closures_below_one_in_1e5_are_dropped() -> None:
    """Weak echoes need a weight above 1e-5: an index of 1.005 reflects 6e-6, and shows nothing."""
    for n, seen in ((1.005, False), (1.01, True)):
        scene = rh.new_scene(size=4)
        rh.add_emitter()
        material = nodes.make_material("weak", n, 0.0, 0.0, penetrable=False)
        rh.add_plate(20, down(10), material)
        assert (rh.render(scene)[..., 2].max() > 0) is np.bool_(seen)


def test_repeats_are_bit_identical() -> None:
    images = []
    for _ in range(2):
        scene = rh.new_scene(size=16, max_bounces=3)
        rh.add_emitter()
        material = nodes.make_material("m", 1.4, 0.1, 0.5, 0.5)
        rh.add_plate(20, down(10), material)
        rh.add_box((-1.1, -1.3, -9.0), (1.2, 0.9, -7.0), material)
        images.append(rh.render(scene, 10))
    assert np.mean(images[0] > 0) > 0.9
    assert np.array_equal(images[0], images[1])


@pytest.mark.parametrize(("tilt_deg", "share"), [(0.0, 0.0), (30.0, 0.5), (50.0, 0.5)])
def test_opaque_plates_that_coincide_lose_their_power(tilt_deg: float, share: float) -> None:
    """All of it square on, about half tilted, as materials.md tells; a gap of 1e-5 cures it."""
    powers = []
    for count, gap in ((1, 0.0), (2, 0.0), (2, 1e-5)):
        scene = rh.new_scene(size=64, fov_deg=12)
        rh.add_emitter()
        material = rh.lambert(0.6)
        turn = Matrix.Rotation(math.radians(tilt_deg), 4, "X") @ Matrix.Rotation(0.47, 4, "Z")
        for number in range(count):
            rh.add_plate(1, down(10 + number * gap) @ turn, material, name=f"Plate {number}")
        powers.append(float(rh.render(scene)[..., 2].sum(dtype=np.float64)))
    assert powers[1] / powers[0] == pytest.approx(share, abs=0.12)
    assert powers[2] == pytest.approx(powers[0], rel=1e-3)
