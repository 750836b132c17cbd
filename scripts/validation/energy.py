# SPDX-License-Identifier: GPL-3.0-or-later
"""Conservation of energy: what a white furnace shows of surfaces and slabs."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from radarsim_addon.arrays import Real
from radarsim_addon.blender import nodes
from radarsim_addon.blender.nodes.materials import preset_material

from .case import Bench, Case, Check, Group, absolute_check, worst_of
from .closed_forms import smith_lambda
from .energy_slabs import library_faces, library_slabs, not_above, simple_slabs
from .fresnel import textbook_reflectance
from .furnace import look_down, radiance, sky_scene
from .scenes import add_plate, facing_plate, metallic

ANGLES_DEG = (0.0, 30.0, 60.0, 75.0)


def smith_albedo(
    alpha: float, angle_deg: float, reflectance: Callable[[Real], Real] | None = None
) -> float:
    """Share of the power that single scattering by a Beckmann surface sends upwards.

    The integral over the facets' normals m of F (i.m) G_2 D(m) / (n.i), quadrature in
    tan^2 = -alpha^2 ln(1 - u), with Smith's exact Lambda, height-correlated G_2 (Heitz 2014).
    """
    x, w = np.polynomial.legendre.leggauss(160)
    share, weight = (x + 1) / 2, w / 2
    tangent = alpha * np.sqrt(-np.log1p(-share))[:, None]
    azimuth = (np.arange(320) + 0.5)[None, :] * (math.pi / 320)
    cos_i, sin_i = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    cos_m = 1 / np.sqrt(1 + tangent**2)
    facing = cos_i * cos_m + sin_i * tangent * cos_m * np.cos(azimuth)
    cos_o = 2 * facing * cos_m - cos_i
    seen = (facing > 0) & (cos_o > 0)

    lost = smith_lambda(alpha, np.array(cos_i)) + smith_lambda(alpha, np.where(seen, cos_o, 1.0))
    fresnel = 1.0 if reflectance is None else reflectance(np.clip(facing, 0, 1))
    value = np.where(seen, fresnel * facing / (cos_i * cos_m) / (1 + lost), 0.0)
    return float(np.sum(weight[:, None] * value) / 320)


def _surface(material: Callable[[], Any], angle_deg: float) -> Any:
    """Sky and plate, face up, seen at an angle; the scene."""
    scene = sky_scene()
    plate = facing_plate((0.0, 0.0, 0.0), 1e3, 90.0, spin_deg=13.0)
    add_plate("Plate", plate, material())
    look_down(scene, angle_deg)
    return scene


def smooth_surfaces(bench: Bench) -> list[Check]:
    """Mirror-like media: what comes from above is R, from below T; R + T = 1."""
    checks = []
    for key, preset in nodes.PRESETS.items():

        def material(preset: Any = preset) -> Any:
            return nodes.make_material("Smooth", preset.n, preset.kappa, 1.0, 0.0)

        found = []
        for angle_deg in ANGLES_DEG:
            total, spread = radiance(bench, _surface(material, angle_deg), 64).both
            # A metal is opaque: it absorbs what it does not reflect.
            passes = nodes.interface.OPAQUE_BELOW_TRANSMITTANCE
            index = complex(preset.n, preset.kappa)
            reflected = textbook_reflectance(index, angle_deg)
            absorbed = 0.0
            if 1 - textbook_reflectance(index, 0.0) < passes:
                absorbed = 1 - reflected
            name = f"reflected + transmitted + absorbed at {angle_deg:g} deg"
            found.append(
                absolute_check(
                    name,
                    1.0,
                    total + absorbed,
                    1e-3,
                    "conservation of energy",
                    standard_error=spread,
                )
            )
        checks.append(worst_of(f"face of {key}", found))
    return checks


def rough_conductors(bench: Bench) -> list[Check]:
    """Albedo of the Metallic BSDF; one result a roughness and medium, and the table of deficits."""
    checks, brightest = [], []
    table: dict[tuple[float, float], float] = {}
    alphas = (0.1, 0.3, 0.6, 1.0)
    # Up to 4.5 the lobe takes Fresnel's equations in a form for large indices: docs/internals.md.
    new = bpy.app.version >= (5, 0, 0)
    for alpha in alphas:
        for index in (1e4 + 1e4j, 2.3 + 0.05j):

            def material(index: complex = index, alpha: float = alpha) -> Any:
                return metallic(index, alpha / math.sqrt(2))

            def reflectance(cosine: Real, index: complex = index) -> Real:
                angle = np.degrees(np.arccos(cosine))
                return np.asarray(textbook_reflectance(index, angle))

            found = []
            exact = new or abs(index) > 1e3
            for angle_deg in ANGLES_DEG:
                value, spread = radiance(bench, _surface(material, angle_deg), 64).both
                expected = smith_albedo(alpha, angle_deg, reflectance)
                row = absolute_check(
                    f"albedo at {angle_deg:g} deg",
                    expected,
                    value,
                    3e-3 if exact else 0.03,
                    "Smith-Beckmann single scattering, integrated numerically",
                    standard_error=spread,
                )
                found.append(row if exact else dataclasses.replace(row, usual_bound=3e-3))
                brightest.append(value)
                if abs(index) > 1e3:
                    table[alpha, angle_deg] = 1 - value
            checks.append(worst_of(f"alpha {alpha:g}, n = {index:g}", found))
    checks.append(not_above("rough conductors", brightest))
    heads = [f"{angle:g}°" for angle in ANGLES_DEG]
    bench.lines += [
        "",
        (
            "What single scattering loses on a rough, nearly perfect conductor (n = 1e4 + 1e4j), "
            "fraction of the power, measured in the furnace:"
        ),
        "",
        "| alpha | rms slope | " + " | ".join(heads) + " |",
        "| --- " * (2 + len(heads)) + "|",
    ]
    for alpha in alphas:
        cells = [f"{max(table[alpha, angle], 0.0):.3f}" for angle in ANGLES_DEG]
        bench.lines.append(
            f"| {alpha:g} | {alpha / math.sqrt(2):.3f} | " + " | ".join(cells) + " |"
        )
    return checks


def presets(bench: Bench) -> list[Check]:
    """Every preset as users get it, at all angles: never more than comes in."""
    checks = []
    for key in nodes.PRESETS:
        values = []
        for angle_deg in (*ANGLES_DEG, 85.0):
            scene = _surface(lambda key=key: preset_material(key), angle_deg)
            values.append(radiance(bench, scene, 64).both[0])
        checks.append(not_above(f"preset {key}", values))
    assert bpy.data.materials
    return checks


GROUP = Group(
    "energy",
    "Energy",
    "Surfaces under a sky of radiance 1, 32 x 32 pixels of 64 samples. Standard errors are "
    "those of the mean over the pixels.",
    (
        Case("smooth surfaces", smooth_surfaces, 30.0),
        Case("slabs of presets", simple_slabs, 60.0),
        Case("slabs of the library", library_slabs, 120.0),
        Case("faces of the library", library_faces, 60.0),
        Case("rough conductors", rough_conductors, 60.0),
        Case("presets", presets, 30.0),
    ),
)
