# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups and materials as data-blocks: contents, versions, rebuilding, foreign groups."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.blender.nodes import groups
from radarsim_addon.errors import ConfigError, SceneError
from tests.blender import render_helpers as rh
from tests.blender.tree_text import dump

pytestmark = pytest.mark.blender

SNAPSHOTS = Path(__file__).parent / "snapshots"
KINDS = sorted(nodes.DEFINITIONS)


@pytest.fixture(autouse=True)
def empty_file() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.mark.parametrize("kind", KINDS)
def test_snapshot(kind: str) -> None:
    """What is in a group, as text. After a wanted change: RADARSIM_UPDATE_SNAPSHOTS=1, look at the
    diff, and raise the definition's version."""
    tree = nodes.ensure_group(kind)
    text = f"version {nodes.DEFINITIONS[kind].version}\n" + dump(tree)
    path = SNAPSHOTS / f"{kind}.txt"
    if os.environ.get("RADARSIM_UPDATE_SNAPSHOTS"):
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text(encoding="utf-8")
    # ... and it is well formed
    assert groups.group_version(tree) == nodes.DEFINITIONS[kind].version
    assert all(link.is_valid for link in tree.links)
    for item in tree.interface.items_tree:
        assert len(item.description) > 40, f"{item.name} has no tooltip"
    for node in tree.nodes:
        assert node.name == node.label, "labels are the nodes' names and must be unique"
        if node.bl_idname != "NodeGroupOutput":
            assert any(s.is_linked for s in node.outputs), f"{node.name} feeds nothing"
    places = {tuple(node.location) for node in tree.nodes}
    assert len(places) == len(tree.nodes), "nodes lie on top of each other"


def test_ensure_group_makes_one_group() -> None:
    first = nodes.ensure_group("radar_material")
    assert nodes.ensure_group("radar_material") == first
    assert len(bpy.data.node_groups) == 1


def test_group_renamed_by_the_user_is_still_found() -> None:
    tree = nodes.ensure_group("radar_material")
    tree.name = "Mein Radar"
    assert nodes.ensure_group("radar_material") == tree


def test_foreign_group_of_the_same_name_is_left_alone() -> None:
    foreign = bpy.data.node_groups.new("Radar Material", "ShaderNodeTree")
    foreign.nodes.new("ShaderNodeMath")
    ours = nodes.ensure_group("radar_material")
    assert ours != foreign
    assert foreign.name == "Radar Material"
    assert [n.bl_idname for n in foreign.nodes] == ["ShaderNodeMath"]
    assert ours.name.startswith("Radar Material.")


def make_stale(tree: Any) -> None:
    """Turn a group into what an older radarsim might have left: other nodes, other sockets."""
    tree.nodes.clear()
    tree.nodes.new("ShaderNodeBsdfDiffuse")
    interface = tree.interface
    panel = interface.new_panel("Old panel")
    interface.new_socket("Colour", in_out="INPUT", socket_type="NodeSocketColor", parent=panel)
    roughness = next(i for i in interface.items_tree if i.name == "Roughness")
    roughness.description = "old"
    interface.move_to_parent(roughness, panel, 0)
    specularity = next(i for i in interface.items_tree if i.name == "Specularity")
    interface.remove(specularity)
    tree[groups.VERSION_PROPERTY] = 0


