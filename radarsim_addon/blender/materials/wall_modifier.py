# SPDX-License-Identifier: GPL-3.0-or-later
"""Thicknesses of walls as an attribute of an object's faces, whatever modifiers make these."""

from __future__ import annotations

from typing import Any

import bpy

from ...array_types import Real
from ..nodes import attributes
from ..state import SettingsRestorer

_NAME = "radarsim walls"


def store_thickness(recorder: SettingsRestorer, item: Any, thickness: Real) -> None:
    """Give the faces of an object's evaluated mesh the thickness of their walls, until restored.

    Parameters
    ----------
    recorder
        Records the change.
    item : bpy.types.Object
        Of this file.
    thickness
        In the object's own units, by polygon, (n,).
    """
    mesh = bpy.data.meshes.new(_NAME)
    recorder.on_restore(_NAME, lambda: bpy.data.meshes.remove(mesh))
    mesh.vertices.add(len(thickness))
    held = mesh.attributes.new(attributes.FACE_WALL_THICKNESS, "FLOAT", "POINT")
    held.data.foreach_set("value", thickness.astype("f4"))
    holder = bpy.data.objects.new(_NAME, mesh)
    recorder.on_restore(_NAME, lambda: bpy.data.objects.remove(holder))
    holder.hide_render = True
    tree = bpy.data.node_groups.new(_NAME, "GeometryNodeTree")
    recorder.on_restore(_NAME, lambda: bpy.data.node_groups.remove(tree))
    _draw(tree, holder)
    modifier = item.modifiers.new(_NAME, "NODES")
    recorder.on_restore(item.name, lambda: item.modifiers.remove(modifier))
    modifier.node_group = tree


def _draw(tree: Any, holder: Any) -> None:
    """Copy the values of the holder's points to the faces, by their number."""
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = (
        "NodeGroupInput",
        "GeometryNodeObjectInfo",
        "GeometryNodeInputNamedAttribute",
        "GeometryNodeInputIndex",
        "GeometryNodeSampleIndex",
        "GeometryNodeStoreNamedAttribute",
        "NodeGroupOutput",
    )
    begin, held, named, index, sample, store, end = map(tree.nodes.new, kinds)
    held.inputs["Object"].default_value = holder
    named.data_type = sample.data_type = store.data_type = "FLOAT"
    sample.domain, store.domain = "POINT", "FACE"
    named.inputs["Name"].default_value = attributes.FACE_WALL_THICKNESS
    store.inputs["Name"].default_value = attributes.FACE_WALL_THICKNESS
    for source, target in (
        (begin.outputs["Geometry"], store.inputs["Geometry"]),
        (held.outputs["Geometry"], sample.inputs["Geometry"]),
        (named.outputs["Attribute"], sample.inputs["Value"]),
        (index.outputs["Index"], sample.inputs["Index"]),
        (sample.outputs["Value"], store.inputs["Value"]),
        (store.outputs["Geometry"], end.inputs["Geometry"]),
    ):
        tree.links.new(source, target)
