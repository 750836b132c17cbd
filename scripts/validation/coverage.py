# SPDX-License-Identifier: GPL-3.0-or-later
"""Coverage diagrams: lobes, a round Earth solved in another way, a render of the same scene."""

from __future__ import annotations

import math

import numpy as np

from radarsim_addon.arrays import Real
from radarsim_addon.blender.headless import scene_coverage
from radarsim_addon.blender.materials import make_physical_material
from radarsim_addon.blender.plan import CoverageRequest
from radarsim_addon.physics.mirrors import MirrorMaterial
from radarsim_addon.signal.radar import ConstantGain, CoverageSetup, Mount, compute_coverage

from .case import Bench, Case, Check, Group, power_check, ratio_db, relative_check, worst_of
from .mirrors import CLEAR_M, FLOOR_DB, GROUNDS, expected_points, gamma
from .scenes import acquire, add_mesh, lambert, new_scene, wavelength

HEIGHT_M = 15.0
HEIGHTS_M = np.linspace(0.5, 120.0, 600)
EARTH_M = np.longdouble(8.495e6)
LOBE_BOUND, ROUND_BOUND_DB, RENDER_BOUND_DB = 1e-3, 0.01, 0.05


def _setup(
    epsilon: complex, carrier_hz: float, polarisation: str, radius_m: float
) -> CoverageSetup:
    pose = np.eye(4)
    pose[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]  # looks along +y
    mount = Mount(ConstantGain(), HEIGHT_M, pose)
    ground = MirrorMaterial(complex(np.sqrt(epsilon)), 1.0, True)
    return CoverageSetup(mount, mount, ground, wavelength(carrier_hz), polarisation, radius_m)


def lobes(bench: Bench) -> list[Check]:
    """Heights of maxima and minima over a flat conductor."""
    checks = []
    for carrier_hz, range_m in ((3e9, 4e3), (10e9, 12e3)):
        setup = _setup(GROUNDS["conductor"][carrier_hz], carrier_hz, "horizontal", math.inf)
        spacing_m = setup.wavelength_m * range_m / (4 * HEIGHT_M)
        height_m = np.linspace(0.3, 6.7, 64_001) * spacing_m
        level = compute_coverage(setup, height_m, range_m).factor[:, 0]
        turns = np.flatnonzero(np.diff(np.sign(np.diff(level)))) + 1
        found = [
            relative_check(
                f"extremum {n} at {carrier_hz / 1e9:g} GHz, {range_m / 1e3:g} km",
                n * spacing_m, float(height_m[turns[n - 1]]), LOBE_BOUND,
                "h = n lambda R / (4 h_r)", unit="m",
            )
            for n in range(1, 7)
        ]  # fmt: skip
        checks.append(worst_of("lobes and nulls", found))
    return checks


def round_earth_pattern(
    epsilon: complex, carrier_hz: float, vertical: bool, range_m: float
) -> tuple[Real, Real]:
    """F^4 and grazing angles over `HEIGHTS_M`: the shortest path via the ground, a tube of rays.

    In Cartesian coordinates with the Earth's centre as origin, in long double.
    """
    angle, radius = np.longdouble(range_m) / EARTH_M, EARTH_M + HEIGHTS_M.astype(np.longdouble)
    radar = np.array([0, EARTH_M + HEIGHT_M], dtype=np.longdouble)
    target = np.stack([radius * np.sin(angle), radius * np.cos(angle)])
    low, high = np.zeros(radius.size, np.longdouble), np.full(radius.size, angle)
    for _ in range(90):
        middle = (low + high) / 2
        foot = EARTH_M * np.stack([np.sin(middle), np.cos(middle)])
        along = np.stack([np.cos(middle), -np.sin(middle)])
        ways = (foot - radar[:, None], foot - target)
        slope = sum((along * way).sum(0) / np.sqrt((way**2).sum(0)) for way in ways)
        low, high = np.where(slope < 0, middle, low), np.where(slope < 0, high, middle)
    legs = [np.sqrt((way**2).sum(0)) for way in ways]
    direct = np.sqrt(((target - radar[:, None]) ** 2).sum(0))
    sine = -(ways[0] * foot).sum(0) / EARTH_M / legs[0]
    # The tube: rays next to the one that is reflected, in the plane and across it.
    way = ways[0] / legs[0]
    turned = np.stack([way[1], -way[0]])
    step = np.longdouble(1e-7)
    widths = []
    for across in (0, 1):
        ends = []
        for sign in (1, -1):
            ray = way + sign * step * turned * (1 - across)
            ray = np.concatenate([ray, np.full((1, radius.size), sign * step * across)])
            ray /= np.sqrt((ray**2).sum(0))
            start = np.array([*radar, 0], dtype=np.longdouble)[:, None]
            b = (start * ray).sum(0)
            with np.errstate(invalid="ignore"):  # rays that miss the Earth, below the horizon
                at = start + ray * (-b - np.sqrt(b * b - (start**2).sum(0) + EARTH_M**2))
            normal = at / EARTH_M
            after = ray - 2 * (ray * normal).sum(0) * normal
            ends.append(at + after * legs[1])
        apart = (ends[0] - ends[1]) / (2 * step)
        apart -= (apart * after).sum(0) * after  # across the rays
        widths.append(np.sqrt((apart**2).sum(0)))
    spread = direct / np.sqrt(widths[0] * widths[1])
    excess = np.asarray(legs[0] + legs[1] - direct, dtype=np.float64)
    grazing = np.arcsin(np.asarray(sine, dtype=np.float64))
    turn = np.exp(-2j * math.pi / wavelength(carrier_hz) * excess)
    coefficient = np.conj(gamma(epsilon, np.sin(grazing), vertical))
    one_way = 1 + coefficient * np.asarray(spread, dtype=np.float64) * turn
    return np.asarray(np.abs(one_way) ** 4), grazing


