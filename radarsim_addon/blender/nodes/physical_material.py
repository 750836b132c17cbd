# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar Material, physical, and Radar Sheet: media of complex index n + j kappa.

Surface::

    smooth     Glossy, sharp          code R
    rough      Metallic (conductor)   code F(half vector), Beckmann: Kirchhoff's model in its
                                      geometric-optics limit
               Glossy                 code F(0), instead, up to Blender 4.5
    either     Diffuse                code rho, with a clutter model
               Transparent            T x transmission  (not encoded: Ray Length continues)

R and T are those of `interface`, for the polarisation of the run. The Metallic BSDF
evaluates Fresnel's equations at the facet that reflects, but has no colour input. The group
therefore has three of them, each with the index in one channel and vacuum (F = 0) in the others,
mixed with black by the code of that channel. Where the world encodes the range, one is enough.
From inside, their unpolarised F is scaled by R/F.

The clutter lobe returns a given sigma0 towards the radar, by grazing angle: a Diffuse BSDF whose
albedo depends on the direction that it is seen from::

    rho = sigma0(psi) / (4 |I . N| |I . Ng|),    psi = asin |I . N|

with I the way to the receiver, N the smooth and Ng the true normal: Cycles' cosine and the area
that a pixel covers cancel both. sigma0 is in dB in a row of an image, linear over
u = (psi / 90 degrees)^(1/3), which leaves 2e-4 dB down to 0.05 degrees. The albedo may be above 1
where the receiver looks; elsewhere it is limited to 1, so that power cannot build up between
surfaces. `paths.clutter_weights` corrects bistatic paths and those of higher orders.

Volume, per Blender unit along a ray, with c the cosine outside to the layer's normal and
q = sqrt(epsilon - 1 + c^2)::

    B: alpha = 4 pi Im(q) c / wavelength
    R: alpha + c (Re q - c)/k         G: alpha + 2 c (Re q - c)/k

A ray crosses a layer of thickness d over the length d/c, which gives the refracted wave's
absorption exp(-2 k0 Im(q) d) and optical delay d (Re q - c). Without a layer normal c is 1, which
gives 4 pi kappa / wavelength and n - 1. In a shell, and in a layer that has its interior at its
faces, the volume does nothing, and each face has the factors of half of the wall behind it.

Radar Sheet is a thin pane as one face, with the interference of all internal echoes. With g = 1 for
s and epsilon for p polarisation, and E = exp(2 j k0 q d), the slab's amplitudes (Airy; Born and
Wolf 7.6, 14.4) are::

    D = 4 g c q + (g c - q)^2 (1 - E)
    |t|^2 = |4 g c q|^2 |E| / |D|^2        |r|^2 = |(g c)^2 - q^2|^2 |1 - E|^2 / |D|^2

