# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim coverage``: the scene's radar and ground, files, operator, and what is refused."""

from __future__ import annotations

import csv
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import headless
from radarsim_addon.blender.headless import scripting
from radarsim_addon.blender.materials import make_physical_material
from radarsim_addon.blender.plan import CoverageRequest, parse_axis
from radarsim_addon.blender.ui.picture_images import axes_of
from radarsim_addon.errors import ConfigError, SceneError
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

CARRIER_HZ = 3e9
WAVELENGTH_M = 299_792_458 / CARRIER_HZ
REQUEST = CoverageRequest(np.linspace(0.0, 30.0, 121), np.array([1500.0]), flat=True)
Make = Callable[..., Any]


def level_plane(name: str, z: float, size: float, material: Any = None) -> Any:
    """A level square around the origin."""
    half = size / 2
    mesh = bpy.data.meshes.new(name)
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    plane = bpy.data.objects.new(name, mesh)
    plane.location.z = z
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(plane)
    return plane


@pytest.fixture
def sea(addon: Any) -> Any:
    """A radar 10 m over a conducting sea, in a scene whose unit is 2 m."""
    scene = rs.new_scene()
    scene.unit_settings.scale_length = 2.0
    settings = scripting.settings(bpy.data.objects["Radar"])
    settings.carrier_hz, settings.polarisation = CARRIER_HZ, "horizontal"
    conductor = make_physical_material("Sea", "index", carrier_hz=CARRIER_HZ, n=1e4, k=1e4)
    level_plane("Ocean", -5.0, 500.0, conductor)
    return scene


def computed(**changes: Any) -> Any:
    request = CoverageRequest(**{**vars(REQUEST), **changes})
    return headless.scene_coverage(bpy.context.scene, bpy.context.view_layer, request)


def conductor_lobes(height_m: Any, radar_m: float = 10.0, range_m: float = 1500.0) -> Any:
    """Two-way power over a conductor: direct wave less that of the image."""
    ways = [np.hypot(range_m, height_m + sign * radar_m) for sign in (-1, 1)]
    waves = [np.exp(-2j * math.pi * way / WAVELENGTH_M) / way for way in ways]
    return np.abs(1 - waves[1] / waves[0]) ** 4


def test_a_ground_beyond_its_band_follows_the_radars_choice(sea: Any) -> None:
    """ITU-R P.2040 knows wet ground up to 10 GHz."""
    soil = make_physical_material("Soil", "wet_ground", carrier_hz=CARRIER_HZ)
    sea.objects["Ocean"].data.materials[0] = soil
    settings = scripting.settings(bpy.data.objects["Radar"])
    settings.carrier_hz, settings.beyond_band = 24e9, "refuse"
    with pytest.raises(ConfigError, match="1 to 10 GHz"):
        computed()
    settings.beyond_band = "hold"
    assert np.isfinite(computed().factor).all()


def test_radar_and_ground_are_those_of_the_scene(sea: Any) -> None:
    before = [(item.name, tuple(item.location)) for item in sea.objects]
    found = computed()
    assert np.allclose(found.factor[:, 0], conductor_lobes(REQUEST.height_m), atol=1e-3)
    assert {item.code for item in found.findings} == {"coverage-ground-ends"}
    assert found.findings[0].numbers["reach_m"] == pytest.approx(500.0)
    assert before == [(item.name, tuple(item.location)) for item in sea.objects]


def test_the_ground_is_the_largest_object_below(sea: Any) -> None:
    mast = level_plane("Mast", -1.0, 1.0, bpy.data.materials["Sea"])
    hidden = level_plane("Hidden", -2.0, 900.0, bpy.data.materials["Sea"])
    hidden.hide_render = True
    bed = level_plane("Bed", -9.0, 500.0, bpy.data.materials["Sea"])
    assert computed().setup.receiver.height_m == pytest.approx(10.0)
    assert computed(ground="Mast").setup.receiver.height_m == pytest.approx(2.0)
    assert computed(ground=bed.name).setup.receiver.height_m == pytest.approx(18.0)
    mast.rotation_euler.x = math.radians(2)
    with pytest.raises(SceneError, match=r"'Mast' is tilted by 2 degrees"):
        computed(ground="Mast")
    mast.location.x = 3.0
    with pytest.raises(SceneError, match="No face of 'Mast'"):
        computed(ground="Mast")


def test_medium_follows_the_carrier_and_roughness_counts(sea: Any) -> None:
    water = make_physical_material(
        "Water", "sea_water", carrier_hz=77e9, rms_height_m=0.3, rms_slope=0.1
    )
    bpy.data.objects["Ocean"].data.materials[0] = water
    low, high = (
        headless.scene_coverage(
            sea, bpy.context.view_layer, REQUEST, values={"carrier_hz": carrier}
        ).setup.ground
        for carrier in (3e9, 10e9)
    )
    assert low.rms_height_m == 0.3
    # sea water: some 69 + 40j at 3 GHz, 52 + 38j at 10 GHz
    assert (low.index**2).real == pytest.approx(69, rel=0.05)
    assert (high.index**2).real == pytest.approx(52, rel=0.1)
    assert computed(rms_height_m=0.0).setup.ground.rms_height_m == 0
    with pytest.raises(ConfigError, match="--rms-height is -1 m"):
        computed(rms_height_m=-1.0)


