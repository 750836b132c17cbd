# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes of a scene that must not change its echoes, or change them in a known way.

The scene is oblique: a turned radar with its antennas apart, a turned and unevenly scaled ball, a
tilted plate, a mirror that is tilted twice, and a box that moves.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import bmesh
from mathutils import Euler, Vector

from radarsim_addon.blender.materials import make_physical_material
from radarsim_addon.signal import frame_paths, open_run, synthesize
from radarsim_addon.signal.detection import object_echoes
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = [pytest.mark.blender, pytest.mark.slow]

ECHOING = ("Ball", "Plate", "Box")


@contextlib.contextmanager
def edited_mesh(mesh: Any) -> Iterator[Any]:
    edited = bmesh.new()
    edited.from_mesh(mesh)
    yield edited
    edited.to_mesh(mesh)
    edited.free()


def build(metres_per_unit: float = 1.0, side: int = 1) -> Any:
    """Return the parent of all: the scene in Blender units of so many metres; side -1 mirrors x."""
    scene, units = rs.new_scene(), 1 / metres_per_unit
    scene.unit_settings.scale_length = metres_per_unit
    ph.field_of_view(50)
    ph.radar_at((1.0 * units, -2.0 * units, 3.0 * units)).rotation_euler = (1.5, 0.2, 0.05)
    bpy.data.objects["Radar Emitter"].location = (0.8 * units, 0.3 * units, 0.0)
    rough = make_physical_material("Rough", "concrete", carrier_hz=5.3e9, rms_slope=0.3)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, location=(-1, 13, 2))
    bpy.ops.object.shade_smooth()
    ball = bpy.context.object
    ball.name, ball.rotation_euler, ball.scale = "Ball", (0.7, 0.3, 1.1), (1.0, 1.8, 0.7)
    ball.data.materials.append(rough)
    with edited_mesh(ball.data) as mesh:  # triangles, so that a mirrored ball has mirrored ones
        bmesh.ops.triangulate(mesh, faces=mesh.faces[:])
        if side < 0:
            bmesh.ops.scale(mesh, vec=(-1, 1, 1), verts=mesh.verts[:])
            bmesh.ops.reverse_faces(mesh, faces=mesh.faces[:])
    plate = ph.plate_at(20.0, 3.0, ph.lambert(0.5))
    plate.name, plate.location, plate.rotation_euler = "Plate", (5, 20, 4), (-0.4, 0.3, 0.2)
    mirror = ph.plate_at(12.0, 40.0, ph.mirror())
    mirror.name, mirror.location, mirror.rotation_euler = "Mirror", (0, 12, -3), (-1.4, 0.15, 0.1)
    bpy.ops.mesh.primitive_cube_add(size=2, location=(-5, 16, 3), rotation=(0.2, 0.1, 0.6))
    box = bpy.context.object
    box.name, box.scale = "Box", (0.7, 1.2, 1.0)
    box.data.materials.append(ph.rough_metal())
    for item in (ball, plate, mirror, box):
        item.location *= units
        item.scale *= units
    mh.key(
        box, "location", (1, box.location.copy()), (25, box.location + Vector((2, 5, 1)) * units)
    )
    mh.interpolation(box, "LINEAR", "LINEAR")
    world = mh.empty("World", (0, 0, 0))
    for item in scene.objects:
        if item is world:
            continue
        if item.parent is None:
            item.parent = world
        item.location.x *= side
        item.rotation_euler.y *= side
        item.rotation_euler.z *= side
    start = box.location.copy()
    mh.key(box, "location", (1, start), (25, start + Vector((2 * side, 5, 1)) * units))
    mh.interpolation(box, "LINEAR", "LINEAR")
    scene.frame_set(1)
    return world


class Echo(NamedTuple):
    """Of an object: power, range, rate, azimuth (right positive) of its direct paths.

    The error is that of all paths, with those over the mirror.
    """

    power_w: float
    error_w: float
    over_mirror_w: float
    range_m: float
    rate_mps: float
    azimuth_rad: float