def round_earth(bench: Bench) -> list[Check]:
    """F^4 over the height of a target at 5, 10 and 20 km, 4/3 of the Earth's radius."""
    checks = []
    for ground, grounds in GROUNDS.items():
        for carrier_hz, epsilon in grounds.items():
            for polarisation in ("horizontal", "vertical"):
                setup = _setup(epsilon, carrier_hz, polarisation, float(EARTH_M))
                worst = []
                for range_m in (5e3, 10e3, 20e3):
                    expected, grazing = round_earth_pattern(
                        epsilon, carrier_hz, polarisation == "vertical", range_m
                    )
                    found = compute_coverage(setup, HEIGHTS_M, range_m)
                    limit = (wavelength(carrier_hz) / (2 * math.pi * float(EARTH_M))) ** (1 / 3)
                    held = grazing > limit
                    assert np.array_equal(held, found.zone[:, 0] == 0)
                    strong = held & (expected > expected[held].max() * 10 ** (-FLOOR_DB / 10))
                    worst += [
                        power_check(
                            f"{range_m / 1e3:g} km", one, other, ROUND_BOUND_DB,
                            "shortest path via the ground, tube of rays, long double", unit="dB",
                        )
                        for one, other in zip(
                            expected[strong], found.factor[strong, 0], strict=True
                        )
                    ]  # fmt: skip
                name = f"{ground}, {carrier_hz / 1e9:g} GHz, {polarisation}"
                checks.append(worst_of(name, worst))
    return checks


def rendered(bench: Bench) -> list[Check]:
    """The diagram of a scene against paths that are rendered in the same scene."""
    checks, range_m, high_m, carrier_hz = [], 1500.0, 20.0, 3e9
    epsilon = GROUNDS["sea"][carrier_hz]
    for polarisation in ("horizontal", "vertical"):
        new_scene(2 * math.degrees(math.atan((high_m / 2) / range_m)))
        index = complex(np.sqrt(epsilon))
        ground = make_physical_material(
            "Ground", "index", carrier_hz=carrier_hz, penetrable=False, n=index.real, k=index.imag
        )
        side, z = 200.0, -high_m / 2
        corners = [(-side, -50, z), (side, -50, z), (side, 2e3, z), (-side, 2e3, z)]
        add_mesh("Ground", corners, [(0, 1, 2, 3)], ground)
        strip = [
            (-5, range_m, z + CLEAR_M),
            (5, range_m, z + CLEAR_M),
            (5, range_m, -z),
            (-5, range_m, -z),
        ]
        add_mesh("Plate", strip, [(0, 1, 2, 3)], lambert(0.6))
        run = acquire(
            bench, 2, 1, height_px=512, carrier_hz=carrier_hz, max_reflections=3,
            polarisation=polarisation,
        )  # fmt: skip
        point_m, measured = expected_points(run, carrier_hz)
        order = np.argsort(point_m[:, 2])
        heights_m, chosen = np.unique(point_m[order, 2] - z, return_index=True)
        request = CoverageRequest(heights_m, np.array([range_m]), flat=True)
        import bpy

        scene = bpy.context.scene
        found = scene_coverage(
            scene, bpy.context.view_layer, request,
            values={"carrier_hz": carrier_hz, "polarisation": polarisation},
        )  # fmt: skip
        expected = found.ground_gain[:, 0]
        measured = measured[order][chosen]
        strong = expected > expected.max() * 10 ** (-FLOOR_DB / 10)
        worst = [
            power_check("", one, other, RENDER_BOUND_DB, "the coverage diagram, flat", unit="dB")
            for one, other in zip(expected[strong], measured[strong], strict=True)
        ]
        checks.append(worst_of(f"rendered paths, sea, 3 GHz, {polarisation}", worst))
        for height_m, one, other in zip(heights_m, expected, measured, strict=True):
            bench.point(
                "coverage_curve", series=polarisation, height_m=height_m,
                diagram_db=ratio_db(one, 1.0), rendered_db=ratio_db(other, 1.0),
            )  # fmt: skip
    return checks


GROUP = Group(
    "coverage",
    "Coverage diagrams",
    "A radar 15 m over a smooth ground. The independent solution looks for the shortest path "
    "via the ground on an Earth of 4/3 of its radius. Compared down to 30 dB below the "
    "strongest.",
    (
        Case("lobes over a conductor", lobes, 5.0, quick=True),
        Case("round Earth", round_earth, 10.0, quick=True),
        Case("render of the same scene", rendered, 40.0),
    ),
)
