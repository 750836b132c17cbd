# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes for plane-parallel layers: angle to the faces, and reflections between them."""

from __future__ import annotations

from typing import Any

from . import attributes
from .build import TreeBuilder

MOST_ECHOES = 8.0
"""Internal echoes after which the ratio of the two polarisations no longer changes."""
STARTED_INSIDE_WITHIN = 1.02
"""A ray of at most this times the path length across the layer began between its faces. Cycles
computes positions to 1e-7 of the mesh's size: for a pane of 5 mm, 100 m wide, 2e-3 of its
thickness."""


def shell_thickness(build: TreeBuilder, at_face: bool) -> Any:
    """Add nodes for the thickness of the object's walls, Blender units; 0 for other objects.

    In an interior, where there is no normal, it only tells whether there are such walls.
    """
    thickness = build.object_vector_attribute("Shell thickness", attributes.OBJECT_SHELL_THICKNESS)
    own = build.node("ShaderNodeSeparateXYZ", "Shell", {0: thickness}).outputs["X"]
    if not at_face:
        return own
    normal = build.node("ShaderNodeNewGeometry", "Face of the wall").outputs["Normal"]
    local = _to_object(build, "Normal in object units", normal)
    # An instance may be scaled: the unit normal is 1/scale long in the object's units.
    length = build.node(
        "ShaderNodeVectorMath", "1 / scale", {0: local}, operation="LENGTH"
    ).outputs["Value"]
    return build.math("DIVIDE", "Shell thickness, scaled", own, length)


def _to_object(build: TreeBuilder, label: str, vector: Any) -> Any:
    """Add a node that turns a vector of the world into the object's own units."""
    return build.node(
        "ShaderNodeVectorTransform",
        label,
        {0: vector},
        vector_type="VECTOR",
        convert_from="WORLD",
        convert_to="OBJECT",
    ).outputs[0]


def layer_cosine(build: TreeBuilder) -> Any:
    """Add nodes for the cosine of the ray's angle to the object's layer normal, 1 without one."""
    math = build.math
    normal = build.object_vector_attribute("Layer normal", attributes.OBJECT_LAYER_NORMAL)
    world = build.node(
        "ShaderNodeVectorTransform",
        "Layer normal, world",
        {0: normal},
        vector_type="NORMAL",
        convert_from="OBJECT",
        convert_to="WORLD",
    ).outputs[0]
    unit = build.vector_math("NORMALIZE", "Unit layer normal", {0: world})
    ray = build.node("ShaderNodeNewGeometry", "Ray inside").outputs["Incoming"]
    dot = build.dot("I . layer normal", ray, unit)
    length = build.node(
        "ShaderNodeVectorMath", "|layer normal|", {0: normal}, operation="LENGTH"
    ).outputs["Value"]
    given = math("GREATER_THAN", "layer normal given", length, 0.5)
    cosine = math("ABSOLUTE", "|I . layer normal|", dot, clamp=True)
    return build.select("c to the layer", given, 1.0, cosine)


def internal_echoes(build: TreeBuilder) -> Any:
    """Add nodes for the number of earlier reflections between the faces of a layer, at most 8.

    A ray that began at a face inside counts the path's reflections; this is too many if the path
    met another object first. A ray that entered, or no layer thickness: 0.
    """
    math = build.math
    normal = build.object_vector_attribute("Layer normal (echoes)", attributes.OBJECT_LAYER_NORMAL)
    unit = build.vector_math("NORMALIZE", "Unit layer normal, object", {0: normal})
    thickness = build.object_vector_attribute("Layer thickness", attributes.OBJECT_LAYER_THICKNESS)
    across = build.node("ShaderNodeSeparateXYZ", "Thickness", {0: thickness}).outputs["X"]
    ray = build.node("ShaderNodeNewGeometry", "Ray (echoes)").outputs["Incoming"]
    # In the object's own units, so that its scale does not matter.
    local = _to_object(build, "Ray, object", ray)
    rise = build.dot("Rise per length", local, unit)
    path = build.node("ShaderNodeLightPath", "Path (echoes)").outputs
    crossed = math("MULTIPLY", "ray across", path["Ray Length"], math("ABSOLUTE", "rise", rise))
    limit = math("MULTIPLY", "thickness, and a little", across, STARTED_INSIDE_WITHIN)
    inside = math("LESS_THAN", "began inside", crossed, limit)
    bounces = math("MINIMUM", "bounces, at most", path["Ray Depth"], MOST_ECHOES)
    return math("MULTIPLY", "internal echoes", inside, bounces)
