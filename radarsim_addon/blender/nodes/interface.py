# SPDX-License-Identifier: GPL-3.0-or-later
"""Power at a smooth interface between vacuum and a medium, by Math nodes in float32.

With c = cos(incidence) outside, s^2 = 1 - c^2, epsilon = (n + j kappa)^2 and
q = u + j v = sqrt(epsilon - s^2) (Born & Wolf, Principles of Optics, 14.2), the textbook

    r_s = (c - q) / (c + q),     r_p = r_s (s^2 - c q) / (s^2 + c q)

loses all digits in c - q for n near 1. Because (c - q)(c + q) = 1 - epsilon, it is equal to

    |r_s|^2 = |epsilon - 1|^2 / ((c + u)^2 + v^2)^2
    |r_p|^2 = |r_s|^2 ((c u - s^2)^2 + (c v)^2) / ((c u + s^2)^2 + (c v)^2)

with Re(epsilon - 1) = (n - 1)(n + 1) - kappa^2. No significant difference of nearly equal numbers
remains, from n = 1 (exactly 0) to n = kappa = 1e4, and up to grazing incidence. Their mean is the
unpolarised `reflectance`.

`interface_power` follows both polarisations through a layer (Born & Wolf 1.5.2, 14.2):

    entering  t   = 1 - |r|^2       t_s = 4 c u / |c + q|^2
                                    t_p = 4 c Re(epsilon q*) / |epsilon c + q|^2
    there and back |1 - r^2|        d_s = 4 c |q| / |c + q|^2
                                    d_p = 4 c |epsilon q| / |epsilon c + q|^2

A wave with the fractions w_s and w_p of its power in the two polarisations enters with the power
T_in = w_s t_s + w_p t_p. The fractions inside differ from those outside. In a lossy medium the
power that leaves is not 1 - |r|^2 of the incident power, because the incident and the reflected
wave interfere. After j reflections inside, with v_i = w_i R_i^j,

    T_out = sum v_i d_i^2 / sum v_i t_i,       R_out = sum v_i t_i R_i / sum v_i t_i

The product of these factors over all faces of a path is the mean of the series of both
polarisations, sum w_i d_i^2 R_i^j. Without loss T_in + R_in = 1 and T_out + R_out = 1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ...signal.scene.surface import OPAQUE_BELOW_TRANSMITTANCE
from . import attributes
from .build import Source, TreeBuilder


def cos_incidence(build: TreeBuilder) -> Any:
    """Add nodes for |Incoming . Normal|, the cosine of the angle outside, on both faces of a plate.

    Cycles' Fresnel node would invert the index on the back face.
    """
    geometry = build.node("ShaderNodeNewGeometry", "Geometry").outputs
    dot = build.dot("I . N", geometry["Incoming"], geometry["Normal"])
    return build.math("ABSOLUTE", "c = |I . N|", dot, clamp=True)


def reflectance(build: TreeBuilder, n: Source, kappa: Source, cosine: Source) -> Any:
    """Add nodes for F, the mean of |r_s|^2 and |r_p|^2 at an index n + j kappa, from vacuum."""
    math = build.math
    # epsilon - 1 = excess + 2j product
    below = math("SUBTRACT", "n - 1", n, 1.0)
    above = math("ADD", "n + 1", n, 1.0)
    real_part = math("MULTIPLY", "(n - 1)(n + 1)", below, above)
    kappa2 = math("MULTIPLY", "kappa^2", kappa, kappa)
    excess = math("SUBTRACT", "Re(epsilon - 1)", real_part, kappa2)
    product = math("MULTIPLY", "n kappa", n, kappa)
    imaginary = math("MULTIPLY", "Im epsilon", product, 2.0)

    cosine2 = math("MULTIPLY", "c^2", cosine, cosine)
    sine2 = math("SUBTRACT", "s^2", 1.0, cosine2)

    # q^2 = epsilon - s^2 = (epsilon - 1) + c^2. The larger part of q comes from the root, the
    # smaller from u v = n kappa: neither cancels.
    z_real = math("ADD", "Re q^2", excess, cosine2)
    z_abs = _length(build, "|q^2|", z_real, imaginary)
    z_real_abs = math("ABSOLUTE", "|Re q^2|", z_real)
    double = math("ADD", "|q^2| + |Re q^2|", z_abs, z_real_abs)
    half = math("MULTIPLY", "(|q^2| + |Re q^2|) / 2", double, 0.5)
    larger = math("SQRT", "larger part of q", half)
    smaller = math("DIVIDE", "smaller part of q", product, larger)
    refracting = math("GREATER_THAN", "Re q^2 > 0", z_real, 0.0)
    u = build.select("u = Re q", refracting, smaller, larger)
    v = build.select("v = Im q", refracting, larger, smaller)

    v2 = math("MULTIPLY", "v^2", v, v)
    sum_cu = math("ADD", "c + u", cosine, u)
    denominator = math("MULTIPLY_ADD", "|c + q|^2", sum_cu, sum_cu, v2)
    numerator = _length(build, "|epsilon - 1|", excess, imaginary)
    amplitude_s = math("DIVIDE", "|r_s|", numerator, denominator)
    power_s = math("MULTIPLY", "|r_s|^2", amplitude_s, amplitude_s)

    cu = math("MULTIPLY", "c u", cosine, u)
    cv = math("MULTIPLY", "c v", cosine, v)
    cv2 = math("MULTIPLY", "(c v)^2", cv, cv)
    minus = math("SUBTRACT", "c u - s^2", cu, sine2)
    plus = math("ADD", "c u + s^2", cu, sine2)
    top = math("MULTIPLY_ADD", "|c q - s^2|^2", minus, minus, cv2)
    bottom = math("MULTIPLY_ADD", "|c q + s^2|^2", plus, plus, cv2)
    ratio = math("DIVIDE", "|r_p|^2 / |r_s|^2", top, bottom)
    double_mean = math("MULTIPLY_ADD", "|r_s|^2 + |r_p|^2", power_s, ratio, power_s)
    return math("MULTIPLY", "F", double_mean, 0.5, clamp=True)


def transmittance(build: TreeBuilder, n: Source, kappa: Source, power: Source) -> Any:
    """Add nodes for 1 - F, and 0 for a conductor.

    An index of 1e4 + j1e4 transmits 2e-4, so Cycles would trace rays behind every metal face.
    """
    open_ = is_open(build, n, kappa)
    rest = build.math("SUBTRACT", "1 - F", 1.0, power, clamp=True)
    return build.math("MULTIPLY", "T", rest, open_)


def is_open(build: TreeBuilder, n: Source, kappa: Source) -> Any:
    """Add nodes for 1, or 0 for a conductor; see `transmittance`."""
    math = build.math
    above = math("ADD", "n + 1 (T)", n, 1.0)
    kappa2 = math("MULTIPLY", "kappa^2 (T)", kappa, kappa)
    bottom = math("MULTIPLY_ADD", "(n + 1)^2 + kappa^2", above, above, kappa2)
    four_n = math("MULTIPLY", "4 n", n, 4.0)
    normal = math("DIVIDE", "1 - F at normal incidence", four_n, bottom)
    return math("GREATER_THAN", "not a conductor", normal, OPAQUE_BELOW_TRANSMITTANCE)


def _length(build: TreeBuilder, label: str, x: Source, y: Source) -> Any:
    """Add nodes for sqrt(x^2 + y^2)."""
    y2 = build.math("MULTIPLY", f"{label}: imaginary^2", y, y)
    total = build.math("MULTIPLY_ADD", f"{label}^2", x, x, y2)
    return build.math("SQRT", label, total)


class Pair(NamedTuple):
    """A complex number: real and imaginary part, sockets or constants."""

    re: Source
    im: Source


def product(build: TreeBuilder, label: str, a: Pair, b: Pair) -> Pair:
    """Add nodes for a b."""
    math = build.math
    cross = math("MULTIPLY", f"{label}: im im", a.im, b.im)
    re = math("SUBTRACT", f"Re {label}", math("MULTIPLY", f"{label}: re re", a.re, b.re), cross)
    other = math("MULTIPLY", f"{label}: im re", a.im, b.re)
    return Pair(re, math("MULTIPLY_ADD", f"Im {label}", a.re, b.im, other))


def scaled(build: TreeBuilder, label: str, a: Pair, factor: Source) -> Pair:
    return Pair(
        build.math("MULTIPLY", f"Re {label}", a.re, factor),
        build.math("MULTIPLY", f"Im {label}", a.im, factor),
    )


def total(build: TreeBuilder, label: str, a: Pair, b: Pair) -> Pair:
    return Pair(
        build.math("ADD", f"Re {label}", a.re, b.re), build.math("ADD", f"Im {label}", a.im, b.im)
    )


def difference(build: TreeBuilder, label: str, a: Pair, b: Pair) -> Pair:
    return Pair(
        build.math("SUBTRACT", f"Re {label}", a.re, b.re),
        build.math("SUBTRACT", f"Im {label}", a.im, b.im),
    )


def power(build: TreeBuilder, label: str, a: Pair) -> Any:
    """Add nodes for |a|^2."""
    im2 = build.math("MULTIPLY", f"{label}: im^2", a.im, a.im)
    return build.math("MULTIPLY_ADD", label, a.re, a.re, im2)


class Wave(NamedTuple):
    """Sockets with the wave inside a medium; u + j v is its wave vector's normal part over k0."""

    #: Re(epsilon) - 1
    excess: Any
    epsilon_im: Any
    #: Outside.
    cosine: Source
    u: Source
    v: Source


