# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour maps of the pictures: equal steps look equal, and lightness alone tells the order."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[3]
USED = {
    name
    for path in (ROOT / "radarsim_addon").rglob("*.py")
    for name in re.findall(r'cmap="(\w+)"', path.read_text(encoding="utf-8"))
}
#: Of sRGB (D65) to CIE XYZ (IEC 61966-2-1), and the white point.
_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
_WHITE = _XYZ.sum(axis=1)


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of sRGB colours in 0 to 1, shape (n, 3)."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    ratio = linear @ _XYZ.T / _WHITE
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack(
        [116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1
    )


def test_there_are_some() -> None:
    assert "viridis" in USED


@pytest.mark.parametrize("name", sorted(USED))
def test_lightness_tells_the_order(name: str) -> None:
    """Of a map of two signs, in each half."""
    from matplotlib import colormaps

    light = lab(colormaps[name](np.linspace(0, 1, 256))[:, :3])[:, 0]
    halves = [light[:128], light[:127:-1]] if name == "RdBu_r" else [light]
    for half in halves:
        assert (np.diff(half) > -0.05).all()
        assert half[-1] - half[0] > 50


def largest_over_smallest_step(name: str) -> float:
    """Of 255 equal steps along a colour map, in L*a*b*."""
    from matplotlib import colormaps

    colours = lab(colormaps[name](np.linspace(0, 1, 256))[:, :3])
    steps = np.linalg.norm(np.diff(colours, axis=0), axis=1)
    return float(steps.max() / max(steps.min(), 1e-9))


@pytest.mark.parametrize("name", sorted(USED))
def test_no_step_is_hidden(name: str) -> None:
    """The largest step is at most five times the smallest; in "hot" it is 13 times."""
    assert largest_over_smallest_step(name) < 5
    assert largest_over_smallest_step("hot") > 10
    assert largest_over_smallest_step("jet") > 10
