# SPDX-License-Identifier: GPL-3.0-or-later
"""Directive lobes of walls and slightly rough mirrors: paths by formula, power, bad input.

The lobe is integrated over the half-space here by sums over the sphere.
"""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
import pytest

from radarsim_addon import blender as radarsim
from radarsim_addon.blender import nodes
from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.rough import masking_lambda
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.paths.test_paths_clutter import WAVELENGTH_M, ground, move_transmitter

pytestmark = pytest.mark.blender

SITE = np.array([3.0, 22.0, 1.0])
INDEX = 2.4 + 0.1j


def lobes(exponent: int, incidence: np.ndarray, scattered: np.ndarray) -> np.ndarray:
    """Lobe over its integral above z = 0, of unit vectors of incidence and scattering, (n, 3)."""
    up, turn = np.meshgrid((np.arange(150) + 0.5) / 150, (np.arange(100) + 0.5) * np.pi / 50)
    level = np.sqrt(1 - up**2)
    sphere = np.stack([level * np.cos(turn), level * np.sin(turn), up], axis=-1).reshape(-1, 3)
    angles = np.linspace(0, np.pi / 2, 90)
    ways = np.stack([np.sin(angles), 0 * angles, np.cos(angles)])
    totals = 2 * np.pi * np.mean(((1 + sphere @ ways) / 2) ** exponent, axis=0)
    mirrored = incidence * (-1, -1, 1)
    total = np.interp(np.arccos(mirrored[:, 2]), angles, totals)
    along = np.einsum("ij,ij->i", mirrored, scattered)
    return ((1 + along) / 2) ** exponent / total


def fresnel(sine: np.ndarray) -> np.ndarray:
    """Mean reflectance of both polarisations at sines of grazing angles."""
    root = np.sqrt(INDEX**2 - (1 - sine**2))
    h, v = (sine - root) / (sine + root), (INDEX**2 * sine - root) / (INDEX**2 * sine + root)
    return (np.abs(h) ** 2 + np.abs(v) ** 2) / 2


