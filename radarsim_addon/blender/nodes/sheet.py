# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar Sheet: a thin pane as one face, with the interference of all its internal echoes.

With q = sqrt(epsilon - 1 + c^2), g = 1 for s and epsilon for p polarisation, and
E = exp(2 j k0 q d), the slab's amplitudes (Airy; Born and Wolf 7.6, 14.4) are

    D = 4 g c q + (g c - q)^2 (1 - E)
    |t|^2 = |4 g c q|^2 |E| / |D|^2        |r|^2 = |(g c)^2 - q^2|^2 |1 - E|^2 / |D|^2

Each is taken for the run's polarisation. The code of what passes is that of the optical delay
d (Re q - c). Both sides are alike.
"""

from __future__ import annotations

import math as _math
from typing import Any

from .build import GroupDefinition, SocketSpec, TreeBuilder
from .complex_nodes import Pair, difference, power, product, scaled, total
from .fresnel import cos_incidence
from .interface import Wave, excess, polarisation, wave_inside
from .outputs import SURFACE, wavelength
from .radar_material import EXTINCTION, INDEX, camera_lobes
from .range_encoding import inverse_code_length, range_code, ray_length

KIND = "radar_sheet"

THICKNESS = "Thickness"


def _draw(build: TreeBuilder) -> None:
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
    share_s, share_p = polarisation(build)

    def mean(label: str, s: Any, p: Any) -> Any:
        both = math("MULTIPLY", f"p of {label}", share_p, p)
        return math("MULTIPLY_ADD", label, share_s, s, both, clamp=True)

    passed = math("MULTIPLY", "T, or 0 at the gate", mean("T", passed_s, passed_p), transmits)
    back = math("MULTIPLY", "R, or 0 before the gate", mean("R", back_s, back_p), reflects)

    # Delay d (Re q - c); the code of the way outside runs on.
    depth = math("MULTIPLY", "d", thickness, wavelength(build))
    longer = math("MULTIPLY", "d (Re q - c)", depth, excess(build, wave))
    with build.prefixed("Delay: "):
        delay = range_code(build, longer, inverse_k)
    colours = []
    for label, colour, weight in (("Mirror colour", code, back), ("Delayed", delay, passed)):
        node = build.node(
            "ShaderNodeVectorMath", label, {0: colour, "Scale": weight}, operation="SCALE"
        )
        colours.append(node.outputs[0])
    mirror = build.node(
        "ShaderNodeBsdfAnisotropic",
        "Mirror",
        {"Color": colours[0], "Roughness": 0.0},
        distribution="BECKMANN",
    )
    through = build.node("ShaderNodeBsdfTransparent", "Transmission", {"Color": colours[1]})
    surface = build.node(
        "ShaderNodeAddShader", "Surface", {0: mirror.outputs[0], 1: through.outputs[0]}
    )
    build.group_output("Surface", surface.outputs[0])


def _slab(
    build: TreeBuilder, name: str, gc: Pair, wave: Wave, modulus: Any, contrast: Pair
) -> tuple[Any, Any]:
    """Transmitted and reflected power of one polarisation; gc is c for s, epsilon c for p."""
    math = build.math
    q = Pair(wave.u, wave.v)
    minus, plus = (
        difference(build, f"g c - q, {name}", gc, q),
        total(build, f"g c + q, {name}", gc, q),
    )
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
    kind=KIND,
    name="Radar Sheet",
    version=1,
    description=(
        "A thin pane modelled as one face: all echoes between its two sides interfere. For panes, "
        "radomes and panels whose thickness is a few wavelengths at most"
    ),
    sockets=(
        SURFACE,
        SocketSpec(
            INDEX,
            "INPUT",
            "NodeSocketFloat",
            "Real part n of the complex index of refraction at the carrier (no unit). Set from the "
            "material's medium whenever the carrier changes; a link here takes its place",
            default=2.5,
            minimum=0.0,
            maximum=1e5,
        ),
        SocketSpec(
            EXTINCTION,
            "INPUT",
            "NodeSocketFloat",
            "Imaginary part kappa of the complex index at the carrier (no unit), physical. Set "
            "from the material's medium whenever the carrier changes",
            default=0.0,
            minimum=0.0,
            maximum=1e5,
        ),
        SocketSpec(
            THICKNESS,
            "INPUT",
            "NodeSocketFloat",
            "Thickness of the pane in wavelengths in vacuum at the carrier. Set from the "
            "material's thickness in metres whenever the carrier changes",
            default=0.1,
            minimum=0.0,
            maximum=1e6,
        ),
    ),
    draw=_draw,
)
