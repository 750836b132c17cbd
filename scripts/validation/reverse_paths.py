# SPDX-License-Identifier: GPL-3.0-or-later
"""Second reflections between two walls: a path and its reverse add up coherently.

The expected power is that of pairs of surface elements A, B of two Lambert walls, whose amplitudes
exp(-j k L_AB) + exp(-j k L_BA) have one random phase: the integral of 2 (1 + cos k (L_AB - L_BA)).
"""

from __future__ import annotations

import math

import numpy as np

from radarsim_addon.arrays import Real
from radarsim_addon.signal import open_run
from radarsim_addon.signal.maps import expected_power
from radarsim_addon.signal.scattering import reverse_factors

from .case import Bench, Case, Check, Group, absolute_check, power_check
from .closed_forms import smith_lambda
from .scenes import (
    CARRIER_HZ,
    EIRP_W,
    Acquired,
    Plate,
    acquire,
    add_plate,
    lambert,
    metallic,
    new_scene,
    wavelength,
)

ALBEDO = 0.6
LEFT = Plate(np.array([-2.0, 11.0, 0.1]), np.array([0, 2.0, 0]), np.array([0, 0, 1.5]))
RIGHT = Plate(np.array([2.0, 10.5, 0.0]), np.array([0, 2.0, 0]), np.array([0, 0, 1.5]))
#: Pixels a side, replicates.
SIZE = (256, 12)
BASELINES_M = (0.0, 0.01, 0.02, 0.05, 0.5)
#: Where the wall on the left mirrors to.
ACROSS = Plate(np.array([0.0, 20.0, 0.0]), np.array([4.0, 0, 0]), np.array([0, 0, 3.0]))
#: Widths alpha of the lobe of a metal wall, and pixels a side, replicates.
WIDTHS, FEW = (0.1, 0.3), (128, 24)


def _integrals(site_m: Real) -> tuple[float, float]:
    """Power of all pairs by themselves, in both directions, and with interference [W]."""
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


def narrow(bench: Bench) -> list[Check]:
    """Second reflections between a rough metal and a Lambert wall, by few rays."""
    checks = []
    for width in WIDTHS:
        new_scene(26.0)
        add_plate("Left", LEFT, metallic(1e4 + 1e4j, width / math.sqrt(2)))
        add_plate("Across", ACROSS, lambert(ALBEDO))
        found = acquire(bench, *FEW, max_reflections=2)
        rows = found.rows[found.rows["order"] == 2]
        each = FEW[1] * np.bincount(rows["replicate"], rows["power_w"], minlength=FEW[1])
        error = float(each.std(ddof=1) / math.sqrt(FEW[1]) / each.mean())
        label = f"rough metal (alpha {width:g}) and Lambert wall"
        checks += [
            power_check(
                f"second reflections, {label}",
                2 * _from_lobe(width),
                float(each.mean()),
                0.2,
                "integral over pairs of surface elements",
                relative_error=error,
            ),
            absolute_check(
                f"their relative standard error, {FEW[0]} pixels, {FEW[1]} replicates, {label}",
                0.0,
                error,
                0.03,
                "0.10 and 0.05 where each direction has rays of its own",
            ),
        ]
    return checks


def _from_lobe(width: float) -> float:
    """Power of the paths that begin at a Beckmann lobe of the wall on the left [W]."""
    (a, a_m2), (b, b_m2) = LEFT.nodes(48), ACROSS.nodes(16)
    range_m = np.linalg.norm(a, axis=1)
    back, power_w = -a / range_m[:, None], 0.0
    level = EIRP_W * wavelength() ** 2 / (4 * math.pi) ** 2 * ALBEDO / math.pi
    for point, area_m2 in zip(b, b_m2, strict=True):
        d = np.linalg.norm(point - a, axis=1)
        onward, reach_m = (point - a) / d[:, None], float(np.linalg.norm(point))
        half = onward + back
        facet = half[:, 0] / np.linalg.norm(half, axis=1)
        density = np.exp((1 - facet**-2) / width**2) / (math.pi * width**2 * facet**4)
        masking = 1 + smith_lambda(width, onward[:, 0]) + smith_lambda(width, back[:, 0])
        at_b = onward[:, 1] * point[1] / reach_m**3
        power_w += area_m2 * float(a_m2 @ (density / (4 * masking) * at_b / (range_m * d) ** 2))
    return level * power_w


GROUP = Group(
    "reverse paths",
    "Paths and their reverses",
    "Second reflections between two walls.",
    (
        Case("enhancement", enhancement, 60.0),
        Case("narrow and wide lobes", narrow, 30.0),
    ),
)