class InterfacePower(NamedTuple):
    """Fractions of the power that meets a face from the ray's side, as the run polarises."""

    reflected: Source
    #: A colour, see `passed_by_channel`.
    passed: Source
    #: The unpolarised reflectance from outside, as a Metallic BSDF has it.
    reference: Any


def wave_inside(build: TreeBuilder, n: Source, kappa: Source, cosine: Source) -> Wave:
    """Add nodes for q = sqrt(epsilon - 1 + c^2), epsilon = (n + j kappa)^2, exact near n = 1."""
    math = build.math
    below = math("SUBTRACT", "n - 1", n, 1.0)
    above = math("ADD", "n + 1", n, 1.0)
    product = math("MULTIPLY", "(n - 1)(n + 1)", below, above)
    kappa2 = math("MULTIPLY", "kappa^2", kappa, kappa)
    excess = math("SUBTRACT", "Re(epsilon) - 1", product, kappa2)
    n_kappa = math("MULTIPLY", "n kappa", n, kappa)
    imaginary = math("MULTIPLY", "Im epsilon", n_kappa, 2.0)
    q2_real = math("MULTIPLY_ADD", "Re q^2", cosine, cosine, excess)
    q2_abs = build.modulus("|q^2|", q2_real, imaginary)
    q2_real_abs = math("ABSOLUTE", "|Re q^2|", q2_real)
    half = math("MULTIPLY", "half", math("ADD", "|q^2| + |Re q^2|", q2_abs, q2_real_abs), 0.5)
    larger = math("SQRT", "larger part of q", half)
    smaller = math("DIVIDE", "smaller part of q", n_kappa, larger)
    refracting = math("GREATER_THAN", "Re q^2 > 0", q2_real, 0.0)
    u = build.select("u = Re q", refracting, smaller, larger)
    v = build.select("v = Im q", refracting, larger, smaller)
    return Wave(excess, imaginary, cosine, u, v)


