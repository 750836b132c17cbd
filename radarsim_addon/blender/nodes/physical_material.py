# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar Material, physical: a medium of complex index n + j kappa with a smooth or rough surface.

Surface::

    smooth     Glossy, sharp          code R
    rough      Metallic (conductor)   code F(half vector), Beckmann: Kirchhoff's model in its
                                      geometric-optics limit
               Glossy                 code F(0), instead, up to Blender 4.5
    either     Transparent            T x transmission  (no code: the ray's length runs on)

R and T of :mod:`.interface`, for the run's polarisation. The Metallic BSDF evaluates Fresnel's
equations where they belong, at the facet that reflects, but takes no colour: so there are three of
them, each with the index in one channel and vacuum (F = 0) in the others, mixed with black by
that channel's code. From inside, their unpolarised F is scaled by R/F.

Volume, per Blender unit along a ray, with c the cosine outside to the layer's normal and
q = sqrt(epsilon - 1 + c^2)::

    B: alpha = 4 pi Im(q) c / wavelength
    R: alpha + c (Re q - c)/k         G: alpha + 2 c (Re q - c)/k

A layer of thickness d is crossed over d/c: absorption exp(-2 k0 Im(q) d) and optical delay
d (Re q - c), as the refracted wave has them. Without a layer normal c is 1: 4 pi kappa / wavelength
and n - 1.
"""

from __future__ import annotations

import math as _math
from typing import Any

from ...physics.rough_transmission import RAMP_BELOW
from . import attributes
from .build import GroupDefinition, SocketSpec, TreeBuilder
from .fresnel import cos_incidence
from .interface import excess, interface_power, wave_inside
from .layer import internal_echoes, layer_cosine
from .outputs import SURFACE, VOLUME, any_inverse_code_length, interior, wavelength
from .radar_material import EXTINCTION, INDEX, ROUGHNESS, camera_lobes
from .range_encoding import inverse_code_length, range_code, ray_length

KIND = "radar_physical"

TRANSMISSION = "Transmission"
GRAZING_TRANSMISSION = "Grazing Transmission"

SMOOTH_BELOW = 0.01
"""Roughness (alpha 1e-4) below which a surface is taken as a mirror."""


def _draw(build: TreeBuilder) -> None:
    n = build.group_input(INDEX)
    kappa = build.group_input(EXTINCTION)
    inverse_k = inverse_code_length(build)
    _draw_surface(build, n, kappa, inverse_k)
    _draw_volume(build, n, kappa, inverse_k)


def _draw_surface(build: TreeBuilder, n: Any, kappa: Any, inverse_k: Any) -> None:
    math = build.math
    roughness = build.group_input(ROUGHNESS)
    cosine = cos_incidence(build)
    wave = wave_inside(build, n, kappa, cosine)
    power = interface_power(build, n, kappa, wave, internal_echoes(build))
    code = range_code(build, ray_length(build), inverse_k)
    reflects, transmits = camera_lobes(build)
    is_rough = math("GREATER_THAN", "rough", roughness, SMOOTH_BELOW)
    is_smooth = math("SUBTRACT", "smooth", 1.0, is_rough)

    weight = math("MULTIPLY", "R of a mirror", power.reflected, is_smooth)
    weight = math("MULTIPLY", "R, or 0 before the gate", weight, reflects)
    colour = build.node(
        "ShaderNodeVectorMath", "Mirror colour", {0: code, "Scale": weight}, operation="SCALE"
    )
    mirror = build.node(
        "ShaderNodeBsdfAnisotropic",
        "Mirror",
        {"Color": colour.outputs[0], "Roughness": 0.0},
        distribution="BECKMANN",
    )
    rough = _rough_lobes(build, n, kappa, roughness, code, power, reflects, is_rough)
    passed = math("MULTIPLY", "T, scaled", power.passed, _transmission(build, cosine))
    through = build.node(
        "ShaderNodeBsdfTransparent",
        "Transmission",
        {"Color": math("MULTIPLY", "T, or 0 at the gate", passed, transmits)},
    )
    reflected = build.node("ShaderNodeAddShader", "Reflection", {0: mirror.outputs[0], 1: rough})
    total = build.node(
        "ShaderNodeAddShader", "Surface", {0: reflected.outputs[0], 1: through.outputs[0]}
    )
    build.group_output("Surface", total.outputs[0])


def _transmission(build: TreeBuilder, cosine: Any) -> Any:
    """Factor on T: the first input, and below RAMP_BELOW linear to the second at grazing."""
    math = build.math
    ramp = math("MULTIPLY_ADD", "ramp", cosine, -1.0 / RAMP_BELOW, 1.0, clamp=True)
    flat = math("SUBTRACT", "1 - ramp", 1.0, ramp)
    low = math("MULTIPLY", "grazing part", build.group_input(GRAZING_TRANSMISSION), ramp)
    return math("MULTIPLY_ADD", "factor on T", build.group_input(TRANSMISSION), flat, low)


def _rough_lobes(
    build: TreeBuilder,
    n: Any,
    kappa: Any,
    roughness: Any,
    code: Any,
    power: Any,
    reflects: Any,
    is_rough: Any,
) -> Any:
    """Three Metallic BSDFs, one a channel; or one Glossy with Fresnel at normal incidence.

    Up to Blender 4.5 the Metallic BSDF takes a form of Fresnel's equations for large indices, in
    which vacuum reflects obliquely: the three lobes would leak into one another's channel.
    """
    math = build.math
    back = build.node("ShaderNodeNewGeometry", "Side (lobes)").outputs["Backfacing"]
    inside = math("DIVIDE", "R / F", power.reflected, power.reference, clamp=True)
    ratio = build.select("1, or R / F from inside", back, 1.0, inside)
    weight = math("MULTIPLY", "rough, R / F", ratio, is_rough)
    weight = math("MULTIPLY", "rough, or 0 before the gate", weight, reflects)
    exact = build.scene_attribute(attributes.ATTR_FACET_FRESNEL)
    flat = math("SUBTRACT", "normal incidence", 1.0, exact)
    flat = math(
        "MULTIPLY",
        "weight of F(0)",
        math("MULTIPLY", "flat", flat, weight),
        _normal(build, n, kappa),
    )
    colour = build.node(
        "ShaderNodeVectorMath", "Facets' colour", {0: code, "Scale": flat}, operation="SCALE"
    )
    glossy = build.node(
        "ShaderNodeBsdfAnisotropic",
        "Facets",
        {"Color": colour.outputs[0], "Roughness": roughness},
        distribution="BECKMANN",
    )
    weight = math("MULTIPLY", "weight of F", weight, exact)
    codes = build.node("ShaderNodeSeparateXYZ", "Code by channel", {0: code}).outputs
    total = glossy.outputs[0]
    for axis, channel in enumerate("RGB"):
        index = build.node(
            "ShaderNodeCombineXYZ",
            f"Index in {channel}",
            {i: n if i == axis else 1.0 for i in range(3)},
        )
        extinction = build.node(
            "ShaderNodeCombineXYZ",
            f"Extinction in {channel}",
            {i: kappa if i == axis else 0.0 for i in range(3)},
        )
        lobe = build.node(
            "ShaderNodeBsdfMetallic",
            f"Facets, {channel}",
            {
                "IOR": index.outputs[0],
                "Extinction": extinction.outputs[0],
                "Roughness": roughness,
            },
            distribution="BECKMANN",
            fresnel_type="PHYSICAL_CONDUCTOR",
        )
        coded = build.node(
            "ShaderNodeMixShader",
            f"Code on {channel}",
            {
                0: math("MULTIPLY", f"Weight of {channel}", weight, codes[axis]),
                2: lobe.outputs[0],
            },
        ).outputs[0]
        total = build.node(
            "ShaderNodeAddShader", f"Facets to {channel}", {0: total, 1: coded}
        ).outputs[0]
    return total


def _normal(build: TreeBuilder, n: Any, kappa: Any) -> Any:
    """F at normal incidence, ((n - 1)^2 + kappa^2) / ((n + 1)^2 + kappa^2)."""
    math = build.math
    kappa2 = math("MULTIPLY", "kappa^2 (F0)", kappa, kappa)
    below = math("SUBTRACT", "n - 1 (F0)", n, 1.0)
    above = math("ADD", "n + 1 (F0)", n, 1.0)
    top = math("MULTIPLY_ADD", "(n - 1)^2 + kappa^2 (F0)", below, below, kappa2)
    bottom = math("MULTIPLY_ADD", "(n + 1)^2 + kappa^2 (F0)", above, above, kappa2)
    return math("DIVIDE", "F(0)", top, bottom)


def _draw_volume(build: TreeBuilder, n: Any, kappa: Any, inverse_k: Any) -> None:
    math = build.math
    cosine = layer_cosine(build)
    with build.prefixed("Volume: "):
        wave = wave_inside(build, n, kappa, cosine)
    length = wavelength(build)
    normal_rate = math("MULTIPLY", "4 pi Im q", wave.v, 4.0 * _math.pi)
    rate = math("MULTIPLY", "4 pi Im(q) c", normal_rate, cosine)
    alpha = math("DIVIDE", "alpha = 4 pi Im(q) c / wavelength", rate, length)
    any_inverse_k = any_inverse_code_length(build, inverse_k)
    longer = math("MULTIPLY", "c (Re q - c)", cosine, excess(build, wave))
    # A light wave that runs ahead (n < 1) cannot be told by absorption.
    delay = math(
        "MULTIPLY", "c (Re q - c) / k", math("MAXIMUM", "from 0 up", longer, 0.0), any_inverse_k
    )
    interior(build, alpha, delay, "c (Re q - c) / k")


RADAR_PHYSICAL = GroupDefinition(
    kind=KIND,
    name="Radar Material, physical",
    version=2,
    description=(
        "Smooth or rough surface of a medium of complex index n + j kappa, with what the wave does "
        "inside: Fresnel losses, absorption and delay at the angle at which it goes through"
    ),
    sockets=(
        SURFACE,
        VOLUME,
        SocketSpec(
            INDEX,
            "INPUT",
            "NodeSocketFloat",
            "Real part n of the complex index of refraction at the carrier (no unit). Set from the "
            "material's medium whenever the carrier changes; a link here takes its place",
            default=2.3,
            minimum=0.0,
            maximum=1e5,
        ),
        SocketSpec(
            EXTINCTION,
            "INPUT",
            "NodeSocketFloat",
            "Imaginary part kappa of the complex index at the carrier (no unit), physical: power "
            "falls as exp(-4 pi kappa d / wavelength) with the depth d. Set from the medium",
            default=0.0,
            minimum=0.0,
            maximum=1e5,
        ),
        SocketSpec(
            ROUGHNESS,
            "INPUT",
            "NodeSocketFloat",
            "Roughness of the surface as Cycles takes it: roughness^2 = alpha = sqrt(2) x rms "
            "slope. 0 is a mirror, which sends no echo straight back to a point antenna",
            default=0.0,
            subtype="FACTOR",
        ),
        SocketSpec(
            TRANSMISSION,
            "INPUT",
            "NodeSocketFloat",
            "Factor on the power that goes through each face, up to 60 degrees. 1, but for rough "
            "surfaces, whose facets reflect a little more than a smooth one: no power is created",
            default=1.0,
            subtype="FACTOR",
        ),
        SocketSpec(
            GRAZING_TRANSMISSION,
            "INPUT",
            "NodeSocketFloat",
            "The same at grazing incidence; between 60 degrees and there it is linear in the "
            "cosine. Set from medium and roughness, as the factor above",
            default=1.0,
            subtype="FACTOR",
        ),
    ),
    draw=_draw,
)
