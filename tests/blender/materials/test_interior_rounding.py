# SPDX-License-Identifier: GPL-3.0-or-later
"""Walls whose faces stand for their interior, against Cycles' volume nearby and closed forms."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix, Vector

from radarsim_addon.blender.materials import (
    Interiors,
    interior_losses_db,
    interiors,
    make_physical_material,
    set_layer_normals,
    settle_interiors_far_away,
)
from radarsim_addon.blender.nodes import attributes, make_material
from radarsim_addon.blender.state import SettingsRestorer, evaluated_snapshot
from radarsim_addon.physics.fresnel import excess_path_m, slab_power
from radarsim_addon.signal.radar import Waveform
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

CARRIER_HZ = 5.3e9
WAVELENGTH_M = ph.C0_MPS / CARRIER_HZ
INDEX = 2.3 + 0.05j


def wall(
    y: float, turn_deg: float = 30.0, size: tuple[float, ...] = (8.0, 0.2, 8.0), **medium: float
) -> Any:
    """A wall across +Y about (0.31, y, 0.17), turned about Z; its scale is not uniform."""
    bpy.ops.mesh.primitive_cube_add(
        size=1, location=(0.31, y, 0.17), rotation=(0, 0, math.radians(turn_deg))
    )
    item = bpy.context.object
    item.name, item.scale = "Wall", size
    medium = medium or {"n": INDEX.real, "k": INDEX.imag}
    material = make_physical_material("Wall", "index", carrier_hz=CARRIER_HZ, **medium)
    item.data.materials.append(material)
    return item


def settled(reach: float = 20e3) -> Interiors:
    """How interiors would be computed if something echoed at this distance."""
    recorder = SettingsRestorer()
    bpy.context.view_layer.update()
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    set_layer_normals(recorder, snapshot)
    antennas = [(0.0, 0.0, 0.0)] * 2
    losses_db = interior_losses_db(WAVELENGTH_M, snapshot)
    return settle_interiors_far_away(
        recorder, snapshot, antennas, reach, WAVELENGTH_M, 1.0, reach, losses_db
    )


@pytest.mark.parametrize("distance_m", [10.0, 1000.0, 20e3])
@pytest.mark.parametrize("before_m", [5.0, None])
def test_an_echo_through_a_wall_at_any_distance(
    tmp_path: Path, distance_m: float, before_m: float | None
) -> None:
    """A wall near the target or near the radar: power within 0.02 dB, length within its sigma."""
    found = []
    for used in (False, True):
        rs.new_scene()
        ph.field_of_view(max(1.0 / distance_m, 1e-3))
        rs.add_plate(distance_m)
        if used:
            wall(4.0 if before_m is None else distance_m - before_m)
        rows = ph.run_paths(tmp_path / str(used), width_px=8, height_px=8).table()
        found.append(rows[rows["last_scatterer_m"][:, 1] > distance_m - 1])
    bare, behind = found
    assert len(bare) == len(behind) == 64
    normal = np.array([-0.5, math.sqrt(0.75), 0.0])
    cosine = np.abs(behind["direction"] @ normal)
    want = slab_power(INDEX, 0.2, WAVELENGTH_M, cosine, "single-pass").transmitted ** 2
    assert np.abs(10 * np.log10(behind["power_w"] / bare["power_w"] / want)).max() < 0.02
    longer_m = 2 * excess_path_m(INDEX, 0.2, cosine)
    off_m = behind["length_m"] - bare["length_m"] - longer_m
    assert np.sqrt(np.mean(off_m**2)) < 1.5 * behind["length_sigma_m"].mean()


def test_a_thin_wall_far_away_delays(tmp_path: Path) -> None:
    """Two millimetres at 5 km: less than the encoding's noise times 20, but there."""
    rs.new_scene()
    ph.field_of_view(1e-3)
    rs.add_plate(5000.0)
    wall(4995.0, 0.0, (8.0, 5e-3, 8.0), n=2.3, k=0.0)
    rows = ph.run_paths(tmp_path, width_px=8, height_px=8).table()
    rows = rows[rows["last_scatterer_m"][:, 1] > 4999]
    off_m = rows["length_m"] - 2 * np.linalg.norm(rows["last_scatterer_m"], axis=1)
    error_m = off_m - 2 * 5e-3 * 1.3
    assert np.abs(error_m).mean() < 1.5 * rows["length_sigma_m"].mean()


