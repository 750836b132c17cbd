# SPDX-License-Identifier: GPL-3.0-or-later
"""Walls of buildings: a thin one on the way from the transmitter alone."""

from __future__ import annotations

import dataclasses

import numpy as np

from radarsim_addon.blender.materials.physical_materials import make_physical_material

from .case import Bench, Case, Check, Group, absolute_check
from .scenes import acquire, add_box, add_plate, facing_plate, new_scene, wavelength
from .slabs import metal, passage

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


GROUP = Group(
    "buildings",
    "Walls of buildings",
    "As before, in scenes that are less plain.",
    (Case("lit through a film", film, 10.0),),
)
