# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar Material: reflection, transmission and absorption of radar power (Fig. 4, Eq. 2-3, 7).

Surface, with F the complex Fresnel reflectance of :mod:`.fresnel` and s the specularity::

    Glossy(Beckmann, roughness)  code F s
  + Diffuse                      code F (1 - s)
  + Transparent                  1 - F            (not encoded: Ray Length continues)

Volume, per Blender unit of depth, with alpha = 4 pi kappa / Lambda (Eq. 7)::

    B: alpha       R: alpha + (n - 1)/k       G: alpha + 2 (n - 1)/k

Red and green thus also encode the optical delay (n - 1) d of the depth d.
"""

from __future__ import annotations

import math as _math
from typing import Any

from . import attributes
from .build import GroupDefinition, TreeBuilder, factor_input, float_input
from .fresnel import cos_incidence, reflectance, transmittance
from .outputs import SURFACE, VOLUME, any_inverse_code_length, interior
from .range_encoding import inverse_code_length, range_code, ray_length

KIND = "radar_material"

INDEX = "Index of Refraction"
EXTINCTION = "Extinction Coefficient"
SPECULARITY = "Specularity"
ROUGHNESS = "Roughness"
TRANSMISSION = "Transmission"

INDEX_AT_CARRIER = (
    "Real part n of the complex index of refraction at the carrier (no unit). Set from the "
    "material's medium whenever the carrier changes; a link here replaces it"
)
"""Tooltip of the index of groups that follow a medium."""


def _draw(build: TreeBuilder) -> None:
    n = build.group_input(INDEX)
    kappa = build.group_input(EXTINCTION)
    specularity = build.group_input(SPECULARITY)
    roughness = build.group_input(ROUGHNESS)
    inverse_k = inverse_code_length(build)
    _draw_surface(build, n, kappa, specularity, roughness, inverse_k)
    _draw_volume(build, n, kappa, inverse_k)


def _draw_surface(
    build: TreeBuilder, n: Any, kappa: Any, specularity: Any, roughness: Any, inverse_k: Any
) -> None:
    math = build.math
    power = reflectance(build, n, kappa, cos_incidence(build))
    code = range_code(build, ray_length(build), inverse_k)

    reflects, transmits = camera_lobes(build)
    scattered = math("MULTIPLY", "F, or 0 before the gate", power, reflects)
    specular = math("MULTIPLY", "F s", scattered, specularity)
    diffuse = math("SUBTRACT", "F (1 - s)", scattered, specular)
    specular_colour = build.scale("Specular colour", code, specular)
    diffuse_colour = build.scale("Diffuse colour", code, diffuse)
    passed = math(
        "MULTIPLY",
        "T, scaled",
        transmittance(build, n, kappa, power),
        build.group_input(TRANSMISSION),
    )
    glossy = build.glossy("Specular lobe", specular_colour, roughness)
    lambert = build.node("ShaderNodeBsdfDiffuse", "Diffuse lobe", {"Color": diffuse_colour})
    through = build.transparent(
        "Transmission", math("MULTIPLY", "1 - F, or 0 at it", passed, transmits)
    )
    reflected = build.add_shaders("Reflection", glossy, lambert.outputs[0])
    total = build.add_shaders("Surface", reflected, through)
    build.group_output("Surface", total)


def camera_lobes(build: TreeBuilder) -> tuple[Any, Any]:
    """Add nodes for the factors of reflection and transmission, 0 or 1.

    Cycles would follow one of the lobes of a camera ray at random. A render of one path class
    switches reflection off before its surface, and transmission off at it. Other rays have both.
    """
    math = build.math
    light_path = build.node("ShaderNodeLightPath", "Path so far")
    camera = light_path.outputs["Is Camera Ray"]
    depth = math("ADD", "depth + 1", light_path.outputs["Transparent Depth"], 1.0)
    before = math(
        "LESS_THAN", "before the gate", depth, build.scene_attribute(attributes.ATTR_SURFACE_DEPTH)
    )
    stop = build.scene_attribute(attributes.ATTR_SURFACE_STOP)
    requested = math("GREATER_THAN", "stop asked for", stop, 0.0)
    at_gate = math("GREATER_THAN", "at the gate", depth, stop)
    stopping = math("MULTIPLY", "stopping", math("MULTIPLY", "stop", requested, at_gate), camera)
    passing = math("MULTIPLY", "passing", before, camera)
    return (
        math("SUBTRACT", "reflects", 1.0, passing),
        math("SUBTRACT", "transmits", 1.0, stopping),
    )


def _draw_volume(build: TreeBuilder, n: Any, kappa: Any, inverse_k: Any) -> None:
    math = build.math
    given = build.scene_attribute(attributes.ATTR_EXTINCTION_LENGTH)
    is_given = math("GREATER_THAN", "Lambda given", given, 0.0)
    length = build.select("Lambda", is_given, 1.0, given)
    four_pi_kappa = math("MULTIPLY", "4 pi kappa", kappa, 4.0 * _math.pi)
    alpha = math("DIVIDE", "alpha = 4 pi kappa / Lambda", four_pi_kappa, length)
    above_vacuum = math("SUBTRACT", "n - 1 (delay)", n, 1.0)
    excess = math("MAXIMUM", "n - 1, from 0 up", above_vacuum, 0.0)
    any_inverse_k = any_inverse_code_length(build, inverse_k)
    delay = math("MULTIPLY", "(n - 1) / k", excess, any_inverse_k)
    interior(build, alpha, delay, "(n - 1) / k")


RADAR_MATERIAL = GroupDefinition(
    kind=KIND,
    name="Radar Material",
    version=3,
    description=(
        "Reflection, transmission and absorption of radar power by a medium of complex index "
        "n + j kappa, with the range encoding of the running measurement"
    ),
    sockets=(
        SURFACE,
        VOLUME,
        float_input(
            INDEX,
            "Real part n of the complex index of refraction at the carrier frequency, relative to "
            "vacuum (no unit). 1 is vacuum, 1e4 a metal; sqrt(permittivity) for a low-loss medium",
            1.5,
            minimum=1.0,
        ),
        float_input(
            EXTINCTION,
            "Imaginary part of the complex index, normalised (no unit): inside the object power "
            "falls as exp(-4 pi kappa d / Lambda) with the depth d. Lambda is the scene's "
            "extinction length, one Blender unit unless set; with Lambda = wavelength this is the "
            "physical extinction coefficient",
            0.0,
        ),
        factor_input(
            SPECULARITY,
            "Fraction of the reflected power in the specular (glossy) lobe. The rest is diffuse. "
            "0 is a Lambert surface, 1 is similar to a mirror",
            0.5,
        ),
        factor_input(
            ROUGHNESS,
            "Roughness of the specular lobe (Beckmann) as in Blender's Glossy BSDF: "
            "roughness^2 = alpha = sqrt(2) x RMS slope of the surface. 0 is a perfect mirror, "
            "which returns no echo to a point antenna",
            0.5,
        ),
        factor_input(
            TRANSMISSION,
            "Factor on the power that passes each face. A run sets it to 0 where Volume is not "
            "connected to the Material Output: what enters such an object does not come out",
            1.0,
        ),
    ),
    draw=_draw,
)
