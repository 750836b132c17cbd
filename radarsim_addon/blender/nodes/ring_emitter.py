# SPDX-License-Identifier: GPL-3.0-or-later
"""Ring Emitter: emission of the transmitter, limited to one ring of ranges (Eq. 5 of Costa et al.).

The same Point light serves the sampling mode "paths". Limits on the number of reflections and of
transparent surfaces leave one path per pixel, and the colour can encode the last scatterer of that
path.
"""

from __future__ import annotations

from typing import Any

from . import attributes
from .build import GroupDefinition, SocketSpec, TreeBuilder
from .range_encoding import inverse_code_length, range_code, ray_length

KIND = "ring_emitter"


def _draw(build: TreeBuilder) -> None:
    math = build.math
    length = ray_length(build)
    ring_min = build.scene_attribute(attributes.ATTR_RING_MIN)
    ring_max = build.scene_attribute(attributes.ATTR_RING_MAX)
    # Adjacent rings compare with the same edges, so each length is in exactly one ring and the
    # rings add up to the render without limits.
    below_max = math("LESS_THAN", "r < ring max", length, ring_max)
    below_min = math("LESS_THAN", "r < ring min", length, ring_min)
    inside = math("SUBTRACT", "ring min <= r < ring max", below_max, below_min)
    gated = math("GREATER_THAN", "gated", ring_max, 0.0)
    ring = build.select("Ring gate", gated, 1.0, inside)
    gate = math("MULTIPLY", "Gate", ring, _path_gate(build))

    code = range_code(build, length, inverse_code_length(build))
    coded = build.scale("Gate x code", code, gate)
    colour = build.vector_math("MULTIPLY", "x vertex", {0: coded, 1: _vertex_colour(build, length)})
    emission = build.node("ShaderNodeEmission", "Emission", {"Color": colour, "Strength": 1.0})
    build.group_output("Emission", emission.outputs[0])


def _path_gate(build: TreeBuilder) -> Any:
    """Add nodes for 1 for paths within the limits of order and transparent depth, else 0.

    During next-event estimation Ray Depth is the number of reflections of the path so far, and
    Transparent Depth the number of transparent surfaces on the camera's side.
    """
    math = build.math
    light_path = build.node("ShaderNodeLightPath", "Path so far")
    order = light_path.outputs["Ray Depth"]
    depth = math("ADD", "depth + 1", light_path.outputs["Transparent Depth"], 1.0)
    gate: Any = None
    for label, value, low, high in (
        ("order", order, attributes.ATTR_ORDER_MIN, attributes.ATTR_ORDER_MAX),
        ("depth", depth, attributes.ATTR_DEPTH_MIN, attributes.ATTR_DEPTH_MAX),
    ):
        minimum = build.scene_attribute(low)
        maximum = build.scene_attribute(high)
        above = math("GREATER_THAN", f"{label} > min", value, minimum)
        limited = math("GREATER_THAN", f"{label} limited", maximum, 0.0)
        below = math("LESS_THAN", f"{label} < max", value, maximum)
        inside = build.select(f"{label} below max", limited, 1.0, below)
        both = math("MULTIPLY", f"{label} gate", above, inside)
        gate = both if gate is None else math("MULTIPLY", "Path gate", gate, both)
    return gate


def _vertex_colour(build: TreeBuilder, length: Any) -> Any:
    """Add nodes for 1 + scale (X - origin) per channel, X the illuminated point; 1 if scale is 0.

    A render with it, divided by a render without it, gives the last vertex of each path.
    """
    geometry = build.node("ShaderNodeNewGeometry", "Geometry")
    offset = build.scale("To the lit point", geometry.outputs["Incoming"], length)
    point = build.vector_math("ADD", "Lit point", {0: geometry.outputs["Position"], 1: offset})
    origin = build.scene_vector_attribute(attributes.ATTR_VERTEX_ORIGIN)
    offset = build.vector_math("SUBTRACT", "From origin", {0: point, 1: origin})
    scale = build.scene_attribute(attributes.ATTR_VERTEX_SCALE)
    mapped = build.scale("Mapped", offset, scale)
    return build.vector_math("ADD", "1 + mapped", {0: mapped, 1: (1.0, 1.0, 1.0)})


RING_EMITTER = GroupDefinition(
    kind=KIND,
    name="Ring Emitter",
    version=2,
    description=(
        "Transmitter of the radar, for a Point light: the light's power is the EIRP in watts. "
        "While a ring is rendered, it emits only where ring min <= ray length < ring max"
    ),
    sockets=(
        SocketSpec(
            "Emission",
            "OUTPUT",
            "NodeSocketShader",
            "Blue: power; red: times exp(-r/k); green: times exp(-2r/k), r the length of the last "
            "segment and k the range encoding length. Connect to the Light Output",
        ),
    ),
    draw=_draw,
)
