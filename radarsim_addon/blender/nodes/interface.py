# SPDX-License-Identifier: GPL-3.0-or-later
"""Power at a smooth interface for both polarisations, by Math nodes in float32.

Notation as in :mod:`.fresnel`: epsilon the permittivity, c the cosine outside, q = u + j v. For
each polarisation, without subtraction of nearly equal numbers (Born & Wolf 1.5.2, 14.2):

    entering  t   = 1 - |r|^2       t_s = 4 c u / |c + q|^2
                                    t_p = 4 c Re(epsilon q*) / |epsilon c + q|^2
    there and back |1 - r^2|        d_s = 4 c |q| / |c + q|^2
                                    d_p = 4 c |epsilon q| / |epsilon c + q|^2

A wave of shares w_s and w_p enters with the power T_in = w_s t_s + w_p t_p. Inside, its shares are
no longer those, and in a lossy medium the power that leaves is not 1 - |r|^2 of what arrives, as
incident and reflected wave interfere. After j reflections inside, with v_i = w_i R_i^j,

    T_out = sum v_i d_i^2 / sum v_i t_i,       R_out = sum v_i t_i R_i / sum v_i t_i

so that the product of all factors from the first face to the last is, passage by passage, the mean
of both polarisations' series, sum w_i d_i^2 R_i^j; and without loss nothing is created:
T_in + R_in = 1 and T_out + R_out = 1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from . import attributes
from .build import TreeBuilder
from .fresnel import is_open


class Wave(NamedTuple):
    """Sockets with the wave inside, at the outside angle of cosine c.

    excess, epsilon_im
        Re(epsilon) - 1 and Im(epsilon).
    u, v
        q = u + j v, normal component of the wave vector over k0.
    """

    excess: Any
    epsilon_im: Any
    cosine: Any
    u: Any
    v: Any


class InterfacePower(NamedTuple):
    """Sockets: shares of the power that arrives at a face, on the side where the ray comes from.

    reflected, passed
        Of the wave of this run's polarisation.
    reference
        Reflectance from outside of an unpolarised wave: what a Metallic BSDF evaluates.
    """

    reflected: Any
    passed: Any
    reference: Any


def wave_inside(build: TreeBuilder, n: Any, kappa: Any, cosine: Any) -> Wave:
    """q = sqrt(epsilon - 1 + c^2) for epsilon = (n + j kappa)^2, all digits kept near n = 1."""
    math = build.math
    below = math("SUBTRACT", "n - 1", n, 1.0)
    above = math("ADD", "n + 1", n, 1.0)
    product = math("MULTIPLY", "(n - 1)(n + 1)", below, above)
    kappa2 = math("MULTIPLY", "kappa^2", kappa, kappa)
    excess = math("SUBTRACT", "Re(epsilon) - 1", product, kappa2)
    n_kappa = math("MULTIPLY", "n kappa", n, kappa)
    imaginary = math("MULTIPLY", "Im epsilon", n_kappa, 2.0)
    q2_real = math("MULTIPLY_ADD", "Re q^2", cosine, cosine, excess)
    q2_abs = _length(build, "|q^2|", q2_real, imaginary)
    q2_real_abs = math("ABSOLUTE", "|Re q^2|", q2_real)
    half = math("MULTIPLY", "half", math("ADD", "|q^2| + |Re q^2|", q2_abs, q2_real_abs), 0.5)
    larger = math("SQRT", "larger part of q", half)
    smaller = math("DIVIDE", "smaller part of q", n_kappa, larger)
    refracting = math("GREATER_THAN", "Re q^2 > 0", q2_real, 0.0)
    u = build.select("u = Re q", refracting, smaller, larger)
    v = build.select("v = Im q", refracting, larger, smaller)
    return Wave(excess, imaginary, cosine, u, v)


def interface_power(
    build: TreeBuilder, n: Any, kappa: Any, wave: Wave, echoes: Any
) -> InterfacePower:
    """Reflected and passed power at a face that is hit from outside (front) or inside (back).

    `echoes` is j, how often the wave was reflected inside before.
    """
    math = build.math
    excess, eps_im, c, u, v = wave
    eps_re = math("ADD", "Re epsilon", excess, 1.0)
    four_c = math("MULTIPLY", "4 c", c, 4.0)
    q_abs = _length(build, "|q|", u, v)
    eps_abs = _length(build, "|epsilon|", eps_re, eps_im)

    sum_s_re = math("ADD", "c + u", c, u)
    sum_s = _square(build, "|c + q|^2", sum_s_re, v)
    enter_s = _share(build, "t_s", four_c, u, sum_s)
    both_s = _share(build, "d_s", four_c, q_abs, sum_s)
    contrast = _length(build, "|epsilon - 1|", excess, eps_im)
    r_s = math("DIVIDE", "|r_s|", contrast, sum_s)
    power_s = math("MULTIPLY", "R_s", r_s, r_s)

    sum_p_re = math("MULTIPLY_ADD", "Re(epsilon c + q)", eps_re, c, u)
    sum_p_im = math("MULTIPLY_ADD", "Im(epsilon c + q)", eps_im, c, v)
    sum_p = _square(build, "|epsilon c + q|^2", sum_p_re, sum_p_im)
    flux = math("MULTIPLY_ADD", "Re(epsilon q*)", eps_re, u, math("MULTIPLY", "e v", eps_im, v))
    enter_p = _share(build, "t_p", four_c, flux, sum_p)
    both_p = _share(build, "d_p", four_c, math("MULTIPLY", "|epsilon q|", eps_abs, q_abs), sum_p)
    ratio = _ratio_p(build, wave)
    power_p = math("MULTIPLY", "R_p", power_s, ratio)

    share_s, share_p = polarisation(build)
    # v_i over R_s^j, which cancels: R_p is never more than R_s.
    left_p = math("MULTIPLY", "v_p", share_p, math("POWER", "(R_p / R_s)^j", ratio, echoes))

    def weighted(label: str, weight_p: Any, s: Any, p: Any) -> Any:
        return math(
            "MULTIPLY_ADD", label, share_s, s, math("MULTIPLY", f"p of {label}", weight_p, p)
        )

    entering = weighted("T_in", share_p, enter_s, enter_p)
    reflected_in = weighted("R_in", share_p, power_s, power_p)
    arriving = weighted("sum v t", left_p, enter_s, enter_p)
    both = weighted(
        "sum v d^2",
        left_p,
        math("MULTIPLY", "d_s^2", both_s, both_s),
        math("MULTIPLY", "d_p^2", both_p, both_p),
    )
    inside = weighted(
        "sum v t R",
        left_p,
        math("MULTIPLY", "t_s R_s", enter_s, power_s),
        math("MULTIPLY", "t_p R_p", enter_p, power_p),
    )
    leaving = math("DIVIDE", "T_out", both, arriving)
    reflected_out = math("DIVIDE", "R_out", inside, arriving)
    back = build.node("ShaderNodeNewGeometry", "Side").outputs["Backfacing"]
    passed = build.select("T", back, entering, leaving)
    reflected = build.select("R", back, reflected_in, reflected_out)
    total = math("ADD", "R_s + R_p", power_s, power_p)
    return InterfacePower(
        reflected=math("MINIMUM", "R, at most 1", reflected, 1.0),
        passed=math("MULTIPLY", "T, or 0 for a conductor", passed, is_open(build, n, kappa)),
        reference=math("MULTIPLY", "F", total, 0.5, clamp=True),
    )


def _ratio_p(build: TreeBuilder, wave: Wave) -> Any:
    """|r_p|^2 / |r_s|^2 = |c q - s^2|^2 / |c q + s^2|^2."""
    math = build.math
    sine2 = math("SUBTRACT", "s^2", 1.0, math("MULTIPLY", "c^2", wave.cosine, wave.cosine))
    cu = math("MULTIPLY", "c u", wave.cosine, wave.u)
    cv = math("MULTIPLY", "c v", wave.cosine, wave.v)
    top = _square(build, "|c q - s^2|^2", math("SUBTRACT", "c u - s^2", cu, sine2), cv)
    bottom = _square(build, "|c q + s^2|^2", math("ADD", "c u + s^2", cu, sine2), cv)
    return math("DIVIDE", "R_p / R_s", top, bottom)


def excess(build: TreeBuilder, wave: Wave) -> Any:
    """Re q - c = Re((epsilon - 1)/(q + c)), which keeps its digits near n = 1."""
    math = build.math
    re = math("ADD", "Re(q + c)", wave.u, wave.cosine)
    bottom = math(
        "MULTIPLY_ADD", "|q + c|^2", re, re, math("MULTIPLY", "Im(q + c)^2", wave.v, wave.v)
    )
    top = math(
        "MULTIPLY_ADD",
        "Re((epsilon - 1)(q + c)*)",
        wave.excess,
        re,
        math("MULTIPLY", "Im(epsilon) Im(q)", wave.epsilon_im, wave.v),
    )
    return math("DIVIDE", "Re q - c", top, bottom)


def polarisation(build: TreeBuilder) -> tuple[Any, Any]:
    """Shares w_s and w_p of the wave: one half each, or from the plane of incidence.

    With I the ray, N the normal and Z the vertical, the field of a horizontally polarised wave
    lies along I x Z, that of an s-polarised one along I x N: w_s is the squared cosine between.
    """
    math = build.math
    geometry = build.node("ShaderNodeNewGeometry", "Wave front")
    ray, normal = geometry.outputs["Incoming"], geometry.outputs["Normal"]
    across = build.vector_math("CROSS_PRODUCT", "I x N", {0: ray, 1: normal})
    level = build.vector_math("CROSS_PRODUCT", "I x Z", {0: ray, 1: (0.0, 0.0, 1.0)})

    def dot(label: str, first: Any, second: Any) -> Any:
        node = build.node(
            "ShaderNodeVectorMath", label, {0: first, 1: second}, operation="DOT_PRODUCT"
        )
        return node.outputs["Value"]

    product = dot("(I x N).(I x Z)", across, level)
    lengths = math(
        "MULTIPLY", "lengths^2", dot("|I x N|^2", across, across), dot("|I x Z|^2", level, level)
    )
    horizontal = math(
        "DIVIDE", "w_s of H", math("MULTIPLY", "product^2", product, product), lengths, clamp=True
    )
    asked = build.scene_attribute(attributes.ATTR_POLARISATION)
    is_horizontal = math("GREATER_THAN", "H asked", asked, 1.5)
    is_vertical = math("GREATER_THAN", "V or H asked", asked, 0.5)
    vertical = math("SUBTRACT", "w_s of V", 1.0, horizontal)
    one = build.select("w_s of V or H", is_horizontal, vertical, horizontal)
    share_s = build.select("w_s", is_vertical, 0.5, one)
    return share_s, math("SUBTRACT", "w_p", 1.0, share_s)


def _share(build: TreeBuilder, label: str, four_c: Any, factor: Any, bottom: Any) -> Any:
    top = build.math("MULTIPLY", f"{label}, numerator", four_c, factor)
    return build.math("DIVIDE", label, top, bottom)


def _square(build: TreeBuilder, label: str, x: Any, y: Any) -> Any:
    """x^2 + y^2."""
    y2 = build.math("MULTIPLY", f"{label}: imaginary^2", y, y)
    return build.math("MULTIPLY_ADD", label, x, x, y2)


def _length(build: TreeBuilder, label: str, x: Any, y: Any) -> Any:
    """sqrt(x^2 + y^2)."""
    return build.math("SQRT", label, _square(build, f"{label}^2", x, y))