def measured(folder: Path, frame: int = 1, **changes: Any) -> tuple[dict[str, Echo], np.ndarray]:
    """Echoes by object, and the samples of the burst."""
    options = {"replicates": 2, "max_reflections": 2} | changes.pop("options", {})
    size = {"width_px": 64, "height_px": 64, "frames": (frame,), **changes}
    run = ph.run_paths(folder, options=options, **size)
    rows, record = run.table(frame), run.record(frame)
    local = rows["direction"] @ np.array(record.receiver.matrix_world)[:3, :3]
    azimuth_rad = np.arctan2(local[:, 0], -local[:, 2])
    found = {}
    for echo in object_echoes(open_run(folder).frame(frame), record.carrier_hz):
        number = record.objects.index(echo.name) + 1
        mine = rows["last_object"] == number
        mirrored_w = float(rows["power_w"][mine & (rows["order"] > 1)].sum())
        mine &= rows["order"] == 1
        weight = rows["power_w"][mine]
        means = [
            float(values[mine] @ weight / weight.sum()) if mine.any() else math.nan
            for values in (rows["length_m"] / 2, rows["range_rate_mps"], azimuth_rad)
        ]
        found[echo.name] = Echo(float(weight.sum()), echo.power_error_w, mirrored_w, *means)
    paths = frame_paths(open_run(folder).frame(frame))
    return found, synthesize(paths, open_run(folder).radar, range_limits_m=(0, 60)).samples


def assert_same(
    found: dict[str, Echo], wanted: dict[str, Echo], names: dict[str, str], close: float = 1e-4
) -> None:
    """Ranges to 0.1 mm, rates to 0.1 mm/s, powers and angles to `close`."""
    assert set(names) | {"Mirror"} == set(wanted)
    for name, new_name in names.items():
        one, other = found[new_name], wanted[name]
        assert one.power_w == pytest.approx(other.power_w, rel=close), name
        # a path more or less at the edge of the mirror is 1 %
        assert one.over_mirror_w == pytest.approx(other.over_mirror_w, rel=0.02), name
        assert one.range_m == pytest.approx(other.range_m, abs=max(1e-4, close)), name
        assert one.rate_mps == pytest.approx(other.rate_mps, abs=max(1e-4, close)), name
        assert one.azimuth_rad == pytest.approx(other.azimuth_rad, abs=close), name


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory, group_folder: Path) -> Any:
    """The scene as it is: echoes and samples."""
    from scripts.validation.kept_groups import kept_groups

    with kept_groups(group_folder):
        build()
        found, samples = measured(tmp_path_factory.mktemp("usual") / "run")
    assert found["Ball"].over_mirror_w > 1e-3 * found["Ball"].power_w > 0
    assert abs(found["Box"].rate_mps) > 3
    return found, samples


def moved_scene() -> None:
    """About the vertical, by which polarisations are named."""
    world = build()
    world.location, world.rotation_euler = (40.0, -25.0, 12.0), Euler((0, 0, 2.3))


def shuffled_scene() -> None:
    """Names and the order of objects, which give objects their numbers, are reversed."""
    build()
    for name, new in zip(("Ball", "Plate", "Mirror", "Box"), ("Z", "Y", "X", "A"), strict=True):
        bpy.data.objects[name].name = new
    collection = bpy.context.scene.collection
    for name in ("Z", "X", "Y", "A"):
        item = bpy.data.objects[name]
        collection.objects.unlink(item)
        collection.objects.link(item)


def later_scene() -> None:
    """Frame 1 is frame 101, at 50 frames per second, stretched to twice the time."""
    build()
    curves = rs.animation_curves(bpy.data.objects["Box"].animation_data)
    render = bpy.context.scene.render
    render.fps, render.frame_map_old, render.frame_map_new = 48, 50, 100
    # what frame 101 shows is frame 50.5 of the animation, 24 of which take a second
    for curve in curves:
        for point in curve.keyframe_points:
            point.co.x += 49.5
        curve.update()


SAME = {
    "moved and turned with the radar": (moved_scene, 1, {name: name for name in ECHOING}),
    "renamed, in another order": (shuffled_scene, 1, {"Ball": "Z", "Plate": "Y", "Box": "A"}),
    "another frame and frame rate": (later_scene, 101, {name: name for name in ECHOING}),
    "units of 1 mm": (lambda: build(1e-3), 1, {name: name for name in ECHOING}),
    "units of 1 km": (lambda: build(1e3), 1, {name: name for name in ECHOING}),
}


@pytest.mark.parametrize("name", SAME)
def test_nothing_changes(usual: Any, tmp_path: Path, name: str) -> None:
    change, frame, names = SAME[name]
    change()
    found, samples = measured(tmp_path, frame)
    assert_same(found, usual[0], names)
    off = np.linalg.norm(samples - usual[1]) / np.linalg.norm(usual[1])
    assert off < 0.02, off  # 0.1 mm is 0.02 rad


#: Finer and without the mirror, so that standard errors are about 1 %.
ONE = {"replicates": 4, "max_reflections": 1}
FINE: dict[str, Any] = {"width_px": 80, "height_px": 80, "options": ONE}


