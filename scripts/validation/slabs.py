# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands behind a wall: power and apparent range against the plane-parallel closed form."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np

from radarsim_addon.arrays import Real
from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials.layers import MAX_LOSS_DB, MAX_LOSS_DB_4_5
from radarsim_addon.blender.materials.physical_materials import make_physical_material
from radarsim_addon.physics.materials import material as library_index
from radarsim_addon.signal import open_run

from .case import Bench, Case, Check, Group, absolute_check, power_check, relative_check
from .fresnel import textbook_reflectance
from .scenes import EIRP_W, Acquired, acquire, add_plate, add_wall, facing_plate, new_scene
from .scenes import wavelength as wavelength_of

TARGET_M = 10.0
WALL_M = 5.0
FOV_DEG = 2.0
POWER_DB = 0.02
RANGE = 1e-5
METAL = 1e4 + 1e4j
SOURCE = "plane-parallel layer, straight path: |1 - r^2|^2 exp(-2 k0 Im(q) d) each way"


def passage(
    index: complex, thickness_m: float, wavelength_m: float, cosine: Real
) -> tuple[Real, Real, Real]:
    """Power through a layer once, s and p, and how much longer it makes the path optically [m].

    With Snell's angle inside: q = n cos(theta_t); r from Born and Wolf 1.5.2.
    """
    inside = np.sqrt(1 - (1 - cosine**2) / index**2 + 0j)
    r_s = (cosine - index * inside) / (cosine + index * inside)
    r_p = (index * cosine - inside) / (index * cosine + inside)
    q = index * inside
    loss = np.exp(-4 * math.pi / wavelength_m * q.imag * thickness_m)
    powers = [np.asarray(np.abs(1 - r**2) ** 2 * loss) for r in (r_s, r_p)]
    return powers[0], powers[1], np.asarray(thickness_m * (q.real - cosine))


def measure(
    bench: Bench,
    index: complex,
    thickness_m: float,
    angle_deg: float,
    *,
    carrier_hz: float = 5.3e9,
    polarisation: str = "average",
    medium: str | None = None,
) -> tuple[Acquired, Real, Real, Real]:
    """A rough metal plate at 10 m behind a wall that is turned about Z.

    Returns the run, and per path of the plate: radiance over what the bare plate would show;
    length over the expected; expected power of both passages.
    """
    new_scene(FOV_DEG)
    add_plate("Plate", facing_plate((0.0, TARGET_M, 0.0), 2.0), metal())
    if medium is None:
        wall = make_physical_material(
            "Wall", "index", carrier_hz=carrier_hz, n=index.real, k=index.imag
        )
    else:
        wall = make_physical_material("Wall", medium, carrier_hz=carrier_hz)
    normal = add_wall("Wall", (0.0, WALL_M, 0.0), thickness_m, angle_deg, wall)
    run = acquire(bench, 16, 2, carrier_hz=carrier_hz, polarisation=polarisation)
    rows = run.of("Plate")
    rows = rows[rows["order"] == 1]
    cosine = np.abs(rows["direction"] @ normal)
    wavelength_m = wavelength_of(carrier_hz)
    s, p, longer_m = passage(index, thickness_m, wavelength_m, cosine)
    # The wall is turned about Z: the plane of incidence is horizontal, so vertical is s.
    once = {"average": (s + p) / 2, "vertical": s, "horizontal": p}[polarisation]
    forward = rows["direction"][:, 1]
    reach_m = TARGET_M / forward
    area_m2 = wavelength_m**2 / (4 * math.pi)
    radiance = rows["power_w"] / rows["solid_angle_sr"] / area_m2
    angle = np.degrees(np.arccos(np.clip(forward, 0, 1)))
    bare = textbook_reflectance(METAL, angle) / math.pi
    bare = bare * EIRP_W * forward / (4 * math.pi * reach_m**2)
    return run, radiance / bare, rows["length_m"] / (2 * (reach_m + longer_m)), once**2


def _checks(label: str, found: tuple[Acquired, Real, Real, Real]) -> list[Check]:
    """Mean power over the plate and the worst length."""
    run, power, length, expected = found
    whole = 2 * 16 * 16  # the plate fills the view
    if power.size != whole:
        return [
            relative_check(f"{label}: paths", whole, power.size, 0.0, "every pixel sees the plate")
        ]
    worst = int(np.argmax(np.abs(np.log(np.maximum(power, 1e-300) / expected))))
    far = int(np.argmax(np.abs(length - 1)))
    del run
    power_row = power_check(
        f"{label}: power, two ways",
        float(expected[worst]),
        float(power[worst]),
        POWER_DB,
        SOURCE,
        unit="dB",
    )
    range_row = relative_check(
        f"{label}: apparent range over expected", 1.0, float(length[far]), RANGE, "d (Re q - cos)"
    )
    return [dataclasses.replace(row, points=power.size) for row in (power_row, range_row)]