def test_stale_group_is_rebuilt_in_place(tmp_path: Path) -> None:
    """Values and links of the user's materials survive, also through a saved file."""
    material = nodes.make_material("User's", 2.5, 0.125, 0.25, 0.75)
    material.use_fake_user = True
    tree = material.node_tree
    node = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeGroup")
    value = tree.nodes.new("ShaderNodeValue")
    value.name = "n by the user"
    tree.links.new(value.outputs[0], node.inputs["Index of Refraction"])
    group = node.node_tree
    fresh = dump(group)
    make_stale(group)
    assert dump(group) != fresh
    path = str(tmp_path / "alt, with spaces.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)

    assert nodes.refresh_groups() == ["Radar Material"]
    assert nodes.refresh_groups() == []
    material = bpy.data.materials["User's"]
    node = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeGroup")
    assert len(bpy.data.node_groups) == 1
    assert node.node_tree == nodes.ensure_group("radar_material")
    assert dump(node.node_tree) == fresh
    names = [socket.name for socket in node.inputs]
    assert names == [
        "Index of Refraction",
        "Extinction Coefficient",
        "Specularity",
        "Roughness",
        "Transmission",
    ]
    assert node.inputs["Transmission"].default_value == 1.0
    assert node.inputs["Extinction Coefficient"].default_value == 0.125
    assert node.inputs["Roughness"].default_value == 0.75
    assert node.inputs["Specularity"].default_value == 0.5  # was gone: the default again
    assert node.inputs["Index of Refraction"].links[0].from_node.name == "n by the user"
    assert {(link.from_socket.name, link.to_socket.name) for link in material.node_tree.links} == {
        ("Value", "Index of Refraction"),
        ("Surface", "Surface"),
        ("Volume", "Volume"),
    }


def test_rebuilt_group_renders_as_a_new_one() -> None:
    def picture(spoil: bool) -> np.ndarray:
        scene = rh.new_scene(size=8)
        emitter = rh.add_emitter()
        material = nodes.make_material("m", 1.4, 1.0, 0.5, 0.5)
        rh.add_plate(20, material=material).location.z = -10
        if spoil:
            make_stale(nodes.ensure_group("radar_material"))
            lamp_group = nodes.ensure_group("ring_emitter")
            lamp_group.nodes.clear()
            lamp_group[groups.VERSION_PROPERTY] = 0
            assert sorted(nodes.refresh_groups()) == ["Radar Material", "Ring Emitter"]
            # The removed input comes back with its default, which is what was set.
            assert emitter.data.node_tree.nodes["Group"].node_tree == lamp_group
        return rh.render(scene, 10, (5, 15))

    fresh = picture(False)
    assert fresh.min() > 0
    assert np.array_equal(picture(True), fresh)


def test_every_copy_of_a_stale_group_is_rebuilt() -> None:
    """Appending materials from several files leaves several copies."""
    first = nodes.ensure_group("radar_material")
    fresh = dump(first)
    second = first.copy()
    make_stale(first)
    make_stale(second)
    nodes.ensure_group("radar_material")
    assert dump(first) == dump(second) == fresh


def test_newer_group_is_refused_by_name() -> None:
    tree = nodes.ensure_group("radar_material")
    tree[groups.VERSION_PROPERTY] = 999
    with pytest.raises(SceneError, match=r"'Radar Material' has version 999.*Update radarsim"):
        nodes.ensure_group("radar_material")


def test_failing_definition_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(build: Any) -> None:
        build.math("ADD", "x", 1.0, 2.0)
        raise RuntimeError("no such node")

    old = nodes.DEFINITIONS["ring_emitter"]
    bad = dataclasses.replace(old, draw=broken, version=old.version + 1)
    monkeypatch.setitem(groups.DEFINITIONS, "ring_emitter", bad)
    with pytest.raises(RuntimeError, match="no such node"):
        nodes.ensure_group("ring_emitter")
    assert len(bpy.data.node_groups) == 0

    monkeypatch.setitem(groups.DEFINITIONS, "ring_emitter", old)
    tree = nodes.ensure_group("ring_emitter")
    before = dump(tree)
    monkeypatch.setitem(groups.DEFINITIONS, "ring_emitter", bad)
    with pytest.raises(RuntimeError, match="no such node"):
        nodes.ensure_group("ring_emitter")
    # The user's old group is untouched: the failure was met on a scratch group.
    assert list(bpy.data.node_groups) == [tree]
    assert dump(tree) == before


def test_setup_emitter() -> None:
    light = bpy.data.lights.new("Lamp", "POINT")
    light.energy = 123.0
    light.shadow_soft_size = 0.25
    node = nodes.setup_emitter(light)
    assert nodes.setup_emitter(light) == node
    assert light.energy == 123.0
    assert light.shadow_soft_size == 0
    output = next(n for n in light.node_tree.nodes if n.bl_idname == "ShaderNodeOutputLight")
    assert [link.from_node for link in output.inputs["Surface"].links] == [node]
    assert sum(n.bl_idname == "ShaderNodeGroup" for n in light.node_tree.nodes) == 1


def test_only_a_point_light_can_be_the_transmitter() -> None:
    with pytest.raises(SceneError, match=r"of type SUN\. Only a Point light"):
        nodes.setup_emitter(bpy.data.lights.new("Sun", "SUN"))
    assert len(bpy.data.node_groups) == 0


@pytest.mark.parametrize("preset", sorted(nodes.PRESETS))
def test_presets(preset: str) -> None:
    plate = rh.add_plate(1.0)
    plate.data.materials.clear()
    assert nodes.assign_radar_material([plate], preset) == [plate]
    material = plate.material_slots[0].material
    assert nodes.is_radar_material(material)
    values = nodes.PRESETS[preset]
    output = material.node_tree.nodes["Material Output"]
    assert output.inputs["Volume"].is_linked is values.penetrable
    node = output.inputs["Surface"].links[0].from_node
    got = [socket.default_value for socket in node.inputs]
    wanted = [values.n, values.kappa, values.specularity, values.roughness, 1.0]
    assert got == pytest.approx(wanted, rel=1e-6)
    # A conductor by the material's own rule, and only that, is not penetrable.
    transmittance = 4 * values.n / ((values.n + 1) ** 2 + values.kappa**2)
    assert values.penetrable is (transmittance > 1e-3)


@pytest.mark.parametrize(
    ("preset", "a", "b", "c", "d"),
    [
        ("concrete", 5.24, 0.0, 0.0462, 0.7822),
        ("wood", 1.99, 0.0, 0.0047, 1.0718),
        ("glass", 6.31, 0.0, 0.0036, 1.3394),
        ("ground", 15.0, -0.1, 0.035, 1.63),
    ],
)
def test_preset_indices_are_those_of_the_itu(
    preset: str, a: float, b: float, c: float, d: float
) -> None:
    """ITU-R P.2040-3 (2023) Table 3 at 5.3 GHz: eps' = a f^b, sigma = c f^d, f in GHz."""
    f_ghz = 5.3
    permittivity = a * f_ghz**b + 17.97510j * c * f_ghz**d / f_ghz
    index = permittivity**0.5
    assert nodes.PRESETS[preset].n == pytest.approx(index.real, abs=2e-4)
    assert nodes.PRESETS[preset].kappa == pytest.approx(index.imag, abs=2e-4)


def test_preset_material_is_shared_until_it_is_edited() -> None:
    plates = [rh.add_plate(1.0, name=name) for name in "abc"]
    for plate in plates:
        plate.data.materials.clear()
    nodes.assign_radar_material(plates[:2], "concrete")
    shared = plates[0].active_material
    assert plates[1].active_material == shared
    node = next(n for n in shared.node_tree.nodes if n.bl_idname == "ShaderNodeGroup")
    node.inputs["Roughness"].default_value = 0.1
    nodes.assign_radar_material(plates[2:], "concrete")
    assert plates[2].active_material != shared
    assert plates[0].active_material == shared
    fresh = plates[2].active_material  # its numbers are the preset's, but a link replaces one
    value = fresh.node_tree.nodes.new("ShaderNodeValue")
    node = next(n for n in fresh.node_tree.nodes if n.bl_idname == "ShaderNodeGroup")
    fresh.node_tree.links.new(value.outputs[0], node.inputs["Roughness"])
    assert nodes.preset_material("concrete") not in (shared, fresh)


def test_assigning_fills_all_slots_and_passes_over_empties() -> None:
    plate = rh.add_plate(1.0)
    plate.data.materials.append(rh.lambert(0.5))
    empty = bpy.data.objects.new("Empty", None)
    assert nodes.assign_radar_material([empty, plate], "metal") == [plate]
    assert {slot.material.name for slot in plate.material_slots} == {"Radar Metal"}


def test_assigning_to_nothing_is_an_error() -> None:
    empty = bpy.data.objects.new("Rig", None)
    with pytest.raises(SceneError, match=r"Rig \(empty\) selected. Select one or more meshes"):
        nodes.assign_radar_material([empty], "metal")
    assert len(bpy.data.materials) == 0
    with pytest.raises(
        ConfigError, match=r"no material preset 'kryptonite'\. Choose one of: metal"
    ):
        nodes.assign_radar_material([rh.add_plate(1.0)], "kryptonite")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.5, 0.0), "Index of refraction n is 0.5; expected at least 1"),
        ((float("nan"), 0.0), "Index of refraction n holds nan"),
        ((1.5, -0.1), "Extinction coefficient kappa is -0.1"),
        ((1.5, 0.0, 1.5), "Specularity is 1.5; expected 0 to 1"),
        ((1.5, 0.0, 0.5, -1.0), "Roughness is -1; expected 0 to 1"),
    ],
)
def test_material_numbers_are_checked(arguments: tuple[float, ...], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        nodes.make_material("bad", *arguments)
    assert len(bpy.data.materials) == 0


def test_plain_material_is_not_a_radar_material() -> None:
    assert not nodes.is_radar_material(None)
    assert not nodes.is_radar_material(rh.lambert(0.5))