The polarisation is that of the run. The code of the transmitted wave is that of the optical delay
d (Re q - c). Both sides are the same.
"""

from __future__ import annotations

import math as _math
from typing import Any, NamedTuple

import numpy as np

from ...arrays import Real
from ...physics.rough import RAMP_BELOW
from ...signal.scene import SMOOTH_BELOW
from . import attributes
from .build import GroupDefinition, Source, TreeBuilder, factor_input, float_input
from .interface import (
    Pair,
    Wave,
    cos_incidence,
    difference,
    excess,
    interface_power,
    passed_by_channel,
    polarisation,
    power,
    product,
    scaled,
    total,
    wave_inside,
)
from .radar_material import (
    EXTINCTION,
    INDEX,
    INDEX_AT_CARRIER,
    ROUGHNESS,
    SURFACE,
    TRANSMISSION,
    VOLUME,
    any_inverse_code_length,
    camera_lobes,
    interior,
    inverse_code_length,
    range_code,
    ray_length,
    wavelength,
)

#: Input of a group: place of its table in the image, 0 to 1; 0 for none.
CLUTTER_ROW = "Clutter Row"
#: Name of the node that reads the image; a run gives it one.
TABLE_NODE = "Clutter tables"
TABLE_WIDTH = 1024
#: Cycles drops a closure whose weight, the mean of its channels, is less than this.
VANISHES_BELOW = 1e-5


def table_angles_rad() -> Real:
    """Return the grazing angles of the columns of a table, (TABLE_WIDTH,) [rad]."""
    return np.pi / 2 * ((np.arange(TABLE_WIDTH) + 0.5) / TABLE_WIDTH) ** 3


def add_clutter_lobe(build: TreeBuilder, code: Source, reflects: Source) -> Any:
    """Add nodes for the lobe, encoded by `code`; 0 where `reflects` is, or without a table."""
    math = build.math
    with build.prefixed("Clutter: "):
        row = build.group_input(CLUTTER_ROW)
        geometry = build.node("ShaderNodeNewGeometry", "Geometry").outputs
        sines = []
        for name, output in (("N", "Normal"), ("Ng", "True Normal")):
            dot = build.dot(f"I . {name}", geometry["Incoming"], geometry[output])
            sines.append(math("ABSOLUTE", f"|I . {name}|", dot))
        sine, true_sine = sines
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


#: Internal echoes after which the ratio of the two polarisations no longer changes.
MOST_ECHOES = 8.0
#: A ray of at most this times the path length across the layer began between its faces. Cycles
#: computes positions to 1e-7 of the mesh's size: for a pane of 5 mm, 100 m wide, 2e-3 of its
#: thickness.
STARTED_INSIDE_WITHIN = 1.02
#: Least cosine between a layer's normal and those of its two faces; its rim is beyond.
SAME_PLANE = 0.9998


class Wall(NamedTuple):
    """Sockets for a wall whose interior its faces stand for; depths across it [Blender units]."""

    #: Of the ray outside to the wall's normal.
    cosine: Source
    #: Depth for a ray that goes through the face, 0 in other objects; negative at some rims.
    passed: Source
    #: Depth for a ray that turns back inside, 0 in other objects.
    turned: Source


def wall_at_face(build: TreeBuilder, face_cosine: Source) -> Wall:
    """Add nodes for the wall behind a face that a ray meets.

    Each face stands for the half of the wall next to it. A face at the rim of a layer stands for
    the part of the ray inside the wall that the other faces count too much or too little.
    """
    math = build.math
    geometry = build.node("ShaderNodeNewGeometry", "Face of the wall").outputs
    back = geometry["Backfacing"]
    common = _first(build, "Shell thickness", attributes.OBJECT_SHELL_THICKNESS)
    own = build.face_attribute("Wall thickness", attributes.FACE_WALL_THICKNESS)
    known = math("GREATER_THAN", "face has its own", own, 0.0)
    own = math("MULTIPLY", "own, in a shell", own, math("GREATER_THAN", "shell", common, 0.0))
    own = build.select("Thickness of the wall", known, common, own)
    # The object, or an instance, may be scaled, by axes.
    upright = _to_object(build, "Normal, object", geometry["Normal"], "NORMAL")
    upright = build.vector_math("NORMALIZE", "Unit normal, object", {0: upright})
    local = _to_object(build, "Normal in object units", geometry["Normal"])
    length = build.dot("1 / scale", upright, local)
    shell = math("DIVIDE", "Shell thickness, scaled", own, length)

    given = build.object_vector_attribute("Faces of the layer", attributes.OBJECT_LAYER_AT_FACES)
    faces = build.node("ShaderNodeSeparateXYZ", "Faces", {0: given}).outputs
    own_normal, normal = _layer_normals(build, faces["X"])
    per_length = build.dot(
        "1 / scale across", own_normal, _to_object(build, "Layer normal, object", normal)
    )
    scale = math("DIVIDE", "scale across, or 0", faces["X"], per_length)
    thickness = _first(build, "Thickness of the layer", attributes.OBJECT_LAYER_THICKNESS)
    thickness = math("MULTIPLY", "Layer thickness, scaled", thickness, scale)
    place = _to_object(build, "Place in the object", geometry["Position"], "POINT")
    height = math("SUBTRACT", "height", build.dot("height, object", place, own_normal), faces["Y"])
    height = math("MULTIPLY", "height over the middle", height, scale)
    towards = build.dot("I . layer normal (wall)", geometry["Incoming"], normal)
    along = math("MULTIPLY", "height along the ray", height, math("SIGN", "sign", towards))
    outward = math("MULTIPLY_ADD", "1 into, -1 out of", back, -2.0, 1.0)
    rim = math("MULTIPLY", "across, at the rim", along, outward)
    across = build.dot("N . layer normal", geometry["Normal"], normal)
    across = math("ABSOLUTE", "|N . layer normal|", across)
    in_plane = math("GREATER_THAN", "a face, not the rim", across, SAME_PLANE)

    whole = math("ADD", "shell or layer thickness", shell, thickness)
    half = math("MULTIPLY", "half of the wall", whole, 0.5)
    is_layer = math("GREATER_THAN", "layer at faces", faces["X"], 0.5)
    at_rim = math("MULTIPLY", "rim", is_layer, math("SUBTRACT", "not a face", 1.0, in_plane))
    passed = build.select("across, this face", at_rim, half, rim)
    # No colour of a facet exceeds 1: echoes of the rim's inside near the front come out too weak.
    twice = math("MULTIPLY", "twice", math("MAXIMUM", "from 0 up", passed, 0.0), 2.0)
    turned = math("MULTIPLY", "across and back", twice, back)
    cosine = math("ABSOLUTE", "c to the wall, layer", towards, clamp=True)
    return Wall(build.select("c to the wall", is_layer, face_cosine, cosine), passed, turned)


def _first(build: TreeBuilder, label: str, name: str) -> Any:
    """Add nodes for the first number of a custom property of the object, 0 without one."""
    vector = build.object_vector_attribute(label, name)
    return build.node("ShaderNodeSeparateXYZ", f"{label}, number", {0: vector}).outputs["X"]


def _layer_normals(build: TreeBuilder, given: Any) -> tuple[Any, Any]:
    """Add nodes for the object's unit layer normal in its own axes and in the world's.

    It is the Z axis where `given` is 0: without any normal, all would be NaN.
    """
    normal = build.object_vector_attribute("Layer normal (wall)", attributes.OBJECT_LAYER_NORMAL)
    normal = build.scale("Layer normal, or nothing", normal, given)
    missing = build.math("SUBTRACT", "no layer", 1.0, given)
    axis = build.node("ShaderNodeCombineXYZ", "Z, or nothing", {2: missing}).outputs[0]
    normal = build.vector_math("ADD", "Layer normal, or Z", {0: normal, 1: axis})
    unit = build.vector_math("NORMALIZE", "Unit layer normal, own axes", {0: normal})
    world = build.node(
        "ShaderNodeVectorTransform",
        "Layer normal of the wall, world",
        {0: unit},
        vector_type="NORMAL",
        convert_from="OBJECT",
        convert_to="WORLD",
    ).outputs[0]
    return unit, build.vector_math("NORMALIZE", "Unit layer normal of the wall", {0: world})


def _to_object(build: TreeBuilder, label: str, vector: Any, kind: str = "VECTOR") -> Any:
    """Add a node that turns a vector or point of the world into the object's own units."""
    return build.node(
        "ShaderNodeVectorTransform",
        label,
        {0: vector},
        vector_type=kind,
        convert_from="WORLD",
        convert_to="OBJECT",
    ).outputs[0]