class _Power(NamedTuple):
    """Sockets for one polarisation: t, d and R of the module's docstring."""

    entering: Any
    there_and_back: Source
    reflected: Source


def interface_power(
    build: TreeBuilder, n: Source, kappa: Source, wave: Wave, echoes: Any
) -> InterfacePower:
    """Add nodes for the power at a face that is hit from outside (front) or inside (back).

    `echoes` is j, the number of earlier reflections inside.
    """
    math = build.math
    s, p, ratio = _powers(build, wave)
    weight_s, weight_p = polarisation(build)
    # v_i over R_s^j, which cancels: R_p is never more than R_s.
    left_p = math("MULTIPLY", "v_p", weight_p, math("POWER", "(R_p / R_s)^j", ratio, echoes))

    def weighted(label: str, factor_p: Any, of_s: Any, of_p: Any) -> Any:
        part_p = math("MULTIPLY", f"p of {label}", factor_p, of_p)
        return math("MULTIPLY_ADD", label, weight_s, of_s, part_p)

    entering = weighted("T_in", weight_p, s.entering, p.entering)
    reflected_in = weighted("R_in", weight_p, s.reflected, p.reflected)
    arriving = weighted("sum v t", left_p, s.entering, p.entering)
    square_s = math("MULTIPLY", "d_s^2", s.there_and_back, s.there_and_back)
    square_p = math("MULTIPLY", "d_p^2", p.there_and_back, p.there_and_back)
    both = weighted("sum v d^2", left_p, square_s, square_p)
    inside = weighted(
        "sum v t R",
        left_p,
        math("MULTIPLY", "t_s R_s", s.entering, s.reflected),
        math("MULTIPLY", "t_p R_p", p.entering, p.reflected),
    )
    leaving = math("DIVIDE", "T_out", both, arriving)
    reflected_out = math("DIVIDE", "R_out", inside, arriving)
    back = build.node("ShaderNodeNewGeometry", "Side").outputs["Backfacing"]
    passed = build.select("T", back, entering, leaving)
    by_s, by_p = (
        build.select(
            f"T_{name}",
            back,
            one.entering,
            math("DIVIDE", f"d_{name}^2 / t_{name}", square, one.entering),
        )
        for name, one, square in (("s", s, square_s), ("p", p, square_p))
    )
    # Echoes between the faces of a layer keep the polarisation that entered it.
    entered = math("LESS_THAN", "no echo inside", echoes, 0.5)
    by_channel = passed_by_channel(build, passed, by_s, by_p, entered)
    reflected = build.select("R", back, reflected_in, reflected_out)
    total = math("ADD", "R_s + R_p", s.reflected, p.reflected)
    return InterfacePower(
        reflected=math("MINIMUM", "R, at most 1", reflected, 1.0),
        passed=build.scale("T, or 0 for a conductor", by_channel, is_open(build, n, kappa)),
        reference=math("MULTIPLY", "F", total, 0.5, clamp=True),
    )


