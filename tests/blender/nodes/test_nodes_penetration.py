# SPDX-License-Identifier: GPL-3.0-or-later
"""Waves that enter the Radar Material: absorption (Eq. 7), optical delay, transmission of faces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender import nodes
from radarsim_addon.physics.fresnel import unpolarised_reflectance
from tests.blender import render_helpers as rh

pytestmark = pytest.mark.blender

DEPTH = 2.0
WALL = 10.0
BEHIND = (9.0, 20.0)
"""Ring that holds the wall behind the slab and not the slab."""


def slab_scene(n: float, kappa: float, *, slab: bool = True) -> tuple[Any, Any]:
    """A slab from z = -5 to -7 before a rough metal wall at -10; the scene and the rays."""
    scene = rh.new_scene(size=32, fov_deg=30)
    rh.add_emitter()
    wall = nodes.make_material("wall", 1e4, 1e4, 0.0, penetrable=False)
    rh.add_plate(30, Matrix.Translation((0, 0, -WALL)), wall, name="Wall")
    if slab:
        # Odd corners keep the faces' diagonals away from pixel centres: a shadow ray that
        # crosses exactly the edge between two triangles counts both.
        material = nodes.make_material("slab", n, kappa, 0.3, 0.5)
        rh.add_box((-9.3, -8.1, -5 - DEPTH), (8.7, 9.9, -5.0), material)
    return scene, rh.pixel_directions(scene)


@pytest.mark.parametrize("extinction_length", [0.0, 0.25])
def test_absorption_both_ways_through_a_slab(extinction_length: float) -> None:
    """exp(-4 pi kappa 2d / Lambda); an absent Lambda means one unit."""
    kappa = 0.004 if extinction_length else 0.02
    scene, rays = slab_scene(1.0, kappa)
    through = rh.render(scene, 0, BEHIND, extinction_length)[..., 2].astype(np.float64)
    bare_scene, _ = slab_scene(1.0, kappa, slab=False)
    bare = rh.render(bare_scene, 0, BEHIND)[..., 2]
    path = DEPTH / -rays[..., 2]
    passed = 1 - unpolarised_reflectance(complex(1.0, kappa), -rays[..., 2])
    # The camera's ray picks transmission with probability `passed` and is weighted with its
    # inverse; the ray to the emitter is attenuated by both faces.
    expected = passed**2 * np.exp(-4 * math.pi * kappa * 2 * path / (extinction_length or 1.0))
    assert expected.max() < 0.7
    hit = through > 0
    assert hit.mean() > 0.99
    assert np.abs((through / bare / expected)[hit] - 1).max() < 1e-5


@pytest.mark.parametrize("n", [1.4, 2.3])
def test_optical_delay_and_transmission_of_a_slab(n: float) -> None:
    """Range grows by (n - 1) d each way; power falls with (1 - F) at each face, each way."""
    code_length = 10.0
    kappa = 0.003
    scene, rays = slab_scene(n, kappa)
    pixels = rh.render(scene, code_length, BEHIND)
    hit = pixels[..., 2] > 0
    path = DEPTH / -rays[..., 2]
    expected = 2 * WALL / -rays[..., 2] + 2 * (n - 1) * path
    # The near plane cuts the first segment, in front of the slab.
    measured = rh.decode_length(pixels, code_length) + rh.near_clip_length(scene)
    assert np.abs(measured / expected - 1)[hit].max() < 1e-5
    assert np.abs(rh.path_check(pixels)[hit] - 1).max() < 1e-5

    # Without the code the choice of lobe is exactly F to 1 - F, so that what passes is exact too.
    plain = rh.render(scene, 0, BEHIND)[..., 2].astype(np.float64)
    bare_scene, _ = slab_scene(n, kappa, slab=False)
    bare = rh.render(bare_scene, 0, BEHIND)[..., 2]
    passed = 1 - unpolarised_reflectance(complex(n, kappa), -rays[..., 2])
    closed = passed**2 * np.exp(-4 * math.pi * kappa * 2 * path)
    hit = plain > 0
    assert np.abs((plain / bare / closed)[hit] - 1).max() < 1e-5
    # The share of pixels that pass both faces is (1 - F)^2: 1024 trials, four standard errors.
    share = float((passed**2).mean())
    assert abs(hit.mean() - share) < 4 * math.sqrt(share * (1 - share) / hit.size)


def test_back_face_echo_carries_the_way_inside() -> None:
    """The far face of a slab shows at its depth plus the optical delay, not before it."""
    n, code_length = 2.3, 10.0
    scene, rays = slab_scene(n, 0.01)
    pixels = rh.render(scene, code_length, (7.0, 7.0 / math.cos(math.radians(22)) + 1e-3))
    inside = DEPTH / -rays[..., 2]
    expected = 2 * 7 / -rays[..., 2] + 2 * (n - 1) * inside
    hit = (pixels[..., 2] > 0) & (7 / -rays[..., 2] < 9)
    measured = rh.decode_length(np.where(hit[..., None], pixels, 1), code_length)
    measured += rh.near_clip_length(scene)
    # Rays that reflected at the front face are not gated in: their last segment is 5 to 6.
    assert hit.sum() > 100
    assert np.abs(measured / expected - 1)[hit].max() < 1e-5


def test_conductors_let_nothing_through() -> None:
    scene = rh.new_scene()
    rh.add_emitter()
    metal = nodes.PRESETS["metal"]
    front = nodes.make_material("front", metal.n, metal.kappa, 0.5, 0.5, penetrable=False)
    rh.add_plate(20, Matrix.Translation((0, 0, -5)), front, name="Front")
    rh.add_plate(30, Matrix.Translation((0, 0, -WALL)), rh.lambert(0.9), name="Wall")
    scene.cycles.samples = 64
    assert rh.render(scene, 0, BEHIND).max() == 0


def test_absorption_is_felt_at_any_scale() -> None:
    """60 dB through a slab, to 1e-4: no sampling of free paths is left in it."""
    kappa = 6 * math.log(10) / (4 * math.pi * 2 * DEPTH)
    scene, rays = slab_scene(1.0, kappa)
    through = rh.render(scene, 0, BEHIND)[..., 2].astype(np.float64)
    bare_scene, _ = slab_scene(1.0, kappa, slab=False)
    bare = rh.render(bare_scene, 0, BEHIND)[..., 2]
    passed = 1 - unpolarised_reflectance(complex(1.0, kappa), -rays[..., 2])
    expected = passed**2 * 10 ** (-6 / -rays[..., 2])
    hit = through > 0
    assert hit.mean() > 0.5
    assert np.abs((through / bare / expected)[hit] - 1).max() < 1e-4


def test_open_plane_is_a_half_space() -> None:
    """Ground as a single face: what lies under it is attenuated, what stands above is not."""
    n, kappa, code_length = 1.4, 0.01, 10.0
    images = {}
    for with_ground in (False, True):
        scene = rh.new_scene(size=32, fov_deg=30)
        rh.add_emitter()
        metal = nodes.make_material("metal", 1e4, 1e4, 0.0, penetrable=False)
        rh.add_plate(30, Matrix.Translation((0, 0, -8)), metal, name="Bedrock")
        rh.add_plate(0.4, Matrix.Translation((0.7, 0.3, -4)), metal, name="Drone")
        if with_ground:
            ground = nodes.make_material("ground", n, kappa, 0.0, 0.5)
            rh.add_plate(50, Matrix.Translation((1.7, 0.9, -6)), ground, name="Ground")
        # The ground's own echo, 6 and more, is gated out.
        above = rh.render(scene, code_length, (3.0, 5.0))
        below = rh.render(scene, code_length, (8.0, 20.0))
        images[with_ground] = above, below
    rays = rh.pixel_directions(scene)
    assert images[True][0].max() > 0
    assert np.array_equal(images[True][0], images[False][0])

    bare, buried = images[False][1], images[True][1]
    hit = buried[..., 2] > 0
    assert hit.mean() > 0.5
    expected = (2 * 8 + 2 * (n - 1) * 2) / -rays[..., 2]
    measured = rh.decode_length(buried, code_length) + rh.near_clip_length(scene)
    assert np.abs(measured / expected - 1)[hit].max() < 1e-5
    # On average: (1 - F)^2 exp(-4 pi kappa 2 d); 1024 trials that pass with 97 %.
    passed = 1 - unpolarised_reflectance(complex(n, kappa), -rays[..., 2])
    closed = passed**2 * np.exp(-4 * math.pi * kappa * 4 / -rays[..., 2])
    assert buried[..., 2].sum() / (bare[..., 2] * closed).sum() == pytest.approx(1, abs=0.03)
