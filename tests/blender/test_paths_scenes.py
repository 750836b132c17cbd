# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths in scenes as users have them: other lights, instances, libraries, scales, animations."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import contract  # noqa: E402
from radarsim_addon.blender import nodes, path_scene  # noqa: E402
from radarsim_addon.blender.path_tiles import Tile  # noqa: E402
from radarsim_addon.blender.rig import DEFAULT_EIRP_W  # noqa: E402
from radarsim_addon.physics.radar_equation import monostatic_power_w, to_db  # noqa: E402
from radarsim_addon.signal.pathtable import FLAG_CODED_LENGTH  # noqa: E402
from tests.blender import path_helpers as ph  # noqa: E402
from tests.blender import radar_scenes as rs  # noqa: E402
from tests.blender.test_settings_restore import rna_values  # noqa: E402

pytestmark = pytest.mark.blender

METAL = (1e4, 1e4, 0.0, 0.5)


def rough_metal() -> Any:
    return nodes.make_material("Rough metal", *METAL, penetrable=False)


# -- what does not belong to the measurement -------------------------------------------------------


def furnished_scene(clutter: bool) -> None:
    """A floor, a wall and a ball of foreign materials; with clutter: lamps, sky, fog, glow."""
    rs.new_scene()
    ph.field_of_view(50)
    ph.radar_at((0, 0, 2))
    grey = ph.principled("Grey", (0.5, 0.5, 0.5))
    ph.quad("Floor", [(-20, -5, 0), (20, -5, 0), (20, 30, 0), (-20, 30, 0)], grey)
    ph.quad("Wall", [(-20, 20, 0), (20, 20, 0), (20, 20, 20), (-20, 20, 20)], grey)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(1, 10, 2), radius=1)
    bpy.context.object.data.materials.append(ph.principled("Red", (0.8, 0.1, 0.1)))
    glow = ph.principled("Glow", (0.3, 0.3, 0.3))
    ph.quad("Lamp shade", [(-3, 12, 1), (-1, 12, 1), (-1, 12, 3), (-3, 12, 3)], glow)
    image = bpy.context.scene.render.image_settings
    # Set, not as Blender starts: its unset colour space cannot be put back by anybody.
    image.file_format = "OPEN_EXR"
    image.file_format = "PNG"
    if not clutter:
        return
    surface = next(n for n in glow.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    surface.inputs["Emission Color"].default_value = (1, 0.7, 0.2, 1)
    surface.inputs["Emission Strength"].default_value = 50.0
    glow.cycles.emission_sampling = "FRONT_BACK"
    for kind, power in (("POINT", 1e6), ("AREA", 500.0), ("SUN", 5.0), ("SPOT", 1e4)):
        light = bpy.data.objects.new(kind, bpy.data.lights.new(kind, kind))
        light.data.energy = power
        light.location = (3, 8, 6)
        bpy.context.scene.collection.objects.link(light)
    world = bpy.data.worlds.new("Sky")
    if world.node_tree is None:
        world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    sky = tree.nodes.new("ShaderNodeBackground")
    noise = tree.nodes.new("ShaderNodeTexNoise")  # a sky that must be sampled, like a picture
    tree.links.new(noise.outputs["Color"], sky.inputs["Color"])
    haze = tree.nodes.new("ShaderNodeVolumeScatter")
    haze.inputs["Density"].default_value = 0.05
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(sky.outputs[0], output.inputs["Surface"])
    tree.links.new(haze.outputs[0], output.inputs["Volume"])
    bpy.context.scene.world = world
    fog = bpy.data.materials.new("Fog")
    if fog.node_tree is None:
        fog.use_nodes = True
    fog.node_tree.nodes.clear()
    mist = fog.node_tree.nodes.new("ShaderNodeVolumePrincipled")
    end = fog.node_tree.nodes.new("ShaderNodeOutputMaterial")
    fog.node_tree.links.new(mist.outputs[0], end.inputs["Volume"])
    bpy.ops.mesh.primitive_cube_add(location=(0, 6, 2), size=4)
    bpy.context.object.name = "Zz fog"
    bpy.context.object.data.materials.append(fog)


def everything(scene: Any) -> dict[str, Any]:
    """All values of all that a measurement might touch."""
    owners: dict[str, Any] = {
        "scene": scene,
        "render": scene.render,
        "image": scene.render.image_settings,
        "cycles": scene.cycles,
    }
    for layer in scene.view_layers:
        owners[f"layer {layer.name}"] = layer
        owners[f"layer cycles {layer.name}"] = layer.cycles
        for group in layer.lightgroups:
            owners[f"light group {layer.name}/{group.name}"] = group
    for item in bpy.data.objects:
        owners[f"object {item.name}"] = item
        if item.data is not None:
            owners[f"data {item.name}"] = item.data
    for item in (*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights):
        owners[f"{type(item).__name__} {item.name}"] = item
        if hasattr(item, "cycles"):
            owners[f"cycles {item.name}"] = item.cycles
        if item.node_tree is not None:
            for node in item.node_tree.nodes:
                owners[f"node {item.name}/{node.name}"] = node
                for socket in node.inputs:
                    owners[f"socket {item.name}/{node.name}/{socket.identifier}"] = socket
    values: dict[str, Any] = {name: rna_values(owner) for name, owner in owners.items()}
    values["custom"] = {key: str(value) for key, value in scene.items()}
    values["data"] = {
        kind: sorted(item.name for item in getattr(bpy.data, kind))
        for kind in ("objects", "meshes", "materials", "worlds", "lights", "cameras")
    }
    values["time"] = (scene.frame_current, scene.frame_subframe)
    return values


def test_lights_sky_and_fog_stay_out(tmp_path: Path) -> None:
    """Bit for bit the table of the same scene without them, orders 1 and 2, all put back."""
    options = {"max_order": 2}
    size = {"width_px": 24, "height_px": 24}
    furnished_scene(clutter=False)
    clean = ph.run_paths(tmp_path / "clean", options=options, **size).table()
    furnished_scene(clutter=True)
    scene = bpy.context.scene
    scene.frame_set(7, subframe=0.25)
    layer = scene.view_layers[0]
    with bpy.context.temp_override(scene=scene, view_layer=layer):
        bpy.ops.scene.view_layer_add_lightgroup(name="Theirs")
        bpy.ops.scene.view_layer_add_lightgroup(name="Others")
    layer.active_lightgroup_index = 0
    bpy.data.objects["POINT"].lightgroup = "Theirs"
    for number, item in enumerate(bpy.data.objects):
        item.pass_index = 100 + number
    before = everything(scene)
    run = ph.run_paths(tmp_path / "cluttered", options=options, **size)
    after = everything(scene)
    for name in before.keys() | after.keys():
        assert after.get(name) == before.get(name), name
    rows = run.table()
    assert rows.size == clean.size
    for name in rows.dtype.names:
        np.testing.assert_array_equal(rows[name], clean[name], err_msg=name)
    assert {1, 2} == set(rows["order"])
    assert any("Zz fog" in text for text in run.job.warnings)


def test_an_error_in_a_render_puts_all_back(tmp_path: Path) -> None:
    furnished_scene(clutter=True)
    scene = bpy.context.scene
    before = everything(scene)
    from radarsim_addon.blender.path_job import PathJob
    from radarsim_addon.blender.path_options import PathOptions

    with (
        pytest.raises(RuntimeError, match="power cut"),
        PathJob(
            scene, scene.view_layers[0], rs.measurement(), tmp_path, PathOptions(shifts=1)
        ) as job,
    ):
        for number, task in enumerate(job.pending()):
            job.start(task)
            if number == 3:
                raise RuntimeError("power cut")
            job.render(task)
            job.finish(task)
    after = everything(scene)
    for name in before.keys() | after.keys():
        assert after.get(name) == before.get(name), name


# -- repeated, stopped, continued ------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["AUTO", "FIXED"])
def test_number_of_threads_changes_nothing(
    mode: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither the paths, by a bit, nor the user's setting, also the one that is not in force."""
    options = {"max_order": 2, "shifts": 2}
    tables = []
    for name, least in (("one", 1 << 30), ("all", 0)):
        monkeypatch.setattr(path_scene, "_ONE_THREAD_BELOW_PX", least)
        furnished_scene(clutter=False)
        render = bpy.context.scene.render
        render.threads_mode, render.threads = "FIXED", 5
        render.threads_mode = mode
        run = ph.run_paths(tmp_path / name, options=options, width_px=40, height_px=40)
        tables.append((run.folder / contract.frame_dir(1) / contract.PATHS_TABLE).read_bytes())
        assert render.threads_mode == mode
        render.threads_mode = "FIXED"
        assert render.threads == 5
    assert tables[0] == tables[1]


def test_order_of_tiles_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lots are drawn by place, poses are read as they are rendered: the same rows, to the bit."""
    options = {"max_order": 2, "shifts": 2, "tile_px": 10}
    furnished_scene(clutter=False)
    forwards = ph.run_paths(tmp_path / "a", options=options, width_px=24, height_px=24).table()
    split = Tile.split
    monkeypatch.setattr(Tile, "split", lambda tile, most: split(tile, most)[::-1])
    furnished_scene(clutter=False)
    backwards = ph.run_paths(tmp_path / "b", options=options, width_px=24, height_px=24).table()
    tiles = backwards["tile"].max()
    assert tiles >= 8
    backwards["tile"] = tiles - backwards["tile"]
    order = np.argsort(backwards["tile"], kind="stable")
    assert backwards[order].tobytes() == forwards.tobytes()


def test_a_frame_that_was_stopped_goes_on(tmp_path: Path) -> None:
    """Finished tiles are taken as they are, parents that were refined too; the table is that of an
    uninterrupted run, bit by bit, also where a kept tile was damaged."""
    options = {"max_order": 2, "shifts": 2, "error_target": 0.05, "max_level": 1, "tile_px": 12}
    size = {"width_px": 24, "height_px": 24}
    furnished_scene(clutter=False)
    whole = ph.run_paths(tmp_path / "whole", options=options, **size)
    folder = tmp_path / "stopped"
    for limit in (60, 60):
        ph.run_paths(folder, options=options, limit=limit, **size)
    tiles = sorted((folder / contract.frame_dir(1) / contract.TILES_DIR).glob("*.rows"))
    assert len(tiles) >= 3
    assert not list(folder.rglob("*.part"))
    tiles[0].write_bytes(tiles[0].read_bytes()[:-1] + b"?")
    run = ph.run_paths(folder, options=options, **size)
    table = Path(contract.frame_dir(1)) / contract.PATHS_TABLE
    assert (folder / table).read_bytes() == (whole.folder / table).read_bytes()
    ours, theirs = run.record(), whole.record()
    changed = {"render_time_s": ours.render_time_s}
    assert dataclasses.replace(theirs, **changed) == ours
    assert run.job.path_scene is not None
    assert run.job.path_scene.renders < theirs.renders - 20
    assert not tiles[1].parent.exists()
    assert (run.job.done, run.job.total) == (whole.job.done, whole.job.total)


def test_same_seed_same_bits(tmp_path: Path) -> None:
    """Bit-identical with refinement and lots drawn; another seed draws other lots."""
    options = {"max_order": 2, "shifts": 2, "error_target": 0.05, "max_level": 1, "tile_px": 12}
    files = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        furnished_scene(clutter=False)
        run = ph.run_paths(tmp_path / name, options=options, width_px=24, height_px=24, seed=seed)
        files.append((run.folder / contract.frame_dir(1) / contract.PATHS_TABLE).read_bytes())
    assert run.record().finest_level > 0
    assert files[0] == files[1]
    assert files[0] != files[2]


def test_a_stopped_run_goes_on(tmp_path: Path) -> None:
    """Whole frames are kept as they are, the frame that was cut off is made anew."""
    rs.new_scene()
    ph.plate_at(10, 4, rough_metal())
    stopped = ph.run_paths(tmp_path, frames=(1, 2, 3), limit=3)
    tables = sorted(tmp_path.glob("frames/*/paths.npy"))
    assert 0 < len(tables) < 3
    times = {path: path.stat().st_mtime_ns for path in tables}
    left_over = tmp_path / contract.frame_dir(3) / contract.TILES_DIR / "0.rows.part"
    left_over.parent.mkdir(parents=True, exist_ok=True)
    left_over.write_bytes(b"half")
    run = ph.run_paths(tmp_path, frames=(1, 2, 3))
    assert len(list(tmp_path.glob("frames/*/paths.npy"))) == 3
    assert {path: path.stat().st_mtime_ns for path in tables} == times
    assert not list(tmp_path.rglob("*.part"))
    assert (run.job.done, run.job.total) == (3, 3)
    assert stopped.job.done < 3
    # A damaged table is made again, a good one is not.
    tables[0].write_bytes(tables[0].read_bytes()[:-1])
    run = ph.run_paths(tmp_path, frames=(1, 2, 3))
    assert run.table(1).size == run.table(2).size
    assert tables[0].stat().st_mtime_ns != times[tables[0]]


def test_overwriting_keeps_nothing_of_the_other_run(tmp_path: Path) -> None:
    """A run of other options over an earlier one measures every frame anew."""
    rs.new_scene()
    ph.plate_at(10, 4, rough_metal())
    ph.run_paths(tmp_path)
    run = ph.run_paths(tmp_path, overwrite=True, options={"shifts": 3})
    assert run.record().shifts == 3
    assert set(run.table()["shift"]) == {0, 1, 2}


# -- instances and libraries -----------------------------------------------------------------------


def plate_collection(y: float = 0.0) -> Any:
    """A collection that is not in the scene, with one plate."""
    collection = bpy.data.collections.new("Plates")
    plate = ph.plate_at(y, 2.0, rough_metal())
    bpy.context.scene.collection.objects.unlink(plate)
    collection.objects.link(plate)
    return collection


def instance(collection: Any, location: tuple[float, float, float]) -> Any:
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type = "COLLECTION"
    empty.instance_collection = collection
    empty.location = location
    bpy.context.scene.collection.objects.link(empty)
    return empty


PLACES = [(-3.0, 10.0, 0.0), (0.0, 14.0, 0.0), (4.0, 18.0, 0.0)]


def assert_plates_seen(rows: np.ndarray, places: list[tuple[float, float, float]]) -> None:
    """Each row lies on one of the plates, all of them are seen, ranges are those of the plates."""
    planes = np.array([place[1] for place in places])
    which = np.argmin(np.abs(rows["last_m"][:, 1:2] - planes), axis=1)
    assert set(which) == set(range(len(places)))
    cosine = rows["direction"][:, 1]
    np.testing.assert_allclose(rows["length_m"], 2 * planes[which] / cosine, rtol=1e-6)
    centre = np.array(places)[which]
    assert np.abs(rows["last_m"] - centre)[:, [0, 2]].max() <= 1 + 1e-5
    assert not np.any(rows["flags"])


def test_collection_instances(tmp_path: Path) -> None:
    rs.new_scene()
    ph.field_of_view(40)
    collection = plate_collection()
    for place in PLACES:
        instance(collection, place)
    run = ph.run_paths(tmp_path, width_px=48, height_px=48)
    rows = run.table()
    assert_plates_seen(rows, PLACES)
    assert {run.record().objects[n - 1] for n in rows["object"]} == {"Plate"}


def test_instances_of_geometry_nodes(tmp_path: Path) -> None:
    """Instances on points, with a material that only the node tree sets."""
    rs.new_scene()
    ph.field_of_view(40)
    mesh = bpy.data.meshes.new("Points")
    mesh.from_pydata(PLACES, [], [])
    host = bpy.data.objects.new("Host", mesh)
    bpy.context.scene.collection.objects.link(host)
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    new = tree.nodes.new
    given, result = new("NodeGroupInput"), new("NodeGroupOutput")
    grid, dress, scatter = (
        new("GeometryNodeMeshGrid"),
        new("GeometryNodeSetMaterial"),
        new("GeometryNodeInstanceOnPoints"),
    )
    grid.inputs["Size X"].default_value = grid.inputs["Size Y"].default_value = 2.0
    dress.inputs["Material"].default_value = rough_metal()
    scatter.inputs["Rotation"].default_value = (math.pi / 2, 0, 0)
    tree.links.new(grid.outputs["Mesh"], dress.inputs["Geometry"])
    tree.links.new(given.outputs[0], scatter.inputs["Points"])
    tree.links.new(dress.outputs[0], scatter.inputs["Instance"])
    tree.links.new(scatter.outputs[0], result.inputs[0])
    host.modifiers.new("Scatter", "NODES").node_group = tree
    run = ph.run_paths(tmp_path, width_px=48, height_px=48)
    assert_plates_seen(run.table(), PLACES)


def test_linked_library(tmp_path: Path) -> None:
    """A scene whose plates come from another file, with foreign and with Radar Materials."""
    rs.new_scene()
    collection = plate_collection()
    foreign = ph.plate_at(0, 2.0, ph.principled("Foreign", (0.6, 0.5, 0.4)))
    foreign.name = "Foreign plate"
    bpy.context.scene.collection.objects.unlink(foreign)
    other = bpy.data.collections.new("Foreign")
    other.objects.link(foreign)
    library = tmp_path / "library.blend"
    bpy.data.libraries.write(str(library), {collection, other}, fake_user=True)
    rs.new_scene()
    ph.field_of_view(40)
    with bpy.data.libraries.load(str(library), link=True) as (_, target):
        target.collections = ["Plates", "Foreign"]
    mine, theirs = target.collections
    for collection, place in zip((mine, theirs, mine), PLACES, strict=True):
        instance(collection, place)
    bpy.context.scene.render.image_settings.file_format = "OPEN_EXR"
    bpy.context.scene.render.image_settings.file_format = "PNG"
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    before = everything(bpy.context.scene)
    run = ph.run_paths(tmp_path / "run", width_px=48, height_px=48)
    after = everything(bpy.context.scene)
    for name in before.keys() | after.keys():
        assert after.get(name) == before.get(name), name
    rows, record = run.table(), run.record()
    assert_plates_seen(rows, PLACES)
    assert record.code == "world"
    assert {record.objects[n - 1] for n in rows["object"]} == {"Plate", "Foreign plate"}


# -- scales ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("metres_per_unit", "size"),
    [(1.0, 1.0), (1.0, 1e-3), (1.0, 1e3), (0.01, 100.0), (0.001, 1.0), (1000.0, 1.0)],
    ids=["metres", "millimetres", "kilometres", "centimetre units", "millimetre units", "km units"],
)
@pytest.mark.parametrize("code", ["materials", "world"])
def test_scales(tmp_path: Path, metres_per_unit: float, size: float, code: str) -> None:
    """Order 1 and 2 of a floor and a wall: everything grows with the scene, to rounding."""
    rs.new_scene()
    scene = bpy.context.scene
    scene.unit_settings.scale_length = metres_per_unit
    ph.field_of_view(50)
    ph.radar_at((0, 0, 2 * size))
    x, near, end, top = 30 * size, -5 * size, 10 * size, 30 * size
    floor = nodes.make_material("Floor", 1e4, 1e4, 1.0, 0.0, penetrable=False)
    ph.quad("Floor", [(-x, near, 0), (x, near, 0), (x, end, 0), (-x, end, 0)], floor)
    wall = [(-x, end, 0), (x, end, 0), (x, end, top), (-x, end, top)]
    ph.quad("Wall", wall, rough_metal())
    options = {"max_order": 2, "code": code}
    run = ph.run_paths(tmp_path, width_px=24, height_px=24, options=options)
    rows = run.table()
    unit_m = size * metres_per_unit
    direction = rows["direction"]
    image = direction * (10 / direction[:, 1:2])
    seen = image + np.array([0.0, 0.0, 2.0])
    one, two = rows["order"] == 1, rows["order"] == 2
    assert one.sum() > 150
    assert two.sum() > 150
    np.testing.assert_array_equal(two, seen[:, 2] < 0)
    last = np.where(two[:, None], seen * (1, 1, -1), seen)
    back = np.linalg.norm(last - (0, 0, 2), axis=1)
    length = (np.linalg.norm(image, axis=1) + back) * unit_m
    np.testing.assert_allclose(rows["length_m"], length, rtol=1e-6)
    np.testing.assert_allclose(rows["last_m"], last * unit_m, atol=5e-5 * unit_m)
    reflectance = 0.9998
    lit = last[:, 1] / back
    # The lamp's watts are per Blender unit squared: powers in watts grow with the unit's square.
    irradiance = DEFAULT_EIRP_W / (4 * np.pi * (back * unit_m) ** 2)
    want = reflectance / np.pi * lit * irradiance
    np.testing.assert_allclose(ph.radiance(rows), want, rtol=1e-3)


# -- time ------------------------------------------------------------------------------------------


def test_animated_radar_frames(tmp_path: Path) -> None:
    """Each frame is measured from where the radar is then; the sidecar says where that was."""
    rs.new_scene()
    ph.field_of_view(20)
    rs.move_steadily(bpy.data.objects["Radar"], (0.0, 2.4, 0.0))
    ph.plate_at(30, 60, rough_metal())
    run = ph.run_paths(tmp_path, frames=(1, 11), width_px=8, height_px=8)
    for frame, travelled in ((1, 0.0), (11, 2.4 * 10 / 24)):
        rows, record = run.table(frame), run.record(frame)
        assert record.camera.matrix_world[1][3] == pytest.approx(travelled, abs=1e-6)
        want = 2 * (30 - travelled) / rows["direction"][:, 1]
        np.testing.assert_allclose(rows["length_m"], want, rtol=3e-7)
    assert bpy.context.scene.frame_current == 1


@pytest.mark.parametrize("velocity", [(0.0, 3.0, 0.0), (20.0, 0.0, 0.0), (3.0, -7.0, 2.0)])
def test_moving_plate(tmp_path: Path, velocity: tuple[float, float, float]) -> None:
    """Receding positive, crossing by the angle of each path; what stands still has none."""
    rs.new_scene()
    ph.field_of_view(20)
    plate = ph.plate_at(15, 2, rough_metal())
    ph.plate_at(30, 60, rough_metal()).name = "Wall"
    rs.move_steadily(plate, velocity)
    run = ph.run_paths(tmp_path, width_px=32, height_px=32, passes=2)
    rows, names = run.table(), run.record().objects
    moving = rows["object"] == names.index("Plate") + 1
    assert moving.sum() > 20
    want = rows["direction"][moving] @ np.array(velocity)
    # Float32 of the poses over 10 ms.
    np.testing.assert_allclose(rows["range_rate_mps"][moving], want, atol=5e-4)
    assert np.all(rows["range_rate_mps"][~moving] == 0)


def test_spinning_plate(tmp_path: Path) -> None:
    """omega x r of each path's own point, exact although the plate turns on during the interval."""
    rs.new_scene()
    ph.field_of_view(16)
    plate = ph.plate_at(15, 3, rough_metal())
    plate.rotation_euler = (0, 0, 0.3)
    plate.keyframe_insert("rotation_euler", frame=1)
    rate_rad_s = 12.0
    plate.rotation_euler = (0, 0, 0.3 + rate_rad_s)
    plate.keyframe_insert("rotation_euler", frame=25)
    for curve in rs.animation_curves(plate.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    bpy.context.scene.frame_set(1)
    rows = ph.run_paths(tmp_path, width_px=32, height_px=32, passes=2).table()
    assert rows.size > 200
    arm = rows["last_m"] - (0, 15, 0)
    speed = np.cross((0, 0, rate_rad_s), arm)
    want = np.sum(rows["direction"] * speed, axis=1)
    assert np.ptp(want) > 20
    np.testing.assert_allclose(rows["range_rate_mps"], want, atol=2e-3)


def test_moving_radar_over_ground(tmp_path: Path) -> None:
    """Clutter: each path closes in at v cos(angle), 2 v cos/lambda of Doppler."""
    rs.new_scene()
    ph.field_of_view(40)
    velocity = np.array([5.0, 50.0, -1.0])
    radar = ph.radar_at((0, 0, 100))
    radar.rotation_euler.x -= math.radians(40)
    rs.move_steadily(radar, tuple(velocity))
    ph.quad(
        "Ground", [(-900, -900, 0), (900, -900, 0), (900, 900, 0), (-900, 900, 0)], rough_metal()
    )
    run = ph.run_paths(tmp_path, width_px=32, height_px=32, passes=2)
    rows = run.table()
    assert rows.size == 32 * 32
    want = -rows["direction"] @ velocity
    np.testing.assert_allclose(rows["range_rate_mps"], want, atol=2e-3)


def test_moving_mirror_of_two_bounces(tmp_path: Path) -> None:
    """A wall that approaches, seen in the floor: each leg shortens by its own cosine."""
    rs.new_scene()
    ph.field_of_view(50)
    ph.radar_at((0, 0, 2))
    floor = nodes.make_material("Floor", 1e4, 1e4, 1.0, 0.0, penetrable=False)
    ph.quad("Floor", [(-30, -5, 0), (30, -5, 0), (30, 30, 0), (-30, 30, 0)], floor)
    wall = ph.plate_at(10, 60, rough_metal())
    rs.move_steadily(wall, (0.0, -4.0, 0.0))
    rows = ph.run_paths(
        tmp_path, width_px=24, height_px=24, passes=2, options={"max_order": 2}
    ).table()
    two = rows[rows["order"] == 2]
    assert two.size > 100
    image = two["direction"] * (10 / two["direction"][:, 1:2])
    last = (image + np.array([0.0, 0.0, 2.0])) * (1, 1, -1)
    back = np.linalg.norm(last - (0, 0, 2), axis=1)
    way = np.linalg.norm(image, axis=1)
    # The vertex of the frozen path moves with the wall: d|image|/dt and d|back|/dt at fixed x, z.
    want = -4.0 * (image[:, 1] / way + last[:, 1] / back) / 2
    np.testing.assert_allclose(two["range_rate_mps"], want, atol=1e-3)


def test_moving_instance(tmp_path: Path) -> None:
    """An instancer that moves takes its plates along."""
    rs.new_scene()
    ph.field_of_view(40)
    collection = plate_collection()
    movers = [instance(collection, place) for place in PLACES]
    rs.move_steadily(movers[1], (0.0, 6.0, 0.0))
    rows = ph.run_paths(tmp_path, width_px=48, height_px=48, passes=2).table()
    planes = np.array([place[1] for place in PLACES])
    which = np.argmin(np.abs(rows["last_m"][:, 1:2] - planes), axis=1)
    want = np.where(which == 1, 6.0 * rows["direction"][:, 1], 0.0)
    np.testing.assert_allclose(rows["range_rate_mps"], want, atol=5e-4)


# -- small and far ---------------------------------------------------------------------------------


def far_target(half_m: float) -> float:
    """A small plate at 600 m, off the axis, before a wall that fills the view; its power in W."""
    rs.new_scene()
    ph.field_of_view(40)
    metal = rough_metal()
    ph.quad("Wall", [(-900, 1e3, -900), (900, 1e3, -900), (900, 1e3, 900), (-900, 1e3, 900)], metal)
    x, y, z, s = 100.0, 600.0, 60.0, half_m
    target = [(x - s, y, z - s), (x + s, y, z - s), (x + s, y, z + s), (x - s, y, z + s)]
    ph.quad("Target", target, metal)
    reach = math.sqrt(x**2 + y**2 + z**2)
    sigma = 4 * 0.9998 * (2 * s) ** 2 * (y / reach) ** 2
    return float(monostatic_power_w(DEFAULT_EIRP_W, sigma, reach, ph.C0_MPS / 5.3e9))


def test_tiles_zoom_in_on_a_far_target(tmp_path: Path) -> None:
    """A target below a pixel within 0.2 dB; all directions known; the view is covered once."""
    power = far_target(6.0)
    options = {"shifts": 4, "error_target": 0.02, "max_level": 5, "tile_px": 16}
    run = ph.run_paths(tmp_path, width_px=32, height_px=32, options=options)
    rows, record = run.table(), run.record()
    assert record.finest_level >= 3, (record.tiles, record.renders, record.relative_error)
    target = rows[rows["object"] == record.objects.index("Target") + 1]
    assert abs(float(to_db(target["power_w"].sum() / power))) < 0.2
    seen = target["last_m"] / np.linalg.norm(target["last_m"], axis=1, keepdims=True)
    assert np.abs(seen - target["direction"]).max() < 2e-7
    # Every ray meets something: gaps or overlaps of tiles would show in the solid angle.
    half = math.tan(math.radians(20))
    frame_sr = 4 * math.atan(half * half / math.sqrt(1 + 2 * half * half))
    for shift in range(4):
        mine = rows[rows["shift"] == shift]
        # A shift moves the frame by up to half a pixel of the coarsest: by 1 % of the cosines.
        assert 4 * mine["solid_angle_sr"].sum() == pytest.approx(frame_sr, rel=2e-3)
    assert rows["solid_angle_sr"].sum() == pytest.approx(frame_sr, rel=2e-4)


def test_a_target_between_the_rays_is_said(tmp_path: Path) -> None:
    far_target(0.05)
    record = ph.run_paths(tmp_path, width_px=16, height_px=16).record()
    said = [text for text in record.warnings if "met by no ray" in text]
    assert len(said) == 1
    assert "'Target'" in said[0]


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
    plate = ph.plate_at(0.0, size, rough_metal(), tilt_deg=tilt)
    levels_db = []
    for range_m in RANGES_M:
        run = far_run(tmp_path / f"{range_m:g}", range_m, 0.8, options={"shifts": 8, "code": code})
        rows = run.table()
        assert rows.size > 8 * 300
        point, normal = plane_of(plate)
        off_plane = np.abs((rows["last_m"] - point) @ normal)
        assert off_plane.max() < 1e-6  # 39e-6 is a hundredth of the wavelength
        radar = np.array(run.record().camera.matrix_world)[:3, 3]
        exact = 2 * np.linalg.norm(rows["last_m"] - radar, axis=1)
        np.testing.assert_allclose(rows["length_m"], exact, rtol=0, atol=1e-9 + 4e-16 * range_m)
        assert not np.any(rows["flags"] & FLAG_CODED_LENGTH)
        assert run.record().length_sigma_m < 39e-6
        # Where the pixel looks: within a fifth of it.
        to_point = rows["last_m"] - radar
        seen = to_point / np.linalg.norm(to_point, axis=1, keepdims=True)
        assert np.abs(seen - rows["direction"]).max() < 0.2 * 1.6 / 32 / range_m + 1e-9
        sigma = 4 * albedo * size**2 * math.cos(math.radians(tilt)) ** 2
        want = monostatic_power_w(DEFAULT_EIRP_W, sigma, range_m, ph.C0_MPS / 77e9)
        levels_db.append(float(to_db(rows["power_w"].sum() / want)))
    assert np.abs(levels_db).max() < 0.05
    assert np.ptp(levels_db[1:]) < 0.01


def test_sphere_from_10_m_to_10_km(tmp_path: Path) -> None:
    """Vertices on the facets of the mesh as it is, within lambda/100 at 77 GHz."""
    rs.new_scene()
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=1.0, location=(0, 0, 0))
    ball = bpy.context.object
    ball.data.materials.append(rough_metal())
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
        rows = far_run(tmp_path / f"{range_m:g}", range_m, 1.15, options={"shifts": 4}).table()
        # The point is outside of no facet, and on at least one of them.
        outside = (rows["last_m"] @ normal.T - offset).max(axis=1)
        assert np.abs(outside).max() < 2e-6
        to_radar = np.array([0.0, -range_m, 0.0]) - middle
        reach = np.linalg.norm(to_radar, axis=1)
        cosine = np.maximum(np.sum(normal * to_radar, axis=1) / reach, 0.0)
        sigma = 4 * 0.9998 * area * cosine**2
        want = monostatic_power_w(DEFAULT_EIRP_W, sigma, reach, ph.C0_MPS / 77e9).sum()
        assert abs(float(to_db(rows["power_w"].sum() / want))) < 0.05


# -- large -----------------------------------------------------------------------------------------


def test_a_million_triangles(tmp_path: Path) -> None:
    """A plate of 1.0e6 triangles measures as the same plate of two."""
    tables = []
    for divisions in (1, 708):
        rs.new_scene()
        bpy.ops.mesh.primitive_grid_add(
            x_subdivisions=divisions,
            y_subdivisions=divisions,
            size=8,
            location=(0, 10, 0),
            rotation=(math.pi / 2, 0, 0),
        )
        plate = bpy.context.object
        plate.data.materials.append(rough_metal())
        triangles = 2 * len(plate.data.polygons)
        assert (triangles > 1_000_000) == (divisions > 1)
        # off the grid's lines: a shadow ray through a shared edge counts both its triangles
        ph.radar_at((0.0123, 0, 0.0077))
        run = ph.run_paths(tmp_path / str(divisions), width_px=48, height_px=48)
        tables.append(run.table())
    coarse, fine = tables
    assert coarse.size == fine.size
    np.testing.assert_allclose(fine["length_m"], coarse["length_m"], rtol=1e-6)
    np.testing.assert_allclose(fine["power_w"], coarse["power_w"], rtol=1e-5)