def angles(bench: Bench, index: complex, polarisations: Sequence[str]) -> list[Check]:
    checks = []
    for polarisation in polarisations:
        for angle_deg in (0.0, 30.0, 60.0):
            found = measure(bench, index, 0.2, angle_deg, polarisation=polarisation)
            label = f"n = {index:g}, 0.2 m, {angle_deg:g} deg, {polarisation}"
            checks += _checks(label, found)
    return checks


def several(bench: Bench) -> list[Check]:
    """One to four walls in a row, of equal and of unlike media, in the mean of polarisations."""
    checks = []
    permittivities = (4.2 + 0j, 5.24 + 0.57j, 1.99 + 0.09j, 2.7 + 0.05j)
    for count, media in ((1, (4.2,)), (2, (4.2,) * 2), (4, (4.2,) * 4), (4, permittivities)):
        for angle_deg in (37.0, 58.0, 70.0):
            found = []
            for used in ((), media):
                new_scene(0.2)
                add_plate("Plate", facing_plate((0.0, 100.0, 0.0), 4.0), metal())
                powers, longer_m = np.ones(2), 0.0
                for number, eps in enumerate(used):
                    index = complex(np.sqrt(eps))
                    wall = make_physical_material(
                        "Wall", "index", carrier_hz=5.3e9, n=index.real, k=index.imag
                    )
                    place_m = (0.0, 20.0 + 15.0 * number, 0.0)
                    add_wall(f"Wall {number}", place_m, 0.05, angle_deg, wall, 30.0)
                    cosine = np.array(math.cos(math.radians(angle_deg)))
                    s, p, more_m = passage(index, 0.05, wavelength_of(5.3e9), cosine)
                    powers, longer_m = powers * (s, p), longer_m + 2 * float(more_m)
                rows = acquire(bench, 8, 1, carrier_hz=5.3e9, refine_for="objects").of("Plate")
                power_w = float(rows["power_w"].sum())
                found.append((power_w, float(rows["power_w"] @ rows["length_m"]) / power_w))
            label = f"{count} walls{' of four media' if media is permittivities else ''}"
            label += f", {angle_deg:g} deg"
            want, got = float(powers.mean() ** 2), found[1][0] / found[0][0]
            source = "mean over s and p of the product of all walls, each way"
            row = power_check(f"{label}: power, two ways", want, got, POWER_DB, source, unit="dB")
            got_m = found[1][1] - found[0][1]
            checks += [
                row,
                absolute_check(f"{label}: longer", longer_m, got_m, 2e-4, SOURCE, unit="m"),
            ]
    return checks


def far(bench: Bench) -> list[Check]:
    """A wall 5 m from the target or from the radar, from 10 m to 20 km; and a thin one at 5 km."""
    checks, index, angle_deg = [], 2.3 + 0.05j, 30.0
    cases = [
        (distance_m, 0.2, from_m) for distance_m in (10.0, 1e3, 5e3, 20e3) for from_m in (-5, 5)
    ]
    for distance_m, thickness_m, from_m in (*cases[1:], (5e3, 0.005, -5)):
        found = []
        for used in (False, True):
            new_scene(max(1.0 / distance_m, 1e-3))
            add_plate("Plate", facing_plate((0.0, distance_m, 0.0), 4.0), metal())
            if used:
                wall = make_physical_material(
                    "Wall", "index", carrier_hz=5.3e9, n=index.real, k=index.imag
                )
                # Off its middle: rays along the diagonal of a face may meet both triangles.
                place_m = (3.3, (distance_m if from_m < 0 else 0.0) + from_m, 1.1)
                normal = add_wall("Wall", place_m, thickness_m, angle_deg, wall, 20.0)
            rows = acquire(bench, 8, 1, carrier_hz=5.3e9).of("Plate")
            found.append(rows[rows["order"] == 1])
        bare, behind = found
        near = "target" if from_m < 0 else "radar"
        label = f"{distance_m:g} m, {1e3 * thickness_m:g} mm 5 m from the {near}"
        cosine = np.abs(behind["direction"] @ normal)
        s, p, longer_m = passage(index, thickness_m, wavelength_of(5.3e9), cosine)
        power = behind["power_w"] / bare["power_w"]
        want = ((s + p) / 2) ** 2
        worst = int(np.argmax(np.abs(np.log(power / want))))
        row = power_check(
            f"{label}: power, two ways",
            float(want[worst]),
            float(power[worst]),
            POWER_DB,
            SOURCE,
            unit="dB",
        )
        checks.append(dataclasses.replace(row, points=power.size))
        sigma_m = float(np.mean(behind["length_sigma_m"]))
        off_m = behind["length_m"] - bare["length_m"] - 2 * longer_m
        got = float(np.sqrt(np.mean(off_m**2))) / sigma_m
        source = f"d (Re q - cos), the rms error over length_sigma_m ({1e3 * sigma_m:.2g} mm)"
        row = absolute_check(f"{label}: length, in its sigma", 0.0, got, 2.0, source)
        checks.append(dataclasses.replace(row, points=power.size))
    return checks


