# SPDX-License-Identifier: GPL-3.0-or-later
"""Small targets in views of the whole sphere: tiles of their own, powers of a closed form."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import signal
from radarsim_addon.blender import nodes
from radarsim_addon.blender.paths import tiles as path_tiles
from radarsim_addon.blender.paths.tiles import Tile
from radarsim_addon.physics.radar_equation import effective_area_m2
from radarsim_addon.signal.detection import object_echoes
from radarsim_addon.signal.paths import PathRows, tiles_by_replicate
from radarsim_addon.signal.paths.footprints import grid_places
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = [pytest.mark.blender, pytest.mark.slow]

DISTANCE = 10.0
REFLECTANCE = 1 - 4e4 / (1e8 + 2e4 + 1 + 1e8)
SIZE = {"width_px": 64, "height_px": 32}
OPTIONS = {"replicates": 4, "max_standard_error": 0.02, "refine_for": "objects"}


def lambert() -> Any:
    """A metal that scatters as Lambert's law says."""
    return nodes.make_material("lambert", n=1e4, kappa=1e4, specularity=0.0, penetrable=False)


def wide_camera(left: float, right: float, bottom: float, top: float) -> None:
    """Make the receiver an equirectangular camera of these longitudes and latitudes."""
    camera = bpy.context.scene.camera.data
    camera.type = "PANO"
    settings = camera if hasattr(camera, "panorama_type") else camera.cycles
    settings.panorama_type = "EQUIRECTANGULAR"
    settings.longitude_min, settings.longitude_max = left, right
    settings.latitude_min, settings.latitude_max = bottom, top


