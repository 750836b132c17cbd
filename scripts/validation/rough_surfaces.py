# SPDX-License-Identifier: GPL-3.0-or-later
"""sigma_0 of rough surfaces through the whole chain, against the Kirchhoff model."""

from __future__ import annotations

import math

import bpy

from .case import Bench, Case, Check, Group, power_check, worst_of
from .closed_forms import kirchhoff_coefficient, plate_power
from .scenes import EIRP_W, acquire, add_plate, facing_plate, metallic, new_scene, wavelength

MEDIA = (1.4 + 1.0j, 2.3 + 0.05j, 9.0 + 3.0j, 100.0 + 100.0j, 1e4 + 1e4j)
SLOPES = (0.1, 0.2, 0.3)
ANGLES_DEG = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
RANGE_M = 1000.0
PLATE_M = 0.8
SPACING_M = 1.2
BOUND_DB = 0.1
FAINTEST_DB = -200.0
SOURCE = "Kirchhoff model in the geometric-optics limit, Ulaby, Moore, Fung II, eq. 12.55"


def name_of(index: complex) -> str:
    """An index for people."""
    return f"{index.real:g}+{index.imag:g}j"


def sigma0_checks(bench: Bench, slope: float, width_px: int = 360) -> list[Check]:
    """One row a medium: the worst of its angles. All media stand side by side in one scene."""
    found: dict[complex, list[Check]] = {index: [] for index in MEDIA}
    for angle_deg in ANGLES_DEG:
        plates = _scene(slope, angle_deg)
        run = acquire(bench, width_px, 4, height_px=width_px // 5)
        for number, index in enumerate(MEDIA):
            plate = plates[number]
            model_w = plate_power(plate, kirchhoff_coefficient(index, slope))
            # Radar equation solved for sigma_0 = sigma / A at the plate's distance.
            range_m = math.hypot(*plate.centre_m)
            one = EIRP_W * wavelength() ** 2 * plate.area_m2
            one /= (4 * math.pi) ** 3 * range_m**4
            if 10 * math.log10(model_w / one) < FAINTEST_DB:
                continue
            power_w, spread = run.power_w(f"Medium {number}")
            check = power_check(
                f"{angle_deg:g} deg",
                model_w / one,
                power_w / one,
                BOUND_DB,
                SOURCE,
                unit="dB",
                relative_error=spread,
            )
            found[index].append(check)
            bench.point(
                "sigma0",
                medium=name_of(index),
                slope=slope,
                angle_deg=angle_deg,
                expected_db=check.expected,
                measured_db=check.measured,
                error_db=check.error,
            )
    return [
        worst_of(f"n = {name_of(index)}, slope {slope:g}", checks)
        for index, checks in found.items()
    ]


def _scene(slope: float, angle_deg: float) -> list:
    """Five plates in a row, one a medium, all tilted by the same angle."""
    width_m = len(MEDIA) * SPACING_M
    new_scene(math.degrees(2 * math.atan(width_m / 2 / RANGE_M)))
    plates = []
    for number, index in enumerate(MEDIA):
        across_m = (number - (len(MEDIA) - 1) / 2) * SPACING_M
        plate = facing_plate((across_m, RANGE_M, 0.0), PLATE_M, angle_deg)
        add_plate(f"Medium {number}", plate, metallic(index, slope))
        plates.append(plate)
    assert len(bpy.data.materials) == len(MEDIA)
    return plates


GROUP = Group(
    "rough_surfaces",
    "Rough surfaces",
    "sigma_0 of plates at 1 km from received power, by the Metallic BSDF (physical conductor, "
    "Beckmann) under the world's range code; 0 to 60 degrees, where the model is above -200 dB.",
    tuple(
        Case(
            f"sigma_0, slope {slope:g}",
            lambda bench, slope=slope: sigma0_checks(bench, slope),
            40.0,
            quick=slope == 0.2,
        )
        for slope in SLOPES
    ),
)