def passed_by_channel(
    build: TreeBuilder, mean: Any, s: Source, p: Source, allowed: Any = 1.0
) -> Any:
    """Add nodes for the passing power as a colour: the mean, or each polarisation by itself.

    See `attributes.ATTR_BY_POLARISATION`; where `allowed` is 0 it is the mean in any case.
    """
    math = build.math
    asked = build.scene_attribute(attributes.ATTR_BY_POLARISATION)
    chosen = math("MULTIPLY", "by polarisation", asked, allowed)
    bounces = build.node("ShaderNodeLightPath", "Way of the path").outputs["Ray Depth"]
    first_way = math("LESS_THAN", "from the receiver", bounces, 0.5)
    green = build.select("T on the way from the receiver", first_way, p, s)
    blue = build.select("T on the way to the transmitter", first_way, s, p)
    channels = enumerate((("R", p), ("G", green), ("B", blue)))
    inputs = {i: build.select(f"T in {name}", chosen, mean, t) for i, (name, t) in channels}
    return build.node("ShaderNodeCombineXYZ", "T by channel", inputs).outputs[0]


def _powers(build: TreeBuilder, wave: Wave) -> tuple[_Power, _Power, Any]:
    """Add nodes for t, d and R of the s and the p polarisation, and for R_p / R_s."""
    math = build.math
    excess, eps_im, c, u, v = wave
    eps_re = math("ADD", "Re epsilon", excess, 1.0)
    four_c = math("MULTIPLY", "4 c", c, 4.0)
    q_abs = build.modulus("|q|", u, v)
    eps_abs = build.modulus("|epsilon|", eps_re, eps_im)

    sum_s = build.sum_of_squares("|c + q|^2", math("ADD", "c + u", c, u), v)
    enter_s = _quotient(build, "t_s", four_c, u, sum_s)
    both_s = _quotient(build, "d_s", four_c, q_abs, sum_s)
    contrast = build.modulus("|epsilon - 1|", excess, eps_im)
    r_s = math("DIVIDE", "|r_s|", contrast, sum_s)
    power_s = math("MULTIPLY", "R_s", r_s, r_s)

    sum_p_re = math("MULTIPLY_ADD", "Re(epsilon c + q)", eps_re, c, u)
    sum_p_im = math("MULTIPLY_ADD", "Im(epsilon c + q)", eps_im, c, v)
    sum_p = build.sum_of_squares("|epsilon c + q|^2", sum_p_re, sum_p_im)
    flux = math("MULTIPLY_ADD", "Re(epsilon q*)", eps_re, u, math("MULTIPLY", "e v", eps_im, v))
    enter_p = _quotient(build, "t_p", four_c, flux, sum_p)
    eps_q = math("MULTIPLY", "|epsilon q|", eps_abs, q_abs)
    both_p = _quotient(build, "d_p", four_c, eps_q, sum_p)
    sine2 = math("SUBTRACT", "s^2", 1.0, math("MULTIPLY", "c^2", c, c))
    cu = math("MULTIPLY", "c u", c, u)
    cv = math("MULTIPLY", "c v", c, v)
    top = build.sum_of_squares("|c q - s^2|^2", math("SUBTRACT", "c u - s^2", cu, sine2), cv)
    bottom = build.sum_of_squares("|c q + s^2|^2", math("ADD", "c u + s^2", cu, sine2), cv)
    ratio = math("DIVIDE", "R_p / R_s", top, bottom)
    power_p = math("MULTIPLY", "R_p", power_s, ratio)
    return _Power(enter_s, both_s, power_s), _Power(enter_p, both_p, power_p), ratio


