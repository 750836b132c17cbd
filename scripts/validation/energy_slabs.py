# SPDX-License-Identifier: GPL-3.0-or-later
"""Conservation of energy of slabs: simple presets and the asset library, in every polarisation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import (
    EXACT_FACETS,
    read_surface,
    set_layer_normals,
    settle_interiors,
    update_materials,
)
from radarsim_addon.blender.materials.physical_materials import ASSETS, Medium
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.nodes.groups import refresh_groups
from radarsim_addon.blender.state import SettingsRestorer, evaluated_snapshot
from radarsim_addon.blender.ui.material_panel import BLEND

from .case import Bench, Check, absolute_check, worst_of
from .fresnel import textbook_reflectance
from .furnace import Radiance, look_down, radiance, sky_scene
from .scenes import CARRIER_HZ, add_box, add_plate, facing_plate, wavelength

SLAB_ANGLES_DEG = (0.0, 30.0, 60.0)
#: In the order of the numbers that shaders get.
POLARISATIONS = ("average", "vertical", "horizontal")
#: Nothing may send back more than it gets, but for sampling noise.
MOST = 1.002
MOST_SOURCE = "no surface sends back more than it gets"
#: Of library materials. Thin enough for glass and plasterboard to show many echoes inside.
SLAB_M = 0.05
SAMPLES = 64
#: Of faces, whose largest share alone is asked for.
FACE_SAMPLES = 8
SUM_BOUND = 1e-3
#: Reflected and transmitted alone: a ray takes one of them at random, so that
#: either has a standard error of 6e-4; their sum has not.
PART_BOUND = 3e-3
SUM = "reflected + transmitted + absorbed"


def simple_slabs(bench: Bench) -> list[Check]:
    """Presets of the simple material in a closed white furnace, smooth, in every polarisation.

    Their model is unpolarised: F at both faces, straight on inside. A conductor is opaque.
    """
    checks, brightest = [], []
    for key, preset in nodes.PRESETS.items():
        index = complex(preset.n, preset.kappa)
        # Thick enough for some 60 % to be absorbed on one passage, straight through.
        depth = 0.07 / preset.kappa if preset.penetrable else 0.5
        found = []
        scene = sky_scene()
        material = nodes.make_material(
            "Slab", preset.n, preset.kappa, 1.0, 0.0, penetrable=preset.penetrable
        )
        add_box("Slab", (-501.0, -499.0, -depth), (497.0, 503.0, 0.0), material)
        furnace = _Furnace(bench, scene)
        for angle_deg in SLAB_ANGLES_DEG:
            faces = float(textbook_reflectance(index, angle_deg))
            sent = faces
            if preset.penetrable:
                cosine = math.cos(math.radians(angle_deg))
                sent = _series(faces, (1 - faces) ** 2, 4 * math.pi * preset.kappa * depth / cosine)
            for number, name in enumerate(POLARISATIONS):
                total, spread = furnace(angle_deg, number).both
                brightest.append(total)
                found.append(_sum_check(angle_deg, name, total, sent, spread))
        thickness = f"{depth:.3g} units" if preset.penetrable else "opaque"
        checks.append(worst_of(f"slab of preset {key}, {thickness}", found))
    return [*checks, not_above("slabs of presets", brightest)]


def library_slabs(bench: Bench) -> list[Check]:
    """Every smooth material of the asset library, each polarisation against its own series.

    In *average* reflected and transmitted power are measured apart, too, and so is 80 degrees.
    """
    checks, parts, brightest = [], [], []
    table = ["", f"Slabs of {SLAB_M * 1e3:g} mm at 5.3 GHz, *average*: measured less the mean of"]
    table[1] += " both polarisations' series, reflected / transmitted / both:"
    angles = (*SLAB_ANGLES_DEG, 80.0)
    table += ["", "| material | " + " | ".join(f"{a:g}°" for a in angles) + " |"]
    table += ["| --- " * (1 + len(angles)) + "|"]
    for asset in ASSETS:
        if asset.rms_height_m:
            continue
        index = Medium(asset.medium, asset.parameters).index(CARRIER_HZ)
        furnace = _library_furnace(bench, asset.name, SLAB_M)
        opaque = read_surface(bpy.data.materials[asset.name]).is_opaque
        found, row = [], []
        for angle_deg in angles:
            expected = _library_series(index, opaque, angle_deg)
            mean = np.mean(expected, axis=0)
            average = furnace(angle_deg)
            up, down, _ = average
            off = up[0] - mean[0], down[0] - mean[1]
            row.append(f"{off[0]:+.4f} / {off[1]:+.4f} / {sum(off):+.4f}")
            for what, one, value in (("reflected", up, mean[0]), ("transmitted", down, mean[1])):
                parts.append(
                    absolute_check(
                        f"{asset.name}, {what} at {angle_deg:g} deg",
                        float(value),
                        one[0],
                        PART_BOUND,
                        "mean of both polarisations' series of passages",
                        standard_error=one[1],
                    )
                )
            for number, name in enumerate(POLARISATIONS):
                if number and angle_deg > SLAB_ANGLES_DEG[-1]:
                    continue
                # The plane of incidence holds world Z: vertical is p.
                sent = float(np.sum((mean, expected[1], expected[0])[number]))
                seen = furnace(angle_deg, number) if number else average
                total, spread = seen.both
                brightest.append(total)
                found.append(_sum_check(angle_deg, name, total, sent, spread))
        checks.append(worst_of(f"slab of {asset.name}, {SLAB_M * 1e3:g} mm", found))
        table.append(f"| {asset.name} | " + " | ".join(row) + " |")
    bench.lines += table
    return [
        *checks,
        worst_of("average, one part", parts),
        not_above("slabs of the library", brightest),
    ]


def library_faces(bench: Bench) -> list[Check]:
    """Every material of the asset library as users get it, rough or smooth, at all angles."""
    values = []
    for asset in ASSETS:
        furnace = _library_furnace(bench, asset.name, 0.0)
        angles = (0.0, 30.0, 60.0, 75.0, 85.0)
        values += [furnace(angle_deg, 0, FACE_SAMPLES).both[0] for angle_deg in angles]
    return [not_above("materials of the library", values)]


def not_above(name: str, values: list[float]) -> Check:
    """The largest of them is no more than MOST; below 1 there is no error."""
    largest = max(values)
    error = max(largest - 1, 0.0) if math.isfinite(largest) else math.nan
    label = f"{name}: largest share sent back"
    return Check(label, 1.0, largest, "", error, MOST - 1, "1", MOST_SOURCE, points=len(values))


def _sum_check(angle_deg: float, name: str, total: float, sent: float, spread: float) -> Check:
    """R + T + A = 1, with the absorbed share A = 1 - R - T of the closed form."""
    return absolute_check(
        f"{SUM} at {angle_deg:g} deg, {name}",
        1.0,
        total + 1 - sent,
        SUM_BOUND,
        "series of passages through both faces",
        standard_error=spread,
    )


@dataclass
class _Furnace:
    """One scene for all renders of a material: making it takes longer than a render."""

    bench: Bench
    scene: Any

    def __call__(self, angle_deg: float, polarisation: int = 0, samples: int = SAMPLES) -> Radiance:
        self.scene[attributes.ATTR_POLARISATION] = float(polarisation)
        if self.scene.camera is not None:
            bpy.data.objects.remove(self.scene.camera)
        look_down(self.scene, angle_deg)
        return radiance(self.bench, self.scene, samples)


def _library_furnace(bench: Bench, name: str, thickness_m: float) -> _Furnace:
    """A slab, or a plate of no thickness, of a material from the library's file, brought up to
    date as a run does."""
    scene = sky_scene()
    scene[attributes.ATTR_WAVELENGTH] = wavelength()
    scene[attributes.ATTR_FACET_FRESNEL] = float(EXACT_FACETS)
    with bpy.data.libraries.load(str(BLEND), link=False) as (_, chosen):
        chosen.materials = [name]
    refresh_groups()
    update_materials(CARRIER_HZ)
    material = bpy.data.materials[name]
    if thickness_m:
        settle_interiors(SettingsRestorer(), [material])
        add_box("Slab", (-501.0, -499.0, -thickness_m), (497.0, 503.0, 0.0), material)
    else:
        plate = facing_plate((0.0, 0.0, 0.0), 1e3, 90.0, spin_deg=13.0)
        add_plate("Plate", plate, material)
    look_down(scene, 0.0)
    set_layer_normals(SettingsRestorer(), evaluated_snapshot(bpy.context.view_layer))
    return _Furnace(bench, scene)


def _library_series(index: complex, opaque: bool, angle_deg: float) -> list[tuple[float, float]]:
    """Reflected and transmitted power of the slab, for s and p."""
    if opaque:
        return [(face, 0.0) for face, _, _ in _faces(index, angle_deg)]
    series = []
    for face, both, rate in _faces(index, angle_deg):
        once = math.exp(-rate * SLAB_M)
        out = both * once / (1 - (face * once) ** 2)
        series.append((face + out * face * once, out))
    return series


def _faces(index: complex, angle_deg: float) -> list[tuple[float, float, float]]:
    """For s and p: |r|^2, |1 - r^2|^2 of the way in and out, and the absorption per metre."""
    cos_i = math.cos(math.radians(angle_deg))
    cos_t = complex(np.sqrt(1 - (1 - cos_i**2) / index**2 + 0j))
    rate = 4 * math.pi / wavelength() * (index * cos_t).imag
    found = []
    for r in (
        (cos_i - index * cos_t) / (cos_i + index * cos_t),
        (index * cos_i - cos_t) / (index * cos_i + cos_t),
    ):
        found.append((abs(r) ** 2, abs(1 - r**2) ** 2, rate))
    return found


def _series(face: float, both: float, exponent: float) -> float:
    """Reflected and transmitted power, all passages added in power."""
    once = math.exp(-exponent)
    return face + both * once / (1 - (face * once) ** 2) * (1 + face * once)
