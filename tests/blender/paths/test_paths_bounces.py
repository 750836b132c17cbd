# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths at grazing angles and of several reflections, against closed forms; mirrors, nothing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.signal import FrameResult, PathFlag, ProcessOptions, process_run

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import physical_materials as pm
from radarsim_addon.physics.fresnel import unpolarised_reflectance
from radarsim_addon.signal.decoding.path_class_pixels import first_vertex_order_2
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


@pytest.mark.parametrize("code", ["materials", "world"])
def test_grazing_plane(tmp_path: Path, code: str) -> None:
    """A plane met at 1 degree: range of each pixel against the plane in float64."""
    rs.new_scene()
    ph.field_of_view(0.6)
    height = 1.0
    radar = ph.radar_at((0, 0, height))
    radar.rotation_euler.x -= math.radians(1.0)
    metal = nodes.make_material("Metal", 1e4, 1e4, 0.0, 0.5, penetrable=False)
    material = metal if code == "materials" else ph.lambert(0.9)
    ph.quad("Ground", [(-50, -5, 0), (50, -5, 0), (50, 300, 0), (-50, 300, 0)], material)
    run = ph.run_paths(
        tmp_path, width_px=32, height_px=32, options={"replicates": 2, "range_encoding": code}
    )
    rows = run.table()
    assert rows.size == 2 * 32 * 32
    reach = height / -rows["direction"][:, 2]
    assert reach.min() < 45
    assert reach.max() > 80
    # Float32 of a direction is 4.5e-8 rad; at 1 degree that is 2.6e-6 of the range.
    np.testing.assert_allclose(rows["length_m"], 2 * reach, rtol=2e-5)
    # The vertex lies on the plane, and the length is the vertex's to float64.
    np.testing.assert_allclose(rows["last_scatterer_m"][:, 2], 0, atol=1e-6)
    exact = 2 * np.linalg.norm(rows["last_scatterer_m"] - (0, 0, height), axis=1)
    np.testing.assert_allclose(rows["length_m"], exact, rtol=2e-7)

    # Power of each pixel, at its own angle: reflectance / pi x sine of the depression x irradiance.
    def radiance_at(sine: np.ndarray) -> np.ndarray:
        reflects = unpolarised_reflectance(1e4 + 1e4j, sine) if code == "materials" else 0.9
        return np.asarray(reflects / np.pi * sine * ph.irradiance(height / sine))

    radiance = ph.radiance(rows)
    np.testing.assert_allclose(radiance, radiance_at(2 * height / exact), rtol=1e-5)
    # And all of each shift, against a dense sum over its view in the plane one before the camera.
    count, half, tilt = 400, math.tan(math.radians(0.3)), math.radians(1.0)
    ahead = np.array([0.0, math.cos(tilt), -math.sin(tilt)])
    upward = np.array([0.0, math.sin(tilt), math.cos(tilt)])
    for shift in (0, 1):
        mine = rows["replicate"] == shift
        direction = rows["direction"][mine]
        # A shift moves the whole view by a part of a pixel, which at this angle is percents.
        middle = np.mean(direction @ upward / (direction @ ahead))
        x, z = np.meshgrid(*2 * [half * ((2 * np.arange(count) + 1) / count - 1)])
        z = z + middle
        norm = np.sqrt(x**2 + 1 + z**2)
        sine = (math.sin(tilt) - z * math.cos(tilt)) / norm
        whole = np.sum(radiance_at(sine) / norm**3) * (2 * half / count) ** 2
        found = 2 * np.sum(radiance[mine] * rows["solid_angle_sr"][mine])
        assert found == pytest.approx(whole, rel=5e-4)


@pytest.mark.parametrize("code", ["materials", "world"])
def test_mirror_corridor(tmp_path: Path, code: str) -> None:
    """Two mirror walls and a rough end: orders 1 to 3 are the images of the end, one, two away."""
    rs.new_scene()
    ph.field_of_view(42)
    half, end = 1.0, 12.0
    walls = ph.mirror()
    for side in (-half, half):
        corners = [(side, -1, -20), (side, end, -20), (side, end, 20), (side, -1, 20)]
        ph.quad("Wall", corners, walls)
    rough = nodes.make_material("End", 1e4, 1e4, 0.0, 0.5, penetrable=False)
    ph.quad("End", [(-half, end, -20), (half, end, -20), (half, end, 20), (-half, end, 20)], rough)
    options = {"max_reflections": 3, "range_encoding": code, "mirror_images": 0}
    run = ph.run_paths(tmp_path, width_px=32, height_px=32, options=options)
    rows = run.table()
    direction = rows["direction"]
    unfolded = direction * (end / direction[:, 1:2])
    images = np.rint(unfolded[:, 0] / (2 * half))  # walls crossed
    np.testing.assert_array_equal(rows["order"], 1 + np.abs(images))
    assert {1, 2, 3} == set(rows["order"])
    x = unfolded[:, 0] - 2 * half * images
    scatterer = np.stack([np.where(images % 2, -x, x), unfolded[:, 1], unfolded[:, 2]], axis=1)
    way_back = np.linalg.norm(scatterer, axis=1)
    length = np.linalg.norm(unfolded, axis=1) + way_back
    np.testing.assert_allclose(rows["length_m"], length, rtol=1e-6)
    np.testing.assert_allclose(rows["last_scatterer_m"], scatterer, atol=5e-5)
    wall = np.abs(rows["first_scatterer_m"][rows["order"] > 1][:, 0])
    np.testing.assert_allclose(wall, half, atol=1e-6)
    # Each mirror's Fresnel reflectance, the end's cosines, and the way back alone in the lamp's.
    reflects = unpolarised_reflectance(1e4 + 1e4j, np.abs(direction[:, 0]))
    wall_power = reflects ** np.abs(images)
    lit = scatterer[:, 1] / way_back
    out = np.abs(direction[:, 1])
    power = unpolarised_reflectance(1e4 + 1e4j, out) / np.pi * lit * ph.irradiance(way_back)
    np.testing.assert_allclose(ph.radiance(rows), power * wall_power, rtol=2e-4)