def test_grounds_without_a_known_reflection_are_refused(sea: Any) -> None:
    ocean = bpy.data.objects["Ocean"]
    sloped = make_physical_material("Sloped", "index", carrier_hz=CARRIER_HZ, n=3.0, rms_slope=0.2)
    ocean.data.materials[0] = sloped
    with pytest.raises(SceneError, match="'Sloped' has a slope and no RMS height"):
        computed()
    assert computed(rms_height_m=0.01).setup.ground.rms_height_m == 0.01
    ocean.data.materials[0] = bpy.data.materials.new("Blue")
    with pytest.raises(SceneError, match="'Blue', which is no mirror"):
        computed()
    bpy.data.objects.remove(ocean)
    with pytest.raises(SceneError, match="No surface is straight below the radar"):
        computed()


def test_command_writes_picture_and_numbers(sea: Any, tmp_path: Path) -> None:
    file = tmp_path / "sea.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    words = [sys.executable, "-m", "radarsim_addon", "coverage", str(file), "--flat"]
    axes = ["--target-height", "0:30:0.25", "--range-limits", "1000:2000:250"]
    done = subprocess.run(
        [*words, *axes, "--curve-range", "1500"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "coverage-ground-ends" in done.stdout
    with np.load(tmp_path / "coverage.npz") as data:
        assert data["range_m"].tolist() == [1000, 1250, 1500, 1750, 2000]
        levels = data["pattern_propagation_factor_f4"]
        assert np.allclose(levels[:, 2], conductor_lobes(REQUEST.height_m), atol=1e-3)
        assert np.allclose(levels, data["relative_to_free_space"])
        assert str(data["polarisation"]) == "horizontal" and np.isinf(data["earth_radius_m"])
    with open(tmp_path / "coverage.csv", encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    curve = [float(row["pattern_propagation_factor_f4"]) for row in rows]
    assert np.allclose(curve, levels[:, 2])
    # at h = lambda R / (4 h_r) the textbook has its first lobe of 16
    textbook = [float(row["flat_two_ray"]) for row in rows]
    peak_m = WAVELENGTH_M * 1500 / 40
    assert float(rows[int(np.argmax(textbook[:30]))]["height_m"]) == pytest.approx(peak_m, abs=0.13)
    picture = (tmp_path / "coverage.png").read_bytes()
    assert picture.startswith(b"\x89PNG") and len(picture) > 20_000
    refused = subprocess.run(
        [*words, *axes[:2], "--range-limits", "9:1"], capture_output=True, text=True, check=False
    )
    assert refused.returncode == 2 and "ConfigError: --range-limits '9:1'" in refused.stderr


def test_operator_draws_the_diagram(sea: Any, tmp_path: Path) -> None:
    arguments = {"lowest": 0, "highest": 30, "nearest": 1000, "farthest": 2000, "steps": 50}
    with pytest.raises(RuntimeError, match="never saved"):
        bpy.ops.radarsim.coverage(**arguments)
    with pytest.raises(RuntimeError, match="expected the first below the last"):
        bpy.ops.radarsim.coverage(**{**arguments, "highest": 0}, folder=str(tmp_path))
    done = bpy.ops.radarsim.coverage(**arguments, flat=True, folder=str(tmp_path))
    assert done == {"FINISHED"}
    names = {file.name for file in tmp_path.iterdir()}
    assert names == {"coverage.npz", "coverage.csv", "coverage.png"}
    image = bpy.data.images["Radar coverage"]
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)[..., :3]
    # the first null: dark purple; the first lobe: yellow
    axes = axes_of("Radar coverage")
    assert axes is not None and axes.y == pytest.approx([-0.3, 30.3])  # cells of 0.6 m
    range_m = 1500.0
    (across, low), (_, high) = (axes.place(range_m, height) for height in (0.0, 30.0))
    rows = slice(*(round(at * image.size[1]) for at in (low, high)))
    inner = pixels[rows, round(across * image.size[0])]
    heights = np.linspace(0, 30, inner.shape[0])
    level = conductor_lobes(heights, range_m=range_m)
    assert inner[np.argmax(level)][0] > 0.8 and inner[np.argmin(level[200:]) + 200][0] < 0.5


@pytest.mark.parametrize(
    "text", ["", "1", "2:1", "0:1:0", "0:1:-1", "a:b", "0:inf", "0:1:1e-9", "0:1:2:3"]
)
def test_axes_that_are_not_understood(text: str) -> None:
    with pytest.raises(ConfigError, match="expected FIRST:LAST or FIRST:LAST:STEP"):
        parse_axis("--target-height", text)


def test_axes_include_their_ends() -> None:
    assert parse_axis("", "0:60:0.1").size == 601
    assert parse_axis("", "500:20000").size == 401
    assert parse_axis("", "0:1:0.4").tolist() == [0.0, 0.4, 0.8]


def test_scripts_reach_the_same_radar(sea: Any) -> None:
    rig = scripting.add_radar((0, 0, 1), (0, 100, 1))
    found = headless.scene_coverage(sea, bpy.context.view_layer, REQUEST, rig)
    assert found.setup.receiver.height_m == pytest.approx(12.0)
