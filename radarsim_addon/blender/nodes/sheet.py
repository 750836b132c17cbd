# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar Sheet: a thin pane as one face, with the interference of all internal echoes.

With q = sqrt(epsilon - 1 + c^2), g = 1 for s and epsilon for p polarisation, and
E = exp(2 j k0 q d), the slab's amplitudes (Airy; Born and Wolf 7.6, 14.4) are

    D = 4 g c q + (g c - q)^2 (1 - E)
    |t|^2 = |4 g c q|^2 |E| / |D|^2        |r|^2 = |(g c)^2 - q^2|^2 |1 - E|^2 / |D|^2

The polarisation is that of the run. The code of the transmitted wave is that of the optical delay
d (Re q - c). Both sides are the same.
"""

from __future__ import annotations

import math as _math
from typing import Any

from .build import GroupDefinition, TreeBuilder, float_input
from .complex_nodes import Pair, difference, power, product, scaled, total
from .fresnel import cos_incidence
from .interface import Wave, excess, passed_by_channel, polarisation, wave_inside
from .outputs import SURFACE, any_inverse_code_length, wavelength
from .radar_material import EXTINCTION, INDEX, INDEX_AT_CARRIER, camera_lobes
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
    weight_s, weight_p = polarisation(build)

    def mean(label: str, s: Any, p: Any) -> Any:
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
    draw=_draw,
)
