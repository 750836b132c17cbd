# SPDX-License-Identifier: GPL-3.0-or-later
"""Absolute power of Lambert plates, near and far, square on and oblique, one site and two."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .case import Bench, Case, Check, Group, absolute_check, power_check
from .closed_forms import lambert_coefficient, plate_power
from .scenes import acquire, add_plate, facing_plate, lambert, new_scene

ALBEDO = 0.6
RANGES_M = (10.0, 100.0, 1000.0, 10000.0)
BOUND_DB = 0.05
SOURCE = "radar equation integrated over the plate, s0 = 4 rho cos_i cos_s"


def measure_plate(
    bench: Bench, range_m: float, tilt_deg: float, side_px: int = 96, baseline_deg: float = 0.0
) -> tuple[float, float, float]:
    """Expected and measured power of a square metre [W], and its relative standard error.

    With a baseline the transmitter stands on the same circle around the plate.
    """
    angle = math.radians(baseline_deg)
    transmitter = np.array([range_m * math.sin(angle), range_m * (1 - math.cos(angle)), 0.0])
    scene = new_scene(
        math.degrees(2 * math.atan(0.9 / range_m)),
        transmitter_m=transmitter.tolist() if baseline_deg else None,
    )
    assert scene.camera is not None
    plate = facing_plate((0.0, range_m, 0.0), 1.0, tilt_deg)
    add_plate("Plate", plate, lambert(ALBEDO))
    measured, spread = acquire(bench, side_px).power_w("Plate")
    expected = plate_power(plate, lambert_coefficient(ALBEDO), transmitter)
    return expected, measured, spread


def ranges(bench: Bench, tilt_deg: float) -> list[Check]:
    checks, measured_w, expected_w = [], [], []
    for range_m in RANGES_M:
        expected, measured, spread = measure_plate(bench, range_m, tilt_deg)
        measured_w.append(measured)
        expected_w.append(expected)
        name = f"1 m^2 at {range_m:g} m, {tilt_deg:g} deg"
        checks.append(
            power_check(name, expected, measured, BOUND_DB, SOURCE, relative_error=spread)
        )
        bench.point(
            "power_against_range",
            tilt_deg=tilt_deg,
            range_m=range_m,
            expected_w=expected,
            measured_w=measured,
            error_db=checks[-1].error,
        )
    # At 10 m the plate is no point, its mean 1/R^4 is below that of its centre: the slope of the
    # exact integral is not -4 from there on.
    name = f"slope of power over range, 100 m to 10 km, {tilt_deg:g} deg"
    slope = _slope(RANGES_M[1:], measured_w[1:])
    checks.append(absolute_check(name, -4.0, slope, 0.01, "radar equation"))
    name = f"slope of power over range, 10 m to 10 km, {tilt_deg:g} deg"
    exact, slope = _slope(RANGES_M, expected_w), _slope(RANGES_M, measured_w)
    source = "slope of the integral over the plate, which is near at 10 m"
    checks.append(absolute_check(name, exact, slope, 0.002, source))
    return checks


def _slope(range_m: Sequence[float], power_w: Sequence[float]) -> float:
    return float(np.polyfit(np.log10(range_m), np.log10(power_w), 1)[0])


def bistatic(bench: Bench) -> list[Check]:
    checks = []
    for range_m, baseline_deg in ((100.0, 40.0), (100.0, 75.0), (10000.0, 40.0)):
        expected, measured, spread = measure_plate(bench, range_m, 20.0, baseline_deg=baseline_deg)
        name = f"1 m^2 at {range_m:g} m, tilted 20 deg, sites {baseline_deg:g} deg apart"
        checks.append(
            power_check(name, expected, measured, BOUND_DB, SOURCE, relative_error=spread)
        )
    return checks


GROUP = Group(
    "radiometric",
    "Radiometric chain",
    "A square metre of a Lambert surface (Diffuse BSDF, albedo 0.6) in watts: scene, renders, "
    "table of paths, sum of powers.",
    (
        Case("plate square on", lambda bench: ranges(bench, 0.0), 20.0, quick=True),
        Case("plate at 60 degrees", lambda bench: ranges(bench, 60.0), 20.0),
        Case("two sites", bistatic, 20.0),
    ),
)