def hollow(bench: Bench) -> list[Check]:
    """A room that Solidify makes hollow: a plate in it, and behind it."""
    checks, index, thickness_m = [], complex(np.sqrt(4.2 + 0.1j)), 0.2
    for angle_deg in (0.0, 20.0, 40.0):
        for target_m, walls in ((20.0, 1), (40.0, 2)):
            found = []
            for used in (False, True):
                new_scene(0.3)
                add_plate("Plate", facing_plate((0.0, target_m, 0.0), 2.0), metal())
                if used:
                    wall = make_physical_material(
                        "Room", "index", carrier_hz=5.3e9, n=index.real, k=index.imag
                    )
                    add_wall("Room", (0.0, 20.0, 0.0), 10.0, angle_deg, wall, 5.0)
                    solidify = bpy.data.objects["Room"].modifiers.new("Walls", "SOLIDIFY")
                    solidify.thickness, solidify.use_even_offset = thickness_m, True
                rows = acquire(bench, 8, 1, carrier_hz=5.3e9, refine_for="objects").of("Plate")
                power_w = float(rows["power_w"].sum())
                found.append((power_w, float(rows["power_w"] @ rows["length_m"]) / power_w))
            cosine = np.array(math.cos(math.radians(angle_deg)))
            s, p, longer_m = passage(index, thickness_m, wavelength_of(5.3e9), cosine)
            label = f"room, {angle_deg:g} deg, plate {'behind' if walls == 2 else 'inside'}"
            want, got = float((s**walls + p**walls) / 2) ** 2, found[1][0] / found[0][0]
            checks.append(power_check(f"{label}: power", want, got, POWER_DB, SOURCE, unit="dB"))
            got_m, want_m = found[1][1] - found[0][1], 2 * walls * float(longer_m)
            checks.append(absolute_check(f"{label}: longer", want_m, got_m, 2e-4, SOURCE, unit="m"))
    return checks


def metal() -> object:
    """Rough metal of the plates."""
    return nodes.make_material("Metal", METAL.real, METAL.imag, 0.0, 0.5, penetrable=False)


def lossless(bench: Bench) -> list[Check]:
    """A wall of n = 2.3; and what "average" means, for the report."""
    index = 2.3 + 0j
    bench.lines += [
        "",
        (
            "A wave that keeps its polarisation passes both ways with the mean of the squares of "
            "the two polarisations' powers; *average* gives the square of their mean, which is "
            "less. The difference, from the closed forms (it is a choice, not an error of "
            "rendering; the runs *vertical* and *horizontal* have none):"
        ),
        "",
        "| n | 0° | 30° | 45° | 60° |",
        "| --- | --- | --- | --- | --- |",
    ]
    for n in (index, complex(library_index("concrete", 5.3e9))):
        cosine = np.cos(np.radians([0.0, 30.0, 45.0, 60.0]))
        s, p, _ = passage(n, 0.0, 1.0, cosine)
        less = 10 * np.log10((s**2 + p**2) / 2 / ((s + p) / 2) ** 2)
        cells = " | ".join(f"{value:.2f} dB" for value in np.abs(less))
        bench.lines.append(f"| {n:.4g} | {cells} |")
    return angles(bench, index, ("average", "vertical", "horizontal"))


def lossy(bench: Bench) -> list[Check]:
    """A wall of n = 2.3 that also absorbs."""
    return angles(bench, 2.3 + 0.05j, ("average", "vertical", "horizontal"))