def add_target(longitude: float, latitude: float, half_m: float, name: str = "Target") -> Any:
    """A square that faces the radar from 10 m, its sides along longitude and latitude."""
    east = np.array([math.cos(longitude), -math.sin(longitude), 0.0])
    level = np.array([math.sin(longitude), math.cos(longitude), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    ahead = math.cos(latitude) * level + math.sin(latitude) * up
    north = math.cos(latitude) * up - math.sin(latitude) * level
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = [tuple(DISTANCE * ahead + half_m * (a * east + b * north)) for a, b in signs]
    return ph.quad(name, corners, bpy.data.materials.get("lambert") or lambert())


def add_room() -> None:
    """Walls all around, all of them farther than the target."""
    bpy.ops.mesh.primitive_cube_add(size=30.0, location=(1.3, -0.7, 0.9))
    bpy.context.object.name = "Room"
    bpy.context.object.data.materials.append(bpy.data.materials.get("lambert") or lambert())


def power_w(half_m: float) -> float:
    """Power of a square that faces the radar: A F/pi EIRP/(4 pi) times the integral of d^2/r^6."""
    nodes_, weights = np.polynomial.legendre.leggauss(24)
    squared = DISTANCE**2 + half_m**2 * (nodes_[:, None] ** 2 + nodes_**2)
    integral = half_m**2 * DISTANCE**2 * weights @ squared**-3 @ weights
    area = float(effective_area_m2(ph.C0_MPS / 5.3e9))
    return area * REFLECTANCE / math.pi * eirp_w() / (4 * math.pi) * float(integral)


def eirp_w() -> float:
    """The lamp's power."""
    return float(next(o for o in bpy.context.scene.objects if o.type == "LIGHT").data.energy)


def echo_of(run: ph.PathRun, name: str = "Target") -> Any:
    """Power of an object with its standard error, as users read it."""
    echoes = object_echoes(signal.open_run(run.folder).frame(1), 5.3e9)
    return next(echo for echo in echoes if echo.name == name)


def assert_power(run: ph.PathRun, expected_w: float, name: str = "Target") -> None:
    """Within 0.2 dB, and within three standard errors as reported."""
    echo = echo_of(run, name)
    assert abs(10 * math.log10(echo.power_w / expected_w)) < 0.2
    # float32 renders add some 1e-6
    assert abs(echo.power_w - expected_w) < 3 * echo.power_error_w + 1e-5 * expected_w


SPHERE = 4 * math.pi


@pytest.mark.parametrize(
    ("longitude", "latitude", "half_m"),
    [
        (0.3, 0.2, 0.02),
        (2.5, 1.0, 0.02),
        pytest.param(math.pi, 0.1, 0.02, id="seam"),
        pytest.param(math.pi - 1e-3, -0.4, 0.01, id="mostly on one side of the seam"),
        pytest.param(1.0, 1.56, 0.02, id="beside the pole"),
        pytest.param(0.0, math.pi / 2, 0.02, id="pole"),
        pytest.param(0.7, 1e-3 - math.pi / 2, 0.01, id="other pole, off the middle"),
        pytest.param(-1.9, -1.1, 0.003, id="small"),
    ],
)
def test_small_target_in_a_room(
    longitude: float, latitude: float, half_m: float, tmp_path: Path
) -> None:
    """A few thousandths of a pixel of a whole sphere, wherever it is; the sphere is covered."""
    rs.new_scene()
    wide_camera(-math.pi, math.pi, -math.pi / 2, math.pi / 2)
    add_room()
    add_target(longitude, latitude, half_m)
    run = ph.run_paths(tmp_path, options=OPTIONS, **SIZE)
    assert_power(run, power_w(half_m))
    rows, record = run.table(), run.record()
    assert (record.small_objects, record.small_objects_tiled) == (1, 1)
    assert record.stop_reason == "error target"
    assert len(rows) < 40 * 4 * SIZE["width_px"] * SIZE["height_px"]
    # The midpoint rule makes each pixel too small by (5.6 degrees)^2/24.
    assert rows["solid_angle_sr"].sum() == pytest.approx(SPHERE, rel=1e-3)
    target = rows[rows["last_object"] == record.objects.index("Target") + 1]
    seen = target["last_scatterer_m"] / np.linalg.norm(
        target["last_scatterer_m"], axis=1, keepdims=True
    )
    assert np.abs(seen - target["direction"]).max() < 4e-7


def test_refinement_quarters_tiles_of_a_sphere(tmp_path: Path) -> None:
    """A target too large for a tile of its own: what its edges leave is refined away."""
    rs.new_scene()
    wide_camera(-math.pi, math.pi, -math.pi / 2, math.pi / 2)
    add_room()
    add_target(2.9, 0.8, 6.0)  # across the seam
    options = OPTIONS | {"max_standard_error": 0.003, "tile_px": 16}
    run = ph.run_paths(tmp_path, options=options, **SIZE)
    record = run.record()
    assert record.small_objects == 0
    assert record.finest_refinement_level >= 2
    assert record.stop_reason == "error target"
    assert run.table()["solid_angle_sr"].sum() == pytest.approx(SPHERE, rel=1e-3)
    coarse = ph.run_paths(tmp_path / "coarse", options={"replicates": 4, "tile_px": 16}, **SIZE)
    assert echo_of(run).power_error_w < 0.5 * echo_of(coarse).power_error_w
    assert_power(run, power_w(6.0))


def test_target_on_the_borders_of_tiles(tmp_path: Path) -> None:
    """Where four tiles meet, in a part of the sphere; the grid begins beside the axis."""
    rs.new_scene()
    wide_camera(-0.9, 1.1, -0.6, 0.8)
    add_room()
    add_target(0.1, 0.1, 0.02)  # the middle of the frame
    run = ph.run_paths(tmp_path, options=OPTIONS | {"tile_px": 16}, **SIZE)
    assert_power(run, power_w(0.02))
    expected = 2.0 * (math.sin(0.8) + math.sin(0.6))
    assert run.table()["solid_angle_sr"].sum() == pytest.approx(expected, rel=5e-4)
    rows = run.table()
    target = rows[rows["last_object"] == run.record().objects.index("Target") + 1]
    assert len(set(target["tile"])) >= 4


def test_tiles_agree_with_a_dense_frame(tmp_path: Path) -> None:
    """An octahedron before the walls: many times as many rays without tiles say the same.

    They are those of a frame of 1024 x 512 pixels, of which the part around the target is measured.
    """
    rs.new_scene()
    wide_camera(-2.0, 2.0, -0.9, 0.9)
    add_room()
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=1, radius=0.35, location=(6.0, 5.0, 1.5))
    bpy.context.object.name = "Target"
    bpy.context.object.data.materials.append(bpy.data.materials["lambert"])
    run = ph.run_paths(tmp_path / "tiles", options=OPTIONS, **SIZE)
    longitude, latitude = math.atan2(6.0, 5.0), math.atan2(1.5, math.hypot(6.0, 5.0))
    half_width, half_height = 64 * 4.0 / 1024, 64 * 1.8 / 512
    wide_camera(
        longitude - half_width, longitude + half_width, latitude - half_height,
        latitude + half_height,
    )  # fmt: skip
    dense = ph.run_paths(
        tmp_path / "dense", options={"replicates": 4, "tile_px": 128}, width_px=128, height_px=128
    )
    ours, theirs = echo_of(run), echo_of(dense)
    assert abs(10 * math.log10(ours.power_w / theirs.power_w)) < 0.2
    spread = math.hypot(ours.power_error_w, theirs.power_error_w)
    assert abs(ours.power_w - theirs.power_w) < 3 * spread
    assert len(run.table()) < 0.05 * len(dense.table()) * (1024 / 128) * (512 / 128)


def test_order_of_tiles_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit by bit, with refinement and a target on seam and borders."""
    options = OPTIONS | {"tile_px": 16, "replicates": 2}

    def run(name: str) -> PathRows:
        rs.new_scene()
        wide_camera(-math.pi, math.pi, -math.pi / 2, math.pi / 2)
        add_room()
        add_target(math.pi, 0.0, 0.02)
        found = ph.run_paths(tmp_path / name, options=options, width_px=32, height_px=32)
        return found.table()

    def ordered(rows: PathRows) -> PathRows:
        rows = rows.copy()
        rows["tile"] = 0
        keys = [part for n in rows.names for part in np.atleast_2d(rows[n].T)]
        return rows[np.lexsort(keys)]

    first = run("a")
    split = Tile.split
    monkeypatch.setattr(path_tiles.Tile, "split", lambda tile, most: split(tile, most)[::-1])
    reverse = run("b")
    assert reverse.tobytes() != first.tobytes()
    assert ordered(first).equals(ordered(reverse))


def test_animated_camera(tmp_path: Path) -> None:
    """The radar turns: tiles follow the target, frame by frame, over much of the sphere."""
    rs.new_scene()
    wide_camera(-math.pi, math.pi, -math.pi / 2, math.pi / 2)
    add_room()
    plates = [add_target(0.4, 0.1, 0.02)]
    radar = ph.radar_at((0.0, 0.0, 0.0))
    radar.rotation_euler = (0.0, 0.0, 0.0)
    radar.keyframe_insert("rotation_euler", frame=1)
    radar.rotation_euler = (math.radians(95.0), 0.0, math.pi + 0.4)
    radar.keyframe_insert("rotation_euler", frame=3)
    run = ph.run_paths(tmp_path, options=OPTIONS | {"motion": "off"}, frames=(1, 2, 3), **SIZE)
    ahead = []
    for frame in (1, 2, 3):
        rows, record = run.table(frame), run.record(frame)
        target = rows[rows["last_object"] == record.objects.index(plates[0].name) + 1]
        found = target["power_w"].sum()
        assert abs(10 * math.log10(found / power_w(0.02))) < 0.2, frame
        assert record.small_objects_tiled == 1
        ahead.append(np.array(record.receiver.matrix_world)[:3, :3].T @ target["direction"][0])
    turned = np.degrees(np.arccos([ahead[0] @ ahead[1], ahead[0] @ ahead[2]]))
    assert np.all(turned > 30), turned


def test_what_no_ray_met_is_said_in_wide_views(tmp_path: Path) -> None:
    rs.new_scene()
    wide_camera(-math.pi, math.pi, -math.pi / 2, math.pi / 2)
    add_target(math.pi, 0.2, 0.005)
    record = ph.run_paths(tmp_path, **SIZE).record()
    assert [item.subjects for item in record.findings if item.code == "object-missed-by-rays"] == [
        ("Target",)
    ]


def test_small_targets_around_a_pole_have_small_images(tmp_path: Path) -> None:
    """Cubes under a radar that hangs askew: no tile's grid is larger than the tile."""
    rs.new_scene()
    wide_camera(-math.pi, math.pi, -math.pi / 2, math.pi / 2)
    material = lambert()
    corners = [(-200, -200, -5), (200, -200, -5), (200, 200, -5), (-200, 200, -5)]
    ph.quad("Ground", corners, material)
    for number in range(4):
        away = 5 * math.radians(0.1 + 0.3 * number)
        place = (away * math.cos(2.3 * number), away * math.sin(2.3 * number), -4.98)
        bpy.ops.mesh.primitive_cube_add(size=0.01, location=place)
        bpy.context.object.data.materials.append(material)
    angles = bpy.data.objects["Radar"].rotation_euler
    bpy.data.objects["Radar"].rotation_euler = (angles.x + 0.013, 0.021, 0.4)
    options = {**OPTIONS, "replicates": 2, "tile_px": 128}
    run = ph.run_paths(tmp_path, width_px=256, height_px=128, options=options)
    sizes = []
    for views in tiles_by_replicate(run.table(), 2):
        for rows in views:
            at = grid_places(rows, run.record().receiver, 2)
            sizes.append(max(int(place.max()) + 1 for place in at))
    assert len(sizes) > 10
    assert max(sizes) <= 128
    assert run.record().stop_reason == "error target"
    for name in ("Cube", "Cube.001", "Cube.002", "Cube.003"):
        echo = echo_of(run, name)
        assert 0 < echo.power_error_w < 0.1 * echo.power_w


def test_a_street_in_all_directions(tmp_path: Path) -> None:
    """Images of tiles at the poles are as wide as the view, and the sum below is a closed form."""
    rs.new_scene()
    wide_camera(-math.pi, math.pi, -math.pi / 2, math.pi / 2)
    metal, height_m, width_px = lambert(), 1.8, 256
    ground = [(-300, -300, -height_m), (300, -300, -height_m), (300, 300, -height_m)]
    ph.quad("Ground", [*ground, (-300, 300, -height_m)], metal)
    for x in (-14.0, 14.0):
        for y in range(-100, 101, 20):
            bpy.ops.mesh.primitive_cube_add(size=1, location=(x, y, 4.0))
            bpy.context.object.scale = (12, 17, 11.6)
            bpy.context.object.data.materials.append(metal)
    run = ph.run_paths(
        tmp_path, width_px=width_px, height_px=width_px // 2, options={"replicates": 2}
    )
    rows, receiver = run.table(), run.record().receiver
    for tile in np.unique(rows["tile"]):
        for replicate in (0, 1):
            mine = rows[(rows["tile"] == tile) & (rows["replicate"] == replicate)]
            col, row = grid_places(mine, receiver, 2)
            assert col.max() < width_px and row.max() < width_px // 2
            assert np.unique(row * width_px + col).size == mine.size
    below = rows["direction"][:, 2] < -math.cos(math.pi / 4)
    integral = 2 * math.pi / height_m**2 * (1 - 1 / 4) / 4
    area = float(effective_area_m2(ph.C0_MPS / 5.3e9))
    want = area * REFLECTANCE / math.pi * eirp_w() / (4 * math.pi) * integral
    assert rows["power_w"][below].sum() == pytest.approx(want, rel=0.01)
