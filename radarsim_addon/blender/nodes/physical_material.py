# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar Material, physical: a medium of complex index n + j kappa with a smooth or rough surface.

Surface::

    smooth     Glossy, sharp          code R
    rough      Metallic (conductor)   code F(half vector), Beckmann: Kirchhoff's model in its
                                      geometric-optics limit
               Glossy                 code F(0), instead, up to Blender 4.5
    either     Diffuse                code rho of :mod:`.clutter_lobe`, with a clutter model
               Transparent            T x transmission  (not encoded: Ray Length continues)

R and T are those of :mod:`.interface`, for the polarisation of the run. The Metallic BSDF
evaluates Fresnel's equations at the facet that reflects, but has no colour input. The group
therefore has three of them, each with the index in one channel and vacuum (F = 0) in the others,
mixed with black by the code of that channel. Where the world encodes the range, one is enough.
From inside, their unpolarised F is scaled by R/F.

Volume, per Blender unit along a ray, with c the cosine outside to the layer's normal and
q = sqrt(epsilon - 1 + c^2)::

    B: alpha = 4 pi Im(q) c / wavelength
    R: alpha + c (Re q - c)/k         G: alpha + 2 c (Re q - c)/k

A ray crosses a layer of thickness d over the length d/c, which gives the refracted wave's
absorption exp(-2 k0 Im(q) d) and optical delay d (Re q - c). Without a layer normal c is 1, which
gives 4 pi kappa / wavelength and n - 1. In a shell, and in a layer that has its interior at its
faces, the volume does nothing, and each face has the factors of half of the wall behind it.
"""

from __future__ import annotations

import math as _math
from typing import Any

from ...physics.rough_transmission import RAMP_BELOW
from . import attributes
from .build import GroupDefinition, TreeBuilder, factor_input, float_input
from .clutter_lobe import CLUTTER_ROW, add_clutter_lobe
from .fresnel import cos_incidence
from .interface import InterfacePower, excess, interface_power, wave_inside
from .layer import interior_at_faces, internal_echoes, layer_cosine, wall_at_face
from .outputs import SURFACE, VOLUME, any_inverse_code_length, interior, wavelength
from .radar_material import (
    EXTINCTION,
    INDEX,
    INDEX_AT_CARRIER,
    ROUGHNESS,
    TRANSMISSION,
    camera_lobes,
)
from .range_encoding import inverse_code_length, range_code, ray_length

KIND = "radar_physical"

GRAZING_TRANSMISSION = "Grazing Transmission"

SMOOTH_BELOW = 0.01
"""Roughness (alpha 1e-4) below which a surface is a mirror."""


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
    with build.prefixed("Shell: "):
        code, crossed, in_shell = _wall_crossed(build, n, kappa, cosine, code, inverse_k)
    reflects, transmits = camera_lobes(build)
    is_rough = math("GREATER_THAN", "rough", roughness, SMOOTH_BELOW)
    is_smooth = math("SUBTRACT", "smooth", 1.0, is_rough)

    weight = math("MULTIPLY", "R of a mirror", power.reflected, is_smooth)
    weight = math("MULTIPLY", "R, or 0 before the gate", weight, reflects)
    mirror = build.glossy("Mirror", build.scale("Mirror colour", code, weight), 0.0)
    weight = _facet_weight(build, power, reflects, is_rough)
    coded = math("GREATER_THAN", "coded by materials", inverse_k, 0.0)
    coded = math("MAXIMUM", "coded by channel", coded, in_shell)
    rough = _facet_lobes(build, n, kappa, roughness, code, weight, coded)
    passed = build.scale("T, scaled", power.passed, _transmission(build, cosine))
    passed = build.vector_math("MULTIPLY", "T, wall crossed", {0: passed, 1: crossed})
    through = build.transparent(
        "Transmission", build.scale("T, or 0 at the gate", passed, transmits)
    )
    reflected = build.add_shaders("Reflection of the interface", mirror, rough)
    reflected = build.add_shaders("Reflection", reflected, add_clutter_lobe(build, code, reflects))
    build.group_output("Surface", build.add_shaders("Surface", reflected, through))


def _wall_crossed(
    build: TreeBuilder, n: Any, kappa: Any, face_cosine: Any, code: Any, inverse_k: Any
) -> tuple[Any, Any, Any]:
    """Add nodes for the wall that a face stands for: code and colour with it, and 0 or 1.

    The code is for what turns back at the face, the colour for what passes it.
    """
    math = build.math
    wall = wall_at_face(build, face_cosine)
    wave = wave_inside(build, n, kappa, wall.cosine)
    any_inverse_k = any_inverse_code_length(build, inverse_k)
    length = wavelength(build)
    # Absorption cannot encode a negative delay (n < 1).
    rate = math("MAXIMUM", "Re q - c, from 0 up", excess(build, wave), 0.0)

    def factor(label: str, depth: Any) -> Any:
        waves = math("DIVIDE", f"d / wavelength, {label}", depth, length)
        minus = math("MULTIPLY", f"-4 pi d / wavelength, {label}", waves, -4.0 * _math.pi)
        loss = math("MULTIPLY", f"-4 pi Im(q) d / wavelength, {label}", minus, wave.v)
        longer = math("MULTIPLY", f"d (Re q - c), {label}", depth, rate)
        absorbed = math("EXPONENT", f"absorbed, {label}", loss)
        with build.prefixed(f"Shell, {label}: "):
            delay = range_code(build, longer, any_inverse_k)
        return build.scale(f"Wall crossed, {label}", delay, absorbed)

    turned = factor("turned", wall.turned)
    coded = build.vector_math("MULTIPLY", "Code, wall crossed", {0: code, 1: turned})
    inside = math("GREATER_THAN", "in a wall", wall.turned, 0.0)
    return coded, factor("passed", wall.passed), inside


def _transmission(build: TreeBuilder, cosine: Any) -> Any:
    """Add nodes for the factor on T: below RAMP_BELOW linear in the cosine to the grazing input."""
    math = build.math
    ramp = math("MULTIPLY_ADD", "ramp", cosine, -1.0 / RAMP_BELOW, 1.0, clamp=True)
    flat = math("SUBTRACT", "1 - ramp", 1.0, ramp)
    low = math("MULTIPLY", "grazing part", build.group_input(GRAZING_TRANSMISSION), ramp)
    return math("MULTIPLY_ADD", "factor on T", build.group_input(TRANSMISSION), flat, low)


def _facet_weight(build: TreeBuilder, power: InterfacePower, reflects: Any, is_rough: Any) -> Any:
    """Add nodes for the factor on F of the rough lobes: 0 or 1, or R / F from inside."""
    math = build.math
    back = build.node("ShaderNodeNewGeometry", "Side (lobes)").outputs["Backfacing"]
    inside = math("DIVIDE", "R / F", power.reflected, power.reference, clamp=True)
    ratio = build.select("1, or R / F from inside", back, 1.0, inside)
    weight = math("MULTIPLY", "rough, R / F", ratio, is_rough)
    return math("MULTIPLY", "rough, or 0 before the gate", weight, reflects)


def _facet_lobes(
    build: TreeBuilder, n: Any, kappa: Any, roughness: Any, code: Any, weight: Any, coded: Any
) -> Any:
    """Add Metallic BSDFs, one, or one per channel for the code; or a Glossy BSDF with F(0).

    Cycles rounds the lobe that it samples unlike the others, by more the smoother they are: with
    lobes by channel, the channels of one path differ from order 2 on. Up to Blender 4.5 the
    Metallic BSDF uses a form of Fresnel's equations for large indices, in which vacuum reflects at
    oblique angles. Each lobe would then add to the other channels.
    """
    math = build.math
    exact = build.scene_attribute(attributes.ATTR_FACET_FRESNEL)
    flat = math("SUBTRACT", "normal incidence", 1.0, exact)
    flat = math("MULTIPLY", "flat", flat, weight)
    flat = math("MULTIPLY", "weight of F(0)", flat, _normal(build, n, kappa))
    total = build.glossy("Facets", build.scale("Facets' colour", code, flat), roughness)
    weight = math("MULTIPLY", "weight of F", weight, exact)
    codes = build.node("ShaderNodeSeparateXYZ", "Code by channel", {0: code}).outputs
    by_channel = math("MULTIPLY", "weight of F, coded", weight, coded)
    grey = math("SUBTRACT", "weight of F, not coded", weight, by_channel)

    def in_channel(label: str, axis: int, value: Any, other: float) -> Any:
        inputs = {i: value if i == axis else other for i in range(3)}
        return build.node("ShaderNodeCombineXYZ", label, inputs).outputs[0]

    def with_lobe(label: str, before: Any, index: Any, extinction: Any, factor: Any) -> Any:
        inputs = {"IOR": index, "Extinction": extinction, "Roughness": roughness}
        lobe = build.node(
            "ShaderNodeBsdfMetallic",
            f"Facets, {label}",
            inputs,
            distribution="BECKMANN",
            fresnel_type="PHYSICAL_CONDUCTOR",
        )
        mixed = build.node(
            "ShaderNodeMixShader", f"Code on {label}", {0: factor, 2: lobe.outputs[0]}
        )
        return build.add_shaders(f"Facets to {label}", before, mixed.outputs[0])

    for axis, channel in enumerate("RGB"):
        total = with_lobe(
            channel,
            total,
            in_channel(f"Index in {channel}", axis, n, 1.0),
            in_channel(f"Extinction in {channel}", axis, kappa, 0.0),
            math("MULTIPLY", f"Weight of {channel}", by_channel, codes[axis]),
        )
    return with_lobe("grey", total, n, kappa, grey)


def _normal(build: TreeBuilder, n: Any, kappa: Any) -> Any:
    """Add nodes for F at normal incidence, ((n - 1)^2 + kappa^2) / ((n + 1)^2 + kappa^2)."""
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
        solid = math("SUBTRACT", "interior in the volume", 1.0, interior_at_faces(build))
        wave = wave_inside(build, n, kappa, cosine)
    length = wavelength(build)
    normal_rate = math("MULTIPLY", "4 pi Im q", wave.v, 4.0 * _math.pi)
    rate = math("MULTIPLY", "4 pi Im(q) c", normal_rate, cosine)
    rate = math("MULTIPLY", "4 pi Im(q) c, or 0 with faces", rate, solid)
    alpha = math("DIVIDE", "alpha = 4 pi Im(q) c / wavelength", rate, length)
    any_inverse_k = any_inverse_code_length(build, inverse_k)
    any_inverse_k = math("MULTIPLY", "1/k, or 0 with faces", any_inverse_k, solid)
    longer = math("MULTIPLY", "c (Re q - c)", cosine, excess(build, wave))
    # Absorption cannot encode a negative delay (n < 1).
    delay = math(
        "MULTIPLY", "c (Re q - c) / k", math("MAXIMUM", "from 0 up", longer, 0.0), any_inverse_k
    )
    interior(build, alpha, delay, "c (Re q - c) / k")


RADAR_PHYSICAL = GroupDefinition(
    kind=KIND,
    name="Radar Material, physical",
    version=8,
    description=(
        "Smooth or rough surface of a medium of complex index n + j kappa, with Fresnel losses, "
        "absorption and delay at the angle of the wave inside"
    ),
    sockets=(
        SURFACE,
        VOLUME,
        float_input(INDEX, INDEX_AT_CARRIER, 2.3),
        float_input(
            EXTINCTION,
            "Imaginary part kappa of the complex index at the carrier (no unit), physical: power "
            "falls as exp(-4 pi kappa d / wavelength) with the depth d. Set from the medium",
            0.0,
        ),
        factor_input(
            ROUGHNESS,
            "Roughness of the surface as Cycles takes it: roughness^2 = alpha = sqrt(2) x RMS "
            "slope. 0 is a mirror, which returns no echo to a point antenna",
            0.0,
        ),
        factor_input(
            TRANSMISSION,
            "Factor on the power that passes each face, up to 60 degrees. Below 1 for rough "
            "surfaces, whose facets reflect more than a smooth face, so that power is conserved",
            1.0,
        ),
        factor_input(
            GRAZING_TRANSMISSION,
            "Factor on the power that passes each face at grazing incidence. Above 60 degrees the "
            "factor is linear in the cosine. Set from medium and roughness",
            1.0,
        ),
        factor_input(
            CLUTTER_ROW,
            "Place of the material's table of sigma0 in the image of all tables. 0 is a surface "
            "without a clutter model. Set by a run",
            0.0,
        ),
    ),
    draw=_draw,
)
