# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes for plane-parallel layers: angle to the faces, and reflections between them."""

from __future__ import annotations

from typing import Any, NamedTuple

from . import attributes
from .build import TreeBuilder

MOST_ECHOES = 8.0
"""Internal echoes after which the ratio of the two polarisations no longer changes."""
STARTED_INSIDE_WITHIN = 1.02
"""A ray of at most this times the path length across the layer began between its faces. Cycles
computes positions to 1e-7 of the mesh's size: for a pane of 5 mm, 100 m wide, 2e-3 of its
thickness."""


SAME_PLANE = 0.9998
"""Least cosine between a layer's normal and those of its two faces; its rim is beyond."""


class Wall(NamedTuple):
    """Sockets for a wall whose interior its faces stand for, see `wall_at_face`.

    `cosine` is that of the ray outside to the wall's normal. `passed` and `turned` are the depths
    across the wall [Blender units] that count for a ray that goes through the face, and for one
    that turns back inside; 0 in other objects. At the rim `passed` may be negative.
    """

    cosine: Any
    passed: Any
    turned: Any


def interior_at_faces(build: TreeBuilder) -> Any:
    """Add nodes for 1 if the object's faces absorb and delay in place of its volume, or 0."""
    shell = _first(build, "Shell", attributes.OBJECT_SHELL_THICKNESS)
    layer = _first(build, "Layer at faces", attributes.OBJECT_LAYER_AT_FACES)
    either = build.math("ADD", "shell or layer", shell, layer)
    return build.math("GREATER_THAN", "interior at faces", either, 1e-30)


def wall_at_face(build: TreeBuilder, face_cosine: Any) -> Wall:
    """Add nodes for the wall behind a face that a ray meets.

    Each face stands for the half of the wall next to it. At the rim of a layer it is the way
    across the wall from its middle, which the faces before or after count too much or too little.
    """
    math = build.math
    geometry = build.node("ShaderNodeNewGeometry", "Face of the wall").outputs
    back = geometry["Backfacing"]
    common = _first(build, "Shell thickness", attributes.OBJECT_SHELL_THICKNESS)
    own = build.face_attribute("Wall thickness", attributes.FACE_WALL_THICKNESS)
    known = math("GREATER_THAN", "face has its own", own, 0.0)
    own = math("MULTIPLY", "own, in a shell", own, math("GREATER_THAN", "shell", common, 0.0))
    own = build.select("Thickness of the wall", known, common, own)
    # The object, or an instance, may be scaled, by axes.
    upright = _to_object(build, "Normal, object", geometry["Normal"], "NORMAL")
    upright = build.vector_math("NORMALIZE", "Unit normal, object", {0: upright})
    local = _to_object(build, "Normal in object units", geometry["Normal"])
    length = build.dot("1 / scale", upright, local)
    shell = math("DIVIDE", "Shell thickness, scaled", own, length)

    given = build.object_vector_attribute("Faces of the layer", attributes.OBJECT_LAYER_AT_FACES)
    faces = build.node("ShaderNodeSeparateXYZ", "Faces", {0: given}).outputs
    own_normal, normal = _layer_normals(build, faces["X"])
    per_length = build.dot(
        "1 / scale across", own_normal, _to_object(build, "Layer normal, object", normal)
    )
    scale = math("DIVIDE", "scale across, or 0", faces["X"], per_length)
    thickness = _first(build, "Thickness of the layer", attributes.OBJECT_LAYER_THICKNESS)
    thickness = math("MULTIPLY", "Layer thickness, scaled", thickness, scale)
    place = _to_object(build, "Place in the object", geometry["Position"], "POINT")
    height = math("SUBTRACT", "height", build.dot("height, object", place, own_normal), faces["Y"])
    height = math("MULTIPLY", "height over the middle", height, scale)
    towards = build.dot("I . layer normal (wall)", geometry["Incoming"], normal)
    along = math("MULTIPLY", "height along the ray", height, math("SIGN", "sign", towards))
    outward = math("MULTIPLY_ADD", "1 into, -1 out of", back, -2.0, 1.0)
    rim = math("MULTIPLY", "across, at the rim", along, outward)
    across = build.dot("N . layer normal", geometry["Normal"], normal)
    across = math("ABSOLUTE", "|N . layer normal|", across)
    in_plane = math("GREATER_THAN", "a face, not the rim", across, SAME_PLANE)

    whole = math("ADD", "shell or layer thickness", shell, thickness)
    half = math("MULTIPLY", "half of the wall", whole, 0.5)
    is_layer = math("GREATER_THAN", "layer at faces", faces["X"], 0.5)
    at_rim = math("MULTIPLY", "rim", is_layer, math("SUBTRACT", "not a face", 1.0, in_plane))
    passed = build.select("across, this face", at_rim, half, rim)
    # No colour of a facet exceeds 1: echoes of the rim's inside near the front come out too weak.
    twice = math("MULTIPLY", "twice", math("MAXIMUM", "from 0 up", passed, 0.0), 2.0)
    turned = math("MULTIPLY", "across and back", twice, back)
    cosine = math("ABSOLUTE", "c to the wall, layer", towards, clamp=True)
    return Wall(build.select("c to the wall", is_layer, face_cosine, cosine), passed, turned)


def _first(build: TreeBuilder, label: str, name: str) -> Any:
    """Add nodes for the first number of a custom property of the object, 0 without one."""
    vector = build.object_vector_attribute(label, name)
    return build.node("ShaderNodeSeparateXYZ", f"{label}, number", {0: vector}).outputs["X"]


def _layer_normals(build: TreeBuilder, given: Any) -> tuple[Any, Any]:
    """Add nodes for the object's unit layer normal in its own axes and in the world's.

    Its Z axis where `given` is 0: without any normal, all would be NaN.
    """
    normal = build.object_vector_attribute("Layer normal (wall)", attributes.OBJECT_LAYER_NORMAL)
    normal = build.scale("Layer normal, or nothing", normal, given)
    missing = build.math("SUBTRACT", "no layer", 1.0, given)
    axis = build.node("ShaderNodeCombineXYZ", "Z, or nothing", {2: missing}).outputs[0]
    normal = build.vector_math("ADD", "Layer normal, or Z", {0: normal, 1: axis})
    unit = build.vector_math("NORMALIZE", "Unit layer normal, own axes", {0: normal})
    world = build.node(
        "ShaderNodeVectorTransform",
        "Layer normal of the wall, world",
        {0: unit},
        vector_type="NORMAL",
        convert_from="OBJECT",
        convert_to="WORLD",
    ).outputs[0]
    return unit, build.vector_math("NORMALIZE", "Unit layer normal of the wall", {0: world})


def _to_object(build: TreeBuilder, label: str, vector: Any, kind: str = "VECTOR") -> Any:
    """Add a node that turns a vector or point of the world into the object's own units."""
    return build.node(
        "ShaderNodeVectorTransform",
        label,
        {0: vector},
        vector_type=kind,
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
