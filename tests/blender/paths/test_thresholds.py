# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits are crossed: just below and just above."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.paths import clutter_weights, error_budget, glints, mirrors
from radarsim_addon.blender.paths.curved_mirrors import CurvedMirrors
from radarsim_addon.blender.paths.measured_tiles import QualitySums
from radarsim_addon.blender.paths.tiles import ViewBoxes
from radarsim_addon.blender.views import ViewWindow
from radarsim_addon.physics.mirrors import Reflected
from radarsim_addon.signal.paths import PATH_DTYPE

pytestmark = pytest.mark.blender

FRAME = ViewWindow(0.0, 100.0, 0.0, 100.0, 100, 100)
EARTH_M = 4 / 3 * 6_371_000


def strong_enough(ratio: float) -> bool:
    cells = error_budget.CellPowers(np.array([1, 2]), np.array([1.0, ratio]), np.zeros(2))
    return 2 in error_budget.ErrorBudget(0, powers={0: cells}).object_errors()


def echoes(ratio: float) -> bool:
    rows = np.zeros(2, dtype=PATH_DTYPE)
    rows["order"] = rows["length_m"] = rows["solid_angle_sr"] = 1
    rows["power_w"], rows["last_object"] = (1.0, ratio), (1, 2)
    sides = {"left": -1.0, "right": 1.0, "bottom": -1.0, "top": 1.0}
    sums = QualitySums()
    sums.add_rows(rows, SimpleNamespace(kind="perspective", matrix_world=np.eye(4), **sides))  # type: ignore[arg-type]
    return 2 in sums.echoing


def is_mirrored(angle: float) -> bool:
    back, onward = (np.array([[math.sin(a), 0.0, math.cos(a)]]) for a in (0.0, angle))
    return bool(clutter_weights.is_mirrored((back[:, 2], onward[:, 2]), back, onward)[0])


def curves_away(part: float) -> bool:
    """A level proportional to the sine, of which the Earth takes a part away."""
    lobe: Any = SimpleNamespace(material="Sea", sigma0=lambda sine: sine)
    return bool(
        clutter_weights._curvature(lobe, np.array([0.1]), np.array([2 * EARTH_M * 0.1 * part]))
    )


def turns(fraction: float, apart: float = 0.0) -> mirrors.MirrorPolarisation:
    found = mirrors.MirrorPolarisation()
    columns = (np.array([one]) for one in (1.0, 0.0, fraction, apart))
    found.add(("Mirror",), np.ones(1), Reflected(*columns))
    return found


def mirror(size_m: float) -> mirrors.Mirror:
    corners_m = size_m * np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    normal = np.array([0.0, 0.0, 1.0])
    return mirrors.Mirror(normal, 0.0, corners_m, np.ones(1, int), [], ("Mirror",), 1.0)


def is_above(height: float) -> bool:
    """A point 1 km from an image 1 m below the plane."""
    chain = mirrors.first_images([mirror(5e3)], np.array([1.0, 1.0, 1.0]))[0]
    return bool(mirrors.ways_over(chain, np.array([[1001.0, 1.0, 1e3 * height]])).rows.size)


def is_outside(off: float) -> bool:
    return bool(mirror(1.0).triangle_at(np.array([[-off, 0.3, 0.0]]))[0] < 0)


def is_rounded(wavelengths: float) -> bool:
    one, none = np.ones(1, int), np.zeros(1)
    patches: Any = None
    mirrors_ = CurvedMirrors(patches, one, none, np.array([wavelengths]), one, (), {1: "Ball"})
    return bool(mirrors_.rounded(1.0))


def box(pixels: float) -> ViewBoxes:
    one = np.ones(1)
    right, top = (10 + pixels) * one, 90 * one
    return ViewBoxes(
        one.astype(int), 10 * one, right, 10 * one, top, one, np.zeros((1, 3)), one, one
    )


def is_large(pixels: float) -> bool:
    return not len(error_budget.small_boxes(box(pixels), FRAME))


def is_surely_hit(pixels: float) -> bool:
    anything: Any = None
    with mock.patch.object(error_budget, "projected_bounds", return_value=box(pixels)):
        return not error_budget.missed_objects_findings(anything, ["Box"], (), anything, FRAME)


def differs(level_db: float) -> bool:
    """A curved face of 1 m^2 at 1 m, for a wavelength of 1 m and an EIRP of 1 W."""
    faces = object.__new__(glints.SmoothFaces)
    faces._wavelength_m = faces._eirp_w = 1.0
    faces._antennas_m = [np.zeros(3)] * 2
    face = glints._Face(0, 0.1, 1.0, math.pi, 0.0, np.array([1.0, 0.0, 0.0]))
    faces._faces = {1: (1.0, face, 1e-3, True)}
    return bool(faces.findings({"Ball": 10 ** (level_db / 10) / (4 * math.pi) ** 3}, ["Ball"]))


@pytest.mark.parametrize(
    ("crossed", "below", "above"),
    [
        pytest.param(strong_enough, 0.5e-8, 2e-8, id="faintest-cell"),
        pytest.param(echoes, 0.5e-12, 2e-12, id="faintest-echo"),
        pytest.param(lambda a: not is_mirrored(a), 3e-5, 7e-5, id="mirrored-ray"),
        pytest.param(curves_away, 0.08, 0.15, id="flat-earth-0.5-dB"),
        pytest.param(lambda t: bool(turns(t).finding()), 0.05, 0.07, id="turned-0.5-dB"),
        # 1 + 2 sqrt(apart) is 0.5 dB at 8.8e-4
        pytest.param(lambda a: bool(turns(0, a).phases()), 7e-4, 1.1e-3, id="apart-0.5-dB"),
        pytest.param(is_above, 0.5e-6, 2e-6, id="least-height"),
        pytest.param(is_outside, 0.5e-9, 2e-9, id="edge-of-triangle"),
        pytest.param(is_rounded, 0.015, 0.03, id="flat"),
        pytest.param(is_large, 7.0, 9.0, id="small-object"),
        pytest.param(is_surely_hit, 1.5, 2.5, id="surely-hit"),
        pytest.param(differs, 0.8, 1.2, id="level-of-a-curved-face"),
    ],
)
def test_limit_is_crossed(crossed: Callable[[float], bool], below: float, above: float) -> None:
    assert not crossed(below)
    assert crossed(above)
