# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar Material: reflection, transmission and absorption of radar power (Fig. 4, Eq. 2-3, 7).

Equations of Costa et al. A path segment of length r is encoded as the colour
(exp(-r/k), exp(-2r/k), 1), by materials and transmitter (Eq. 2-3).

Surface, with F the Fresnel reflectance of `interface.reflectance` and s the specularity::

    Glossy(Beckmann, roughness)  code F s
  + Diffuse                      code F (1 - s)
  + Transparent                  1 - F            (not encoded: Ray Length continues)

Volume, per Blender unit of depth, with alpha = 4 pi kappa / Lambda (Eq. 7)::

    B: alpha       R: alpha + (n - 1)/k       G: alpha + 2 (n - 1)/k

Red and green thus also encode the optical delay (n - 1) d of the depth d.

Ring Emitter: emission of the transmitter, a Point light, limited to one ring of ranges (Eq. 5). The
same light serves the sampling mode "paths". There, limits on the number of reflections and of
transparent surfaces leave one path per pixel, and the colour can encode the last scatterer of that
path.
"""

from __future__ import annotations

import math as _math
from typing import Any

from . import attributes
from .build import GroupDefinition, SocketSpec, Source, TreeBuilder, factor_input, float_input
from .interface import cos_incidence, reflectance, transmittance


def ray_length(build: TreeBuilder) -> Any:
    """Add nodes for the length of the ray, Blender units, across transparent surfaces."""
    return build.node("ShaderNodeLightPath", "Light Path").outputs["Ray Length"]


def range_code(build: TreeBuilder, length: Source, inverse_code_length: Any) -> Any:
    """Add nodes for the colour of a segment; white outside a measurement, where 1/k is 0.

    G is the square of R and not a second exponential, so that G B / R^2 = 1 holds to rounding for a
    single path.
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


def any_inverse_code_length(build: TreeBuilder, inverse_k: Source) -> Any:
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


KIND = "radar_material"
INDEX = "Index of Refraction"
EXTINCTION = "Extinction Coefficient"
SPECULARITY = "Specularity"
ROUGHNESS = "Roughness"
TRANSMISSION = "Transmission"

#: Tooltip of the index of groups that follow a medium.
INDEX_AT_CARRIER = (
    "Real part n of the complex index of refraction at the carrier (no unit). Set from the "
    "material's medium whenever the carrier changes; a link here replaces it"
)


def _draw(build: TreeBuilder) -> None:
    n = build.group_input(INDEX)
    kappa = build.group_input(EXTINCTION)
    specularity = build.group_input(SPECULARITY)
    roughness = build.group_input(ROUGHNESS)
    inverse_k = inverse_code_length(build)
    _draw_surface(build, n, kappa, specularity, roughness, inverse_k)
    _draw_volume(build, n, kappa, inverse_k)


def _draw_surface(
    build: TreeBuilder,
    n: Source,
    kappa: Source,
    specularity: Source,
    roughness: Source,
    inverse_k: Source,
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
    passes = transmittance(build, n, kappa, power)
    passed = math("MULTIPLY", "T, scaled", passes, build.group_input(TRANSMISSION))
    glossy = build.glossy("Specular lobe", specular_colour, roughness)
    lambert = build.node("ShaderNodeBsdfDiffuse", "Diffuse lobe", {"Color": diffuse_colour})
    passed = math("MULTIPLY", "1 - F, or 0 at it", passed, transmits)
    through = build.transparent("Transmission", passed)
    reflected = build.add_shaders("Reflection", glossy, lambert.outputs[0])
    build.group_output("Surface", build.add_shaders("Surface", reflected, through))


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


def _draw_volume(build: TreeBuilder, n: Source, kappa: Source, inverse_k: Source) -> None:
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


RING_EMITTER_KIND = "ring_emitter"


def _draw_ring_emitter(build: TreeBuilder) -> None:
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


def _vertex_colour(build: TreeBuilder, length: Source) -> Any:
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
    kind=RING_EMITTER_KIND,
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
    draw=_draw_ring_emitter,
)
