# SPDX-License-Identifier: GPL-3.0-or-later
"""Second reflections between two walls: a path and its reverse add up coherently.

The expected power is that of pairs of surface elements A, B of two Lambert walls, whose amplitudes
exp(-j k L_AB) + exp(-j k L_BA) have one random phase: the integral of 2 (1 + cos k (L_AB - L_BA)).
"""

from __future__ import annotations

import math

import numpy as np

from radarsim_addon.array_types import Real
from radarsim_addon.signal import open_run
from radarsim_addon.signal.maps import expected_power
from radarsim_addon.signal.scattering import reverse_factors

from .case import Bench, Case, Check, Group, absolute_check, power_check
from .scenes import (
    CARRIER_HZ,
    EIRP_W,
    Acquired,
    Plate,
    acquire,
    add_plate,
    lambert,
    new_scene,
    wavelength,
)

ALBEDO = 0.6
LEFT = Plate(np.array([-2.0, 11.0, 0.1]), np.array([0, 2.0, 0]), np.array([0, 0, 1.5]))
RIGHT = Plate(np.array([2.0, 10.5, 0.0]), np.array([0, 2.0, 0]), np.array([0, 0, 1.5]))
#: Pixels a side, replicates.
SIZE = (256, 12)
BASELINES_M = (0.0, 0.01, 0.02, 0.05, 0.5)


def _integrals(site_m: Real) -> tuple[float, float]:
    """Power of all pairs by themselves, both ways round, and with interference [W]."""
    (a, a_m2), (b, b_m2) = LEFT.nodes(40), RIGHT.nodes(40)
    across = b[None] - a[:, None]
    d = np.linalg.norm(across, axis=-1)
    between = across[..., 0] ** 2 / d**4

    def leg(points: Real, place: Real) -> tuple[Real, Real]:
        """Cosine over the squared distance, and distance, of walls across x."""
        way = place - points
        far = np.linalg.norm(way, axis=-1)
        return np.abs(way[:, 0]) / far**3, far

    origin = np.zeros(3)
    (a_seen, a_r), (a_lit, a_t) = leg(a, origin), leg(a, site_m)
    (b_seen, b_r), (b_lit, b_t) = leg(b, origin), leg(b, site_m)
    level = EIRP_W * wavelength() ** 2 / (4 * math.pi) ** 2 * (ALBEDO / math.pi) ** 2
    weights = level * np.outer(a_m2, b_m2) * between
    one, other = weights * np.outer(a_seen, b_lit), weights * np.outer(a_lit, b_seen)
    longer = (a_r[:, None] + b_t[None]) - (a_t[:, None] + b_r[None])
    both = 2 * np.sqrt(one * other) * np.cos(2 * math.pi / wavelength() * longer)
    return float((one + other).sum()), float((one + other + both).sum())


def enhancement(bench: Bench) -> list[Check]:
    """Expected power over the sum of powers, of antennas in one place and apart."""
    checks = []
    for baseline_m in BASELINES_M:
        site = np.array([baseline_m, 0.0, 0.0])
        new_scene(26.0, transmitter_m=site.tolist())
        add_plate("Left", LEFT, lambert(ALBEDO))
        add_plate("Right", RIGHT, lambert(ALBEDO))
        found = acquire(bench, *SIZE, max_reflections=2)
        rows = found.rows[found.rows["order"] == 2]
        factors = reverse_factors(rows, found.record, CARRIER_HZ, math.inf)
        alone, together = _integrals(site)
        power_w = float(rows["power_w"].sum())
        name = f"{baseline_m:g} m apart"
        if baseline_m == 0:
            each = np.bincount(rows["replicate"], rows["power_w"])
            checks.append(
                power_check(
                    "sum of powers of second reflections",
                    alone,
                    power_w,
                    0.2,
                    "integral",
                    relative_error=float(each.std(ddof=1) * math.sqrt(each.size) / power_w),
                )
            )
            checks.append(_chain(bench, found, together))
        checks.append(
            absolute_check(
                f"enhancement of second reflections, {name}",
                together / alone,
                float(rows["power_w"] @ factors) / power_w,
                0.02,
                "pairs of surface elements with one phase",
            )
        )
    return checks


def _chain(bench: Bench, found: Acquired, together_w: float) -> Check:
    """The same in the expected power of the map, over that of the first reflections alone."""
    profiles = [
        expected_power(open_run(one.folder).frame(1), cells_per_sample=16).profile.sum()
        for one in (found, acquire(bench, *SIZE, max_reflections=1))
    ]
    first_w = float(found.rows["power_w"][found.rows["order"] == 1].sum())
    return power_check(
        "expected power with second reflections over that without",
        1 + together_w / first_w,
        float(profiles[0] / profiles[1]),
        0.02,
        "integral over pairs of surface elements",
        unit="dB",
    )


GROUP = Group(
    "reverse paths",
    "Paths and their reverses",
    "Second reflections between two walls, against integrals over pairs of surface elements.",
    (Case("enhancement", enhancement, 60.0),),
)
