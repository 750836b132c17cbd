# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth faces near normal incidence: the level of physical optics is stated, others are left."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import material
from radarsim_addon.findings import Finding
from radarsim_addon.signal.radar import Waveform
from scripts.validation import scenes
from tests.blender import path_helpers as ph

pytestmark = pytest.mark.blender

CODES = ("smooth-face-level", "face-height-unknown")


METAL = {"n": 1e4, "kappa": 1e4}
POLISHED = {**METAL, "rms_height_m": 20e-6, "correlation_length_m": 1e-3}


def found(tmp_path: Path, carrier_hz: float) -> dict[str, Finding]:
    """Findings of the smooth faces of the current scene."""
    waveform = Waveform(carrier_hz, 50e6, 2.5e-6, 60e6)
    run = ph.run_paths(
        tmp_path, waveform=waveform, width_px=24, height_px=24, options={"replicates": 2}
    )
    return {one.code: one for one in run.record().findings if one.code in CODES}


def add_plate(
    width_m: float, height_m: float, range_m: float, tilt_deg: float, surface: dict[str, float]
) -> None:
    scenes.new_scene(math.degrees(2 * math.atan(0.6 * max(width_m, height_m) / range_m)))
    up = height_m * math.sin(math.radians(tilt_deg)), height_m * math.cos(math.radians(tilt_deg))
    plate = scenes.Plate(
        np.array([0.0, range_m, 0.0]), np.array([width_m, 0.0, 0.0]), np.array([0.0, *up])
    )
    scenes.add_plate("Plate", plate, material(name="Surface", **surface))


@pytest.mark.parametrize(
    ("carrier_hz", "width_m", "height_m", "tilt_deg", "surface", "code", "dbsm"),
    [  # 4 pi A^2 / lambda^2
        (2.56e9, 0.267, 0.152, 0.0, (20e-6, 1e-3, 0.0), "smooth-face-level", 1.79),
        (10.24e9, 0.267, 0.152, 0.0, (20e-6, 1e-3, 0.0), "smooth-face-level", 13.83),
        (10.24e9, 0.267, 0.152, 0.0, (5e-6, 1e-3, 0.0), "smooth-face-level", 13.83),
        (10.24e9, 0.267, 0.152, 1.5, (20e-6, 1e-3, 0.0), "smooth-face-level", 13.83),
        (5.3e9, 0.2, 0.6, 0.0, (0.0, 0.0, 0.1), "face-height-unknown", 17.53),
    ],
)
def test_level_of_a_plate_does_not_depend_on_its_polish(
    tmp_path: Path, carrier_hz: float, width_m: float, height_m: float, tilt_deg: float,
    surface: tuple[float, float, float], code: str, dbsm: float,
) -> None:  # fmt: skip
    names = ("rms_height_m", "correlation_length_m", "rms_slope")
    given = {name: value for name, value in zip(names, surface, strict=True) if value}
    add_plate(width_m, height_m, 40.0, tilt_deg, {**METAL, **given})
    (item,) = found(tmp_path, carrier_hz).values()
    assert (item.code, item.severity, item.subjects) == (code, "caution", ("Plate",))
    assert item.numbers["expected_dbsm"] == pytest.approx(dbsm, abs=0.05)
    assert item.numbers["aspect_deg"] == pytest.approx(tilt_deg, abs=0.25)
    # what radarsim has: |Gamma|^2 A / (2 m^2) at normal incidence (Kirchhoff), less aside
    slope = given.get("rms_slope") or math.sqrt(2) * surface[0] / surface[1]
    lobe = math.exp(-((math.tan(math.radians(tilt_deg)) / slope) ** 2) / 2) / (2 * slope**2)
    measured = 10 * math.log10(width_m * height_m * lobe)
    assert item.numbers["measured_dbsm"] == pytest.approx(measured, abs=0.5)


def test_a_plate_beyond_a_fresnel_zone_mirrors_the_radar(tmp_path: Path) -> None:
    """pi R^2: the plate is 8 x 4 m, the zone 0.5 m across."""
    add_plate(8.0, 4.0, 20.0, 0.0, POLISHED)
    item = found(tmp_path, 10.24e9)["smooth-face-level"]
    assert item.numbers["expected_dbsm"] == pytest.approx(
        10 * math.log10(math.pi * 20.0**2), abs=0.1
    )


