# SPDX-License-Identifier: GPL-3.0-or-later
"""sigma0 that the clutter lobe returns to the radar, pixel by pixel, against the model's equation.

Expected values need no code of the package: geometry of a plane, the radiance of a lamp's light,
and the equation of the NRL model with the numbers of its report.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Euler, Matrix

from radarsim_addon.blender.materials import set_clutter, set_clutter_tables
from radarsim_addon.blender.materials.physical_materials import make_physical_material
from radarsim_addon.blender.nodes.groups import group_node
from radarsim_addon.blender.state import SettingsRestorer
from radarsim_addon.physics.rough import sigma0 as kirchhoff
from tests.blender import render_helpers as rh

pytestmark = pytest.mark.blender

CARRIER_HZ = 9.65e9
#: Tilts about three axes [degrees]: nearly grazing, slanted, askew, at normal incidence.
TILTS = ((89.8, 0, 1.0), (80.0, 0, 30.0), (55.0, 20.0, 70.0), (5.0, 3.0, 0))


def sea_db(psi_deg: np.ndarray, state: float) -> np.ndarray:
    """NRL/MR/5310-12-9346, horizontal, 9.65 GHz."""
    lg = math.log10(9.65)
    return np.asarray(
        -73.0
        + 20.781 * np.log10(np.sin(np.radians(psi_deg)))
        + (27.5 + 7.351 * psi_deg) * lg / (1 + 0.95 * psi_deg)
        + 25.65 * (1 + state) ** (1 / (2 + 0.085 * psi_deg + 0.033 * state))
        + 0.0054 * psi_deg**2
    )


def clutter_material(slope: float, name: str, **parameters: float) -> Any:
    material = make_physical_material(
        "Sea", "sea_water", carrier_hz=CARRIER_HZ, penetrable=False, rms_slope=slope
    )
    set_clutter(material, name, **parameters)
    return material


def measured(material: Any, tilt_deg: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Grazing angle [degrees] and sigma0 of the pixels that see a large tilted plate."""
    scene = bpy.context.scene
    turn = Euler([math.radians(one) for one in tilt_deg]).to_matrix()
    # off its centre, since a ray that meets the edge between two triangles sees both or none
    middle = Matrix.Translation((0, 0, -10)) @ turn.to_4x4() @ Matrix.Translation((37, 91, 0))
    plate = rh.add_plate(400, middle, material)
    recorder = SettingsRestorer()
    set_clutter_tables(recorder, {material}, CARRIER_HZ, "horizontal")
    try:
        radiance = rh.render(scene)[..., 2].astype(np.float64)
    finally:
        assert recorder.restore() == []
        bpy.data.objects.remove(plate)
    rays = rh.pixel_directions(scene)
    normal = np.array(turn) @ (0.0, 0.0, 1.0)
    sine = np.abs(rays @ normal)
    range_m = (np.array([0.0, 0, -10]) @ normal) / (rays @ normal)
    seen = (range_m > 0) & (np.degrees(np.arcsin(np.minimum(sine, 1))) >= 0.05) & (range_m < 300)
    irradiance = rh.EIRP_W / (4 * np.pi) / range_m**2
    found = 4 * np.pi * radiance * sine / irradiance
    return np.degrees(np.arcsin(np.minimum(sine, 1)))[seen], found[seen]


@pytest.mark.parametrize("slope", [0.0, 0.15])
def test_pixels_have_the_models_sigma0(slope: float) -> None:
    rh.new_scene(size=64, fov_deg=24.0)
    rh.add_emitter()
    sea = clutter_material(slope, "nrl_sea", sea_state=3)
    angles = []
    for tilt in TILTS:
        psi_deg, found = measured(sea, tilt)
        expected = 10 ** (sea_db(psi_deg, 3.0) / 10)
        if slope:
            index = complex(*(group_node(sea).inputs[i].default_value for i in range(2)))
            cosine = np.sin(np.radians(psi_deg))
            expected += kirchhoff(index, slope, cosine, "cycles")
        error_db = 10 * np.log10(found / expected)
        assert np.abs(error_db).max() < 0.01, (tilt, psi_deg[np.argmax(np.abs(error_db))])
        angles.append(psi_deg)
    seen = np.concatenate(angles)
    assert seen.min() < 0.1 and seen.max() > 89.5 and seen.size > 5000


def test_albedos_above_one_are_exact_towards_the_radar() -> None:
    rh.new_scene(size=32, fov_deg=24.0)
    rh.add_emitter()
    psi_deg, found = measured(clutter_material(0.0, "constant_gamma", gamma_db=0.0), TILTS[0])
    assert (1 / (4 * np.sin(np.radians(psi_deg)))).max() > 8  # the largest albedo
    assert 10 * np.log10(found) == pytest.approx(
        10 * np.log10(np.sin(np.radians(psi_deg))), abs=0.01
    )


def test_a_table_needs_the_run_and_leaves_nothing_behind() -> None:
    rh.new_scene(size=8)
    rh.add_emitter()
    material = clutter_material(0.0, "nrl_sea")
    measured(material, TILTS[3])
    assert "Radar Clutter Tables" not in bpy.data.images
    assert group_node(material).inputs["Clutter Row"].default_value == 0
    rh.add_plate(100, Matrix.Translation((0, 0, -10)), material)
    assert rh.render(bpy.context.scene).max() == 0
