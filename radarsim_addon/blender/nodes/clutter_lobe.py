# SPDX-License-Identifier: GPL-3.0-or-later
"""A lobe that returns a given sigma0 towards the radar, by grazing angle.

A Diffuse BSDF whose albedo depends on the direction that it is seen from::

    rho = sigma0(psi) / (4 |I . N| |I . Ng|),    psi = asin |I . N|

with I the way to the receiver, N the smooth and Ng the true normal: Cycles' cosine and the area
that a pixel covers cancel both. sigma0 is in dB in a row of an image, linear over
u = (psi / 90 degrees)^(1/3), which leaves 2e-4 dB down to 0.05 degrees. The albedo may be above 1
where the receiver looks; elsewhere it is limited to 1, so that power cannot build up between
surfaces. :mod:`..paths.clutter_weights` corrects bistatic paths and those of higher orders.
"""

from __future__ import annotations

import math as _math
from typing import Any

import numpy as np

from ...array_types import Real
from .build import TreeBuilder

CLUTTER_ROW = "Clutter Row"
"""Input of a group: place of its table in the image, 0 to 1; 0 for none."""
TABLE_NODE = "Clutter tables"
"""Name of the node that reads the image; a run gives it one."""
TABLE_WIDTH = 1024
VANISHES_BELOW = 1e-5
"""Cycles drops a closure whose weight, the mean of its channels, is less than this."""


def table_angles_rad() -> Real:
    """Return the grazing angles of the columns of a table, (TABLE_WIDTH,) [rad]."""
    return np.pi / 2 * ((np.arange(TABLE_WIDTH) + 0.5) / TABLE_WIDTH) ** 3


def add_clutter_lobe(build: TreeBuilder, code: Any, reflects: Any) -> Any:
    """Add nodes for the lobe, encoded by `code`; 0 where `reflects` is, or without a table."""
    math = build.math
    with build.prefixed("Clutter: "):
        row = build.group_input(CLUTTER_ROW)
        geometry = build.node("ShaderNodeNewGeometry", "Geometry").outputs
        sine, true_sine = (
            math(
                "ABSOLUTE",
                f"|I . {name}|",
                build.dot(f"I . {name}", geometry["Incoming"], geometry[output]),
            )
            for name, output in (("N", "Normal"), ("Ng", "True Normal"))
        )
        angle = math("ARCSINE", "psi", math("MINIMUM", "sin psi", sine, 1.0))
        ratio = math("MULTIPLY", "psi / 90 degrees", angle, 2 / _math.pi)
        column = math("POWER", "u", ratio, 1 / 3)
    at = build.node("ShaderNodeCombineXYZ", "Clutter: place", {0: column, 1: row}).outputs[0]
    image = build.node(
        "ShaderNodeTexImage", TABLE_NODE, {0: at}, interpolation="Linear", extension="EXTEND"
    )
    with build.prefixed("Clutter: "):
        level = build.node("ShaderNodeSeparateXYZ", "dB", {0: image.outputs["Color"]}).outputs[0]
        scaled = math("MULTIPLY", "ln sigma0", level, _math.log(10) / 10)
        sigma0 = math("EXPONENT", "sigma0", scaled)
        # below it the product of both sines has no float32 left
        area = math("MAXIMUM", "not 0", math("MULTIPLY", "sines", sine, true_sine), 1e-12)
        albedo = math("DIVIDE", "rho", sigma0, math("MULTIPLY", "4 sines", area, 4.0))
        camera = build.node("ShaderNodeLightPath", "Ray").outputs["Is Camera Ray"]
        limited = math("MINIMUM", "rho, at most 1", albedo, 1.0)
        albedo = build.select("rho, limited beyond the first", camera, limited, albedo)
        given = math("GREATER_THAN", "given", row, 0.0)
        weight = math("MULTIPLY", "given, or 0 before the gate", given, reflects)
        albedo = math("MULTIPLY", "rho, or 0", albedo, weight)
        colour = build.scale("Colour", code, albedo)
        return build.node("ShaderNodeBsdfDiffuse", "Lobe", {"Color": colour}).outputs[0]