@pytest.mark.parametrize("kind", ["alone", "oblique", "instance", "rough"])
def test_faces_and_rim_do_what_the_volume_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """A thick block that rays enter and leave by faces and by its rim, and echoes of its inside."""
    tables = []
    for at_faces in (False, True):
        rs.new_scene()
        ph.field_of_view(8.0)
        rs.add_plate(30.0, 6.0)
        item = wall(20.0, 40.0, (1.6, 0.5, 1.9), n=1.7, k=0.002)
        if kind == "oblique":  # the same block, oblique in its own unevenly scaled axes
            bpy.context.view_layer.update()
            shown = item.matrix_world.copy()
            item.scale, item.rotation_euler = (1.8, 0.7, 1.2), (0.2, -0.3, 1.4)
            bpy.context.view_layer.update()
            item.data.transform(item.matrix_world.inverted() @ shown)
        if kind == "instance":
            rs.instance_of(item, (0.1, 4.0, 0.2)).scale = (0.8, 0.8, 0.8)
        else:
            item.data.materials.clear()
            rough = {"rms_slope": 0.3} if kind == "rough" else {}
            item.data.materials.append(
                make_physical_material(
                    "Rough", "index", carrier_hz=CARRIER_HZ, n=1.7, k=0.002, **rough
                )
            )
        if at_faces:
            monkeypatch.setattr(interiors, "_TOLERANCE_DB", 0.0)
        run = ph.run_paths(tmp_path / str(at_faces), width_px=32, height_px=32)
        tables.append(run.table())
    volume, faces = tables
    assert len(volume) == len(faces)
    assert (volume["transparent_depth"] > 0).sum() > 100
    # Echoes of the rim from inside are the exception: no colour of a facet exceeds 1.
    inside = (volume["last_object"] == 2) & (volume["transparent_depth"] == 1)
    rim = inside & (faces["power_w"] < 0.99 * volume["power_w"])
    assert rim.sum() <= 0.06 * inside.sum()
    ratio_db = 10 * np.log10(faces["power_w"] / volume["power_w"])
    assert np.abs(ratio_db[~rim]).max() < 1e-4
    assert np.abs(faces["length_m"] - volume["length_m"])[~rim].max() < 5e-5
    through = (
        faces["power_w"][inside].sum() / volume["power_w"][inside].sum() if inside.any() else 1
    )
    assert abs(10 * np.log10(through)) < 0.02


def test_what_faces_cannot_stand_for_is_named() -> None:
    """Something inside, two materials, a solid cube, a simple material, too much absorption."""
    cases: dict[str, bool] = {}

    def says(name: str) -> None:
        found = settled()
        assert found.delay
        at_faces = attributes.OBJECT_LAYER_AT_FACES in bpy.data.objects["Wall"]
        codes = [item.code for item in found.findings]
        assert codes == ([] if at_faces else ["interior-rounded"])
        assert (found.sigma > 0) is not at_faces
        cases[name] = at_faces

    rs.new_scene()
    wall(2000.0)
    says("plain")
    rs.new_scene()
    item = wall(2000.0)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.04, location=item.location)
    says("pipe inside")
    rs.new_scene()
    item = wall(2000.0, 0.0)
    bpy.ops.mesh.primitive_cube_add(size=1, location=item.location)
    bpy.context.object.location.y -= 0.5 + 0.1
    says("touched")
    rs.new_scene()
    item = wall(2000.0)
    item.data.materials.append(make_material("Other", 1.5, 0.0, 0.0, 0.5))
    says("two materials")
    rs.new_scene()
    wall(2000.0, 0.0, (2.0, 2.0, 2.0))
    says("cube")
    rs.new_scene()
    wall(2000.0, n=2.3, k=0.5)
    says("absorbs more than faces hold")
    rs.new_scene()
    wall(20.0, n=2.3, k=0.2)
    assert settled(200.0).absorption_sigma == 0.0  # 77 dB: too much to share the code's exponent
    assert attributes.OBJECT_LAYER_AT_FACES in bpy.data.objects["Wall"]
    rs.new_scene()
    item = wall(2000.0)
    item.data.materials[0] = make_material("Simple", 1.5, 0.1, 0.0, 0.5)
    says("simple material")
    assert [name for name, at_faces in cases.items() if at_faces] == ["plain", "touched"]


