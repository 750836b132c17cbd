# SPDX-License-Identifier: GPL-3.0-or-later
"""Spheres: rough ones scatter by the same model as plates, integrated over their surface."""

from __future__ import annotations

import math

from scripts.benchmarks.clock import stopwatch

from .case import Bench, Case, Check, Group, power_check
from .closed_forms import (
    Coefficient,
    kirchhoff_coefficient,
    lambert_coefficient,
    plate_power,
    sphere_power,
)
from .scenes import (
    acquire,
    add_plate,
    add_sphere,
    facing_plate,
    lambert,
    metallic,
    new_scene,
)

BOUND_DB = 0.1
RADIUS_M = 1.0
ALBEDO = 0.6
INDEX, SLOPE = 2.3 + 0.05j, 0.2


def _sphere(range_m: float, rough: bool) -> Coefficient:
    """The scene, and the model of the sphere's surface."""
    new_scene(math.degrees(2 * math.atan(1.3 * RADIUS_M / range_m)))
    material = metallic(INDEX, SLOPE) if rough else lambert(ALBEDO)
    add_sphere("Sphere", (0.0, range_m, 0.0), RADIUS_M, material)
    return kirchhoff_coefficient(INDEX, SLOPE) if rough else lambert_coefficient(ALBEDO)


def _spheres(bench: Bench, rough: bool, label: str, source: str) -> list[Check]:
    """One result a range."""
    checks = []
    for range_m in (10.0, 1000.0):
        model = _sphere(range_m, rough)
        measured, spread = acquire(bench, 96).power_w("Sphere")
        expected = sphere_power(range_m, RADIUS_M, model)
        name = f"{label}, at {range_m:g} m"
        checks.append(
            power_check(name, expected, measured, BOUND_DB, source, relative_error=spread)
        )
    return checks


def lambert_sphere(bench: Bench) -> list[Check]:
    source = "numerical integration of 4 rho cos^2; (8/3) rho pi a^2 far away"
    return _spheres(bench, False, "Lambert sphere of 1 m, albedo 0.6", source)


def rough_sphere(bench: Bench) -> list[Check]:
    source = "numerical integration of the Kirchhoff model"
    return _spheres(bench, True, "rough sphere of 1 m, n = 2.3 + 0.05j, slope 0.2", source)


def error_against_time(bench: Bench) -> list[Check]:
    """The same spheres by more and more pixels; the finest has a tenth of the bound."""
    checks = []
    _sphere(100.0, rough=False)
    acquire(bench, 12)  # what Blender and Cycles do once is not counted
    for label in ("Lambert sphere", "rough sphere", "Lambert plate at 60 deg"):
        if "plate" in label:
            new_scene(math.degrees(2 * math.atan(0.9 / 100.0)))
            plate = facing_plate((0.0, 100.0, 0.0), 1.0, 60.0)
            add_plate("Target", plate, lambert(ALBEDO))
            expected = plate_power(plate, lambert_coefficient(ALBEDO))
        else:
            model = _sphere(100.0, "rough" in label)
            expected = sphere_power(100.0, RADIUS_M, model)
        for side_px in (12, 24, 48, 96, 192, 384):
            with stopwatch() as cost:
                measured, spread = acquire(bench, side_px).power_w()
            check = power_check(
                f"{label} at 100 m, {side_px} x {side_px} pixels, 4 replicates",
                expected,
                measured,
                BOUND_DB / 10,
                "numerical integration of the same model",
                relative_error=spread,
            )
            bench.point(
                "error_against_time",
                scene=label,
                side_px=side_px,
                cpu_s=cost.cpu_s,
                error_db=check.error,
                standard_error_db=check.standard_error or 0.0,
            )
        checks.append(check)
    return checks


def glints(bench: Bench) -> list[Check]:
    """Spots of slope times radius, less than a pixel of 32 across the view."""
    checks = []
    for slope, radius_m, range_m, fov_deg in (
        (0.05, 0.3, 20.0, 90.0),
        (0.1, 0.3, 20.0, 90.0),
        (0.2, 0.3, 20.0, 90.0),
        (0.02, 0.1, 300.0, 40.0),
    ):
        new_scene(fov_deg)
        add_sphere("Sphere", (0.0, range_m, 0.0), radius_m, metallic(INDEX, slope))
        measured, spread = acquire(bench, 32).power_w("Sphere")
        expected = sphere_power(range_m, radius_m, kirchhoff_coefficient(INDEX, slope))
        name = f"slope {slope:g}, radius {radius_m:g} m, at {range_m:g} m, 32 x 32 pixels of "
        name += f"{fov_deg:g} degrees"
        source = "numerical integration of the Kirchhoff model"
        checks.append(
            power_check(name, expected, measured, BOUND_DB, source, relative_error=spread)
        )
    return checks


GROUP = Group(
    "spheres",
    "Spheres",
    "Icospheres of 20480 faces with smooth normals.",
    (
        Case("Lambert sphere", lambert_sphere, 20.0, quick=True),
        Case("rough sphere", rough_sphere, 20.0),
        Case("glints", glints, 20.0),
        Case("error against time", error_against_time, 40.0),
    ),
)
