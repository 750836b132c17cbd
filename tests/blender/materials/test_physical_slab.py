# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight through layers of physical materials, against the plane-parallel closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender.nodes import attributes
from radarsim_addon.physics.fresnel import excess_path_m, slab_power
from radarsim_addon.physics.materials import material
from tests.blender import render_helpers as rh
from tests.blender import slab_scene as ss

pytestmark = pytest.mark.blender

WAVELENGTH = 0.0566


def power_to_db(ratio: np.ndarray) -> np.ndarray:
    return np.abs(10 * np.log10(ratio))


@pytest.mark.parametrize("angle", [0, 30, 60])
@pytest.mark.parametrize(
    ("index", "thickness"),
    [(2.3, 0.2), (2.2926 + 0.1259j, 0.05), (1.05 + 0.001j, 0.2), (6.1 + 1.9j, 0.008)],
)
def test_slab_both_ways(index: complex, thickness: float, angle: float) -> None:
    """Power within 0.005 dB, optical delay within 1e-6 of the path."""
    found = ss.cross(complex(index), thickness, angle, WAVELENGTH)
    slab = slab_power(index, thickness, WAVELENGTH, found.cosine, "single-pass")
    # One way the mean of both polarisations; both ways the co-polar echo of a radar slanted 45
    # degrees to the plane of incidence.
    assert power_to_db(found.power / slab.transmitted**2).max() < 5e-3
    delay = excess_path_m(index, thickness, found.cosine)
    assert np.abs(found.extra - delay).max() < 1e-6 * ss.WALL


@pytest.mark.parametrize(("polarisation", "angle"), [(1, 30), (1, 60), (2, 30), (2, 60)])
def test_vertical_and_horizontal(polarisation: int, angle: float) -> None:
    """The plane of incidence is level: vertical is across it (s), horizontal in it (p)."""
    index = complex(material("concrete", 5.3e9))
    found = ss.cross(index, 0.05, angle, WAVELENGTH, polarisation)
    slab = slab_power(index, 0.05, WAVELENGTH, found.cosine, "single-pass")
    one_way = slab.transmitted_s if polarisation == 1 else slab.transmitted_p
    # Rays half a degree off the level plane mix a little of the other one in.
    assert power_to_db(found.power / one_way**2).max() < 2e-3
    other = slab.transmitted_p if polarisation == 1 else slab.transmitted_s
    assert power_to_db(found.power / other**2).min() > 0.5


@pytest.mark.parametrize("carrier_hz", [1e9, 5.3e9, 24e9, 77e9])
@pytest.mark.parametrize("loss_db", [20.0, 90.0])
def test_plate_behind_concrete(carrier_hz: float, loss_db: float) -> None:
    """20 to 90 dB both ways through walls of ITU-R P.2040-3 concrete, at 30 degrees."""
    index = complex(material("concrete", carrier_hz))
    wavelength = 299_792_458.0 / carrier_hz
    q = np.sqrt(index**2 - 1 + 0.75)
    faces = slab_power(index, 1e-9, wavelength, math.sqrt(0.75), "incoherent").transmitted
    absorbed = loss_db + 20 * math.log10(float(faces))
    thickness = absorbed * math.log(10) / 20 * wavelength / (4 * math.pi * q.imag)
    assert thickness < 4  # what fits between radar and wall
    found = ss.cross(index, thickness, 30, wavelength)
    slab = slab_power(index, thickness, wavelength, found.cosine, "single-pass")
    assert power_to_db(slab.transmitted**2).mean() == pytest.approx(loss_db, abs=1.5)
    assert power_to_db(found.power / slab.transmitted**2).max() < 0.02
    delay = excess_path_m(index, thickness, found.cosine)
    assert np.abs(found.extra - delay).max() < 1e-5 * ss.WALL


