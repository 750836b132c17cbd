# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders with the radar node groups against closed forms: range, amplitude, rings, two bounces."""

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

METAL = (1e4, 1e4)
INTENSITY = rh.EIRP_W / (4 * math.pi)
"""Radiant intensity of the emitter, W/sr."""


def rough(n: float, kappa: float) -> Any:
    """Radar Material with the diffuse lobe alone, nothing inside."""
    return nodes.make_material("rough", n, kappa, specularity=0.0, penetrable=False)


def tilted(distance: float, tilt_deg: float) -> Matrix:
    """Plate's pose: `distance` down the view axis, facing the camera, turned about x."""
    return Matrix.Translation((0, 0, -distance)) @ Matrix.Rotation(math.radians(tilt_deg), 4, "X")


def plane_hits(scene: Any, distance: float, tilt_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Range [units] and cosine of incidence of every pixel's ray on such a plate's plane."""
    rays = rh.pixel_directions(scene)
    tilt = math.radians(tilt_deg)
    normal = np.array([0.0, -math.sin(tilt), math.cos(tilt)])
    cosine = -(rays @ normal)
    return (distance * normal[2]) / cosine, cosine


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 60.0])
@pytest.mark.parametrize("code_length", [5.0, 50.0])
def test_range_of_a_plane(tilt_deg: float, code_length: float) -> None:
    scene = rh.new_scene(size=32)
    rh.add_emitter()
    rh.add_plate(60, tilted(10, tilt_deg), rough(*METAL))
    pixels = rh.render(scene, code_length)
    expected, _ = plane_hits(scene, 10, tilt_deg)
    measured = (rh.decode_length(pixels, code_length) + rh.near_clip_length(scene)) / 2
    assert np.abs(measured / expected - 1).max() < 1e-5


def test_range_between_separate_antennas() -> None:
    """Bistatic: total length is the way out plus the way back."""
    scene = rh.new_scene()
    emitter = np.array([2.0, -1.0, 0.5])
    rh.add_emitter(emitter)
    rh.add_plate(20, tilted(10, 20), rough(*METAL))
    pixels = rh.render(scene, 10)
    out, _ = plane_hits(scene, 10, 20)
    points = rh.pixel_directions(scene) * out[..., None]
    expected = out + np.linalg.norm(points - emitter, axis=-1)
    measured = rh.decode_length(pixels, 10) + rh.near_clip_length(scene)
    assert np.abs(measured / expected - 1).max() < 1e-5


@pytest.mark.parametrize("albedo", [0.05, 0.8])
def test_amplitude_of_a_lambert_plate(albedo: float) -> None:
    """rho/pi W/(4 pi R^2) cos on Cycles' own Diffuse: the emitter's power is the EIRP."""
    scene = rh.new_scene()
    rh.add_emitter()
    rh.add_plate(20, tilted(10, 0), rh.lambert(albedo))
    ranges, cosine = plane_hits(scene, 10, 0)
    expected = albedo / math.pi * INTENSITY / ranges**2 * cosine
    amplitude = rh.render(scene)[..., 2]
    assert np.abs(amplitude / expected - 1).max() < 1e-5


@pytest.mark.parametrize(
    ("n", "kappa"), [(1.05, 0.0), (1.4, 1.0), (2.3, 0.05), (9.0, 3.0), (1e4, 0.0), (1e4, 1e4)]
)
@pytest.mark.parametrize("tilt_deg", [0.0, 55.0, 75.0])
def test_amplitude_of_the_material_is_fresnel(n: float, kappa: float, tilt_deg: float) -> None:
    scene = rh.new_scene(size=8, fov_deg=5)
    rh.add_emitter()
    rh.add_plate(60, tilted(10, tilt_deg), rough(n, kappa))
    ranges, cosine = plane_hits(scene, 10, tilt_deg)
    power = unpolarised_reflectance(complex(n, kappa), cosine)
    expected = power / math.pi * INTENSITY / ranges**2 * cosine
    # One sample picks reflection or transmission; reflection meets the emitter whichever it is,
    # as the next-event sample is taken for the surface as a whole.
    amplitude = rh.render(scene)[..., 2]
    assert np.abs(amplitude / expected - 1).max() < 1e-5


@pytest.mark.parametrize("roughness", [0.4, 0.6])
def test_specular_lobe_is_kirchhoff(roughness: float) -> None:
    """Backscatter of the Beckmann lobe: L = F exp(-tan^2/a^2) / (4 pi a^2 cos^4) I cos / R^2.

    sigma0 = |Gamma|^2 exp(-tan^2/a^2)/(a^2 cos^4) is 4 pi cos times the BRDF times cos
    (Ulaby, Moore & Fung, geometric optics); a = roughness^2.
    """
    scene = rh.new_scene(size=8)
    rh.add_emitter()
    material = nodes.make_material(
        "glossy", *METAL, specularity=1.0, roughness=roughness, penetrable=False
    )
    rh.add_plate(20, tilted(10, 10), material)
    ranges, cosine = plane_hits(scene, 10, 10)
    alpha2 = roughness**4
    tan2 = 1 / cosine**2 - 1
    sigma0 = np.exp(-tan2 / alpha2) / (alpha2 * cosine**4)
    power = unpolarised_reflectance(complex(*METAL), cosine)
    expected = power * sigma0 / (4 * math.pi * cosine) * INTENSITY / ranges**2
    amplitude = rh.render(scene)[..., 2]
    assert np.abs(amplitude / expected - 1).max() < 1e-4


def test_specularity_shares_the_reflected_power() -> None:
    """The lobes add up linearly: s glossy + (1 - s) diffuse."""
    scene = rh.new_scene(size=8)
    rh.add_emitter()
    plate = rh.add_plate(20, tilted(10, 20), None)
    images = {}
    for s in (0.0, 0.3, 1.0):
        plate.data.materials[0] = nodes.make_material("s", 1.4, 1.0, s, 0.7, penetrable=False)
        images[s] = rh.render(scene, 10).astype(np.float64)
    mixed = 0.3 * images[1.0] + 0.7 * images[0.0]
    assert np.abs(images[0.3] / mixed - 1).max() < 1e-5


def test_one_path_has_unit_check() -> None:
    scene = rh.new_scene()
    rh.add_emitter()
    rh.add_plate(60, tilted(10, 45), nodes.make_material("m", 1.4, 1.0, 0.5, 0.6))
    assert np.abs(rh.path_check(rh.render(scene, 10)) - 1).max() < 1e-6


def test_mixed_ranges_show_in_the_check() -> None:
    """G B / R^2 of a pixel that holds ranges at 10 and 20 is 1.175: what G is for."""
    scene = rh.new_scene(size=4)
    scene.cycles.samples = 64
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 1.0
    rh.add_emitter()
    material = rough(*METAL)
    # The near plate's edge halves the pixels of column 1.
    edge = -10 * math.tan(math.radians(10)) / 4
    rh.add_plate(20, Matrix.Translation((edge - 20, 0, -10)), material)
    rh.add_plate(40, Matrix.Translation((0, 0, -20)), material)
    check = rh.path_check(rh.render(scene, 10))
    # Shares 0.8 at 20 units of path and 0.2 at 40: (.8 e^-4 + .2 e^-8) / (.8 e^-2 + .2 e^-4)^2.
    assert np.abs(check[:, 1] - 1.175).max() < 0.05
    assert np.abs(check[:, [0, 2, 3]] - 1).max() < 0.01


def dihedral(scene_bounces: int, specularity: float) -> Any:
    """Mirror along the view axis at x = 3, rough wall facing the camera at z = -20; both metal."""
    scene = rh.new_scene(size=16, fov_deg=40, max_bounces=scene_bounces)
    rh.add_emitter()
    side = nodes.make_material("side", *METAL, specularity, 0.0, penetrable=False)
    pose = Matrix.Translation((3, 0, -10)) @ Matrix.Rotation(math.radians(-90), 4, "Y")
    rh.add_plate(10.0, pose, side, name="Side")
    rh.add_plate(30.0, Matrix.Translation((0, 0, -20)), rough(*METAL), name="Wall")
    return scene


def test_two_bounces_in_a_dihedral() -> None:
    """Camera, mirror, rough wall, emitter: length and amplitude by the mirror image's path."""
    scene = dihedral(2, 1.0)
    code_length = 20.0
    pixels = rh.render(scene, code_length)
    rays = rh.pixel_directions(scene)
    to_wall = 20 / -rays[..., 2]
    via_mirror = rays[..., 0] * to_wall > 3  # would pass x = 3 before z = -20
    assert 20 < via_mirror.sum() < 236
    image = rays * to_wall[..., None]  # where the unfolded ray meets the wall
    wall_point = image.copy()
    wall_point[..., 0] = 6 - image[..., 0]
    back = np.linalg.norm(wall_point, axis=-1)
    expected = np.where(via_mirror, to_wall + back, 2 * to_wall)
    measured = rh.decode_length(pixels, code_length) + rh.near_clip_length(scene)
    assert np.abs(measured / expected - 1).max() < 1e-5

    grazing = rays[..., 0]  # cosine on the mirror
    mirror = unpolarised_reflectance(complex(*METAL), np.abs(grazing))
    # The wall is met under the ray's angle; it returns to the emitter under another one.
    wall = unpolarised_reflectance(complex(*METAL), -rays[..., 2])
    cosine_out = 20 / back
    amplitude = mirror * wall / math.pi * INTENSITY / back**2 * cosine_out
    ratio = pixels[..., 2][via_mirror] / amplitude[via_mirror]
    assert np.abs(ratio - 1).max() < 1e-5


def test_rings_add_up_to_the_ungated_render() -> None:
    """Every last segment is in exactly one ring, whatever the bounces and the rounding of edges."""
    scene = dihedral(4, 0.5)
    rh.add_box((-3.0, -2.0, -12.0), (-1.0, 1.0, -9.0), nodes.make_material("b", 1.4, 0.02))
    whole = rh.render(scene, 15.0).astype(np.float64)
    step = 0.7  # not a float32 number
    total = np.zeros_like(whole)
    lit = np.zeros(whole.shape[:2], dtype=int)
    for ring in range(60):
        part = rh.render(scene, 15.0, (ring * step, (ring + 1) * step))
        total += part
        lit += part[..., 2] > 0
    assert lit.max() > 1, "the scene must spread a pixel over several rings to test anything"
    assert np.abs(total / whole - 1).max() < 1e-6


def test_ring_edge_is_in_exactly_one_ring() -> None:
    """Edges moved by single steps of float32 over the echo's own length: never none, never both."""
    scene = rh.new_scene(size=5)  # the middle pixel looks straight down
    rh.add_emitter()
    rh.add_plate(20, Matrix.Translation((0, 0, -8)), rough(*METAL))
    edge = np.float32(8 * (1 - 5e-7))
    inner_lit = []
    for _ in range(12):
        inner = rh.render(scene, 0, (4.0, float(edge)))[2, 2, 2] > 0
        outer = rh.render(scene, 0, (float(edge), 12.0))[2, 2, 2] > 0
        assert inner != outer
        inner_lit.append(bool(inner))
        edge = np.nextafter(edge, np.float32(9))
    assert inner_lit == sorted(inner_lit)
    assert not inner_lit[0]
    assert inner_lit[-1]


def test_without_attributes_there_is_no_code_and_no_gate() -> None:
    scene = rh.new_scene()
    rh.add_emitter()
    rh.add_plate(20, tilted(10, 30), nodes.make_material("m", 1.4, 1.0, 0.5, 0.6))
    plain = rh.render(scene)
    assert plain.min() > 0
    assert np.array_equal(plain[..., 0], plain[..., 2])
    assert np.array_equal(plain[..., 1], plain[..., 2])
    # The code leaves the amplitude alone.
    assert np.abs(rh.render(scene, 10)[..., 2] / plain[..., 2] - 1).max() < 1e-6


def test_power_of_a_small_plate_follows_the_radar_equation() -> None:
    """Sum of L A_e dOmega equals P G G lambda^2 sigma / ((4 pi)^3 R^4), sigma = 4 rho A cos^2."""
    side, wavelength = 0.2, 0.0565
    power = {}
    for distance in (20.0, 40.0):
        # The frame is twice as wide as the plate, whose edges fall between pixels.
        scene = rh.new_scene(size=64, fov_deg=math.degrees(2 * math.atan(side / distance)))
        rh.add_emitter()
        rh.add_plate(side / 2, tilted(distance, 0), rough(*METAL))
        amplitude = rh.render(scene, 10, (0.9 * distance, 1.1 * distance))[..., 2]
        assert (amplitude > 0).sum() == 32 * 32
        rays = rh.pixel_directions(scene)
        pitch = 2 * side / distance / 64
        solid_angle = pitch**2 * (-rays[..., 2]) ** 3
        aperture = wavelength**2 / (4 * math.pi)
        power[distance] = float((amplitude.astype(np.float64) * solid_angle * aperture).sum())
        albedo = unpolarised_reflectance(complex(*METAL), 1.0)
        sigma = 4 * albedo * side**2
        expected = rh.EIRP_W * wavelength**2 * sigma / ((4 * math.pi) ** 3 * distance**4)
        # What is left is the plate's own size: (side/distance)^2, 1e-4.
        assert power[distance] == pytest.approx(expected, rel=1e-4)
    assert power[20.0] / power[40.0] == pytest.approx(16, rel=2e-4)
