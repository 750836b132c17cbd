# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers over surfaces with a clutter model: bistatic, second reflections, and what is said.

Expected powers are integrals over the surfaces by their areas, with the rule that sigma0 of two
angles is the geometric mean of sigma0 at each.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from unittest import mock

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from radarsim_addon import contract
from radarsim_addon.blender.materials import (
    fluctuation_of,
    set_clutter,
    set_clutter_fluctuation,
)
from radarsim_addon.blender.materials.physical_materials import make_physical_material
from radarsim_addon.blender.nodes.physical_material import table_angles_rad
from radarsim_addon.blender.paths.clutter_weights import ClutterLobe
from radarsim_addon.blender.paths.hit_points import BodyMeshes, Normals
from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.clutter import clutter_model
from radarsim_addon.signal import open_run
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = [pytest.mark.blender, pytest.mark.slow]

GAMMA_DB = -15.0
GAMMA = 10 ** (GAMMA_DB / 10)
WAVELENGTH_M = ph.C0_MPS / 5.3e9
LINK = rs.EIRP_W * WAVELENGTH_M**2 / (4 * math.pi) ** 3
UP = np.array([0.0, 0.0, 1.0])


def ground_material(name: str = "constant_gamma", **parameters: float) -> Any:
    """A surface that reflects nothing but by its clutter model."""
    material = make_physical_material("Ground", "vacuum", carrier_hz=5.3e9, penetrable=False)
    set_clutter(material, name, **parameters)
    return material


def cells(corner: Any, side: Any, other: Any, count: int) -> tuple[np.ndarray, float]:
    """Middles of the cells of a parallelogram, (count^2, 3), and the area of one."""
    corner, side, other = (np.array(one, dtype=np.float64) for one in (corner, side, other))
    at = (np.arange(count) + 0.5) / count
    points = corner + at[:, None, None] * side + at[None, :, None] * other
    area = float(np.linalg.norm(np.cross(side, other))) / count**2
    return points.reshape(-1, 3), area


def ground(start: float, stop: float, half: float, height: float) -> tuple[list[Any], Any]:
    """Corners of a level rectangle ahead, below the receiver; and its three vectors."""
    corner, side, other = (-half, start, -height), (2 * half, 0, 0), (0, stop - start, 0)
    a, b, c = (np.array(one, dtype=float) for one in (corner, side, other))
    return [tuple(p) for p in (a, a + b, a + b + c, a + c)], (a, b, c)


def move_transmitter(place: tuple[float, float, float]) -> None:
    emitter = next(item for item in bpy.data.objects if item.type == "LIGHT")
    bpy.context.view_layer.update()
    emitter.matrix_world = Matrix.Translation(place)


