# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials follow the carrier and are found wherever they come from.

Linked files, library overrides, instanced collections, groups within groups, slots of the object,
geometry nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.materials import (
    assigned_materials,
    media_beyond_their_band,
    set_layer_normals,
)
from radarsim_addon.blender.materials import physical_materials as pm
from radarsim_addon.blender.nodes import attributes, groups
from radarsim_addon.blender.nodes.groups import find_group, group_input
from radarsim_addon.blender.scene import check_meshes
from radarsim_addon.blender.state import SettingsRestorer, evaluated_snapshot
from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.fresnel import excess_path_m, slab_power
from radarsim_addon.physics.materials import material as library
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender import render_helpers as rh
from tests.blender.materials.material_ways import (
    MADE_HZ,
    RUN_HZ,
    THICKNESS,
    WALL,
    WAYS,
    geometry_nodes,
    index_of,
    link,
    linked_instance,
    nested,
    nested_exposed,
    soil,
    the_material,
    wall,
)

pytestmark = [pytest.mark.blender, pytest.mark.slow]


@pytest.fixture(autouse=True)
def empty_file() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_follows_the_carrier_and_is_found(way: Callable[[Path], None], tmp_path: Path) -> None:
    rs.new_scene()
    way(tmp_path)
    made = the_material()
    before = index_of(made)
    assert before == pytest.approx(complex(library("soil", MADE_HZ, moisture=0.05)), rel=1e-6)
    recorder = SettingsRestorer()
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    assigned = {m for one in assigned_materials(snapshot) for m in one.materials if m is not None}
    assert pm.update_materials(RUN_HZ, recorder, assigned) == []
    assert set_layer_normals(recorder, snapshot) == []
    expected = complex(library("soil", RUN_HZ, moisture=0.05))
    assert index_of(made) == pytest.approx(expected, rel=1e-6)
    assert abs(expected - before) > 0.01
    (item,) = [one.item for one in assigned_materials(snapshot) if one.item.name == WALL]
    assert np.abs(item[attributes.OBJECT_LAYER_NORMAL]) == pytest.approx([0, 1, 0], abs=1e-6)
    assert item[attributes.OBJECT_LAYER_THICKNESS] == pytest.approx(THICKNESS, rel=1e-5)
    assert recorder.restore() == []
    assert index_of(made) == before
    assert attributes.OBJECT_LAYER_NORMAL not in item


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_mesh_checks_see_it(way: Callable[[Path], None], tmp_path: Path) -> None:
    """A second wall touches the first exactly: that matters where the first has an interior."""
    rs.new_scene()
    way(tmp_path)
    touching = rh.add_box((-2, 5 + THICKNESS / 2, -2), (2, 6, 2), rh.lambert(0.5, "grey"))
    touching.name = "Touching"
    bpy.context.view_layer.update()
    (found,) = check_meshes(evaluated_snapshot(bpy.context.view_layer))
    (pair,) = found.subjects
    assert found.code == "coincident-faces"
    assert "Touching" in pair and WALL in pair


@pytest.mark.parametrize(
    ("way", "code"),
    [*((way, "materials") for way in WAYS), (linked_instance, "world"), (nested_exposed, "world")],
)
def test_run_through_it(way: Callable[[Path], None], code: str, tmp_path: Path) -> None:
    """A rough plate behind the wall: power and range by the closed form at the run's carrier."""
    rs.new_scene()
    way(tmp_path)
    metal = pm.make_physical_material(
        "Metal", "conductor", carrier_hz=RUN_HZ, conductivity_s_per_m=1e7, rms_slope=0.3
    )
    pose = rh.Matrix.Translation((0, 10, 0)) @ rh.Matrix.Rotation(np.pi / 2, 4, "X")
    rh.add_plate(0.5, pose, metal, name="Plate")
    lengths, powers = [], []
    for hidden in (True, False):
        for item in bpy.data.objects:
            if item.name in (WALL, "Instance"):
                item.hide_render = hidden
        run = ph.run_paths(
            tmp_path / f"run_{hidden}", options={"max_reflections": 1, "range_encoding": code}
        )
        plate = run.table()  # the wall is a mirror, which echoes nothing
        assert len(plate) > 10
        powers.append(float(plate["power_w"].sum()))
        lengths.append(float(plate["length_m"].mean()))
    index = complex(library("soil", RUN_HZ, moisture=0.05))
    wavelength = 299792458.0 / RUN_HZ
    slab = slab_power(index, THICKNESS, wavelength, 1.0, "single-pass")
    # Under the world's code the way at each face is drawn at random: only some pixels go through.
    certain = 0.02 if code == "materials" else 0.3
    assert powers[1] / powers[0] == pytest.approx(float(slab.transmitted) ** 2, rel=certain)
    extra = 2 * float(excess_path_m(index, THICKNESS, 1.0))
    # ... and those that do not have the mean length of all.
    near = 2e-3 if code == "materials" else 1e-2
    assert lengths[1] - lengths[0] == pytest.approx(extra, rel=near)


def test_shared_group_with_two_media_is_refused() -> None:
    first = soil()
    nested(first, exposed=False)
    second = first.copy()
    second.name = "Sand"
    second["radarsim_medium_moisture"] = 0.3
    for number, made in enumerate((first, second)):
        rh.add_box((0, 2 * number, 0), (1, 2 * number + 1, 1), made)
    with pytest.raises(ConfigError, match=r"'Sand' and 'Soil' need different numbers.*'Around 0'"):
        pm.update_materials(RUN_HZ)