def excess(build: TreeBuilder, wave: Wave) -> Any:
    """Add nodes for Re q - c = Re((epsilon - 1)/(q + c)), which is exact near n = 1."""
    math = build.math
    re = math("ADD", "Re(q + c)", wave.u, wave.cosine)
    v2 = math("MULTIPLY", "Im(q + c)^2", wave.v, wave.v)
    bottom = math("MULTIPLY_ADD", "|q + c|^2", re, re, v2)
    lossy = math("MULTIPLY", "Im(epsilon) Im(q)", wave.epsilon_im, wave.v)
    top = math("MULTIPLY_ADD", "Re((epsilon - 1)(q + c)*)", wave.excess, re, lossy)
    return math("DIVIDE", "Re q - c", top, bottom)


def polarisation(build: TreeBuilder) -> tuple[Any, Any]:
    """Add nodes for the fractions w_s and w_p of the power in the two polarisations.

    One half each for an unpolarised wave. Else, with the ray I, the normal N and the vertical Z,
    w_s of a horizontally polarised wave is the squared cosine between I x Z and I x N.
    """
    math = build.math
    geometry = build.node("ShaderNodeNewGeometry", "Wave front")
    ray, normal = geometry.outputs["Incoming"], geometry.outputs["Normal"]
    across = build.vector_math("CROSS_PRODUCT", "I x N", {0: ray, 1: normal})
    level = build.vector_math("CROSS_PRODUCT", "I x Z", {0: ray, 1: (0.0, 0.0, 1.0)})

    product = build.dot("(I x N).(I x Z)", across, level)
    across2 = build.dot("|I x N|^2", across, across)
    lengths = math("MULTIPLY", "lengths^2", across2, build.dot("|I x Z|^2", level, level))
    product2 = math("MULTIPLY", "product^2", product, product)
    horizontal = math("DIVIDE", "w_s of H", product2, lengths, clamp=True)
    requested = build.scene_attribute(attributes.ATTR_POLARISATION)
    is_horizontal = math("GREATER_THAN", "H asked", requested, 1.5)
    is_vertical = math("GREATER_THAN", "V or H asked", requested, 0.5)
    vertical = math("SUBTRACT", "w_s of V", 1.0, horizontal)
    one = build.select("w_s of V or H", is_horizontal, vertical, horizontal)
    weight_s = build.select("w_s", is_vertical, 0.5, one)
    return weight_s, math("SUBTRACT", "w_p", 1.0, weight_s)


def _quotient(build: TreeBuilder, label: str, four_c: Any, factor: Source, bottom: Any) -> Any:
    top = build.math("MULTIPLY", f"{label}, numerator", four_c, factor)
    return build.math("DIVIDE", label, top, bottom)