@pytest.mark.parametrize("tilt_deg", [0.0, 20.0])
def test_a_plane_is_named_only_with_something_behind(tilt_deg: float) -> None:
    """A road is one face: what enters it meets nothing, unless there is an object below."""
    rs.new_scene()
    turn = Matrix.Rotation(math.radians(tilt_deg), 4, "X")
    water = make_physical_material("Road", "water", carrier_hz=CARRIER_HZ)
    ph.quad("Road", [(-9, -9, -2), (9, -9, -2), (9, 99, -2), (-9, 99, -2)], water)
    bpy.data.objects["Road"].rotation_euler = turn.to_euler()
    bpy.ops.mesh.primitive_cube_add(size=1, location=turn @ Vector((0, 20, -1.5)))
    bpy.context.object.rotation_euler = turn.to_euler()
    assert settled().findings == []
    bpy.context.object.location = turn @ Vector((0, 20, -1.51))
    assert [item.subjects for item in settled().findings] == [("Road",)]


@pytest.mark.parametrize(
    ("n", "kappa", "severity"),
    [
        (1.5, 0.055, "info"),  # 0.09 dB, 0.02 wavelengths
        (1.5, 0.07, "caution"),  # 0.11 dB, 0.02 wavelengths
        (2.3, 0.02, "info"),  # 0.03 dB, 0.04 wavelengths
        (3.3, 0.02, "caution"),  # 0.03 dB, 0.07 wavelengths
    ],
)
def test_a_negligible_error_is_no_caution(n: float, kappa: float, severity: str) -> None:
    """A small cube; roundings to 24 bits of distances of 10 km, 2 of them a way."""
    rs.new_scene()
    wall(2000.0, 0.0, (0.05, 0.05, 0.05), n=n, k=kappa)
    (said,) = settled(10e3).findings
    depth_m = math.sqrt(2) * 2 * 2**-24 * 10e3
    loss_db_per_m = 40 * math.pi * kappa / WAVELENGTH_M / math.log(10)
    assert said.numbers["power_db"] == pytest.approx(depth_m * loss_db_per_m, rel=1e-3)
    wavelengths = said.numbers["length_wavelengths"]
    assert isinstance(wavelengths, float)
    assert wavelengths > 0.999 * depth_m * (n - 1) / WAVELENGTH_M
    assert (said.code, said.severity) == ("interior-rounded", severity)


@pytest.mark.parametrize(
    ("slope", "width_m", "named"), [(0.3, 2.0, 1), (0.0, 2.0, 0), (0.3, 90.0, 0)]
)
def test_echoes_of_a_rough_rim_are_named(slope: float, width_m: float, named: int) -> None:
    rs.new_scene()
    item = wall(2000.0, 0.0, (width_m, 0.4, width_m))
    item.data.materials[0] = make_physical_material(
        "Rough", "index", carrier_hz=CARRIER_HZ, n=2.3, k=0.01, rms_slope=slope
    )
    said = settled().findings
    assert [one.code for one in said] == ["rim-echoes-weak"] * named
    if named:
        loss_db = 2 * 4 * math.pi * 0.01 / WAVELENGTH_M * 0.4 * 10 / math.log(10)
        assert said[0].numbers["power_db"] == pytest.approx(loss_db, rel=1e-3)


def test_near_walls_keep_their_volume() -> None:
    rs.new_scene()
    wall(20.0)
    found = settled(30.0)
    assert attributes.OBJECT_LAYER_AT_FACES not in bpy.data.objects["Wall"]
    assert found.findings == [] and found.delay
    assert 0 < found.sigma < 1e-6 and 0 < found.absorption_sigma < 1e-4


def test_the_sigma_of_lengths_scales_with_the_unit(tmp_path: Path) -> None:
    """A scene and a wavelength of half the size: absorption and rounding are the same numbers."""
    sigmas_m = []
    for metres in (1.0, 0.5):
        scene = rs.new_scene()
        scene.unit_settings.scale_length = metres
        ph.field_of_view(3.0)
        wall(20.0)
        rs.add_plate(30.0, 8.0)
        waveform = Waveform(CARRIER_HZ / metres, 50e6, 2.5e-6, 60e6)
        run = ph.run_paths(tmp_path / str(metres), width_px=8, height_px=8, waveform=waveform)
        rows, plate = run.table(), run.record().objects.index("Plate") + 1
        behind = rows[(rows["last_object"] == plate) & (rows["transparent_depth"] > 0)]
        sigmas_m.append(np.sort(behind["length_sigma_m"]))
    assert sigmas_m[0].size > 32
    np.testing.assert_allclose(sigmas_m[1], sigmas_m[0] / 2, rtol=1e-3)