def layer_cosine(build: TreeBuilder) -> Any:
    """Add nodes for the cosine of the ray's angle to the object's layer normal, 1 without one."""
    math = build.math
    normal = build.object_vector_attribute("Layer normal", attributes.OBJECT_LAYER_NORMAL)
    world = build.node(
        "ShaderNodeVectorTransform",
        "Layer normal, world",
        {0: normal},
        vector_type="NORMAL",
        convert_from="OBJECT",
        convert_to="WORLD",
    ).outputs[0]
    unit = build.vector_math("NORMALIZE", "Unit layer normal", {0: world})
    ray = build.node("ShaderNodeNewGeometry", "Ray inside").outputs["Incoming"]
    dot = build.dot("I . layer normal", ray, unit)
    length = build.node(
        "ShaderNodeVectorMath", "|layer normal|", {0: normal}, operation="LENGTH"
    ).outputs["Value"]
    given = math("GREATER_THAN", "layer normal given", length, 0.5)
    cosine = math("ABSOLUTE", "|I . layer normal|", dot, clamp=True)
    return build.select("c to the layer", given, 1.0, cosine)


def internal_echoes(build: TreeBuilder) -> Any:
    """Add nodes for the number of earlier reflections between the faces of a layer, at most 8.

    A ray that began at a face inside counts the path's reflections; this is too many if the path
    met another object first. A ray that entered, or no layer thickness: 0.
    """
    math = build.math
    normal = build.object_vector_attribute("Layer normal (echoes)", attributes.OBJECT_LAYER_NORMAL)
    unit = build.vector_math("NORMALIZE", "Unit layer normal, object", {0: normal})
    thickness = build.object_vector_attribute("Layer thickness", attributes.OBJECT_LAYER_THICKNESS)
    across = build.node("ShaderNodeSeparateXYZ", "Thickness", {0: thickness}).outputs["X"]
    ray = build.node("ShaderNodeNewGeometry", "Ray (echoes)").outputs["Incoming"]
    # In the object's own units, so that its scale does not matter.
    local = _to_object(build, "Ray, object", ray)
    rise = build.dot("Rise per length", local, unit)
    path = build.node("ShaderNodeLightPath", "Path (echoes)").outputs
    crossed = math("MULTIPLY", "ray across", path["Ray Length"], math("ABSOLUTE", "rise", rise))
    limit = math("MULTIPLY", "thickness, and a little", across, STARTED_INSIDE_WITHIN)
    inside = math("LESS_THAN", "began inside", crossed, limit)
    bounces = math("MINIMUM", "bounces, at most", path["Ray Depth"], MOST_ECHOES)
    return math("MULTIPLY", "internal echoes", inside, bounces)


