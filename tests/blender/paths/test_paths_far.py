# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths to small and far targets: tiles that zoom in, ranges from 10 m to 10 km."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.signal import PathFlag

bpy = pytest.importorskip("bpy")

from radarsim_addon.physics.radar_equation import monostatic_power_w, to_db
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def far_target(half_m: float) -> float:
    """A small plate at 600 m, off the axis, before a wall that fills the view; its power in W."""
    rs.new_scene()
    ph.field_of_view(40)
    metal = ph.rough_metal()
    ph.quad("Wall", [(-900, 1e3, -900), (900, 1e3, -900), (900, 1e3, 900), (-900, 1e3, 900)], metal)
    x, y, z, s = 100.0, 600.0, 60.0, half_m
    target = [(x - s, y, z - s), (x + s, y, z - s), (x + s, y, z + s), (x - s, y, z + s)]
    ph.quad("Target", target, metal)
    reach = math.sqrt(x**2 + y**2 + z**2)
    sigma = 4 * 0.9998 * (2 * s) ** 2 * (y / reach) ** 2
    return float(monostatic_power_w(rs.EIRP_W, sigma, reach, ph.C0_MPS / 5.3e9))


def test_tiles_zoom_in_on_a_far_target(tmp_path: Path) -> None:
    """A target below a pixel within 0.2 dB; all directions known; the view is covered once."""
    power = far_target(6.0)
    options = {
        "replicates": 4,
        "max_standard_error": 0.01,
        "max_refinement_level": 5,
        "tile_px": 16,
    }
    run = ph.run_paths(tmp_path, width_px=32, height_px=32, options=options)
    rows, record = run.table(), run.record()
    assert record.finest_refinement_level >= 3, (
        record.tiles,
        record.renders,
        record.relative_error,
    )
    target = rows[rows["last_object"] == record.objects.index("Target") + 1]
    assert abs(float(to_db(target["power_w"].sum() / power))) < 0.2
    seen = target["last_scatterer_m"] / np.linalg.norm(
        target["last_scatterer_m"], axis=1, keepdims=True
    )
    assert np.abs(seen - target["direction"]).max() < 2e-7
    # Every ray meets something: gaps or overlaps of tiles would show in the solid angle.
    half = math.tan(math.radians(20))
    frame_sr = 4 * math.atan(half * half / math.sqrt(1 + 2 * half * half))
    for shift in range(4):
        mine = rows[rows["replicate"] == shift]
        # A shift moves the frame by up to half a pixel of the coarsest: by 1 % of the cosines.
        assert 4 * mine["solid_angle_sr"].sum() == pytest.approx(frame_sr, rel=2e-3)
    assert rows["solid_angle_sr"].sum() == pytest.approx(frame_sr, rel=2e-4)


def test_a_target_between_the_rays_is_said(tmp_path: Path) -> None:
    far_target(0.05)
    record = ph.run_paths(tmp_path, width_px=16, height_px=16).record()
    assert [item.subjects for item in record.findings if item.code == "object-missed-by-rays"] == [
        ("Target",)
    ]


# -- far away --------------------------------------------------------------------------------------

RANGES_M = (10.0, 100.0, 1000.0, 10_000.0)


def plane_of(plate: Any) -> tuple[np.ndarray, np.ndarray]:
    """Point and normal of a plate in float64, from the pose that Blender holds."""
    pose = np.array(plate.matrix_world, dtype=np.float64)
    corners = np.array([tuple(v.co) for v in plate.data.vertices], dtype=np.float64)
    world = corners @ pose[:3, :3].T + pose[:3, 3]
    normal = np.cross(world[1] - world[0], world[3] - world[0])
    return world[0], normal / np.linalg.norm(normal)


