# SPDX-License-Identifier: GPL-3.0-or-later
"""Range encoding of a path segment, for materials and transmitter (Eq. 2-3 of Costa et al.)."""

from __future__ import annotations

from typing import Any

from . import attributes
from .build import TreeBuilder


def ray_length(build: TreeBuilder) -> Any:
    """Add nodes for the length of the ray, Blender units, across transparent surfaces."""
    return build.node("ShaderNodeLightPath", "Light Path").outputs["Ray Length"]


def range_code(build: TreeBuilder, length: Any, inverse_code_length: Any) -> Any:
    """Add nodes for the colour (exp(-r/k), exp(-2r/k), 1) of a segment of length r.

    G is the square of R and not a second exponential, so that G B / R^2 = 1 holds to rounding for
    a single path. Outside a measurement 1/k is 0 and the colour is white.
    """
    ratio = build.math("MULTIPLY", "r / k", length, inverse_code_length)
    exponent = build.math("MULTIPLY", "-r / k", ratio, -1.0)
    code = build.math("EXPONENT", "exp(-r / k)", exponent)
    check = build.math("MULTIPLY", "exp(-2 r / k)", code, code)
    colour = build.node("ShaderNodeCombineXYZ", "Range code", {0: code, 1: check, 2: 1.0})
    return colour.outputs[0]


def inverse_code_length(build: TreeBuilder) -> Any:
    """Add nodes for 1/k of the running measurement, per Blender unit; 0 outside one."""
    return build.scene_attribute(attributes.ATTR_INVERSE_CODE_LENGTH)