PHYSICAL_KIND = "radar_physical"
GRAZING_TRANSMISSION = "Grazing Transmission"


def _draw(build: TreeBuilder) -> None:
    n = build.group_input(INDEX)
    kappa = build.group_input(EXTINCTION)
    inverse_k = inverse_code_length(build)
    _draw_surface(build, n, kappa, inverse_k)
    _draw_volume(build, n, kappa, inverse_k)


def _draw_surface(build: TreeBuilder, n: Source, kappa: Source, inverse_k: Source) -> None:
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
    # The factor on F of the rough lobes is 0 or 1, or R / F from inside.
    back = build.node("ShaderNodeNewGeometry", "Side (lobes)").outputs["Backfacing"]
    inside = math("DIVIDE", "R / F", power.reflected, power.reference, clamp=True)
    ratio = build.select("1, or R / F from inside", back, 1.0, inside)
    weight = math("MULTIPLY", "rough, R / F", ratio, is_rough)
    weight = math("MULTIPLY", "rough, or 0 before the gate", weight, reflects)
    coded = math("GREATER_THAN", "coded by materials", inverse_k, 0.0)
    coded = math("MAXIMUM", "coded by channel", coded, in_shell)
    rough = _facet_lobes(build, n, kappa, roughness, code, weight, coded)
    # Below RAMP_BELOW the factor on T is linear in the cosine, to the grazing input.
    ramp = math("MULTIPLY_ADD", "ramp", cosine, -1.0 / RAMP_BELOW, 1.0, clamp=True)
    flat = math("SUBTRACT", "1 - ramp", 1.0, ramp)
    low = math("MULTIPLY", "grazing part", build.group_input(GRAZING_TRANSMISSION), ramp)
    factor = math("MULTIPLY_ADD", "factor on T", build.group_input(TRANSMISSION), flat, low)
    passed = build.scale("T, scaled", power.passed, factor)
    passed = build.vector_math("MULTIPLY", "T, wall crossed", {0: passed, 1: crossed})
    passed = build.scale("T, or 0 at the gate", passed, transmits)
    through = build.transparent("Transmission", passed)
    reflected = build.add_shaders("Reflection of the interface", mirror, rough)
    reflected = build.add_shaders("Reflection", reflected, add_clutter_lobe(build, code, reflects))
    build.group_output("Surface", build.add_shaders("Surface", reflected, through))