def ways(points: np.ndarray, to: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors and distances from points to a place."""
    way = to - points
    length = np.linalg.norm(way, axis=-1)
    return way / length[..., None], length


@pytest.mark.parametrize("place", [(3.0, 4.0, 2.0), (0.0, 0.0, 0.0)])
def test_bistatic_power_is_the_integral_of_the_mean_of_both_angles(
    tmp_path: Path, place: tuple[float, float, float]
) -> None:
    rs.new_scene()
    corners, vectors = ground(9.0, 14.0, 2.0, 1.5)
    ph.quad("Ground", corners, ground_material(gamma_db=GAMMA_DB))
    ph.field_of_view(26.0)
    move_transmitter(place)
    options = {"replicates": 16}
    run = ph.run_paths(tmp_path / "run", width_px=256, height_px=256, options=options)
    points, area = cells(vectors[0], vectors[1], vectors[2], 400)
    (to_r, r), (to_t, t) = ways(points, np.zeros(3)), ways(points, np.array(place))
    sigma = GAMMA * np.sqrt(to_r[:, 2] * to_t[:, 2])
    expected = LINK * np.sum(sigma * area / (r * t) ** 2)
    found = run.table()["power_w"].sum()
    assert 10 * math.log10(found / expected) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("slope", [0.0, 0.25])
def test_second_reflections_are_reciprocal_and_those_of_an_integral(
    tmp_path: Path, slope: float
) -> None:
    """Ground and a wall that reflects as Lambert's law says, in both directions.

    A rough interface of the ground adds its own lobe: less of it is known, so only the
    reciprocity of both ways is tested there.
    """
    rs.new_scene()
    corners, (a, b, c) = ground(8.0, 12.0, 2.0, 1.0)
    material = ground_material(gamma_db=GAMMA_DB)
    if slope:
        material = make_physical_material("Ground", "metal", carrier_hz=5.3e9, rms_slope=slope)
        set_clutter(material, "constant_gamma", gamma_db=GAMMA_DB)
    ph.quad("Ground", corners, material)
    wall = [(-2.0, 12.0, -1.0), (2.0, 12.0, -1.0), (2.0, 12.0, 2.0), (-2.0, 12.0, 2.0)]
    ph.quad("Wall", wall, ph.lambert(0.6))
    ph.field_of_view(34.0)
    options = {"max_reflections": 2, "replicates": 4}
    run = ph.run_paths(tmp_path / "run", width_px=256, height_px=256, options=options)
    rows, names = run.table(), run.record().objects
    two = rows[rows["order"] == 2]
    first = two["first_object"] == names.index("Ground") + 1
    found = np.array([two["power_w"][first].sum(), two["power_w"][~first].sum()])
    if slope:
        assert abs(10 * math.log10(found[0] / found[1])) < 0.3
        return
    low, low_area = cells(a, b, c, 60)
    high, high_area = cells(wall[0], (4, 0, 0), (0, 0, 3), 60)
    (low_r, low_m), (high_r, high_m) = ways(low, np.zeros(3)), ways(high, np.zeros(3))
    between = high[None] - low[:, None]
    d = np.linalg.norm(between, axis=-1)
    rising, ahead = between[..., 2] / d, between[..., 1] / d  # sines at ground and wall
    sigma = GAMMA * np.sqrt(low_r[:, None, 2] * np.maximum(rising, 1e-9))
    # sigma0 of the wall between two directions is 4 rho cos cos
    lambert = 4 * 0.6 * ahead * np.abs(high_r[None, :, 1])
    part = sigma * lambert / (low_m[:, None] * high_m[None, :] * d) ** 2
    expected = LINK / (4 * math.pi) * part.sum() * low_area * high_area
    assert 10 * np.log10(found / expected) == pytest.approx(np.zeros(2), abs=0.2)


def test_normals_are_those_that_hit_points_were_moved_along(tmp_path: Path) -> None:
    """At 77 GHz hit points are refined: the same powers as with normals that are looked for."""
    rs.new_scene()
    corners, _ = ground(8.0, 12.0, 2.0, 1.0)
    ph.quad("Ground", corners, ground_material(gamma_db=GAMMA_DB))
    wall = [(-2.0, 12.0, -1.0), (2.0, 12.0, -1.0), (2.0, 12.0, 2.0), (-2.0, 12.0, 2.0)]
    ph.quad("Wall", wall, ph.lambert(0.6))
    ph.field_of_view(34.0)
    move_transmitter((3.0, 4.0, 2.0))
    options = {"max_reflections": 2}
    asked = {"width_px": 32, "height_px": 32, "options": options,
             "waveform": rs.Waveform(77e9, 150e6, 2.5e-6, 180e6)}  # fmt: skip
    looked_for: list[int] = []
    hit = BodyMeshes.hit

    def count(self: BodyMeshes, bodies: Any, *rays: Any) -> Any:
        looked_for[-1] += int((bodies > 0).sum())
        return hit(self, bodies, *rays)

    rows = []
    for number, add in enumerate((Normals.add, lambda *_: None)):
        looked_for.append(0)
        with mock.patch.object(BodyMeshes, "hit", count), mock.patch.object(Normals, "add", add):
            rows.append(ph.run_paths(tmp_path / str(number), **asked).table())
    np.testing.assert_array_equal(rows[0]["order"], rows[1]["order"])
    np.testing.assert_allclose(rows[0]["power_w"], rows[1]["power_w"], rtol=1e-6)
    clutter = (rows[0]["last_object"] == 1) | (rows[0]["first_object"] == 1)
    assert looked_for[1] - looked_for[0] >= 0.9 * clutter.sum()
    assert set(np.unique(rows[0]["order"][clutter])) == {1, 2}


def test_the_table_of_a_lobe_is_read_as_a_line() -> None:
    """A model that falls by 60 dB from zenith to grazing, against numpy's own interpolation."""
    angles = table_angles_rad()
    table_db = -60 * (1 - angles * 2 / np.pi) ** 4 - 40 * np.cos(angles) ** 2
    lobe = ClutterLobe(table_db, "Ground", clutter_model("nrl_sea"), 2.0 + 0j, 0.0)
    angle = np.concatenate([np.geomspace(1e-9, 1.5, 20_001), np.linspace(1.5, np.pi / 2, 5001)])
    u, known = (np.cbrt(one * 2 / np.pi) for one in (angle, angles))
    line_db = np.interp(u, known, table_db)
    found_db = 10 * np.log10(lobe.sigma0(np.sin(angle)))
    assert np.abs(found_db - line_db).max() < 1e-4


def test_angles_beyond_the_model_and_the_curved_earth_are_said(tmp_path: Path) -> None:
    rs.new_scene()
    corners, _ = ground(500.0, 9000.0, 500.0, 10.0)
    ph.quad("Sea", corners, ground_material("nrl_sea", sea_state=3))
    ph.field_of_view(3.0)
    run = ph.run_paths(tmp_path / "run", width_px=32, height_px=64)
    said = {item.code: item for item in run.record().findings}
    angles = said["clutter-beyond-angles"]
    numbers: dict[str, Any] = {**said["clutter-on-flat-earth"].numbers, **angles.numbers}
    assert angles.subjects == ("Ground",) and 0 < numbers["fraction"] < 0.5
    # the last row of pixels that sees the surface, which ends at 9 km
    end_deg = math.degrees(math.atan(10 / 9000))
    assert end_deg <= numbers["least_deg"] <= end_deg + 3.0 / 64
    # sigma0 falls by 21 to 26 dB a decade of the sine; 0.5 dB is 5 % of the angle
    assert 2000 < numbers["range_m"] < 5000
    flat_rad = math.atan(10 / numbers["range_m"])
    round_rad = flat_rad - numbers["range_m"] / (2 * 4 / 3 * 6.371e6)
    flat_db, round_db = (
        float(clutter_model("nrl_sea").sigma0_db(rs.WAVEFORM.carrier_hz, at_rad, sea_state=3))
        for at_rad in (flat_rad, round_rad)
    )
    assert 0.48 < flat_db - round_db < 1.5  # rows of pixels are some hundred metres apart
    assert 0.5 < numbers["error_db"] < 40


def test_several_materials_of_an_object_are_said(tmp_path: Path) -> None:
    rs.new_scene()
    corners, _ = ground(9.0, 14.0, 2.0, 1.5)
    item = ph.quad("Ground", corners, ground_material(gamma_db=GAMMA_DB))
    item.data.materials.append(ph.lambert(0.5))
    run = ph.run_paths(tmp_path / "run", width_px=16, height_px=16)
    assert "clutter-of-several-materials" in [one.code for one in run.record().findings]


def test_models_that_cannot_hold_are_said(tmp_path: Path) -> None:
    rs.new_scene()
    corners, _ = ground(9.0, 14.0, 2.0, 1.5)
    material = ground_material("nrl_sea", sea_state=0)
    ph.quad("Ground", corners, material)
    waveform = rs.WAVEFORM.__class__(77e9, 50e6, 2.5e-6, 60e6)
    run = ph.run_paths(tmp_path / "run", width_px=8, height_px=8, waveform=waveform)
    said = {item.code: item for item in run.job.findings}
    assert (
        "0.5" in said["clutter-beyond-band"].text or "500 MHz" in said["clutter-beyond-band"].text
    )
    set_clutter(material, "constant_gamma", gamma_db=-50.0)
    run = ph.run_paths(tmp_path / "weak", width_px=8, height_px=8)
    (weak,) = [one for one in run.job.findings if one.code == "clutter-too-weak"]
    # rho = gamma / (4 sin psi) is below 3e-5 above 4.8 degrees
    assert weak.numbers["grazing_deg"] == pytest.approx(4.78, abs=0.1)


def test_the_record_holds_how_clutter_fluctuates(tmp_path: Path) -> None:
    rs.new_scene()
    material = ground_material(gamma_db=GAMMA_DB)
    values = {"texture": "k", "texture_shape": 0.7, "texture_length_m": 2.0, "motion": "sea",
              "motion_speed_mps": 0.1, "motion_fraction": 0.75}  # fmt: skip
    with pytest.raises(ConfigError, match="no 'wind'"):
        set_clutter_fluctuation(material, wind=3.0)
    with pytest.raises(ConfigError, match="Length of the texture"):
        set_clutter_fluctuation(material, texture="k", texture_shape=1.0)
    assert fluctuation_of([material]) is None
    set_clutter_fluctuation(material, **values)
    corners, _ = ground(9.0, 14.0, 2.0, 1.5)
    ph.quad("Ground", corners, material)
    run = ph.run_paths(tmp_path / "run", width_px=8, height_px=8)
    frame = open_run(run.folder).frame(1)
    scene = frame.scene()
    assert scene is not None
    assert scene.objects[0].fluctuation == contract.FluctuationRecord(**values)
    assert scene.objects[0].clutter == "constant_gamma"
    set_clutter_fluctuation(material, motion="gaussian", motion_speed_mps=1.0)
    assert fluctuation_of([None, material]) == contract.FluctuationRecord(
        motion="gaussian", motion_speed_mps=1.0
    )


def test_a_model_without_its_group_or_file_is_named(tmp_path: Path) -> None:
    rs.new_scene()
    plain = ph.lambert(0.5)
    with pytest.raises(ConfigError, match="no physical Radar Material"):
        set_clutter(plain, "nrl_sea")
    plain["radarsim_clutter"] = "nrl_sea"
    plate = ph.plate_at(10, 4, plain)
    run = ph.run_paths(tmp_path / "run", width_px=8, height_px=8)
    assert "clutter-not-connected" in [one.code for one in run.job.findings]
    truth = open_run(run.folder).frame(1).scene()
    assert truth is not None and truth.objects[0].clutter is None
    material = ground_material(gamma_db=GAMMA_DB)
    plate.material_slots[0].material = material
    material["radarsim_clutter"], material["radarsim_clutter_path"] = "table", "//no.csv"
    with pytest.raises(ConfigError, match=r"'Ground'.*does not exist"):
        ph.run_paths(tmp_path / "other", width_px=8, height_px=8)
