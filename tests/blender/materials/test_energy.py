# SPDX-License-Identifier: GPL-3.0-or-later
"""Physical materials in a closed white furnace: what comes back is what went in, less absorption.

Everything around shines with radiance 1, so that a pixel shows the share of the power sent along
its ray that is not absorbed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import EXACT_FACETS
from radarsim_addon.blender.materials.physical_materials import ASSETS
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.physics.fresnel import slab_power, unpolarised_reflectance
from radarsim_addon.physics.rough import albedo, transmission_factors
from scripts.validation import energy_slabs
from scripts.validation.case import Bench, Check
from tests.blender import render_helpers as rh
from tests.blender.slab_scene import physical_material

pytestmark = [pytest.mark.blender, pytest.mark.slow]

WAVELENGTH = 0.0566
SMOOTH = [asset.name for asset in ASSETS if not asset.rms_height_m]
PLACE = Matrix.Translation((0.03, 0.05, -10))


def furnace(
    material: dict[str, Any],
    angle_deg: float,
    thickness: float = 0.0,
    samples: int = 256,
    exact_facets: bool = EXACT_FACETS,
) -> tuple[np.ndarray, np.ndarray]:
    """Blue of a plate (thickness 0) or box in the furnace, and the cosine of incidence.

    exact_facets: Fresnel's equations at each facet, as runs have them from Blender 5.0 on; else
    F(0), as they have it before.
    """
    scene = rh.new_scene(size=8, fov_deg=1, max_bounces=33)
    scene.cycles.samples = samples
    scene.cycles.pixel_filter_type = "BOX"
    scene.world = bpy.data.worlds.new("Furnace")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (1, 1, 1, 1)
    scene[attributes.ATTR_WAVELENGTH] = WAVELENGTH
    scene[attributes.ATTR_FACET_FRESNEL] = float(exact_facets)
    made = physical_material(penetrable=thickness > 0, **material)
    pose = PLACE @ Matrix.Rotation(math.radians(angle_deg), 4, "X")
    if thickness:
        half = thickness / 2
        box = rh.add_box((-900.3, -880.1, -half), (910.7, 920.9, half), made)
        box.matrix_world = pose
        box[attributes.OBJECT_LAYER_NORMAL] = [0.0, 0.0, 1.0]
        box[attributes.OBJECT_LAYER_THICKNESS] = thickness
    else:
        rh.add_plate(900, pose, made)
    pixels = rh.render(scene).astype(np.float64)[..., 2]
    normal = np.array([0, -math.sin(math.radians(angle_deg)), math.cos(math.radians(angle_deg))])
    return pixels, np.abs(rh.pixel_directions(scene) @ normal)


@pytest.mark.parametrize("angle", [0, 60])
@pytest.mark.parametrize("n", [1.4, 2.3])
def test_lossless_slab_gives_everything_back(n: float, angle: float) -> None:
    pixels, _ = furnace({"n": n, "kappa": 0.0}, angle, 0.2)
    assert np.abs(pixels - 1).max() < 1e-6


@pytest.mark.parametrize(
    ("case", "names"),
    [
        (energy_slabs.simple_slabs, list(nodes.PRESETS)),
        (energy_slabs.library_slabs, SMOOTH),
    ],
)
def test_presets_and_the_library_conserve_power(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    case: Callable[[Bench], list[Check]],
    names: list[str],
) -> None:
    """Within 1e-3 in every polarisation, at one of the angles at which the validation does it."""
    monkeypatch.setattr(energy_slabs, "SLAB_ANGLES_DEG", (60.0,))
    checks = case(Bench(tmp_path))
    sums = [check for check in checks if energy_slabs.SUM in check.name]
    assert len(sums) == len(names)
    for name, check in zip(names, sums, strict=True):
        assert name in check.name and check.points >= 3 and check.bound == 1e-3
    assert [f"{c.name}: {c.error:.2g}" for c in checks if not c.passed] == []
    assert "largest share" in checks[-1].name


@pytest.mark.parametrize("angle", [30, 80])
@pytest.mark.parametrize(
    ("index", "thickness"), [(2.2926 + 0.1259j, 0.02), (2.5121 + 0.0227j, 0.05)]
)
def test_lossy_slab_keeps_what_it_absorbs(index: complex, thickness: float, angle: float) -> None:
    """Reflected and transmitted with all internal echoes, against the incoherent closed form.

    In polarisation 'average': echoes inside keep the polarisation that passed the first face.
    """
    pixels, cosine = furnace({"n": index.real, "kappa": index.imag}, angle, thickness, 1024)
    slab = slab_power(index, thickness, WAVELENGTH, cosine, "incoherent")
    expected = float((slab.reflected + slab.transmitted).mean())
    error = pixels.std() / math.sqrt(pixels.size)
    assert error < 8e-4
    assert abs(pixels.mean() - expected) < 1e-3 + 2 * error


@pytest.mark.parametrize("scale", [1.0, 0.25])
def test_layer_behind_a_mirror_is_entered_anew(scale: float) -> None:
    """A path that was reflected elsewhere before it goes through has no echo inside behind it."""
    index, thickness = 2.5121 + 0.0227j, 0.05
    scene = rh.new_scene(size=8, fov_deg=1, max_bounces=1)  # no echo inside: that is the second
    scene.cycles.samples = 256
    scene.cycles.pixel_filter_type = "BOX"
    scene.world = bpy.data.worlds.new("Sky")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    scene[attributes.ATTR_WAVELENGTH] = WAVELENGTH
    mirror = nodes.make_material("Mirror", 1e4, 1e4, 1.0, 0.0, penetrable=False)
    # Down to the mirror, level to the layer, which stands at 60 degrees to the ray.
    rh.add_plate(3, PLACE @ Matrix.Rotation(math.radians(45), 4, "X"), mirror)
    half = thickness / 2 / scale
    size = 30 / scale
    made = physical_material(index.real, index.imag)
    box = rh.add_box((-size, -half, -size), (size * 1.1, half, size * 1.2), made)
    pose = Matrix.Translation((0, -50, -10)) @ Matrix.Rotation(math.radians(60), 4, "Z")
    box.matrix_world = pose @ Matrix.Scale(scale, 4)
    box[attributes.OBJECT_LAYER_NORMAL] = [0.0, 1.0, 0.0]
    box[attributes.OBJECT_LAYER_THICKNESS] = 2 * half
    pixels = rh.render(scene).astype(np.float64)[..., 2]
    slab = slab_power(index, thickness, WAVELENGTH, 0.5, "single-pass")
    expected = float(slab.transmitted) * 0.9998
    error = pixels.std() / math.sqrt(pixels.size)
    assert error < 1e-3
    assert abs(pixels.mean() - expected) < 2e-3 + 2 * error


CLOSED = {"Transmission": 0.0, "Grazing Transmission": 0.0}


def model_albedo(index: complex, slope: float, cosine: float, exact_facets: bool) -> float:
    """The single-scatter albedo of the Smith-Beckmann model, integrated numerically."""
    if exact_facets:
        return albedo(slope, cosine, index, "smith", 256)
    normal = float(unpolarised_reflectance(index, 1.0))
    return normal * albedo(slope, cosine, None, "smith", 256)


@pytest.mark.parametrize("angle", [0, 60])
@pytest.mark.parametrize("slope", [0.1, 0.45])
@pytest.mark.parametrize("index", [1e4 + 1e4j, 9 + 3j])
def test_rough_conductor_has_its_albedo(index: complex, slope: float, angle: float) -> None:
    """Within 3e-3, with F at each facet (from Blender 5.0 on) and with F(0) (on every one)."""
    roughness = math.sqrt(math.sqrt(2) * slope)
    material = {"n": index.real, "kappa": index.imag, "roughness": roughness, **CLOSED}
    for exact_facets in {False, EXACT_FACETS}:
        pixels, cosine = furnace(material, angle, samples=512, exact_facets=exact_facets)
        expected = model_albedo(index, slope, float(cosine.mean()), exact_facets)
        error = pixels.std() / math.sqrt(pixels.size)
        assert error < 1e-3
        assert abs(pixels.mean() - expected) < 3e-3


@pytest.mark.parametrize(
    ("index", "missing_db"),
    [
        (1.4, (0.01, 0.20, 1.20, 4.14)),
        (2.3, (0.00, 0.05, 0.27, 1.06)),
        (9 + 3j, (0.00, -0.01, -0.06, -0.25)),
    ],
)
def test_what_facets_at_normal_incidence_leave_out(
    index: complex, missing_db: tuple[float, ...]
) -> None:
    """F(theta)/F(0) as docs/materials.md tells users of Blender 4.5: nearly smooth facets met at
    15 to 60 degrees."""
    index = complex(index)
    material = {"n": index.real, "kappa": index.imag, "roughness": 0.12, **CLOSED}
    for angle, missing in zip((15, 30, 45, 60), missing_db, strict=True):
        pixels, cosine = furnace(material, angle, exact_facets=False)
        exact = unpolarised_reflectance(index, cosine).mean()
        assert 10 * math.log10(exact / pixels.mean()) == pytest.approx(missing, abs=0.012)


@pytest.mark.parametrize("index", [1.4, 9 + 3j, 20 + 20j])
@pytest.mark.parametrize("slope", [0.1, 0.3, 0.7])
def test_rough_faces_create_no_power(index: complex, slope: float) -> None:
    """Facets reflect more than a smooth face, up to 0.1 near grazing: taken from what passes."""
    index = complex(index)
    flat, grazing = transmission_factors(index, slope, EXACT_FACETS)
    material = {
        "n": index.real,
        "kappa": index.imag,
        "roughness": math.sqrt(math.sqrt(2) * slope),
        "Transmission": flat,
        "Grazing Transmission": grazing,
    }
    for angle in (0, 50, 75, 85):
        pixels, _ = furnace(material, angle)
        error = pixels.std() / math.sqrt(pixels.size)
        assert pixels.mean() < 1.002 + 2 * error, angle
        assert pixels.mean() > 0.3