def level_plate(tmp_path: Path, material: object) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a level plate below the receiver, lit from `SITE`; and the power density there."""
    corners, _ = ground(9.0, 14.0, 2.0, 1.5)
    ph.quad("Ground", corners, material)
    ph.field_of_view(26.0)
    move_transmitter(tuple(SITE))
    rows = ph.run_paths(tmp_path / "run", width_px=32, height_px=32).table()
    way = SITE - rows["last_scatterer_m"]
    return rows, rs.EIRP_W / (4 * np.pi * np.sum(way**2, axis=1))


@pytest.mark.parametrize("kind", ["wall", "glossy wall", "rough mirror"])
def test_bistatic_paths_have_the_lobe(tmp_path: Path, kind: str) -> None:
    rs.new_scene()
    exponent, height_m = 12, 0.006
    if kind == "rough mirror":
        material = radarsim.material(n=INDEX.real, kappa=INDEX.imag, rms_height_m=height_m)
    else:
        roughness = 0.6 if kind == "glossy wall" else 0.0
        material = nodes.make_material("Wall", INDEX.real, INDEX.imag, 0.4, roughness)
    radarsim.set_scattered_lobe(material, exponent)
    rows, irradiance = level_plate(tmp_path, material)
    assert rows.size > 20
    way = SITE - rows["last_scatterer_m"]
    incidence = way / np.linalg.norm(way, axis=1)[:, None]
    sine, seen = incidence[:, 2], -rows["direction"][:, 2]
    share = np.full(rows.size, 0.6)
    if kind == "rough mirror":
        x = 2 * (2 * np.pi * height_m * sine / WAVELENGTH_M) ** 2
        share = 1 - (np.exp(-x) * np.i0(x)) ** 2
    scattered = share * fresnel(sine) * lobes(exponent, incidence, -rows["direction"]) / seen
    if kind == "glossy wall":
        half = incidence - rows["direction"]
        half /= np.linalg.norm(half, axis=1)[:, None]
        alpha = 0.36
        masked = 1 + sum(masking_lambda(alpha, cosine, "cycles") for cosine in (sine, seen))
        density = np.exp(-(1 / half[:, 2] ** 2 - 1) / alpha**2) / (
            np.pi * alpha**2 * half[:, 2] ** 4
        )
        scattered += 0.4 * fresnel(seen) * density / masked / (4 * sine * seen)
    expected = scattered * irradiance * sine
    np.testing.assert_allclose(ph.radiance(rows), expected, rtol=5e-3)


def test_what_a_rough_mirror_takes_from_the_image_is_in_its_lobe(tmp_path: Path) -> None:
    """Seen from the radar, a far wall all around is as bright in a rough mirror as in a smooth one.

    Both lobe and image are seen; the wall's Lambert surface is lit evenly from the middle.
    """
    powers = []
    for height_m in (0.0, 0.009):
        rs.new_scene()
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=5, radius=60.0)
        bpy.context.object.data.materials.append(ph.lambert(0.5))
        material = radarsim.material("metal", rms_height_m=height_m)
        if height_m:
            radarsim.set_scattered_lobe(material, 200)
        tilt = math.radians(40.0)
        # upright, so that the mirrored waves keep their polarisation
        up = np.array([0.0, 0.0, 0.5])
        right = np.array([math.cos(tilt), math.sin(tilt), 0.0]) * 0.5
        at = np.array([0.0, 3.0, 0.0])
        corners = [at - right - up, at + right - up, at + right + up, at - right + up]
        ph.quad("Mirror", [tuple(one) for one in corners], material)
        ph.field_of_view(12.0)
        options = {"max_reflections": 2, "mirror_images": 0, "replicates": 4}
        run = ph.run_paths(tmp_path / str(height_m), width_px=48, height_px=48, options=options)
        rows, names = run.table(), run.record().objects
        first = rows["first_object"] == names.index("Mirror") + 1
        powers.append(rows["power_w"][first & (rows["order"] == 2)].sum())
    x = 2 * (2 * math.pi * 0.009 * math.cos(math.radians(40)) / WAVELENGTH_M) ** 2
    assert (math.exp(-x) * float(np.i0(x))) ** 2 < 0.5
    assert powers[1] / powers[0] == pytest.approx(1.0, abs=0.05)


def test_materials_without_such_a_lobe_are_named(tmp_path: Path) -> None:
    rs.new_scene()
    smooth = radarsim.material("metal")
    rough = radarsim.material("metal", rms_slope=0.2)
    pane = radarsim.material("glass", sheet_thickness_m=0.004)
    for material, said in (
        (smooth, "RMS height above 0"),
        (rough, "RMS height above 0"),
        (pane, "thin sheet"),
        (ph.lambert(0.5), "needs a Radar Material"),
        (nodes.make_material("Mirror", 2.0, 0.0, 1.0, 0.0), "Specularity below 1"),
    ):
        with pytest.raises(ConfigError, match=rf"'{material.name}'.*{said}"):
            radarsim.set_scattered_lobe(material, 4)
        assert "radarsim_lobe_exponent" not in material.keys()
    wall = nodes.make_material("Wall", 2.0, 0.0, 0.5, 0.0)
    radarsim.set_scattered_lobe(wall, 4)
    with pytest.raises(ConfigError, match="whole number from 1"):
        radarsim.set_scattered_lobe(wall, 0.5)
    assert wall["radarsim_lobe_exponent"] == 4
    wall["radarsim_lobe_exponent"] = "wide"  # by hand, in Blender's window
    ph.plate_at(10, 4, wall)
    with pytest.raises(ConfigError, match=r"'Wall'.*'wide'; expected a whole number"):
        ph.run_paths(tmp_path / "run", width_px=8, height_px=8)
    radarsim.set_scattered_lobe(wall, None)
    assert "radarsim_lobe_exponent" not in wall.keys()
    ground_ = radarsim.material("metal", rms_height_m=0.001)
    radarsim.set_clutter(ground_, "constant_gamma")
    with pytest.raises(ConfigError, match="clutter model and a scattered lobe"):
        radarsim.set_scattered_lobe(ground_, 4)
