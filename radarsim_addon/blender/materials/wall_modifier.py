# SPDX-License-Identifier: GPL-3.0-or-later
"""What faces of walls have during a run, whatever modifiers make these."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np

from ...array_types import Real
from ..nodes import attributes
from ..state import SettingsRestorer, read_numbers

_NAME = "radarsim walls"


def store_thickness(recorder: SettingsRestorer, item: Any, thickness: Real) -> bool:
    """Give the faces of an object's evaluated mesh the thickness of their walls, until restored.

    Parameters
    ----------
    recorder
        Records the change.
    item : bpy.types.Object
        Changed in memory if it is linked from another file.
    thickness
        In the object's own units, by polygon, (n,).

    Returns
    -------
    bool
        False for a linked object whose faces modifiers make: it cannot have another modifier.
    """
    if item.library is not None:
        return _store_in_mesh(recorder, item.data, thickness)
    mesh = bpy.data.meshes.new(_NAME)
    recorder.on_restore(_NAME, lambda: bpy.data.meshes.remove(mesh))
    mesh.vertices.add(len(thickness))
    held = mesh.attributes.new(attributes.FACE_WALL_THICKNESS, "FLOAT", "POINT")
    held.data.foreach_set("value", thickness.astype("f4"))
    holder = bpy.data.objects.new(_NAME, mesh)
    recorder.on_restore(_NAME, lambda: bpy.data.objects.remove(holder))
    holder.hide_render = True
    _draw_thickness(_add_modifier(recorder, item), holder)
    return True


def _store_in_mesh(recorder: SettingsRestorer, mesh: Any, thickness: Real) -> bool:
    """Give the faces of a linked mesh their thickness, in memory; returns whether these are all."""
    name = attributes.FACE_WALL_THICKNESS
    if len(mesh.polygons) != len(thickness):
        return False
    if name not in mesh.attributes:  # else by another object of this mesh
        held = mesh.attributes.new(name, "FLOAT", "FACE")
        # foreach_set leaves linked data as it is, without a word.
        for element, value in zip(held.data, thickness.tolist(), strict=True):
            element.value = value
        recorder.on_restore(name, lambda: mesh.attributes.remove(mesh.attributes[name]))
        mesh.update_tag()
    return True


def sharpen_edges(recorder: SettingsRestorer, item: Any, angle_deg: float) -> None:
    """Have an object's normals end at edges of more than an angle, until restored.

    Normals of its own that a mesh was imported with are left out. Objects that a scale by axes
    distorts, whose angles are others, are shaded flat.

    Parameters
    ----------
    recorder
        Records the change.
    item : bpy.types.Object
        One linked from another file keeps its normals if it has modifiers or normals of its own;
        else its mesh is changed in memory.
    angle_deg
        Between the faces on both sides of an edge.
    """
    if item.library is not None:
        if not item.modifiers and "custom_normal" not in item.data.attributes:
            _sharpen_mesh(recorder, item.data, 0.0 if _is_distorted(item) else angle_deg)
        return
    tree = _add_modifier(recorder, item)
    kinds = (
        "NodeGroupInput",
        "GeometryNodeInputMeshEdgeAngle",
        "ShaderNodeMath",
        "GeometryNodeRemoveAttribute",
        "GeometryNodeSetShadeSmooth",
        "NodeGroupOutput",
    )
    begin, angle, above, remove, shade, end = map(tree.nodes.new, kinds)
    above.operation, shade.domain = "GREATER_THAN", "EDGE"
    above.inputs[1].default_value = math.radians(angle_deg)
    remove.inputs["Name"].default_value = "custom_normal"
    shade.inputs["Shade Smooth"].default_value = False
    if _is_distorted(item):
        shade.domain = "FACE"
        above.operation, above.inputs[1].default_value = "ADD", 1.0  # all
    for source, target in (
        (begin.outputs["Geometry"], remove.inputs["Geometry"]),
        (angle.outputs["Unsigned Angle"], above.inputs[0]),
        (above.outputs[0], shade.inputs["Selection"]),
        (remove.outputs["Geometry"], shade.inputs[0]),
        (shade.outputs[0], end.inputs["Geometry"]),
    ):
        tree.links.new(source, target)


def _is_distorted(item: Any) -> bool:
    """Whether a scale by axes changes the angles of an object."""
    scale = item.matrix_world.to_scale()
    return bool(max(scale) > 1.01 * min(scale))


def _sharpen_mesh(recorder: SettingsRestorer, mesh: Any, angle_deg: float) -> None:
    """Mark the edges of a linked mesh with more than this angle as sharp, in memory."""
    name = "sharp_edge"
    edge = read_numbers(mesh.loops, "edge_index", dtype=np.int32).ravel()
    sides = read_numbers(mesh.polygons, "loop_total", dtype=np.int32).ravel()
    normal = np.repeat(read_numbers(mesh.polygons, "normal", 3), sides, axis=0)
    order = np.argsort(edge, kind="stable")
    one, other = order[:-1], order[1:]
    cosine = np.einsum("nx,nx->n", normal[one], normal[other])
    sharp = (edge[one] == edge[other]) & (cosine < math.cos(math.radians(angle_deg)))
    before = mesh.attributes.get(name)
    if before is None:  # else by another object of this mesh
        mesh.attributes.new(name, "BOOLEAN", "EDGE")
        recorder.on_restore(name, lambda: mesh.attributes.remove(mesh.attributes[name]))
    for index in np.unique(edge[one[sharp]]).tolist():  # foreach_set leaves linked data as it is
        recorder.set(mesh.edges[index], "use_edge_sharp", True)
    mesh.update_tag()


def _add_modifier(recorder: SettingsRestorer, item: Any) -> Any:
    """Give an object a modifier until restored; returns its tree, with sockets for geometry."""
    tree = bpy.data.node_groups.new(_NAME, "GeometryNodeTree")
    recorder.on_restore(_NAME, lambda: bpy.data.node_groups.remove(tree))
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    modifier = item.modifiers.new(_NAME, "NODES")
    recorder.on_restore(item.name, lambda: item.modifiers.remove(modifier))
    modifier.node_group = tree
    return tree


def _draw_thickness(tree: Any, holder: Any) -> None:
    """Copy the values of the holder's points to the faces, by their number."""
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