def far_run(folder: Path, range_m: float, half_m: float, **changes: Any) -> ph.PathRun:
    """Radar `range_m` before the origin, a square of +-half_m there fills the frame."""
    ph.radar_at((0, -range_m, 0))
    ph.field_of_view(math.degrees(2 * math.atan(half_m / range_m)))
    return ph.run_paths(
        folder,
        width_px=32,
        height_px=32,
        waveform=rs.Waveform(77e9, 150e6, 2.5e-6, 180e6),
        **changes,
    )


@pytest.mark.parametrize("code", ["materials", "world"])
def test_plate_from_10_m_to_10_km(tmp_path: Path, code: str) -> None:
    """Vertices on the plate's own plane within lambda/100 at 77 GHz, lengths from them, R^-4."""
    rs.new_scene()
    albedo, size, tilt = 0.9998, 1.0, 20.0
    plate = ph.plate_at(0.0, size, ph.rough_metal(), tilt_deg=tilt)
    levels_db = []
    for range_m in RANGES_M:
        run = far_run(
            tmp_path / f"{range_m:g}",
            range_m,
            0.8,
            options={"replicates": 8, "range_encoding": code},
        )
        rows = run.table()
        assert rows.size > 8 * 300
        point, normal = plane_of(plate)
        off_plane = np.abs((rows["last_scatterer_m"] - point) @ normal)
        assert off_plane.max() < 1e-6  # 39e-6 is a hundredth of the wavelength
        radar = np.array(run.record().receiver.matrix_world)[:3, 3]
        exact = 2 * np.linalg.norm(rows["last_scatterer_m"] - radar, axis=1)
        np.testing.assert_allclose(rows["length_m"], exact, rtol=0, atol=1e-9 + 4e-16 * range_m)
        assert not np.any(rows["flags"] & PathFlag.ENCODED_LENGTH)
        assert run.record().length_sigma_m < 39e-6
        # Where the pixel looks: within a fifth of it.
        to_point = rows["last_scatterer_m"] - radar
        seen = to_point / np.linalg.norm(to_point, axis=1, keepdims=True)
        assert np.abs(seen - rows["direction"]).max() < 0.2 * 1.6 / 32 / range_m + 1e-9
        sigma = 4 * albedo * size**2 * math.cos(math.radians(tilt)) ** 2
        want = monostatic_power_w(rs.EIRP_W, sigma, range_m, ph.C0_MPS / 77e9)
        levels_db.append(float(to_db(rows["power_w"].sum() / want)))
    assert np.abs(levels_db).max() < 0.05
    assert np.ptp(levels_db[1:]) < 0.01


def test_sphere_from_10_m_to_10_km(tmp_path: Path) -> None:
    """Vertices on the facets of the mesh as it is, within lambda/100 at 77 GHz."""
    rs.new_scene()
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=1.0, location=(0, 0, 0))
    ball = bpy.context.object
    ball.data.materials.append(ph.rough_metal())
    corners = np.array([tuple(v.co) for v in ball.data.vertices], dtype=np.float64)
    faces = corners[np.array([tuple(p.vertices) for p in ball.data.polygons])]
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    offset = np.sum(normal * faces[:, 0], axis=1)
    # Lambert facets in float64, each by its middle; a convex body shadows only what faces away.
    middle = faces.mean(axis=1)
    area = (
        np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=1) / 2
    )
    for range_m in RANGES_M:
        rows = far_run(tmp_path / f"{range_m:g}", range_m, 1.15, options={"replicates": 4}).table()
        # The point is outside of no facet, and on at least one of them.
        outside = (rows["last_scatterer_m"] @ normal.T - offset).max(axis=1)
        assert np.abs(outside).max() < 2e-6
        to_radar = np.array([0.0, -range_m, 0.0]) - middle
        reach = np.linalg.norm(to_radar, axis=1)
        cosine = np.maximum(np.sum(normal * to_radar, axis=1) / reach, 0.0)
        sigma = 4 * 0.9998 * area * cosine**2
        want = monostatic_power_w(rs.EIRP_W, sigma, reach, ph.C0_MPS / 77e9).sum()
        assert abs(float(to_db(rows["power_w"].sum() / want))) < 0.05