def test_100_db_both_ways() -> None:
    """Every supported Blender carries 100 dB; 4.5 and before end at about 120 dB."""
    index = 2.2926 + 0.1259j
    thickness = 0.373
    found = ss.cross(index, thickness, 0, WAVELENGTH)
    slab = slab_power(index, thickness, WAVELENGTH, found.cosine, "single-pass")
    assert power_to_db(slab.transmitted**2).mean() == pytest.approx(100, abs=10)
    assert power_to_db(found.power / slab.transmitted**2).max() < 0.02


def through_boxes(boxes: list[tuple[complex, float, float]], faces: int) -> np.ndarray:
    """Power of a Lambert wall at y = 10 behind boxes (index, from, to), and its coded length."""
    scene = rh.new_scene(size=8, fov_deg=0.5)
    scene.camera.rotation_euler = (math.pi / 2, 0, 0)
    rh.add_emitter()
    wall = Matrix.Translation((0, 10, 0)) @ Matrix.Rotation(math.pi / 2, 4, "X")
    rh.add_plate(30, wall, rh.lambert(0.9, "wall"), name="Wall")
    for number, (index, near, far) in enumerate(boxes):
        # Other sides for each, so that no two faces coincide.
        wide = 3 + 0.37 * number
        box = rh.add_box(
            (-wide, near, -wide - 0.1),
            (wide + 0.2, far, wide + 0.4),
            ss.physical_material(index.real, index.imag),
        )
        box[attributes.OBJECT_LAYER_NORMAL] = [0.0, 1.0, 0.0]
    scene[attributes.ATTR_WAVELENGTH] = 1.0
    if faces:
        scene[attributes.ATTR_SURFACE_DEPTH] = scene[attributes.ATTR_SURFACE_STOP] = faces + 0.5
    return rh.render(scene, 10.0).astype(np.float64)


@pytest.mark.parametrize("case", ["nested and overlapping", "radar inside"])
def test_several_media(case: str) -> None:
    """What the objects do adds up, and a radar inside a medium loses only what is before it."""
    if case == "radar inside":
        boxes, faces = [(1.8 + 0.01j, -1.0, 7.0)], 1
        depths = [7.0]
    else:
        boxes = [(1.8 + 0.01j, 3.0, 7.0), (1.3 + 0.02j, 4.0, 4.5), (2.1 + 0.005j, 6.0, 8.0)]
        faces, depths = 6, [4.0, 0.5, 2.0]
    ratio = through_boxes(boxes, faces) / through_boxes([], 0)
    power, extra = 1.0, 0.0
    for (index, _, _), depth in zip(boxes, depths, strict=True):
        # Two faces each way; with the radar inside, one: a slab of twice the depth, once.
        if case == "radar inside":
            power *= float(slab_power(index, 2 * depth, 1.0, 1.0, "single-pass").transmitted)
        else:
            power *= float(slab_power(index, depth, 1.0, 1.0, "single-pass").transmitted) ** 2
        extra += float(excess_path_m(index, depth, 1.0))
    assert power_to_db(ratio[..., 2] / power).max() < 0.01
    found = -10.0 * np.log(ratio[..., 0] / ratio[..., 2]) / 2
    # Rays are up to 0.35 degrees off the normal.
    assert np.abs(found - extra).max() < 1e-4 * extra


def test_thick_walls_far_below_what_is_left() -> None:
    """130 dB both ways in a wall longer than Cycles' own volume step; the echo is zero or right.

    With several steps Cycles stops absorbing as soon as 1e-6 is left. Blender 4.5 and before carry
    about 120 dB and then nothing.
    """
    index = complex(material("concrete", 1e9))
    found = ss.cross(index, 1.9, 0, 0.299792458)
    slab = slab_power(index, 1.9, 0.299792458, found.cosine, "single-pass")
    assert power_to_db(slab.transmitted**2).mean() == pytest.approx(128, abs=2)
    if bpy.app.version >= (5, 0, 0):
        assert power_to_db(found.power / slab.transmitted**2).max() < 0.02
    else:
        assert not found.power.any()