@pytest.fixture(scope="module")
def fine(usual: Any, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Echo]:
    build()
    return measured(tmp_path_factory.mktemp("fine") / "run", **FINE)[0]


def assert_within_errors(found: dict[str, Echo], wanted: dict[str, Echo], side: int = 1) -> None:
    """Powers within four standard errors and 8 %, ranges to 3 cm, angles to 0.2 degrees."""
    for name in ECHOING:
        one, other = found[name], wanted[name]
        error_w = math.hypot(one.error_w, other.error_w)
        assert abs(one.power_w - other.power_w) < min(4 * error_w, 0.08 * other.power_w), name
        assert one.range_m == pytest.approx(other.range_m, abs=0.03), name
        assert one.rate_mps == pytest.approx(other.rate_mps, abs=0.05), name
        if side:  # as seen from the same place
            assert one.azimuth_rad == pytest.approx(side * other.azimuth_rad, abs=0.0035), name


def swapped_antennas() -> None:
    build()
    radar, lamp = bpy.data.objects["Radar"], bpy.data.objects["Radar Emitter"]
    radar.location += radar.rotation_euler.to_matrix() @ lamp.location
    lamp.location *= -1


def panorama() -> None:
    """A view of 57 by 49 degrees, whose pixels have equal angles, not tangents."""
    build()
    camera = bpy.context.scene.camera.data
    camera.type = "PANO"
    view = camera if hasattr(camera, "panorama_type") else camera.cycles
    view.panorama_type = "EQUIRECTANGULAR"
    view.longitude_min, view.longitude_max = -0.5, 0.5
    view.latitude_min, view.latitude_max = -0.42, 0.44


def shifted() -> None:
    """A wider view with its middle off the axis: the receiver's axes stay."""
    build()
    ph.field_of_view(60)
    bpy.context.scene.camera.data.shift_x, bpy.context.scene.camera.data.shift_y = 0.1, -0.08


def split() -> None:
    """The left half of each object is one of its own, of the same name and a number."""
    build()
    for name in ECHOING:
        item = bpy.data.objects[name]
        bpy.ops.object.select_all(action="DESELECT")
        item.select_set(True)
        bpy.context.view_layer.objects.active = item
        half = item.copy()
        half.data = item.data.copy()
        bpy.context.scene.collection.objects.link(half)
        for part, clear in ((item, True), (half, False)):
            with edited_mesh(part.data) as mesh:
                everything = [*mesh.verts, *mesh.edges, *mesh.faces]
                bmesh.ops.bisect_plane(
                    mesh, geom=everything, plane_co=(0, 0, 0), plane_no=(1, 0, 0),
                    clear_inner=clear, clear_outer=not clear,
                )  # fmt: skip


def aspect() -> None:
    """Pixels twice as high as wide, in a portrait frame that fits to its width."""
    build()
    bpy.context.scene.camera.data.sensor_fit = "HORIZONTAL"
    bpy.context.scene.render.pixel_aspect_y = 2.0


ALIKE: dict[str, tuple[Any, dict[str, Any]]] = {
    "antennas swapped": (swapped_antennas, FINE),
    "tiles that do not divide a landscape": (
        build, {"width_px": 110, "height_px": 90, "options": {**ONE, "tile_px": 37}},
    ),
    "pixels of 1 to 2": (aspect, {**FINE, "width_px": 110, "height_px": 55}),
    "shifted wide view": (shifted, FINE),
    "panorama": (panorama, {**FINE, "width_px": 90}),
    "each object in two parts": (split, FINE),
}  # fmt: skip


@pytest.mark.parametrize("name", ALIKE)
def test_echoes_are_the_same_within_their_errors(
    fine: dict[str, Echo], tmp_path: Path, name: str
) -> None:
    change, how = ALIKE[name]
    change()
    found, _ = measured(tmp_path, **how)
    if change is split:
        for whole in ECHOING:
            parts = [found[whole], found.pop(f"{whole}.001")]
            weights = [part.power_w for part in parts]
            means = np.average(np.array(parts), axis=0, weights=weights)
            found[whole] = Echo(
                sum(weights), math.hypot(*(part.error_w for part in parts)), 0.0, *means[3:]
            )
    assert_within_errors(found, fine, side=0 if change is swapped_antennas else 1)


def test_a_mirrored_scene_mirrors_the_azimuth(fine: dict[str, Echo], tmp_path: Path) -> None:
    build(side=-1)
    assert fine["Box"].azimuth_rad < -0.1 < 0.1 < fine["Plate"].azimuth_rad  # left and right
    assert_within_errors(measured(tmp_path, **FINE)[0], fine, side=-1)