@pytest.mark.parametrize("code", ["materials", "world"])
def test_dihedral(tmp_path: Path, code: str) -> None:
    """A mirror floor and a rough wall: both vertices and the length in closed form."""
    rs.new_scene()
    ph.field_of_view(50)
    ph.radar_at((0, 0, 2))
    ph.quad("Floor", [(-30, -5, 0), (30, -5, 0), (30, 10, 0), (-30, 10, 0)], ph.mirror())
    rough = nodes.make_material("Wall", 1e4, 1e4, 0.0, 0.5, penetrable=False)
    ph.quad("Wall", [(-30, 10, 0), (30, 10, 0), (30, 10, 30), (-30, 10, 30)], rough)
    options = {"max_reflections": 2, "range_encoding": code, "mirror_images": 0}
    run = ph.run_paths(tmp_path, width_px=32, height_px=32, options=options)
    rows = run.table()
    two = rows[rows["order"] == 2]
    assert two.size > 200
    camera = np.array([0.0, 0.0, 2.0])
    direction = two["direction"]
    first = camera + direction * (2 / -direction[:, 2:])
    image = camera + direction * (10 / direction[:, 1:2])
    last = image * (1, 1, -1)
    length = np.linalg.norm(image - camera, axis=1) + np.linalg.norm(last - camera, axis=1)
    np.testing.assert_allclose(two["length_m"], length, rtol=1e-6)
    np.testing.assert_allclose(two["last_scatterer_m"], last, atol=5e-5)
    np.testing.assert_allclose(two["first_scatterer_m"], first, atol=1e-5)
    names = run.record().objects
    assert {names[number - 1] for number in two["first_object"]} == {"Floor"}
    assert {names[number - 1] for number in two["last_object"]} == {"Wall"}
    # Without looking at the Position pass, from direction, length and last vertex alone:
    found, conditioning = first_vertex_order_2(
        np.broadcast_to(camera, direction.shape),
        direction,
        two["last_scatterer_m"],
        camera,
        two["length_m"],
    )
    error = np.linalg.norm(found - first, axis=1) * conditioning
    assert error.max() < 1e-4
    assert not np.any(two["flags"] & PathFlag.NO_FIRST_VERTEX)


@pytest.mark.parametrize("slope", [0.05, 0.2])
def test_order_2_between_rough_metals_has_its_length(tmp_path: Path, slope: float) -> None:
    """The default range encoding: lengths against both vertices, and nothing mixed."""
    rs.new_scene()
    ph.field_of_view(50)
    ph.radar_at((0, 0, 2))
    metal = pm.make_physical_material(
        "Metal", "conductor", carrier_hz=5.3e9, conductivity_s_per_m=1e7, rms_slope=slope
    )
    ph.quad("Floor", [(-10, 2, 0), (10, 2, 0), (10, 12, 0), (-10, 12, 0)], metal)
    ph.quad("Wall", [(-10, 12, 0), (10, 12, 0), (10, 12, 10), (-10, 12, 10)], metal)
    run = ph.run_paths(tmp_path, width_px=48, height_px=48, options={"max_reflections": 2})
    rows = run.table()
    two = rows[rows["order"] == 2]
    assert two.size > 500
    camera = np.array([0.0, 0.0, 2.0])
    # The first vertex on its plane along the ray, the last one on the other plane, in float64.
    direction, on_floor = two["direction"], two["first_scatterer_m"][:, 2] < 1e-3
    reach = np.where(on_floor, -2 / direction[:, 2], 12 / direction[:, 1])
    first = camera + reach[:, None] * direction
    onward = two["last_scatterer_m"] - first
    stretch = np.where(on_floor, (12 - first[:, 1]) / onward[:, 1], -first[:, 2] / onward[:, 2])
    last = first + stretch[:, None] * onward
    length = reach + np.linalg.norm(last - first, axis=1) + np.linalg.norm(last - camera, axis=1)
    power = two["power_w"] / two["power_w"].sum()
    beyond = np.abs(two["length_m"] - length) > 5 * two["length_sigma_m"]
    assert power[beyond].sum() < 0.01
    assert power[two["flags"] & PathFlag.MIXED > 0].sum() < 0.01
    assert "facets-encode-range" not in {item.code for item in run.job.findings}