def concrete(bench: Bench) -> list[Check]:
    """Thickness chosen so that 20 to 90 dB are lost two ways."""
    checks = []
    for carrier_hz, loss_db in ((1e9, 20.0), (5.3e9, 40.0), (24e9, 65.0), (77e9, 90.0)):
        index = complex(library_index("concrete", carrier_hz))
        thickness_m = thickness_for(index, carrier_hz, loss_db)
        found = measure(bench, index, thickness_m, 20.0, carrier_hz=carrier_hz, medium="concrete")
        lost = -10 * math.log10(float(found[3].mean()))
        label = f"concrete, {1e3 * thickness_m:.0f} mm, {carrier_hz / 1e9:g} GHz, {lost:.1f} dB"
        checks += _checks(label, found)
    return checks


def thickness_for(index: complex, carrier_hz: float, loss_db: float) -> float:
    """Thickness that loses so much two ways at normal incidence, faces included [m]."""
    one = np.array([1.0])
    faces = float(passage(index, 0.0, wavelength_of(carrier_hz), one)[0][0])
    rate = 4 * math.pi * index.imag / wavelength_of(carrier_hz)
    return (loss_db / 2 * math.log(10) / 10 + math.log(faces)) / rate


def hundred_db(bench: Bench) -> list[Check]:
    index = 2.3 + 0.05j
    thickness_m = thickness_for(index, 5.3e9, 100.0)
    found = measure(bench, index, thickness_m, 0.0)
    return _checks(f"n = {index:g}, {1e3 * thickness_m:.0f} mm, 100 dB", found)


def limits(bench: Bench) -> list[Check]:
    """Right up to near this Blender's limit; beyond it, the run says so."""
    index = 2.3 + 0.2j
    limit_db = MAX_LOSS_DB if bpy.app.version >= (5, 0, 0) else MAX_LOSS_DB_4_5
    thickness_m = thickness_for(index, 5.3e9, limit_db - 8)
    found = measure(bench, index, thickness_m, 0.0)
    checks = _checks(f"{limit_db - 8:.0f} dB", found)
    run, *_ = measure(bench, index, thickness_for(index, 5.3e9, limit_db + 15), 0.0)
    said = any(
        item.code == "absorption-below-float32" for item in open_run(run.folder).record.findings
    )
    checks.append(
        Check(
            f"{limit_db + 15:.0f} dB: the run says that float32 does not carry it",
            1.0,
            float(said),
            "",
            1.0 - float(said),
            0.0,
            "1",
            "a finding (1) or none (0)",
        )
    )
    return checks


def opaque(bench: Bench) -> list[Check]:
    """Walls whose Volume is not connected let nothing through."""
    checks = []
    walls: tuple[tuple[str, str, float, dict[str, Any]], ...] = (
        ("2 m of concrete", "concrete", 5.3e9, {}),
        ("ITU metal", "metal", 77e9, {}),
        ("steel", "conductor", 77e9, {"conductivity_s_per_m": 1.45e6}),
    )
    for label, medium, carrier_hz, options in walls:
        new_scene(FOV_DEG)
        plate = nodes.make_material("Metal", METAL.real, METAL.imag, 0.0, 0.5)
        add_plate("Plate", facing_plate((0.0, TARGET_M, 0.0), 2.0), plate)
        wall = make_physical_material(
            "Wall", medium, carrier_hz=carrier_hz, rms_slope=0.2, penetrable=False, **options
        )
        add_wall("Wall", (0.0, WALL_M, 0.0), 2.0, 20.0, wall)
        run = acquire(bench, 8, 1, carrier_hz=carrier_hz)
        behind, before = (float(run.of(name)["power_w"].sum()) for name in ("Plate", "Wall"))
        share = behind / before
        name = f"{label} without Volume, {carrier_hz / 1e9:g} GHz: power from behind over its own"
        checks.append(absolute_check(name, 0.0, share, 1e-30, "exp(-4 pi kappa d / wavelength)"))
    return checks


GROUP = Group(
    "slabs",
    "Walls",
    "A rough metal plate at 10 m behind a wall of the physical Radar Material at 5 m; each "
    "pixel at its own angle, without internal echoes. *average* is the mean of both "
    "polarisations at each passage.",
    (
        Case("lossless wall", lossless, 30.0),
        Case("lossy wall", lossy, 60.0, True),
        Case("several walls", several, 60.0),
        Case("hollow room", hollow, 40.0),
        Case("far away", far, 60.0),
        Case("behind concrete", concrete, 20.0),
        Case("100 dB", hundred_db, 10.0, True),
        Case("limits of float32", limits, 10.0),
        Case("opaque walls", opaque, 10.0, True),
    ),
)
