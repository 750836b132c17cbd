# SPDX-License-Identifier: GPL-3.0-or-later
"""Ordinary scenes: what is said of their materials, and radar materials by their names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import blender as radarsim
from radarsim_addon.blender import rig_settings
from radarsim_addon.blender.materials import media_beyond_their_band, read_surface
from radarsim_addon.blender.materials import physical_materials as pm
from radarsim_addon.blender.materials.physical_materials import READY, suggest_material
from radarsim_addon.blender.nodes.materials import is_radar_material
from radarsim_addon.blender.scene import replace_material, suggest_materials
from radarsim_addon.blender.state import evaluated_snapshot
from radarsim_addon.errors import ConfigError
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender import render_helpers as rh

pytestmark = pytest.mark.blender


def test_names() -> None:
    for name, ready in {
        "Asphalt_02": "Asphalt",
        "CarPaint.001": "Metal, rough",
        "windshieldGlass": "Glass",
        "Metallic red": "Metal, rough",
        "brushed-steel": "Metal, rough",
        "Tires": "Rubber",
        "M_Wood_Oak_4K": "Wood",
        "Skin": "Skin",
        "device": None,
        "Headlight": None,
        "Concrete Wall": "Concrete, rough",
    }.items():
        assert suggest_material(name) == ready
    assert suggest_material("Material.003", "Road") == "Asphalt"
    assert suggest_material("Material.003", "Cube") is None


def test_every_ready_material_can_be_made(subtests: pytest.Subtests) -> None:
    rh.new_scene()
    for name, ready in READY.items():
        with subtests.test(name):
            assert pm.is_physical(ready.material(name, 5.3e9))


def test_skin_is_that_of_the_tables() -> None:
    """Dry skin after Gabriel (1996): 35.6 and 3.2 S/m at 5.3 GHz, 6.6 and 36 S/m at 77 GHz."""
    for carrier_hz, real, conductivity in ((5.3e9, 35.6, 3.2), (77e9, 6.6, 36.4)):
        skin = READY["Skin"]
        epsilon = pm.Medium(skin.medium, skin.parameters).index(carrier_hz) ** 2
        assert epsilon.real == pytest.approx(real, rel=0.1)
        imaginary = conductivity / (2 * 3.141592653589793 * carrier_hz * 8.8541878e-12)
        assert epsilon.imag == pytest.approx(imaginary, rel=0.15)


def street() -> dict[str, Any]:
    """A closed block, an open pane, a road; materials of light alone."""
    made = {
        name: ph.principled(name, (0.4, 0.4, 0.4)) for name in ("Wood", "Window", "Mat.001", "Misc")
    }
    rh.add_box((-2, 8, -1), (0, 9, 1), made["Wood"]).name = "Block"
    ph.quad("Pane", [(1, 8, -1), (2, 8, -1), (2, 8, 1), (1, 8, 1)], made["Window"])
    ph.quad("Road", [(-9, 1, -2), (9, 1, -2), (9, 20, -2), (-9, 20, -2)], made["Mat.001"])
    ph.quad("Thing", [(3, 8, -1), (4, 8, -1), (4, 8, 1), (3, 8, 1)], made["Misc"])
    return made


def test_suggestions_and_replacement() -> None:
    rs.new_scene()
    made = street()
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    found = {item.name: ready for item, ready in suggest_materials(snapshot).items()}
    assert found == {"Wood": "Wood", "Window": "Glass", "Mat.001": "Asphalt", "Misc": None}
    new = {
        name: replace_material(made[name], ready, 5.3e9, evaluated_snapshot(bpy.context.view_layer))
        for name, ready in found.items()
        if ready is not None
    }
    assert bpy.data.objects["Road"].data.materials[0] == new["Mat.001"]
    assert read_surface(new["Wood"]).has_interior  # closed
    assert pm.is_sheet(new["Window"])  # a pane as one face
    assert (
        is_radar_material(new["Mat.001"]) and not read_surface(new["Mat.001"]).has_interior
    )  # open
    assert made["Wood"].users == 1 and made["Wood"].use_fake_user  # kept for the way back
    assert bpy.data.objects["Thing"].data.materials[0] == made["Misc"]


def test_the_list_in_the_window(addon: Any) -> None:
    rs.new_scene()
    made = street()
    state = bpy.context.window_manager.radarsim
    assert bpy.ops.radarsim.suggest_materials() == {"FINISHED"}
    rows = {row.material: row for row in state.suggestions}
    assert {name: row.ready for name, row in rows.items()} == {
        "Wood": "Wood",
        "Window": "Glass",
        "Mat.001": "Asphalt",
        "Misc": "KEEP",
    }
    rows["Window"].ready, rows["Misc"].ready = "KEEP", "Plastic"  # the user's review
    assert bpy.ops.radarsim.apply_materials() == {"FINISHED"}
    assert not state.suggestions
    assert bpy.data.objects["Pane"].data.materials[0] == made["Window"]
    assert bpy.data.objects["Thing"].data.materials[0].name == "Misc (Plastic)"
    bpy.ops.radarsim.suggest_materials()
    assert [row.material for row in state.suggestions] == ["Window"]
    bpy.ops.radarsim.apply_materials(discard=True)
    assert not state.suggestions
    assert bpy.data.objects["Pane"].data.materials[0] == made["Window"]


def test_by_a_script() -> None:
    rs.new_scene()
    street()
    assert radarsim.assign_by_name() == {"Wood": "Wood", "Window": "Glass", "Mat.001": "Asphalt"}
    assert radarsim.assign_by_name() == {}
    bpy.ops.mesh.primitive_cube_add()
    bare = bpy.context.object
    assert radarsim.assign_by_name(default="Plastic") == {"Misc": "Plastic", "": "Plastic"}
    assert bare.data.materials[0].name == "Plastic"
    assert radarsim.assign_by_name(default="Plastic") == {}
    with pytest.raises(ConfigError, match="'Cheese'; expected one of Aluminium, "):
        radarsim.assign_by_name(default="Cheese")
    rig_settings.unregister()


def test_said_once_for_the_scene(tmp_path: Path) -> None:
    rs.new_scene()
    street()
    run = ph.run_paths(tmp_path, width_px=8, height_px=8, frames=(1, 2))
    said = [item for item in run.job.findings if item.code == "optical-material"]
    assert [sorted(item.subjects) for item in said] == [["Block", "Pane", "Road", "Thing"]]


@pytest.mark.parametrize("encoding", ["auto", "materials"])
@pytest.mark.parametrize("foreign", [False, True])
def test_instances_and_not_their_host_decide(tmp_path: Path, foreign: bool, encoding: str) -> None:
    """Geometry nodes replace a bare plane by instances of cubes, whose material they set."""
    rs.new_scene()
    made = ph.principled("Light", (0.4, 0.4, 0.4)) if foreign else ph.rough_metal()
    host = ph.quad("Host", [(-1, 8, -1), (1, 8, -1), (1, 8, 1), (-1, 8, 1)], None)
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = ("MeshCube", "SetMaterial", "InstanceOnPoints")
    cube, set_material, points = (tree.nodes.new(f"GeometryNode{kind}") for kind in kinds)
    set_material.inputs["Material"].default_value = made
    ends = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(ends[0].outputs[0], points.inputs["Points"])
    tree.links.new(cube.outputs["Mesh"], set_material.inputs["Geometry"])
    tree.links.new(set_material.outputs[0], points.inputs["Instance"])
    tree.links.new(points.outputs[0], ends[1].inputs[0])
    host.modifiers.new("Scatter", "NODES").node_group = tree
    run = ph.run_paths(tmp_path, width_px=8, height_px=8, options={"range_encoding": encoding})
    code = "optical-material" if encoding == "auto" else "no-radar-material"
    named = [item.subjects for item in run.job.run_findings if item.code == code]
    assert named == ([("Host",)] if foreign else [])
    assert run.job.code_world == (foreign and encoding == "auto")


def test_fog_is_named_once(tmp_path: Path) -> None:
    """It is hidden, so it does not scatter below its surface."""
    rs.new_scene()
    street()
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, -600))
    fog = ph.principled("Fog", (0.4, 0.4, 0.4))
    nodes = fog.node_tree.nodes
    nodes.clear()
    volume = nodes.new("ShaderNodeVolumePrincipled")
    output = nodes.new("ShaderNodeOutputMaterial")
    fog.node_tree.links.new(volume.outputs[0], output.inputs["Volume"])
    bpy.context.object.data.materials.append(fog)
    run = ph.run_paths(tmp_path, width_px=8, height_px=8)
    said = {item.code: sorted(item.subjects) for item in run.job.findings}
    assert said["optical-material"] == ["Block", "Pane", "Road", "Thing"]
    assert said["object-without-surface"] == ["Cube"]
    assert "subsurface-scattering" not in said


def test_materials_of_no_object_are_not_named(tmp_path: Path) -> None:
    """A fake user keeps them in the file: skin that scatters, a medium beyond its band."""
    rs.new_scene()
    made = street()
    for name in ("Wax", "Old ground"):
        made[name] = ph.principled(name, (0.4, 0.4, 0.4))
        made[name].use_fake_user = True
    shader = made["Wax"].node_tree.nodes["Principled BSDF"]
    shader.inputs["Subsurface Weight"].default_value = 1.0
    made["Old ground"][pm.MEDIUM] = "medium_dry_ground"
    pm.make_physical(made["Old ground"])
    run = ph.run_paths(tmp_path / "unused", width_px=8, height_px=8)
    assert {item.code for item in run.job.run_findings} == {"optical-material"}
    assert media_beyond_their_band(77e9) == []
    bpy.data.objects["Thing"].data.materials[0] = made["Wax"]
    run = ph.run_paths(tmp_path / "used", width_px=8, height_px=8)
    named = [item for item in run.job.run_findings if item.code == "subsurface-scattering"]
    assert [item.subjects for item in named] == [("Wax",)]