@pytest.mark.parametrize(("slope", "said"), [(0.02, False), (0.1, True)])
def test_a_plate_with_the_same_level_smooth_or_rough(
    tmp_path: Path, slope: float, said: bool
) -> None:
    """pi R^2 of both, unless part of the lobe misses: its normals are within 0.2 and 0.1 of it."""
    add_plate(8.0, 4.0, 20.0, 0.0, {**METAL, "rms_slope": slope})
    items = found(tmp_path, 10.24e9)
    assert set(items) == ({"face-height-unknown"} if said else set())
    if said:
        part = math.prod(math.erf(edge / slope / math.sqrt(2)) for edge in (0.2, 0.1))
        measured = 10 * math.log10(math.pi * 20.0**2 * part)
        assert items["face-height-unknown"].numbers["measured_dbsm"] == pytest.approx(
            measured, abs=0.5
        )


def test_dielectric_plate_reflects_less(tmp_path: Path) -> None:
    surface = {"n": 2.5, "rms_height_m": 0.1e-3, "correlation_length_m": 5e-3}
    add_plate(0.5, 0.5, 40.0, 0.0, surface)
    item = found(tmp_path, 5.3e9)["smooth-face-level"]
    metal = 4 * math.pi * 0.25**2 / (299792458 / 5.3e9) ** 2
    expected = 10 * math.log10(metal * (1.5 / 3.5) ** 2)
    assert item.numbers["expected_dbsm"] == pytest.approx(expected, abs=0.05)


def test_gently_curved_face(tmp_path: Path) -> None:
    """A cap of 5 m radius, 1 m across: pi / (1/R_c + 1/R)^2, more than its lobe of 0.15 returns."""
    carrier_hz, radius, range_m = 24e9, 5.0, 20.0
    scenes.new_scene(8.0)
    surface = material(name="Surface", **METAL, rms_slope=0.15)
    grid = np.linspace(-0.5, 0.5, 41)
    x, z = (one.ravel() for one in np.meshgrid(grid, grid))
    y = range_m + radius - np.sqrt(radius**2 - x**2 - z**2)
    corners = list(zip(x, y, z, strict=True))
    faces = [
        (i * 41 + j, i * 41 + j + 1, (i + 1) * 41 + j + 1, (i + 1) * 41 + j)
        for i in range(40)
        for j in range(40)
    ]
    cap = scenes.add_mesh("Cap", corners, faces, surface)
    cap.data.polygons.foreach_set("use_smooth", [True] * len(faces))
    item = found(tmp_path, carrier_hz)["face-height-unknown"]
    expected = 10 * math.log10(math.pi / (1 / radius + 1 / range_m) ** 2)
    assert item.numbers["expected_dbsm"] == pytest.approx(expected, abs=0.1)
    # of the lobe, the normals of the cap are within 0.125 of the bisector along both axes
    part = math.erf(0.5 * (1 / radius + 1 / range_m) / 0.15 / math.sqrt(2)) ** 2
    measured = expected + 10 * math.log10(part)
    assert item.numbers["measured_dbsm"] == pytest.approx(measured, abs=0.3)


@pytest.mark.parametrize("kind", ["rough", "steep", "small", "facets", "sphere", "mirror", "aside"])
def test_nothing_is_said_of_other_surfaces(tmp_path: Path, kind: str) -> None:
    carrier_hz = 10.24e9
    surface = {
        "rough": {"rms_height_m": 5e-3, "correlation_length_m": 0.1},  # lambda / 5.9
        "steep": {"rms_slope": 0.2},
        "mirror": {},
    }.get(kind, POLISHED)
    if kind in ("facets", "sphere"):
        scenes.new_scene(5.0)
        ball = scenes.add_sphere(
            "Ball", (0, 20, 0), 0.5, material(name="Surface", **POLISHED), subdivisions=4
        )
        if kind == "facets":
            ball.data.polygons.foreach_set("use_smooth", [False] * len(ball.data.polygons))
    else:
        small = 0.02 if kind == "small" else 0.3
        add_plate(small, 0.3, 40.0, 20.0 if kind == "aside" else 0.0, {**METAL, **surface})
    assert found(tmp_path, carrier_hz) == {}
