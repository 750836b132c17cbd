# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel reflection: the library against 40 digits, and the renderer's nodes at all angles."""

from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from radarsim_addon.blender import nodes
from radarsim_addon.physics import fresnel

from .case import Bench, Case, Check, Group, absolute_check, power_check, worst_of
from .scenes import (
    EIRP_W,
    Plate,
    Real,
    acquire,
    add_plate,
    facing_plate,
    metallic,
    new_scene,
    wavelength,
)

TABLE = Path(__file__).parents[2] / "tests" / "data" / "fresnel_spot_values.csv"
VACUUM_PERMITTIVITY = 8.8541878128e-12
INDICES = {
    "eps4": 2.0,
    "eps2.56": 1.6,
    "n=1e4(1+i)": 1e4 * (1 + 1j),
    "TIR n=1/1.5": 1 / 1.5,
    "copper5.8e7@10GHz": np.sqrt(1 + 5.8e7j / (2 * np.pi * 10e9 * VACUUM_PERMITTIVITY)),
}
MEDIA = (1.4 + 1.0j, 2.3 + 0.05j, 9.0 + 3.0j, 100.0 + 100.0j, 1e4 + 1e4j)


def against_table(_bench: Bench) -> list[Check]:
    """Every row of the table, one result a medium."""
    with open(TABLE, encoding="utf-8") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    found: dict[str, list[Check]] = {}
    for row in rows:
        case, angle_deg = row["case"], float(row["inc_deg"])
        cosine = np.cos(np.radians(angle_deg))
        results = fresnel.reflection_coefficients(_index(case, rows), cosine)
        for got, letter in zip(results, "sp", strict=True):
            want = complex(float(row[f"r{letter}_re"]), float(row[f"r{letter}_im"]))
            check = Check(
                f"r_{letter} at {angle_deg:g} deg",
                abs(want),
                abs(complex(got)),
                "",
                abs(complex(got) - want) / abs(want),
                1e-10,
                "relative",
                "table of 40 digits (mpmath)",
            )
            found.setdefault(case, []).append(check)
    return [worst_of(case, checks) for case, checks in found.items()]


def _index(case: str, rows: list[dict[str, str]]) -> complex:
    """The table's index; for the one given without a number, from its normal incidence row."""
    if case in INDICES:
        return complex(INDICES[case])
    normal = next(r for r in rows if r["case"] == case and float(r["inc_deg"]) == 0)
    r_s = complex(float(normal["rs_re"]), float(normal["rs_im"]))
    return (1 - r_s) / (1 + r_s)


def special_angles(_bench: Bench) -> list[Check]:
    checks = []
    for real in (1.5, 2.3, 9.0):
        _, r_p = fresnel.reflection_coefficients(real, np.cos(np.arctan(real)))
        checks.append(
            absolute_check(
                f"|r_p| at Brewster's angle, n = {real:g}",
                0.0,
                abs(complex(r_p)),
                1e-14,
                "tan(theta) = n",
            )
        )
    critical = math.asin(1 / 1.5)
    for beyond_deg in (0.0, 5.0, 40.0):
        cosine = math.cos(critical + math.radians(beyond_deg))
        r_s, r_p = fresnel.reflection_coefficients(1 / 1.5, cosine)
        for name, value in (("s", r_s), ("p", r_p)):
            label = f"|r_{name}|, n = 1/1.5, {beyond_deg:g} deg beyond the critical angle"
            checks.append(absolute_check(label, 1.0, abs(complex(value)), 1e-7, "total reflection"))
    for index in MEDIA:
        r_s, r_p = fresnel.reflection_coefficients(index, 0.0)
        error = max(abs(complex(r_s) + 1), abs(complex(r_p) - (-1)))
        checks.append(
            absolute_check(
                f"|r + 1| at 90 degrees, n = {index:g}", 0.0, error, 1e-12, "grazing limit"
            )
        )
    return checks


def textbook_reflectance(index: complex, angle_deg: Any) -> Any:
    """Mean of |r_s|^2 and |r_p|^2 with Snell's angle (Born and Wolf 1.5.2), in the plain form."""
    cos_i = np.cos(np.radians(angle_deg))
    cos_t = np.sqrt(1 - (np.sin(np.radians(angle_deg)) / index) ** 2 + 0j)
    r_s = (cos_i - index * cos_t) / (cos_i + index * cos_t)
    r_p = (index * cos_i - cos_t) / (index * cos_i + cos_t)
    return (np.abs(r_s) ** 2 + np.abs(r_p) ** 2) / 2


def _radiance(rows: Any) -> Real:
    """Radiance of rows [W m^-2 sr^-1], from their power."""
    area_m2 = wavelength() ** 2 / (4 * math.pi)
    return np.asarray(rows["power_w"] / rows["solid_angle_sr"] / area_m2)


