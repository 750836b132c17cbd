# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour maps: even steps of lightness, the same order for readers who confuse red and green."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib import colormaps

PACKAGE = Path(__file__).resolve().parents[3] / "radarsim_addon"
#: Machado, Oliveira and Fernandes (2009), severity 1, on linear RGB.
DEFICIENCIES = {
    "none": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
}
#: Linear sRGB to XYZ with white at Y = 1.
_XYZ = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
) / np.array([[0.9505], [1.0], [1.089]])


def lab(name: str, deficiency: str) -> np.ndarray:
    """CIE L*a*b* of 64 colours of a map, as a reader with the deficiency sees them."""
    rgb = colormaps[name](np.linspace(0, 1, 64))[:, :3]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = np.clip(linear @ np.asarray(DEFICIENCIES[deficiency]).T, 0, 1) @ _XYZ.T
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    x, y, z = f.T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
@pytest.mark.parametrize("name", ["viridis", "magma"])
def test_levels_are_even(name: str, deficiency: str) -> None:
    """Lightness only rises, and no step is much larger or smaller than the mean."""
    colours = lab(name, deficiency)
    assert (np.diff(colours[:, 0]) > 0).all()
    steps = np.linalg.norm(np.diff(colours, axis=0), axis=1)
    assert 0.35 * steps.mean() < steps.min() and steps.max() < 2.2 * steps.mean()


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
def test_signs_are_told_apart(deficiency: str) -> None:
    """The map of phases and signs is darker to both ends, whose colours differ."""
    colours = lab("RdBu_r", deficiency)
    assert (np.diff(colours[:30, 0]) > 0).all() and (np.diff(colours[34:, 0]) < 0).all()
    assert np.linalg.norm(colours[8] - colours[-9]) > 40


def test_no_picture_uses_another_map() -> None:
    used = set()
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text("utf-8")
        used |= set(re.findall(r'cmap="(\w+)"', text))
        used |= set(re.findall(r'"(jet|hsv|rainbow|turbo|hot|cool|spring|autumn|gray)"', text))
    # the last one is of real parts, which have both signs
    assert used <= {"viridis", "magma", "RdBu_r"}, used


def test_the_window_has_the_same_colours() -> None:
    """The live preview draws without matplotlib: its colours are in the font atlas."""
    (atlas,) = [path for path in PACKAGE.rglob("*.npz") if "viridis" in np.load(path).files]
    expected = np.round(colormaps["viridis"](np.linspace(0, 1, 256))[:, :3] * 255)
    assert np.abs(np.load(atlas)["viridis"][:, :3].astype(int) - expected).max() <= 1
