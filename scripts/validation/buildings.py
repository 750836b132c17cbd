# SPDX-License-Identifier: GPL-3.0-or-later
"""Walls of buildings: several in one mesh, and a thin one before the transmitter alone."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np

from radarsim_addon.blender.materials.physical_materials import make_physical_material

from .case import Bench, Case, Check, Group, absolute_check, power_check
from .scenes import CARRIER_HZ as USUAL_HZ
from .scenes import acquire, add_box, add_mesh, add_plate, facing_plate, new_scene, wavelength
from .slabs import POWER_DB, SOURCE, metal, passage

CARRIER_HZ = 77e9


def film(bench: Bench) -> list[Check]:
    """A film before the transmitter, which the receiver looks past, from 30 m to 1 km."""
    checks, index, transmitter_m = [], 1.6 + 0j, (8.0, 0.0, 0.0)
    for range_m, thickness_m in ((30.0, 2e-5), (1000.0, 1e-3)):
        new_scene(30.0 / range_m, transmitter_m=transmitter_m)
        add_plate("Plate", facing_plate((0.0, range_m, 0.0), 1.0), metal())
        wall = make_physical_material("Film", "index", carrier_hz=CARRIER_HZ, n=index.real, k=0.0)
        add_box("Film", (5.1, 5.0, -3.0), (11.1, 5.0 + thickness_m, 3.0), wall)
        rows = acquire(bench, 8, 2, carrier_hz=CARRIER_HZ).of("Plate")
        way_m = rows["last_scatterer_m"] - transmitter_m
        bare_m = np.linalg.norm(way_m, axis=1) + np.linalg.norm(rows["last_scatterer_m"], axis=1)
        cosine = way_m[:, 1] / np.linalg.norm(way_m, axis=1)
        longer_m = passage(index, thickness_m, wavelength(CARRIER_HZ), cosine)[2]
        sigma_m = float(rows["length_sigma_m"].mean())
        got_m = float(np.mean(rows["length_m"] - bare_m))
        label = f"{1e3 * thickness_m:g} mm, {range_m:g} m: longer (sigma {1e3 * sigma_m:.2g} mm)"
        source = "d (Re q - cos), of what the transmitter alone sees through"
        row = absolute_check(label, float(longer_m.mean()), got_m, sigma_m, source, unit="m")
        checks.append(dataclasses.replace(row, points=rows.size))
    return checks


def one_mesh(bench: Bench) -> list[Check]:
    """Walls of several thicknesses and tilts in one object, which a scale by axes distorts."""
    checks, index = [], complex(np.sqrt(4.2 + 0.05j))
    cases = ((1, 37.0), (2, 37.0), (2, 70.0), (4, 37.0), (4, 70.0))
    for count, angle_deg, smooth in (*((*case, False) for case in cases), (4, 37.0, True)):
        walls = [(0.05 + 0.03 * n, angle_deg - 9.0 * n) for n in range(count)]
        found = []
        for used in ((), walls):
            new_scene(0.02)
            add_plate("Plate", facing_plate((0.0, 100.0, 0.0), 4.0), metal())
            if used:
                _joined(used, index, smooth)
            rows = acquire(bench, 8, 1).of("Plate")
            power_w = float(rows["power_w"].sum())
            found.append((power_w, float(rows["power_w"] @ rows["length_m"]) / power_w))
        powers, longer_m = np.ones(2), 0.0
        for thickness_m, tilt_deg in walls:
            cosine = np.array(math.cos(math.radians(tilt_deg)))
            s, p, more_m = passage(index, thickness_m, wavelength(), cosine)
            powers, longer_m = powers * (s, p), longer_m + 2 * float(more_m)
        label = f"{count} walls of one mesh, from {angle_deg:g} deg down"
        label += ", shaded smooth" if smooth else ""
        want, got = float(powers.mean()) ** 2, found[1][0] / found[0][0]
        source = "mean over s and p of the product of all walls, each way"
        checks.append(power_check(f"{label}: power", want, got, POWER_DB, source, unit="dB"))
        got_m = found[1][1] - found[0][1]
        checks.append(absolute_check(f"{label}: longer", longer_m, got_m, 2e-4, SOURCE, unit="m"))
    return checks


def _joined(walls: Sequence[tuple[float, float]], index: complex, smooth: bool) -> None:
    """Boxes of a thickness [m] and turn about Z [deg] each, as one object."""
    scale = np.array([1.7, 0.6, 1.0])
    corners, faces = [], []
    for number, (thickness_m, tilt_deg) in enumerate(walls):
        angle = math.radians(tilt_deg)
        half = ((math.cos(angle), math.sin(angle), 0.0), (-math.sin(angle), math.cos(angle), 0.0))
        extents = np.array([3.01, thickness_m / 2, 3.2])
        for signs in itertools.product((-1, 1), repeat=3):
            along, across, up = extents * signs
            place = along * np.array(half[0]) + across * np.array(half[1]) + (0.0, 0.0, up)
            corners.append((place + np.array([0.05, 12.0 + 9.0 * number, 0.07])) / scale)
        box = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        faces += [tuple(8 * number + corner for corner in side) for side in box]
    wall = make_physical_material("Walls", "index", carrier_hz=USUAL_HZ, n=index.real, k=index.imag)
    item = add_mesh("Walls", corners, faces, wall)
    item.scale = scale
    item.data.polygons.foreach_set("use_smooth", [smooth] * len(faces))


GROUP = Group(
    "buildings",
    "Walls of buildings",
    "Scenes that are less plain.",
    (Case("lit through a film", film, 10.0), Case("walls of one mesh", one_mesh, 60.0)),
)
