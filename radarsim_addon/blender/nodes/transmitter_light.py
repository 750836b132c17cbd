# SPDX-License-Identifier: GPL-3.0-or-later
"""The Ring Emitter on a Point light: the transmitter."""

from __future__ import annotations

import warnings
from typing import Any

from ...errors import SceneError
from .ring_emitter import KIND


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
