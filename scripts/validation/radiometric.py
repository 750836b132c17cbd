# SPDX-License-Identifier: GPL-3.0-or-later
"""Absolute power of Lambert plates, near and far, square on and oblique, one site and two."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .case import Bench, Case, Check, Group, absolute_check, power_check
from .closed_forms import lambert_coefficient, plate_power
from .scenes import (
    CARRIER_HZ,
    EIRP_W,
    acquire,
    add_box,
    add_plate,
    facing_plate,
    lambert,
    new_scene,
    wavelength,
)

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


def street(bench: Bench) -> list[Check]:
    """All directions from a car's roof in a street: ground below, and facades above the radar."""
    height_m, side_m = 1.8, 8.0
    scene = new_scene(90.0)
    material = lambert(ALBEDO)
    add_box("Ground", (-300, -300, -height_m - 1), (300, 300, -height_m), material)
    houses = [(x, -120.0 + 20 * k, 10.0 + 3 * (k % 3)) for x in (-20.0, side_m) for k in range(12)]
    for number, (x, y, top) in enumerate(houses):
        low = (x, y, -height_m)
        add_box(f"House {number}", low, (x + 12, y + 17, top - height_m), material)
    for k in range(6):
        corner = (-4.0 + 6 * (k % 2), -30.0 + 14 * k, -height_m)
        add_box(f"Car {k}", corner, (corner[0] + 1.8, corner[1] + 4, 1.5 - height_m), material)
    camera = scene.camera.data
    camera.type = "PANO"
    panorama = camera if hasattr(camera, "panorama_type") else camera.cycles
    panorama.panorama_type = "EQUIRECTANGULAR"
    run = acquire(bench, 512, 2, height_px=256)
    rows = run.rows
    aperture_m2 = wavelength(CARRIER_HZ) ** 2 / (4 * math.pi)
    unit = EIRP_W / (4 * math.pi) * aperture_m2 * ALBEDO / math.pi
    below = rows["direction"][:, 2] < -math.cos(math.radians(45))
    # R = h / cos t and dA = 2 pi h^2 tan t / cos^2 t: cos^2 t / R^4 dA is 2 pi sin t cos^3 t / h^2
    ground_w = unit * 2 * math.pi / height_m**2 * (1 - math.cos(math.radians(45)) ** 4) / 4
    point = rows["last_scatterer_m"]
    facade = (np.abs(np.abs(point[:, 0]) - side_m) < 1e-3) & (rows["direction"][:, 2] > 0)
    facade_w = 0.0
    for _, y, top in houses:
        at_y = y + (np.arange(1700) + 0.5) / 100
        at_z = (np.arange(2000) + 0.5) * (top - height_m) / 2000
        squares = side_m**2 + at_y[:, None] ** 2 + at_z**2
        facade_w += unit * float(np.sum(side_m**2 / squares**3)) * 0.01 * (top - height_m) / 2000
    source = "radar equation integrated in closed form over the ground, by points over the facades"
    found = (
        ("ground within 45 degrees of the nadir", below, ground_w),
        ("facades above the radar", facade, facade_w),
    )
    return [
        power_check(f"street, {name}", want, float(rows["power_w"][chosen].sum()), BOUND_DB, source)
        for name, chosen, want in found
    ]


GROUP = Group(
    "radiometric",
    "Radiometric chain",
    "A square metre of a Lambert surface in watts; a street seen in all directions.",
    (
        Case("plate at normal incidence", lambda bench: ranges(bench, 0.0), 20.0, quick=True),
        Case("plate at 60 degrees", lambda bench: ranges(bench, 60.0), 20.0),
        Case("two sites", bistatic, 20.0),
        Case("street in all directions", street, 20.0),
    ),
)
