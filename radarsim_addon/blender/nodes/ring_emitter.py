# SPDX-License-Identifier: GPL-3.0-or-later
"""Ring Emitter: a point lamp's emission, gated to one ring of ranges (Eq. 5 of Costa et al.)."""

from __future__ import annotations

import warnings
from typing import Any

from ... import contract
from ...errors import SceneError
from .build import GroupDefinition, SocketSpec, TreeBuilder
from .range_code import inverse_code_length, range_code, ray_length

KIND = "ring_emitter"


def _draw(build: TreeBuilder) -> None:
    math = build.math
    length = ray_length(build)
    ring_min = build.scene_attribute(contract.ATTR_RING_MIN)
    ring_max = build.scene_attribute(contract.ATTR_RING_MAX)
    # Two "less than" that share their edges with the neighbouring rings: every length is in
    # exactly one ring, edges included, so that the rings add up to the ungated render.
    below_max = math("LESS_THAN", "r < ring max", length, ring_max)
    below_min = math("LESS_THAN", "r < ring min", length, ring_min)
    inside = math("SUBTRACT", "ring min <= r < ring max", below_max, below_min)
    gated = math("GREATER_THAN", "gated", ring_max, 0.0)
    gate = build.select("Gate", gated, 1.0, inside)

    code = range_code(build, length, inverse_code_length(build))
    colour = build.node(
        "ShaderNodeVectorMath", "Gate x code", {0: code, "Scale": gate}, operation="SCALE"
    )
    emission = build.node(
        "ShaderNodeEmission", "Emission", {"Color": colour.outputs[0], "Strength": 1.0}
    )
    build.group_output("Emission", emission.outputs[0])


RING_EMITTER = GroupDefinition(
    kind=KIND,
    name="Ring Emitter",
    version=1,
    description=(
        "Transmitter of the radar, for a point lamp: the lamp's power is the EIRP in watts. "
        "While a ring is rendered it shines only where ring min <= ray length < ring max"
    ),
    sockets=(
        SocketSpec(
            "Emission",
            "OUTPUT",
            "NodeSocketShader",
            "Blue: power; red: times exp(-r/k); green: times exp(-2r/k), r the length of the last "
            "segment and k the code length of the measurement. Connect to the Light Output",
        ),
    ),
    draw=_draw,
)


def setup_emitter(light: Any) -> Any:
    """Make a point lamp the radar's transmitter.

    The lamp becomes a true point (a radius would blur ranges) with the Ring Emitter in its node
    tree; power, colour and position stay as they are. Calling it again changes nothing.

    Parameters
    ----------
    light : bpy.types.Light
        A lamp of type POINT.

    Returns
    -------
    bpy.types.ShaderNodeGroup
        The group node in the lamp's tree.

    Raises
    ------
    SceneError
        The lamp is of another type, or linked from a library.
    """
    from .groups import ensure_group  # groups imports this module's definition

    if light.type != "POINT":
        raise SceneError(
            f"Lamp {light.name!r} is of type {light.type}; the radar's emitter is a point lamp. "
            "Choose a point lamp, or add a radar rig."
        )
    if light.library is not None:
        raise SceneError(
            f"Lamp {light.name!r} is linked from {light.library.filepath!r} and cannot be changed. "
            "Make it local, or add a radar rig."
        )
    group = ensure_group(KIND)
    light.shadow_soft_size = 0.0
    light.use_shadow = True
    if hasattr(light, "use_soft_falloff"):
        light.use_soft_falloff = False  # it alters power near the lamp
    if hasattr(light, "normalize"):
        light.normalize = True  # else the power is not divided by the lamp's area
    light.cycles.max_bounces = 1024
    light.cycles.use_multiple_importance_sampling = False
    with warnings.catch_warnings():  # needed up to 5.0, deprecated afterwards
        warnings.simplefilter("ignore", DeprecationWarning)
        light.use_nodes = True
    tree = light.node_tree
    output = next((n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputLight"), None)
    if output is None:
        output = tree.nodes.new("ShaderNodeOutputLight")
        output.location = (300, 0)
    node = next(
        (n for n in tree.nodes if n.bl_idname == "ShaderNodeGroup" and n.node_tree == group), None
    )
    if node is None:
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        node.label = group.name
        node.location = (output.location.x - 220, output.location.y)
    if not any(link.from_node == node for link in output.inputs["Surface"].links):
        tree.links.new(node.outputs["Emission"], output.inputs["Surface"])
    return node
