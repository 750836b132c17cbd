# SPDX-License-Identifier: GPL-3.0-or-later
"""Outputs of the material groups: their sockets, and the interior with its encoded delay."""

from __future__ import annotations

from typing import Any

from . import attributes
from .build import SocketSpec, TreeBuilder

SURFACE = SocketSpec(
    "Surface",
    "OUTPUT",
    "NodeSocketShader",
    "Reflected and transmitted power. Connect to Surface of the Material Output",
)
VOLUME = SocketSpec(
    "Volume",
    "OUTPUT",
    "NodeSocketShader",
    "Absorption and optical delay along the depth inside. Connect to Volume of the "
    "Material Output where the object is a closed mesh that radar waves enter",
)


def any_inverse_code_length(build: TreeBuilder, inverse_k: Any) -> Any:
    """Add nodes for 1/k, whether materials or the world volume encode the range."""
    world_inverse_k = build.scene_attribute(attributes.ATTR_WORLD_CODE)
    return build.math("ADD", "1/k of material or world", inverse_k, world_inverse_k)


def wavelength(build: TreeBuilder) -> Any:
    """Add nodes for the wavelength in vacuum, Blender units; 1 outside a measurement."""
    given = build.scene_attribute(attributes.ATTR_WAVELENGTH)
    is_given = build.math("GREATER_THAN", "wavelength given", given, 0.0)
    return build.select("wavelength", is_given, 1.0, given)


def interior(build: TreeBuilder, alpha: Any, delay: Any, label: str) -> None:
    """Add the volume output: absorption in blue, plus the delay in red, and twice that in green.

    `alpha` and `delay` are per Blender unit; `label` is the formula of the delay.
    """
    math = build.math
    double_delay = math("MULTIPLY", f"2 {label}", delay, 2.0)
    # Absorption is Density x (1 - Color). Cycles counts 32 closures for each volume node and warns
    # above 64 in a material, so this uses one node. Rounding costs 1e-7 of the delay.
    density = math("ADD", f"alpha + 2 {label}", alpha, double_delay)
    red = math("DIVIDE", "Spared in red", delay, density)
    blue = math("DIVIDE", "Spared in blue", double_delay, density)
    colour = build.node("ShaderNodeCombineXYZ", "Spared", {0: red, 1: 0.0, 2: blue})
    absorption = build.node(
        "ShaderNodeVolumeAbsorption", "Interior", {"Color": colour.outputs[0], "Density": density}
    )
    build.group_output("Volume", absorption.outputs[0])
