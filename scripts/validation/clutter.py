# SPDX-License-Identifier: GPL-3.0-or-later
"""Clutter: sigma0 of the models, of single paths, of bistatic paths and of second reflections."""

from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path

import numpy as np

from radarsim_addon import blender as radarsim
from radarsim_addon.arrays import Real
from radarsim_addon.blender import nodes
from radarsim_addon.physics.clutter import clutter_model, clutter_velocities, texture
from radarsim_addon.physics.materials import material as library
from radarsim_addon.physics.rough import sigma0 as kirchhoff

from .case import (
    Bench,
    Case,
    Check,
    Group,
    absolute_check,
    power_check,
    relative_check,
    worst_of,
)
from .clutter_profiles import level_ground, sea_profile
from .scattered_lobes import directive_walls, rough_mirrors
from .scenes import EIRP_W, Plate, acquire, add_plate, lambert, new_scene, wavelength

TABLE = Path(__file__).parents[2] / "tests" / "data" / "clutter.csv"
CARRIER_HZ = 9.65e9
#: What an isotropic receiver gets of a cross section of 1 m^2 at 1 m, both ways.
LINK = EIRP_W * wavelength(CARRIER_HZ) ** 2 / (4 * math.pi) ** 3
_SIDES = {"HH": "horizontal", "VV": "vertical", "any": "average"}
_GAMMA_DB = -15.0


