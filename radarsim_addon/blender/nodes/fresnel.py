# SPDX-License-Identifier: GPL-3.0-or-later
"""Unpolarised Fresnel reflectance of a complex index of refraction, by Math nodes in float32.

With c = cos(incidence), s^2 = 1 - c^2, epsilon = (n + j kappa)^2 and
q = u + j v = sqrt(epsilon - s^2) (Born & Wolf, Principles of Optics, 14.2), the textbook

    r_s = (c - q) / (c + q),     r_p = r_s (s^2 - c q) / (s^2 + c q)

loses all digits in c - q for n near 1. Because (c - q)(c + q) = 1 - epsilon, it is equal to

    |r_s|^2 = |epsilon - 1|^2 / ((c + u)^2 + v^2)^2
    |r_p|^2 = |r_s|^2 ((c u - s^2)^2 + (c v)^2) / ((c u + s^2)^2 + (c v)^2)

with Re(epsilon - 1) = (n - 1)(n + 1) - kappa^2. No significant difference of nearly equal numbers
remains, from n = 1 (exactly 0) to n = kappa = 1e4, and up to grazing incidence.
"""

from __future__ import annotations

from typing import Any

from .build import TreeBuilder

OPAQUE_BELOW_TRANSMITTANCE = 1e-3
"""A medium that transmits less than this fraction at normal incidence is an opaque conductor."""


def cos_incidence(build: TreeBuilder) -> Any:
    """Add nodes for |Incoming . Normal|, the cosine of the angle outside, on both faces of a plate.

    Cycles' Fresnel node would invert the index on the back face.
    """
    geometry = build.node("ShaderNodeNewGeometry", "Geometry").outputs
    dot = build.dot("I . N", geometry["Incoming"], geometry["Normal"])
    return build.math("ABSOLUTE", "c = |I . N|", dot, clamp=True)


def reflectance(build: TreeBuilder, n: Any, kappa: Any, cosine: Any) -> Any:
    """Add nodes for the mean of |r_s|^2 and |r_p|^2 at an index n + j kappa, from vacuum."""
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

    # q = u + j v = sqrt(epsilon - s^2), as epsilon - s^2 = (epsilon - 1) + c^2. The larger part
    # comes from the root, the smaller from u v = n kappa: neither cancels.
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


def transmittance(build: TreeBuilder, n: Any, kappa: Any, power: Any) -> Any:
    """Add nodes for 1 - F, and 0 for a conductor.

    An index of 1e4 + j1e4 transmits 2e-4, so Cycles would trace rays behind every metal face.
    """
    open_ = is_open(build, n, kappa)
    rest = build.math("SUBTRACT", "1 - F", 1.0, power, clamp=True)
    return build.math("MULTIPLY", "T", rest, open_)


def is_open(build: TreeBuilder, n: Any, kappa: Any) -> Any:
    """Add nodes for 1, or 0 for a conductor; see `transmittance`."""
    math = build.math
    above = math("ADD", "n + 1 (T)", n, 1.0)
    kappa2 = math("MULTIPLY", "kappa^2 (T)", kappa, kappa)
    bottom = math("MULTIPLY_ADD", "(n + 1)^2 + kappa^2", above, above, kappa2)
    four_n = math("MULTIPLY", "4 n", n, 4.0)
    normal = math("DIVIDE", "1 - F at normal incidence", four_n, bottom)
    return math("GREATER_THAN", "not a conductor", normal, OPAQUE_BELOW_TRANSMITTANCE)


def _length(build: TreeBuilder, label: str, x: Any, y: Any) -> Any:
    """Add nodes for sqrt(x^2 + y^2)."""
    y2 = build.math("MULTIPLY", f"{label}: imaginary^2", y, y)
    total = build.math("MULTIPLY_ADD", f"{label}^2", x, x, y2)
    return build.math("SQRT", label, total)
