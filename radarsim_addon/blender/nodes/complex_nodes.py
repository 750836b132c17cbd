# SPDX-License-Identifier: GPL-3.0-or-later
"""Complex numbers as pairs of sockets."""

from __future__ import annotations

from typing import Any, NamedTuple

from .build import TreeBuilder


class Pair(NamedTuple):
    """Real and imaginary part: sockets or constants."""

    re: Any
    im: Any


def product(build: TreeBuilder, label: str, a: Pair, b: Pair) -> Pair:
    """Add nodes for a b."""
    math = build.math
    cross = math("MULTIPLY", f"{label}: im im", a.im, b.im)
    re = math("SUBTRACT", f"Re {label}", math("MULTIPLY", f"{label}: re re", a.re, b.re), cross)
    other = math("MULTIPLY", f"{label}: im re", a.im, b.re)
    return Pair(re, math("MULTIPLY_ADD", f"Im {label}", a.re, b.im, other))


def scaled(build: TreeBuilder, label: str, a: Pair, factor: Any) -> Pair:
    """Add nodes for a real factor times a."""
    return Pair(
        build.math("MULTIPLY", f"Re {label}", a.re, factor),
        build.math("MULTIPLY", f"Im {label}", a.im, factor),
    )


def total(build: TreeBuilder, label: str, a: Pair, b: Pair) -> Pair:
    """Add nodes for a + b."""
    return Pair(
        build.math("ADD", f"Re {label}", a.re, b.re), build.math("ADD", f"Im {label}", a.im, b.im)
    )


def difference(build: TreeBuilder, label: str, a: Pair, b: Pair) -> Pair:
    """Add nodes for a - b."""
    return Pair(
        build.math("SUBTRACT", f"Re {label}", a.re, b.re),
        build.math("SUBTRACT", f"Im {label}", a.im, b.im),
    )


def power(build: TreeBuilder, label: str, a: Pair) -> Any:
    """Add nodes for |a|^2."""
    im2 = build.math("MULTIPLY", f"{label}: im^2", a.im, a.im)
    return build.math("MULTIPLY_ADD", label, a.re, a.re, im2)