def _wall_crossed(
    build: TreeBuilder,
    n: Source,
    kappa: Source,
    face_cosine: Source,
    code: Source,
    inverse_k: Source,
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


def _facet_lobes(
    build: TreeBuilder,
    n: Source,
    kappa: Source,
    roughness: Source,
    code: Source,
    weight: Source,
    coded: Any,
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

    def in_channel(label: str, axis: int, value: Source, other: float) -> Any:
        inputs = {i: value if i == axis else other for i in range(3)}
        return build.node("ShaderNodeCombineXYZ", label, inputs).outputs[0]

    def with_lobe(label: str, before: Any, index: Any, extinction: Any, factor: Source) -> Any:
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


def _normal(build: TreeBuilder, n: Source, kappa: Source) -> Any:
    """Add nodes for F at normal incidence, ((n - 1)^2 + kappa^2) / ((n + 1)^2 + kappa^2)."""
    math = build.math
    kappa2 = math("MULTIPLY", "kappa^2 (F0)", kappa, kappa)
    below = math("SUBTRACT", "n - 1 (F0)", n, 1.0)
    above = math("ADD", "n + 1 (F0)", n, 1.0)
    top = math("MULTIPLY_ADD", "(n - 1)^2 + kappa^2 (F0)", below, below, kappa2)
    bottom = math("MULTIPLY_ADD", "(n + 1)^2 + kappa^2 (F0)", above, above, kappa2)
    return math("DIVIDE", "F(0)", top, bottom)


def _draw_volume(build: TreeBuilder, n: Source, kappa: Source, inverse_k: Source) -> None:
    math = build.math
    cosine = layer_cosine(build)
    with build.prefixed("Volume: "):
        # The object's faces absorb and delay in place of its volume if it has one of these.
        shell = _first(build, "Shell", attributes.OBJECT_SHELL_THICKNESS)
        layer = _first(build, "Layer at faces", attributes.OBJECT_LAYER_AT_FACES)
        either = math("ADD", "shell or layer", shell, layer)
        at_faces = math("GREATER_THAN", "interior at faces", either, 1e-30)
        solid = math("SUBTRACT", "interior in the volume", 1.0, at_faces)
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
    longer = math("MAXIMUM", "from 0 up", longer, 0.0)
    delay = math("MULTIPLY", "c (Re q - c) / k", longer, any_inverse_k)
    interior(build, alpha, delay, "c (Re q - c) / k")


RADAR_PHYSICAL = GroupDefinition(
    kind=PHYSICAL_KIND,
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


SHEET_KIND = "radar_sheet"
THICKNESS = "Thickness"


def _draw_sheet(build: TreeBuilder) -> None:
    math = build.math
    n, kappa = build.group_input(INDEX), build.group_input(EXTINCTION)
    thickness = build.group_input(THICKNESS)
    wave = wave_inside(build, n, kappa, cos_incidence(build))
    inverse_k = inverse_code_length(build)
    code = range_code(build, ray_length(build), inverse_k)
    reflects, transmits = camera_lobes(build)

    # E = exp(2 j k0 q d) and its modulus; 1 - E.
    turn = math("MULTIPLY", "2 k0 d", thickness, 4.0 * _math.pi)
    phase = math("MULTIPLY", "2 k0 d Re q", turn, wave.u)
    decay = math("MULTIPLY", "-2 k0 d Im q", math("MULTIPLY", "2 k0 d Im q", turn, wave.v), -1.0)
    modulus = math("EXPONENT", "|E|", decay)
    real = math("MULTIPLY", "Re E", modulus, math("COSINE", "cos", phase))
    imaginary = math("MULTIPLY", "Im E", modulus, math("SINE", "sin", phase))
    contrast = Pair(
        math("SUBTRACT", "Re(1 - E)", 1.0, real), math("MULTIPLY", "Im(1 - E)", imaginary, -1.0)
    )
    permittivity = Pair(math("ADD", "Re epsilon", wave.excess, 1.0), wave.epsilon_im)
    along_p = scaled(build, "epsilon c", permittivity, wave.cosine)
    passed_s, back_s = _slab(build, "s", Pair(wave.cosine, 0.0), wave, modulus, contrast)
    passed_p, back_p = _slab(build, "p", along_p, wave, modulus, contrast)
    weight_s, weight_p = polarisation(build)

    def mean(label: str, s: Source, p: Source) -> Any:
        both = math("MULTIPLY", f"p of {label}", weight_p, p)
        return math("MULTIPLY_ADD", label, weight_s, s, both, clamp=True)

    by_channel = passed_by_channel(build, mean("T", passed_s, passed_p), passed_s, passed_p)
    passed = build.scale("T, or 0 at the gate", by_channel, transmits)
    back = math("MULTIPLY", "R, or 0 before the gate", mean("R", back_s, back_p), reflects)

    # Delay d (Re q - c); Ray Length continues outside.
    depth = math("MULTIPLY", "d", thickness, wavelength(build))
    longer = math("MULTIPLY", "d (Re q - c)", depth, excess(build, wave))
    with build.prefixed("Delay: "):
        delay = range_code(build, longer, any_inverse_code_length(build, inverse_k))
    mirror_colour = build.scale("Mirror colour", code, back)
    delayed = build.vector_math("MULTIPLY", "Delayed", {0: delay, 1: passed})
    mirror = build.glossy("Mirror", mirror_colour, 0.0)
    through = build.transparent("Transmission", delayed)
    build.group_output("Surface", build.add_shaders("Surface", mirror, through))


def _slab(
    build: TreeBuilder, name: str, gc: Pair, wave: Wave, modulus: Any, contrast: Pair
) -> tuple[Any, Any]:
    """Add nodes for the transmitted and reflected power; gc is c for s, epsilon c for p."""
    math = build.math
    q = Pair(wave.u, wave.v)
    minus = difference(build, f"g c - q, {name}", gc, q)
    plus = total(build, f"g c + q, {name}", gc, q)
    both = scaled(build, f"4 g c q, {name}", product(build, f"g c q, {name}", gc, q), 4.0)
    inner = product(build, f"(g c - q)^2, {name}", minus, minus)
    echo = product(build, f"(g c - q)^2 (1 - E), {name}", inner, contrast)
    bottom = power(build, f"|D|^2, {name}", total(build, f"D, {name}", both, echo))
    passing = power(build, f"|4 g c q|^2, {name}", both)
    top = math("MULTIPLY", f"|4 g c q|^2 |E|, {name}", passing, modulus)
    outer = product(build, f"(g c)^2 - q^2, {name}", minus, plus)
    back = power(build, f"|r D|^2, {name}", product(build, f"r D, {name}", outer, contrast))
    return math("DIVIDE", f"T_{name}", top, bottom), math("DIVIDE", f"R_{name}", back, bottom)


RADAR_SHEET = GroupDefinition(
    kind=SHEET_KIND,
    name="Radar Sheet",
    version=3,
    description=(
        "A thin pane modelled as one face: all echoes between its two sides interfere. For panes, "
        "radomes and panels with a thickness of at most a few wavelengths"
    ),
    sockets=(
        SURFACE,
        float_input(INDEX, INDEX_AT_CARRIER, 2.5),
        float_input(
            EXTINCTION,
            "Imaginary part kappa of the complex index at the carrier (no unit), physical. Set "
            "from the material's medium whenever the carrier changes",
            0.0,
        ),
        float_input(
            THICKNESS,
            "Thickness of the pane in wavelengths in vacuum at the carrier. Set from the "
            "material's thickness in metres whenever the carrier changes",
            0.1,
            maximum=1e6,
        ),
    ),
    draw=_draw_sheet,
)
