# SPDX-License-Identifier: GPL-3.0-or-later
"""A wall whose material comes from elsewhere: the ways in which Blender allows it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.materials import (
    assigned_materials,
)
from radarsim_addon.blender.materials import physical_materials as pm
from radarsim_addon.blender.nodes.groups import group_input
from radarsim_addon.blender.state import evaluated_snapshot
from tests.blender import radar_scenes as rs
from tests.blender import render_helpers as rh

MADE_HZ, RUN_HZ = 1.5e9, 5.3e9
THICKNESS = 0.2
WALL = "Wall"


def soil() -> Any:
    """A penetrable material whose index changes with frequency; evaluated where runs are not."""
    return pm.make_physical_material("Soil", "soil", carrier_hz=MADE_HZ, moisture=0.05)


def wall(material: Any) -> Any:
    """A closed layer across +Y at y = 5."""
    half = THICKNESS / 2
    item = rh.add_box((-3.1, 5 - half, -3.3), (3.7, 5 + half, 3.9), material)
    item.name = WALL
    return item


def geometry_nodes(item: Any, material: Any) -> None:
    """Let a modifier set the material."""
    tree = bpy.data.node_groups.new("Set", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    first, last = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    node = tree.nodes.new("GeometryNodeSetMaterial")
    node.inputs["Material"].default_value = material
    tree.links.new(first.outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], last.inputs[0])
    item.modifiers.new("Set", "NODES").node_group = tree


def nested(material: Any, exposed: bool) -> list[Any]:
    """Put the group of a material into two groups, one in the other; returns their trees.

    exposed: the inputs are led out to the material.
    """
    tree = material.node_tree
    node = pm.group_node(material)
    values = {s.name: s.default_value for s in node.inputs}
    inner, trees = node.node_tree, []
    for depth in range(2):
        around = bpy.data.node_groups.new(f"Around {depth}", "ShaderNodeTree")
        for name in ("Surface", "Volume"):
            around.interface.new_socket(name, in_out="OUTPUT", socket_type="NodeSocketShader")
        inside = around.nodes.new("ShaderNodeGroup")
        inside.node_tree = inner
        out = around.nodes.new("NodeGroupOutput")
        bend = around.nodes.new("NodeReroute")
        around.links.new(inside.outputs["Surface"], bend.inputs[0])
        around.links.new(bend.outputs[0], out.inputs["Surface"])
        around.links.new(inside.outputs["Volume"], out.inputs["Volume"])
        if exposed:
            given = around.nodes.new("NodeGroupInput")
            for name in values:
                around.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketFloat")
                around.links.new(given.outputs[name], inside.inputs[name])
        elif depth == 0:
            for name, value in values.items():
                inside.inputs[name].default_value = value
        inner = around
        trees.append(around)
    node.node_tree = inner
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    for name in ("Surface", "Volume"):
        tree.links.new(node.outputs[name], output.inputs[name])
    if exposed:
        for name, value in values.items():
            node.inputs[name].default_value = value
    return trees


def in_library(folder: Path) -> Path:
    """A file with the wall in a collection."""
    item = wall(soil())
    collection = bpy.data.collections.new("Walls")
    bpy.context.scene.collection.children.link(collection)
    bpy.context.scene.collection.objects.unlink(item)
    collection.objects.link(item)
    path = folder / "walls.blend"
    bpy.data.libraries.write(str(path), {collection})
    return path


def link(path: Path) -> Any:
    with bpy.data.libraries.load(str(path), link=True) as (_, chosen):
        chosen.collections = ["Walls"]
    return bpy.data.collections["Walls"]


def plain(folder: Path) -> None:
    wall(soil())


def linked(folder: Path) -> None:
    path = in_library(folder)
    rs.new_scene()
    bpy.context.scene.collection.children.link(link(path))


def linked_instance(folder: Path) -> None:
    path = in_library(folder)
    rs.new_scene()
    rs.instance_of(link(path))


def override(folder: Path) -> None:
    path = in_library(folder)
    rs.new_scene()
    collection = link(path)
    scene = bpy.context.scene
    made = collection.override_hierarchy_create(
        scene, bpy.context.view_layer, do_fully_editable=True
    )
    if made.name not in scene.collection.children:
        scene.collection.children.link(made)


def local_instance(folder: Path) -> None:
    item = wall(soil())
    collection = bpy.data.collections.new("Walls")
    bpy.context.scene.collection.objects.unlink(item)
    collection.objects.link(item)
    rs.instance_of(collection)


def object_slot(folder: Path) -> None:
    made = soil()
    item = wall(made)
    item.data.materials[0] = rh.lambert(0.5, "of the mesh")
    item.material_slots[0].link = "OBJECT"
    item.material_slots[0].material = made


def set_by_nodes(folder: Path) -> None:
    made = soil()
    item = wall(made)
    item.data.materials.clear()
    geometry_nodes(item, made)


def nested_fixed(folder: Path) -> None:
    made = soil()
    nested(made, exposed=False)
    wall(made)


def nested_exposed(folder: Path) -> None:
    made = soil()
    nested(made, exposed=True)
    wall(made)


WAYS = (
    plain,
    linked,
    linked_instance,
    override,
    local_instance,
    object_slot,
    set_by_nodes,
    nested_fixed,
    nested_exposed,
)


def the_material() -> Any:
    """The soil that the wall wears."""
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    (assigned,) = [one for one in assigned_materials(snapshot) if one.item.name == WALL]
    (made,) = [m for m in assigned.materials if m is not None and m.name.startswith("Soil")]
    return made


def index_of(material: Any) -> complex:
    real, imaginary = (
        group_input(material, name).default_value
        for name in ("Index of Refraction", "Extinction Coefficient")
    )
    return complex(real, imaginary)
