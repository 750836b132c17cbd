# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that shine where paths of one class have their last vertex.

A render tells where that is by colours of light. The transmitter's own would have to be another
render. Light of the surfaces is a light group of its own, so each render has both. Cycles does not
sample it like a lamp (emission sampling "NONE"), so it leaves all paths as they are.

The light is added to the node groups of the Radar Materials for the time of a measurement. A
surface that shines is shaded where the last ray of a path ends, which other runs do without.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import bpy

from ..nodes import attributes, is_radar_material
from ..nodes.build import TreeBuilder
from ..nodes.group_search import MATERIAL_KINDS
from ..nodes.groups import KIND_PROPERTY
from ..nodes.outputs import SURFACE
from ..state import SettingsRestorer
from .view_setup import MARK_GROUP, add_light_group, numbered_objects

_PREFIX = "Vertex mark: "
_SUM = "with the surface"
#: Reflections and transparent surfaces are whole numbers; they are equal within this.
_SAME = 0.25


def add_vertex_marks(recorder: SettingsRestorer, scene: Any, view_layer: Any) -> None:
    """Give all Radar Materials the light of `VertexMark`, and their objects its light group."""
    add_light_group(recorder, scene, view_layer, MARK_GROUP)
    for item in numbered_objects():
        recorder.set(item, "lightgroup", MARK_GROUP)
    for tree in bpy.data.node_groups:
        # one that was saved in the middle of a measurement has them already
        if tree.get(KIND_PROPERTY) in MATERIAL_KINDS and _PREFIX + _SUM not in tree.nodes:
            recorder.on_restore(tree.name, partial(_remove_light, tree))
            _add_light(tree)
    for material in bpy.data.materials:
        if is_radar_material(material):
            recorder.set(material.cycles, "emission_sampling", "NONE")


def _add_light(tree: Any) -> None:
    build, end = TreeBuilder(tree), _surface_output(tree)
    math, scene = build.math, build.scene_attribute
    surface = end.links[0].from_socket
    with build.prefixed(_PREFIX):
        path = build.node("ShaderNodeLightPath", "Path so far")
        depth = math("ADD", "depth + 1", path.outputs["Transparent Depth"], 1.0)
        order = path.outputs["Ray Depth"]
        here = math("COMPARE", "order", order, scene(attributes.ATTR_MARK_ORDER), _SAME)
        there = math("COMPARE", "depth", depth, scene(attributes.ATTR_MARK_DEPTH), _SAME)
        gate = math("MULTIPLY", "last vertex", here, there)
        origin = build.scene_vector_attribute(attributes.ATTR_VERTEX_ORIGIN)
        point = build.node("ShaderNodeNewGeometry", "Point").outputs["Position"]
        offset = build.vector_math("SUBTRACT", "from origin", {0: point, 1: origin})
        mapped = build.scale("mapped", offset, scene(attributes.ATTR_MARK_SCALE))
        colour = build.vector_math("ADD", "1 + mapped", {0: mapped, 1: (1.0, 1.0, 1.0)})
        light = build.node("ShaderNodeEmission", "light", {"Color": colour, "Strength": gate})
        both = build.add_shaders(_SUM, surface, light.outputs[0])
    tree.links.new(both, end)


def _remove_light(tree: Any) -> None:
    both = tree.nodes.get(_PREFIX + _SUM)
    if both is not None and both.inputs[0].links:
        tree.links.new(both.inputs[0].links[0].from_socket, _surface_output(tree))
    for node in [node for node in tree.nodes if node.name.startswith(_PREFIX)]:
        tree.nodes.remove(node)


def _surface_output(tree: Any) -> Any:
    """The input of a group's output node that is its surface."""
    ends = (node for node in tree.nodes if node.bl_idname == "NodeGroupOutput")
    return next(ends).inputs[SURFACE.name]