def _square_on(bench: Bench, material: Any) -> tuple[float, float]:
    """Incidence [rad] and radiance of the middle pixel, over the irradiance, of a plate at 10 m."""
    new_scene(0.2)
    add_plate("Plate", facing_plate((0.0, 10.0, 0.0), 8.0), material())
    run = acquire(bench, 17, 1)
    cosine = run.rows["direction"][:, 1]
    middle = int(np.argmax(cosine))
    reach_m = 10.0 / cosine[middle]
    irradiance = EIRP_W / (4 * math.pi * reach_m**2) * cosine[middle]
    angle = float(np.hypot(*run.rows["direction"][middle, [0, 2]]))
    return angle, float(_radiance(run.rows)[middle] / irradiance)


def normal_incidence(bench: Bench) -> list[Check]:
    """The middle pixel of a plate seen square on, by both ways to a conductor."""
    lobes: dict[str, list[Check]] = {"Radar Material, Lambert lobe": []}
    if hasattr(bpy.types, "ShaderNodeBsdfMetallic"):
        lobes["Metallic BSDF, rough lobe"] = []
    slope = 0.2
    source = "|(n-1)/(n+1)|^2"
    for index in MEDIA:
        power = abs((index - 1) / (index + 1)) ** 2

        def painted(index: complex = index) -> Any:
            return nodes.make_material("Medium", index.real, index.imag, 0.0, 0.5, penetrable=False)

        def conductor(index: complex = index) -> Any:
            return metallic(index, slope)

        angle, ratio = _square_on(bench, painted)
        assert angle < 2e-4
        name = f"n = {index:g}"
        check = power_check(name, power, ratio * math.pi, 1e-4, source, unit="dB")
        lobes["Radar Material, Lambert lobe"].append(check)
        if "Metallic BSDF, rough lobe" in lobes:
            _, ratio = _square_on(bench, conductor)
            # Radiance over irradiance is s0/(4 pi), s0 = |Gamma|^2/(2 m^2) square on.
            power_seen = ratio * 4 * math.pi * 2 * slope**2
            check = power_check(name, power, power_seen, 1e-4, source, unit="dB")
            lobes["Metallic BSDF, rough lobe"].append(check)
    return [worst_of(lobe, checks) for lobe, checks in lobes.items()]


def every_angle(bench: Bench) -> list[Check]:
    """A floor seen from 1 m above: each pixel against the textbook form at its own angle."""
    checks = []
    for index in MEDIA:
        new_scene(150.0)
        radar = bpy.data.objects["Radar"]
        radar.rotation_euler.x -= math.radians(25.0)
        floor = Plate(
            np.array([0.0, 0.0, -1.0]), np.array([150.0, 0.0, 0.0]), np.array([0.0, 140.0, 0.0])
        )
        material = nodes.make_material("Floor", index.real, index.imag, 0.0, 0.5, penetrable=False)
        add_plate("Floor", floor, material)
        run = acquire(bench, 64, 1)
        cosine = -run.rows["direction"][:, 2]
        angle_deg = np.degrees(np.arccos(cosine))
        # Beyond 89 degrees float32 of the floor's distance, not of the nodes, is what is seen.
        used = np.flatnonzero(angle_deg < 89.0)
        reach_m = 1 / cosine[used]
        irradiance = EIRP_W / (4 * math.pi * reach_m**2) * cosine[used]
        seen = _radiance(run.rows)[used] / irradiance * math.pi
        want = textbook_reflectance(index, angle_deg[used])
        worst = int(np.argmax(np.abs(np.log(seen / want))))
        for a, s, w in zip(angle_deg[used][::37], seen[::37], want[::37], strict=True):
            bench.point("reflectance", medium=f"{index:g}", angle_deg=a, expected=w, measured=s)
        check = power_check(
            f"floor, n = {index:g}, at {angle_deg[used][worst]:.1f} deg",
            float(want[worst]),
            float(seen[worst]),
            1e-3,
            "Fresnel with Snell's angle, mean of both polarisations",
            unit="dB",
        )
        checks.append(dataclasses.replace(check, points=used.size))
    return checks


GROUP = Group(
    "fresnel",
    "Fresnel reflection",
    "The library against 40 digits; then what comes back through Cycles, from the path table.",
    (
        Case("library against 40 digits", against_table, 2.0, quick=True),
        Case("Brewster, total reflection, grazing", special_angles, 2.0, quick=True),
        Case("Cycles at normal incidence", normal_incidence, 20.0, quick=True),
        Case("Cycles at every angle", every_angle, 20.0),
    ),
)
