# SPDX-License-Identifier: GPL-3.0-or-later
"""What a shader knows of the plane-parallel layer that it is part of: angle and internal echoes."""

from __future__ import annotations

from typing import Any

from . import attributes
from .build import TreeBuilder

MOST_ECHOES = 8.0
"""Internal echoes after which the shares of the two polarisations are taken as they stand."""
STARTED_INSIDE_WITHIN = 1.02
"""A ray that is no longer than this times the way across the layer began between its faces. Cycles
knows places to 1e-7 of the mesh's size, so a pane of 5 mm, 100 m wide, to 2e-3 of its thickness."""


def layer_cosine(build: TreeBuilder) -> Any:
    """Cosine to the object's layer normal, 1 where it has none."""
    math = build.math
    normal = build.node(
        "ShaderNodeAttribute",
        "Layer normal",
        attribute_type="OBJECT",
        attribute_name=attributes.OBJECT_LAYER_NORMAL,
    ).outputs["Vector"]
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
    dot = build.node(
        "ShaderNodeVectorMath", "I . layer normal", {0: ray, 1: unit}, operation="DOT_PRODUCT"
    ).outputs["Value"]
    length = build.node(
        "ShaderNodeVectorMath", "|layer normal|", {0: normal}, operation="LENGTH"
    ).outputs["Value"]
    given = math("GREATER_THAN", "layer normal given", length, 0.5)
    cosine = math("ABSOLUTE", "|I . layer normal|", dot, clamp=True)
    return build.select("c to the layer", given, 1.0, cosine)


def internal_echoes(build: TreeBuilder) -> Any:
    """How often the wave that arrives at a face from inside was reflected between the faces.

    A ray that entered by transmission began outside and is longer than the way across: 0. One
    that began at a face inside has been reflected as often as the path has bounced; for a path
    that met something else before it entered that is too often, up to `MOST_ECHOES`. Objects
    without a thickness: 0.
    """
    math = build.math
    normal = build.node(
        "ShaderNodeAttribute",
        "Layer normal (echoes)",
        attribute_type="OBJECT",
        attribute_name=attributes.OBJECT_LAYER_NORMAL,
    ).outputs["Vector"]
    unit = build.vector_math("NORMALIZE", "Unit layer normal, object", {0: normal})
    thickness = build.node(
        "ShaderNodeAttribute",
        "Layer thickness",
        attribute_type="OBJECT",
        attribute_name=attributes.OBJECT_LAYER_THICKNESS,
    ).outputs["Vector"]
    across = build.node("ShaderNodeSeparateXYZ", "Thickness", {0: thickness}).outputs["X"]
    ray = build.node("ShaderNodeNewGeometry", "Ray (echoes)").outputs["Incoming"]
    # In the object's own units: its scale need not be known.
    local = build.node(
        "ShaderNodeVectorTransform",
        "Ray, object",
        {0: ray},
        vector_type="VECTOR",
        convert_from="WORLD",
        convert_to="OBJECT",
    ).outputs[0]
    rise = build.node(
        "ShaderNodeVectorMath", "Rise per length", {0: local, 1: unit}, operation="DOT_PRODUCT"
    ).outputs["Value"]
    path = build.node("ShaderNodeLightPath", "Path (echoes)").outputs
    crossed = math("MULTIPLY", "ray across", path["Ray Length"], math("ABSOLUTE", "rise", rise))
    limit = math("MULTIPLY", "thickness, and a little", across, STARTED_INSIDE_WITHIN)
    inside = math("LESS_THAN", "began inside", crossed, limit)
    bounces = math("MINIMUM", "bounces, at most", path["Ray Depth"], MOST_ECHOES)
    return math("MULTIPLY", "internal echoes", inside, bounces)