def test_facets_that_encode_the_range_are_said(tmp_path: Path) -> None:
    rs.new_scene()
    metal = pm.make_physical_material("Metal", "metal", carrier_hz=5.3e9, rms_slope=0.1)
    rs.add_plate(10, preset=None).data.materials.append(metal)
    options = {"max_reflections": 2, "range_encoding": "materials"}
    run = ph.run_paths(tmp_path, width_px=8, height_px=8, options=options)
    codes = {item.code for item in run.job.findings}
    assert ("facets-encode-range" in codes) == pm.EXACT_FACETS


def test_a_mirror_that_faces_the_radar_is_said(tmp_path: Path) -> None:
    rs.new_scene()
    plate = ph.plate_at(10, 40, ph.mirror())
    run = ph.run_paths(tmp_path / "alone", width_px=8, height_px=8, options={"max_reflections": 3})
    record = run.record()
    assert (record.path_count, record.total_power_w) == (0, 0.0)
    found, missing = sorted(record.findings, key=lambda one: one.code, reverse=True)
    assert (found.code, found.subjects) == ("surfaces-return-nothing", (plate.name,))
    assert (missing.code, missing.subjects) == ("mirror-echo-not-formed", (plate.name,))
    # larger than a Fresnel zone: pi R^2
    assert missing.numbers["expected_dbsm"] == pytest.approx(
        10 * math.log10(100 * math.pi), abs=0.1
    )
    assert "mirrors (roughness 0)" in found.cause
    # Beside something that echoes it must not go unsaid either.
    plate.name = "Looking-glass"
    bpy.data.objects["Looking-glass"].location.x = 21
    wall = nodes.make_material("Wall", 1e4, 1e4, 0.0, 0.5, penetrable=False)
    ph.quad("Wall", [(-20, 10, -20), (0, 10, -20), (0, 10, 20), (-20, 10, 20)], wall)
    # A rough ground that is met at 80 degrees is no mirror: exp(-tan^2 / alpha^2) = 1e-1700.
    ground = nodes.make_material("Ground", 1e4, 1e4, 1.0, 0.3)
    ph.quad("Ground", [(-20, 1, -1), (20, 1, -1), (20, 9, -1), (-20, 9, -1)], ground)
    run = ph.run_paths(tmp_path / "both", width_px=8, height_px=8)
    findings = run.record().findings
    assert [item.subjects for item in findings if item.code == "object-without-echo"] == [
        ("Looking-glass",)
    ]
    (grazing,) = [item for item in findings if item.code == "rough-object-without-echo"]
    assert grazing.subjects == ("Ground",) and "mirror" not in grazing.cause
    assert run.job.frame_findings == findings
    assert run.job.findings[-len(findings) :] == findings


def test_ground_with_next_to_no_echo_is_said(tmp_path: Path) -> None:
    """At 8 degrees of grazing, a lobe leaves a little that float32 still holds."""
    rs.new_scene()
    wall = nodes.make_material("Wall", 1e4, 1e4, 0.0, 0.5, penetrable=False)
    ph.quad("Wall", [(-20, 10, -20), (0, 10, -20), (0, 10, 20), (-20, 10, 20)], wall)
    corners = [(-20, 6, -1), (20, 6, -1), (20, 9, -1), (-20, 9, -1)]
    ph.quad("Ground", corners, pm.make_physical_material(
        "Ground", "index", carrier_hz=5.3e9, rms_slope=0.7, n=2.0, k=0.1, penetrable=False
    ))  # fmt: skip
    run = ph.run_paths(tmp_path / "faint", width_px=32, height_px=32)
    assert np.unique(run.table()["last_object"]).size == 2  # it has paths
    said = [item for item in run.record().findings if item.code == "rough-object-without-echo"]
    assert [item.subjects for item in said] == [("Ground",)]


def test_nothing_in_sight(tmp_path: Path) -> None:
    """A frame without any echo: an empty table that opens, and a word about it."""
    rs.new_scene()
    run = ph.run_paths(tmp_path, width_px=8, height_px=8, options={"max_reflections": 2})
    record = run.record()
    assert (record.path_count, record.total_power_w, record.relative_error) == (0, 0.0, 0.0)
    assert run.table().size == 0
    assert [item.code for item in record.findings] == ["no-echo"]
    events = process_run(tmp_path, ProcessOptions(plots=False))
    (result,) = (one for one in events if isinstance(one, FrameResult))
    assert [item.code for item in result.findings].count("no-echo") == 1