def against_table(_bench: Bench) -> list[Check]:
    """Every row of the table, one result a model."""
    with open(TABLE, encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    found: dict[str, list[Check]] = {}
    for row in rows:
        name, value = row["parameters"].split("=")
        ghz = 1.0 if row["frequency_ghz"] == "any" else float(row["frequency_ghz"])
        db = clutter_model(row["model"]).sigma0_db(
            ghz * 1e9,
            math.radians(float(row["grazing_deg"])),
            _SIDES[row["polarisation"]],
            **{name: float(value)},
        )
        label = f"{row['parameters']}, {ghz:g} GHz, {row['grazing_deg']} deg {row['polarisation']}"
        expected = float(row["sigma0_db"])
        found.setdefault(row["model"], []).append(
            absolute_check(label, expected, float(db), 1e-3, row["source"], unit="dB")
        )
    return [worst_of(f"sigma0, {model}", checks) for model, checks in found.items()]


def of_paths(bench: Bench) -> list[Check]:
    """sigma0 of each path against the model at its own angle: level, askew and facing."""
    sea, checks = clutter_model("nrl_sea"), []
    for name, tilt_deg, slope in (
        ("level", 90.0, 0.0),
        ("askew", 50.0, 0.0),
        ("askew, rough", 50.0, 0.3),
        ("facing, rough", 6.0, 0.15),
    ):
        new_scene(12.0)
        level = tilt_deg == 90
        tilt, spin = math.radians(tilt_deg), math.radians(0.0 if level else 25.0)
        right = np.array([math.cos(spin), math.sin(spin), 0.0])
        ahead = np.array([-math.sin(spin), math.cos(spin), 0.0])
        back = math.sin(tilt) * ahead + math.cos(tilt) * np.array([0.0, 0.0, 1.0])
        # off the middle: a ray that meets the edge of two triangles counts both or none
        centre = np.array([3.0, 60.0, -0.05] if level else [3.0, 20.0, 1.0])
        plate = Plate(centre, 60 * right, 110 * back)
        material = radarsim.material("sea_water", rms_slope=slope)
        radarsim.set_clutter(material, "nrl_sea", sea_state=3)
        add_plate("Sea", plate, material)
        rows = acquire(bench, 64, 4, carrier_hz=CARRIER_HZ, polarisation="horizontal").rows
        sine = np.abs(rows["direction"] @ plate.normal)
        range_m = rows["length_m"] / 2
        measured = rows["power_w"] * range_m**2 * sine / rows["solid_angle_sr"] / LINK
        psi = np.arcsin(sine)
        expected = 10 ** (sea.sigma0_db(CARRIER_HZ, psi, "horizontal", sea_state=3) / 10)
        if slope:
            index = complex(library("sea_water", CARRIER_HZ, beyond_band="hold"))
            expected = expected + kirchhoff(index, slope, sine, "cycles")
        kept = np.degrees(psi) >= 0.05
        error_db = 10 * np.log10(measured[kept] / expected[kept])
        worst = int(np.argmax(np.abs(error_db)))
        check = power_check(
            f"sigma0 of a path, {name}, {np.degrees(psi[kept]).min():.2f} to "
            f"{np.degrees(psi[kept]).max():.0f} deg",
            float(expected[kept][worst]),
            float(measured[kept][worst]),
            0.01,
            "NRL model, and Kirchhoff's where rough",
            unit="dB",
        )
        checks.append(dataclasses.replace(check, points=int(kept.sum())))
    return checks


def fluctuations(_bench: Bench) -> list[Check]:
    """Moments of K texture, and the slope of the exponential spectrum."""
    grid = np.stack(np.meshgrid(*[np.arange(20) * 7.3] * 2, [0.0]), -1).reshape(-1, 3)
    means, orders = [], []
    for nu in (0.5, 1.0, 4.0):
        found = np.concatenate([texture(grid, "k", nu, 2.0, seed) for seed in range(400)])
        source = "gamma distribution of mean 1"
        means.append(relative_check(f"nu {nu:g}", 1.0, float(found.mean()), 0.01, source))
        orders.append(relative_check(f"nu {nu:g}", nu, float(1 / found.var()), 0.03, source))
    rng, count, speed_mps = np.random.default_rng(3), 400_000, 0.15
    draws = rng.uniform(size=count), rng.uniform(size=count)
    speeds = np.abs(clutter_velocities("exponential", speed_mps, 0.3, draws, np.ones(count), 0.03))
    histogram, edges = np.histogram(speeds[speeds > 0], np.linspace(0, 6 * speed_mps, 19))
    slope = np.polyfit((edges[1:] + edges[:-1]) / 2, np.log(histogram), 1)[0]
    return [
        worst_of("mean of K texture", means),
        worst_of("order of K texture, 1 / variance", orders),
        relative_check(
            "slope of the exponential spectrum", -1 / speed_mps, float(slope), 0.05,
            "exp(-|v| / speed)", unit="s/m",
        ),
    ]  # fmt: skip


def effective_roughness(bench: Bench) -> list[Check]:
    """A Simple material with Specularity 1 - S^2: the Lambert variant of Degli-Esposti's walls.

    Of the power that the boundary reflects, S^2 is scattered: sigma0 = 4 S^2 F sin^2 psi; its
    integral over all directions, S^2 F, and the mirrored rest (1 - S^2) F make up F.
    """
    checks = []
    for scattering in (0.2, 0.6):
        new_scene(12.0)
        material = nodes.make_material(
            "Wall", n=2.4, kappa=0.1, specularity=1 - scattering**2, roughness=0.0
        )
        tilt, spin = math.radians(50.0), math.radians(25.0)
        right = np.array([math.cos(spin), math.sin(spin), 0.0])
        ahead = np.array([-math.sin(spin), math.cos(spin), 0.0])
        back = math.sin(tilt) * ahead + math.cos(tilt) * np.array([0.0, 0.0, 1.0])
        plate = Plate(np.array([3.0, 20.0, 1.0]), 60 * right, 110 * back)
        add_plate("Wall", plate, material)
        rows = acquire(bench, 64, 1, carrier_hz=CARRIER_HZ).rows
        sine = np.abs(rows["direction"] @ plate.normal)
        range_m = rows["length_m"] / 2
        measured = rows["power_w"] * range_m**2 * sine / rows["solid_angle_sr"] / LINK
        expected = 4 * scattering**2 * _fresnel(2.4 + 0.1j, sine) * sine**2
        error_db = 10 * np.log10(measured / expected)
        worst = int(np.argmax(np.abs(error_db)))
        checks.append(
            power_check(
                f"sigma0 of a wall by effective roughness, S = {scattering:g}, "
                f"{np.degrees(np.arcsin(sine.min())):.0f} to "
                f"{np.degrees(np.arcsin(sine.max())):.0f} deg",
                float(expected[worst]),
                float(measured[worst]),
                0.01,
                "4 S^2 F sin^2",
                unit="dB",
            )
        )
    return checks


def _fresnel(index: complex, sine: Real) -> Real:
    """Mean reflectance of both polarisations at sines of grazing angles."""
    root = np.sqrt(index**2 - (1 - sine**2))
    h, v = (sine - root) / (sine + root), (index**2 * sine - root) / (index**2 * sine + root)
    return np.asarray((np.abs(h) ** 2 + np.abs(v) ** 2) / 2)


def other_directions(bench: Bench) -> list[Check]:
    """Totals of a bistatic plate and of second reflections at a wall, against integrals."""
    return [_bistatic(bench), *_second_reflections(bench)]


def _clutter_plate(name: str, plate: Plate) -> None:
    material = radarsim.material("vacuum")
    radarsim.set_clutter(material, "constant_gamma", gamma_db=_GAMMA_DB)
    links = material.node_tree.links
    for link in [one for one in links if one.to_socket.name == "Volume"]:
        links.remove(link)  # opaque, so that nothing is seen through it
    add_plate(name, plate, material)


def _bistatic(bench: Bench) -> Check:
    site = np.array([3.0, 4.0, 2.0])
    new_scene(26.0, transmitter_m=site.tolist())
    plate = Plate(np.array([0.0, 11.5, -1.5]), np.array([4.0, 0, 0]), np.array([0, 5.0, 0]))
    _clutter_plate("Ground", plate)
    measured, spread = acquire(bench, 192, 16, carrier_hz=CARRIER_HZ).power_w()
    points, weights = plate.nodes(48)
    (sine_r, r), (sine_t, t) = _seen(points, np.zeros(3)), _seen(points, site)
    sigma = 10 ** (_GAMMA_DB / 10) * np.sqrt(sine_r * sine_t)
    expected = LINK * float(np.sum(weights * sigma / (r * t) ** 2))
    return power_check(
        "bistatic, order 1, constant gamma",
        expected,
        measured,
        0.02,
        "integral of sqrt(sigma0 sigma0)",
        relative_error=spread,
    )


def _seen(points: Real, place: Real) -> tuple[Real, Real]:
    way = place - points
    distance = np.linalg.norm(way, axis=-1)
    return way[..., 2] / distance, distance


def _second_reflections(bench: Bench) -> list[Check]:
    new_scene(34.0)
    # a gap between both: the integral has a pole where they meet
    ground = Plate(np.array([0.0, 9.5, -1.0]), np.array([4.0, 0, 0]), np.array([0, 3.0, 0]))
    wall = Plate(np.array([0.0, 12.0, 0.5]), np.array([4.0, 0, 0]), np.array([0, 0, 3.0]))
    _clutter_plate("Ground", ground)
    add_plate("Wall", wall, lambert(0.6))
    found = acquire(bench, 192, 8, carrier_hz=CARRIER_HZ, max_reflections=2)
    two = found.rows[found.rows["order"] == 2]
    first = two["first_object"] == found.record.objects.index("Ground") + 1
    low, low_m2 = ground.nodes(48)
    high, high_m2 = wall.nodes(48)
    (sine, near), (_, far) = _seen(low, np.zeros(3)), _seen(high, np.zeros(3))
    between = high[None] - low[:, None]
    d = np.linalg.norm(between, axis=-1)
    sigma = 10 ** (_GAMMA_DB / 10) * np.sqrt(sine[:, None] * between[..., 2] / d)
    wall_sigma = 4 * 0.6 * (between[..., 1] / d) * (high[:, 1] / far)[None]
    part = sigma * wall_sigma / (near[:, None] * far[None] * d) ** 2
    total = LINK / (4 * math.pi) * float(np.einsum("ij,i,j", part, low_m2, high_m2))
    return [
        power_check(
            f"order 2, constant gamma and a wall, {name}",
            total,
            float(two["power_w"][mine].sum()),
            0.2,
            "integral over both surfaces",
        )
        for name, mine in (("ground first", first), ("wall first", ~first))
    ]


GROUP = Group(
    "clutter",
    "Clutter",
    "Models of sigma0 against another code; sigma0 of each path of a scene; bistatic powers, "
    "second reflections and range profiles against integrals over the surfaces.",
    (
        Case("tables", against_table, 5.0, quick=True),
        Case("paths", of_paths, 30.0),
        Case("fluctuations", fluctuations, 20.0),
        Case("effective roughness", effective_roughness, 20.0),
        Case("other directions", other_directions, 60.0),
        Case("directive walls", directive_walls, 60.0),
        Case("rough mirrors", rough_mirrors, 60.0),
        Case("level ground", level_ground, 30.0),
        Case("sea profile", sea_profile, 30.0),
    ),
)