def test_group_behind_a_mix_is_named() -> None:
    made = soil()
    tree = made.node_tree
    node = pm.group_node(made)
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(node.outputs["Surface"], mix.inputs[1])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    rh.add_box((0, 0, 0), (1, 1, 1), made)
    assert find_group(made) is None
    (found,) = pm.update_materials(RUN_HZ)
    assert (found.code, found.subjects) == ("medium-not-connected", ("Soil",))


def test_unused_materials_are_not_named(tmp_path: Path) -> None:
    """Kept by a fake user, without its table: it is in no result."""
    rh.add_box((0, 0, 0), (1, 1, 1), soil())
    spare = soil()
    spare.use_fake_user = True
    spare[pm.MEDIUM], spare[pm.PATH] = "table", str(tmp_path / "missing.csv")
    assert pm.update_materials(RUN_HZ) == []
    rh.add_box((3, 0, 0), (4, 1, 1), spare)
    with pytest.raises(ConfigError, match="missing"):
        pm.update_materials(RUN_HZ)


def test_linked_group_of_an_older_radarsim_is_rebuilt_in_memory(tmp_path: Path) -> None:
    made = soil()
    group = pm.group_node(made).node_tree
    group[groups.VERSION_PROPERTY] = 1
    sockets = group.interface.items_tree
    group.interface.remove(next(s for s in sockets if s.name == "Grazing Transmission"))
    item = wall(made)
    collection = bpy.data.collections.new("Walls")
    collection.objects.link(item)
    path = tmp_path / "old.blend"
    bpy.data.libraries.write(str(path), {collection})
    before = path.read_bytes()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rs.instance_of(link(path))
    made = the_material()
    with pytest.raises(ConfigError, match=r"'Soil'.*'Grazing Transmission'.*old\.blend.*append"):
        pm.update_materials(RUN_HZ, None, {made})
    assert groups.refresh_groups() == ["Radar Material, physical"]
    assert groups.refresh_groups() == []
    assert pm.update_materials(RUN_HZ, None, {made}) == []
    expected = complex(library("soil", RUN_HZ, moisture=0.05))
    assert index_of(made) == pytest.approx(expected, rel=1e-6)
    assert group_input(made, "Grazing Transmission").default_value == 1.0
    assert path.read_bytes() == before


def test_bare_member_of_an_instanced_collection_is_named_and_absorbs(tmp_path: Path) -> None:
    """Blender's grey default would echo without a code, at range 0."""
    rs.new_scene()
    rs.add_plate(20.0)
    bare = rh.add_box((0.05, 5, -1), (1, 6, 1), None)
    bare.name = "Bare"
    before = list(bare.data.materials)
    collection = bpy.data.collections.new("Things")
    bpy.context.scene.collection.objects.unlink(bare)
    collection.objects.link(bare)
    rs.instance_of(collection)
    options = {"max_reflections": 1, "range_encoding": "materials"}
    run = ph.run_paths(tmp_path / "run", options=options, width_px=16, height_px=16)
    assert [item.subjects for item in run.job.findings if item.code == "no-radar-material"] == [
        ("Bare",)
    ]
    lengths = run.table()["length_m"]
    assert len(lengths) and lengths.min() > 39
    assert list(bare.data.materials) == before


def test_foreign_material_set_by_geometry_nodes_needs_the_world_code(tmp_path: Path) -> None:
    """The slots hold Radar Material alone; what is rendered is another."""
    rs.new_scene()
    plate = rs.add_plate(20.0)
    geometry_nodes(plate, rh.lambert(0.5, "grey"))
    run = ph.run_paths(tmp_path / "run", options={"max_reflections": 1}, width_px=16, height_px=16)
    assert run.record().range_encoding == "world"
    assert run.table()["length_m"] == pytest.approx(40.0, rel=0.05)


def put_on_points(item: Any) -> None:
    """Let another modifier show a cube, and on its corners what the object showed before."""
    tree = bpy.data.node_groups.new("Put", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    first, last = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    cube, put = (
        tree.nodes.new("GeometryNodeMeshCube"),
        tree.nodes.new("GeometryNodeInstanceOnPoints"),
    )
    tree.links.new(cube.outputs["Mesh"], put.inputs["Points"])
    tree.links.new(first.outputs[0], put.inputs["Instance"])
    join = tree.nodes.new("GeometryNodeJoinGeometry")
    for shown in (put.outputs[0], cube.outputs["Mesh"]):
        tree.links.new(shown, join.inputs[0])
    tree.links.new(join.outputs[0], last.inputs[0])
    item.modifiers.new("Put", "NODES").node_group = tree


@pytest.mark.parametrize("instances", [False, True])
def test_band_of_a_material_set_by_geometry_nodes_is_checked(instances: bool) -> None:
    item = wall(soil())
    item.data.materials.clear()
    geometry_nodes(item, pm.make_physical_material("Ice", "water", carrier_hz=5e9))
    if instances:
        put_on_points(item)
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    assigned = {m for one in assigned_materials(snapshot) for m in one.materials if m is not None}
    with pytest.raises(ConfigError, match="'Ice'"):
        pm.update_materials(5e12, None, assigned, "refuse")
    assert pm.update_materials(5e12, None, assigned) == []
    (found,) = media_beyond_their_band(5e12, "hold", assigned)
    assert found.code == "medium-beyond-band" and found.subjects == ("Ice",)
