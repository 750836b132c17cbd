# SPDX-License-Identifier: GPL-3.0-or-later
"""Receivers of every projection: ranges, directions and powers of a closed form."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.blender.paths import PathJob
from radarsim_addon.blender.plan import PathOptions
from radarsim_addon.errors import SceneError
from radarsim_addon.signal import open_run
from radarsim_addon.signal.detection import object_echoes
from radarsim_addon.signal.paths import PathRows, open_table
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

DISTANCE = 10.0


def plate_before(kind: str) -> Any:
    """A Lambert plate of metal, 4 units square, 10 units before a receiver of a given kind."""
    scene = rs.new_scene()
    plate = rs.add_plate(DISTANCE, size=4.0, preset=None)
    lambert = nodes.make_material("lambert", n=1e4, kappa=1e4, specularity=0.0, penetrable=False)
    plate.data.materials.append(lambert)
    camera = scene.camera.data
    camera.type = kind
    camera.shift_x, camera.shift_y = 0.05, -0.1
    if kind == "ORTHO":
        camera.ortho_scale = 6.0
    elif kind == "PANO":
        settings = camera if hasattr(camera, "panorama_type") else camera.cycles
        settings.panorama_type = "EQUIRECTANGULAR"
        settings.longitude_min, settings.longitude_max = -0.5, 0.5
        settings.latitude_min, settings.latitude_max = -0.4, 0.45
    else:
        camera.angle = math.radians(40)
    return scene


def measure(scene: Any, folder: Path, **options: Any) -> PathRows:
    measurement = rs.measurement(width_px=64, height_px=64, snapshots=1)
    chosen = PathOptions(replicates=2, tile_px=32, **options)
    with PathJob(scene, scene.view_layers[0], measurement, folder, chosen) as job:
        for task in job.pending():
            job.start(task)
            job.render(task)
            job.finish(task)
    assert job.unrestored == []
    return open_table(folder / "frames" / "frame_0001" / "paths.npz")


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO", "PANO"])
def test_paths_end_on_the_plate_with_the_length_of_their_vertices(
    kind: str, tmp_path: Path
) -> None:
    scene = plate_before(kind)
    paths = measure(scene, tmp_path / "run")
    assert len(paths) > 500
    point = paths["first_scatterer_m"]
    assert np.abs(point[:, 1] - DISTANCE).max() < 1e-5
    assert np.abs(point[:, [0, 2]]).max() <= 2 + 1e-5
    if kind == "ORTHO":
        origin = point * [1, 0, 1]  # rays leave the camera's plane at right angles
    else:
        origin = np.zeros(3)
    # the ray of the row, walked for its first segment, comes to the row's vertex
    walked = origin + paths["direction"] * np.linalg.norm(point - origin, axis=1)[:, None]
    np.testing.assert_allclose(walked, point, atol=2e-5)
    expected = np.linalg.norm(point - origin, axis=1) + np.linalg.norm(point, axis=1)
    np.testing.assert_allclose(paths["length_m"], expected, rtol=1e-6)


@pytest.mark.parametrize(("kind", "bound"), [("PERSP", 0.01), ("PANO", 0.01), ("ORTHO", 0.01)])
def test_solid_angles_add_up_to_the_plate(kind: str, bound: float, tmp_path: Path) -> None:
    """4 atan(a b / (d sqrt(a^2 + b^2 + d^2))) for a rectangle 2a x 2b at d; its area, orthographic.

    The bound is what pixels on the plate's edge leave at 64 x 64 pixels and two shifts.
    """
    paths = measure(plate_before(kind), tmp_path / "run")
    if kind == "ORTHO":
        expected = 16.0
    else:
        half = 2.0
        expected = 4 * math.asin(half * half / (half**2 + DISTANCE**2))
    assert paths["solid_angle_sr"].sum() == pytest.approx(expected, rel=bound)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_a_plate_below_a_pixel_gets_its_own_tile(kind: str, tmp_path: Path) -> None:
    """3 % of a pixel wide or less: its solid angle, or area, to the error that was asked for."""
    scene = plate_before(kind)
    plate = next(item for item in scene.objects if item.type == "MESH")
    plate.scale = (1e-3, 1e-3, 1e-3)
    plate.location.x, plate.location.z = 0.31, -0.22
    paths = measure(scene, tmp_path / "run", max_standard_error=0.02, refine_for="objects")
    half = 2e-3
    expected = 4 * half**2
    if kind == "PERSP":
        distance = math.hypot(DISTANCE, 0.31, 0.22)
        expected *= DISTANCE / distance**3
    assert paths["solid_angle_sr"].sum() == pytest.approx(expected, rel=0.02)
    assert len(paths) > 1000


def test_edges_along_the_grid_are_known_to_be_uncertain(tmp_path: Path) -> None:
    """20.1 pixels a side: shifts that all hold 20 columns do not make its power certain."""
    missed = 0
    for place, (x, z) in enumerate([(0.013, 0.021), (0.034, 0.047), (0.052, 0.071), (0.08, 0.09)]):
        scene = plate_before("ORTHO")
        scene.camera.data.ortho_scale = 6.4
        scene.camera.data.shift_x = scene.camera.data.shift_y = 0.0
        plate = next(item for item in scene.objects if item.type == "MESH")
        plate.scale = (2.01 / 4, 1.0, 2.01 / 4)
        plate.location.x, plate.location.z = x, z
        folder = tmp_path / str(place)
        paths = measure(scene, folder)
        (echo,) = object_echoes(open_run(folder).frame(1), 5.3e9)
        true = paths["solid_angle_sr"].sum() / 2.01**2 - 1
        by_shift = [2 * paths["solid_angle_sr"][paths["replicate"] == k].sum() for k in (0, 1)]
        missed += abs(true) > 3 * np.std(by_shift, ddof=1) / math.sqrt(2) / 2.01**2
        assert abs(true) < 3 * echo.power_error_w / echo.power_w
        assert echo.power_error_w < 0.05 * echo.power_w
    assert missed >= 2  # what the scatter alone said


def test_radiance_is_that_of_a_lambert_plate_in_every_projection(tmp_path: Path) -> None:
    """Power over receiver area and solid angle is F/pi * EIRP cos / (4 pi r^2), any camera."""
    reflectance = 1 - 4e4 / (1e8 + 2e4 + 1 + 1e8)
    for kind in ("PERSP", "ORTHO", "PANO"):
        scene = plate_before(kind)
        emitter = next(o for o in scene.objects if o.type == "LIGHT")
        paths = measure(scene, tmp_path / kind)
        distance = np.linalg.norm(paths["last_scatterer_m"], axis=1)
        cosine = paths["last_scatterer_m"][:, 1] / distance
        area = rs.WAVEFORM.wavelength_m**2 / (4 * math.pi)
        radiance = paths["power_w"] / (area * paths["solid_angle_sr"])
        expected = (
            reflectance / math.pi * emitter.data.energy * cosine / (4 * math.pi * distance**2)
        )
        np.testing.assert_allclose(radiance, expected, rtol=2e-4)


def test_a_fisheye_is_refused_by_name(tmp_path: Path) -> None:
    scene = plate_before("PANO")
    camera = scene.camera.data
    settings = camera if hasattr(camera, "panorama_type") else camera.cycles
    settings.panorama_type = "FISHEYE_EQUIDISTANT"
    with pytest.raises(SceneError, match=r"projection FISHEYE_EQUIDISTANT.*equirectangular"):
        measure(scene, tmp_path / "run")


def test_rings_ask_for_a_perspective_camera(tmp_path: Path) -> None:
    plate_before("ORTHO")
    with pytest.raises(SceneError, match="perspective"):
        rs.run(tmp_path)


def test_edges_of_a_window_far_off_the_axis() -> None:
    """Blender shifts a lens in widths of the frame, also in a low one and a portrait."""
    from radarsim_addon.blender.scene.poses import aim

    for edges, size in (((-0.1, 0.5, 0.2, 0.5), (40, 20)), ((0.3, 0.4, -0.9, -0.5), (10, 40))):
        camera = bpy.data.cameras.new("Window")
        found = aim(camera, "perspective", edges, *size, 1.0)
        assert found == pytest.approx(edges, abs=1e-6)
        middle = (edges[2] + edges[3]) / 2 / (edges[1] - edges[0])
        assert camera.shift_y == pytest.approx(middle, rel=1e-6)
