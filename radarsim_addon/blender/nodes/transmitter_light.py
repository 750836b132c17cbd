# SPDX-License-Identifier: GPL-3.0-or-later
"""The Ring Emitter on a Point light: the transmitter."""

from __future__ import annotations

import warnings
from typing import Any

from ...errors import SceneError
from .groups import ensure_group
from .ring_emitter import KIND


def setup_emitter(light: Any) -> Any:
    """Make a Point light the radar's transmitter.

    The light becomes a true point, because a radius would blur ranges, and gets the Ring Emitter
    in its node tree. Power, colour and position do not change. A second call changes nothing.

    Parameters
    ----------
    light : bpy.types.Light
        A light of type POINT.

    Returns
    -------
    bpy.types.ShaderNodeGroup
        The group node in the light's tree.

    Raises
    ------
    SceneError
        The light is of another type, or linked from a library.
    """
    if light.type != "POINT":
        raise SceneError(
            f"Light {light.name!r} is of type {light.type}. Only a Point light can be the "
            "transmitter. Choose a Point light, or press Radar > Set Up Radar."
        )
    if light.library is not None:
        raise SceneError(
            f"Light {light.name!r} is linked from {light.library.filepath!r}, so radarsim cannot "
            "change it. Make it local, or press Radar > Set Up Radar."
        )
    group = ensure_group(KIND)
    _make_point(light)
    return _link_emission(light.node_tree, group)


def _make_point(light: Any) -> None:
    """Set what makes the light an isotropic point with a node tree."""
    light.shadow_soft_size = 0.0
    light.use_shadow = True
    if hasattr(light, "use_soft_falloff"):
        light.use_soft_falloff = False  # it changes the power near the light
    if hasattr(light, "normalize"):
        light.normalize = True  # else the power is not divided by the light's area
    light.cycles.max_bounces = 1024
    light.cycles.use_multiple_importance_sampling = False
    with warnings.catch_warnings():  # needed up to 5.0, deprecated afterwards
        warnings.simplefilter("ignore", DeprecationWarning)
        light.use_nodes = True


def _link_emission(tree: Any, group: Any) -> Any:
    """Connect the group to the light's output; return its node."""
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
