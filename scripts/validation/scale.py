# SPDX-License-Identifier: GPL-3.0-or-later
"""The same scene at three scales of Blender units, with the same metres."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np

from radarsim_addon.blender import nodes

from .case import Bench, Case, Check, Group, absolute_check, power_check, relative_check
from .scenes import (
    Acquired,
    acquire,
    add_box,
    add_plate,
    add_sphere,
    facing_plate,
    lambert,
    new_scene,
    wavelength,
)

MILLIMETRE_HZ = 77e9
UNITS_PER_M = (1e-3, 1.0, 1e3)


def _measure(bench: Bench, units_per_m: float) -> Acquired:
    """A tilted plate, a plate behind a wall, and double bounces between plate and floor."""
    new_scene(40.0, metres_per_unit=1 / units_per_m)
    add_plate("Floor", facing_plate((0.3, 9.0, -2.0), 7.0, 80.0), lambert(0.7))
    add_plate("Plate", facing_plate((-1.1, 12.0, 0.3), 3.0, 20.0), lambert(0.6))
    wall = nodes.make_material("Wall", 1.4, 0.0, 0.0, 0.5)
    add_box("Wall", (0.6, 6.0, -1.1), (2.9, 6.3, 2.2), wall)
    add_plate("Behind", facing_plate((2.4, 11.0, 0.6), 3.0, 10.0), lambert(0.6))
    return acquire(bench, 64, 2, max_reflections=2, range_encoding="world")


def scales(bench: Bench) -> list[Check]:
    runs = {scale: _measure(bench, scale) for scale in UNITS_PER_M}
    reference = runs[1.0]
    checks = []
    for scale, run in runs.items():
        if scale == 1.0:
            continue
        for name in ("Floor", "Plate", "Behind", "Wall"):
            want, _ = reference.power_w(name)
            got, _ = run.power_w(name)
            label = f"power of {name.lower()}, {scale:g} units per metre"
            checks.append(power_check(label, want, got, 0.01, "the same scene in metres"))
        # Order 1 meets the same points; both tables have the same order of tiles and pixels.
        want_m, got_m = (_first_order(r) for r in (reference, run))
        if want_m.shape != got_m.shape:
            checks.append(
                relative_check(
                    f"paths, {scale:g} units per metre",
                    float(want_m.size),
                    float(got_m.size),
                    0.0,
                    "the same scene in metres",
                )
            )
            continue
        worst = int(np.argmax(np.abs(got_m / want_m - 1)))
        label = f"range of {want_m.size} paths, {scale:g} units per metre"
        check = relative_check(
            label,
            float(want_m[worst]) / 2,
            float(got_m[worst]) / 2,
            1e-6,
            "the same scene in metres",
            unit="m",
        )
        checks.append(check)
    exact = _against_truth(reference)
    return [exact, *checks]


def _first_order(run: Acquired) -> np.ndarray:
    rows = run.rows[(run.rows["order"] == 1) & (run.rows["transparent_depth"] == 0)]
    order = np.lexsort((*np.round(rows["direction"].T, 9), rows["replicate"]))
    return np.asarray(rows["length_m"][order])


def _against_truth(run: Acquired) -> Check:
    """Ranges of the tilted plate against the plane in float64: the near clip is added back."""
    plate = facing_plate((-1.1, 12.0, 0.3), 3.0, 20.0)
    rows = run.of("Plate")
    rows = rows[(rows["order"] == 1) & (rows["transparent_depth"] == 0)]
    exact = (plate.centre_m @ plate.normal) / (rows["direction"] @ plate.normal)
    got = rows["length_m"] / 2
    worst = int(np.argmax(np.abs(got / exact - 1)))
    return relative_check(
        f"range of {rows.size} paths to a tilted plate",
        float(exact[worst]),
        float(got[worst]),
        1e-6,
        "plane and ray in float64",
        unit="m",
    )


def near_clip(bench: Bench) -> list[Check]:
    """A plate 30 mm away, where the near clip would be seen."""
    checks = []
    for scale in UNITS_PER_M:
        new_scene(60.0, metres_per_unit=1 / scale)
        plate = facing_plate((0.0, 0.03, 0.0), 0.2, 15.0)
        add_plate("Plate", plate, lambert(0.6))
        rows = acquire(bench, 32, 1).rows
        exact = (plate.centre_m @ plate.normal) / (rows["direction"] @ plate.normal)
        got = rows["length_m"] / 2
        worst = int(np.argmax(np.abs(got / exact - 1)))
        checks.append(
            relative_check(
                f"plate 30 mm away, {scale:g} units per metre",
                float(exact[worst]),
                float(got[worst]),
                1e-6,
                "plane and ray in float64",
                unit="m",
            )
        )
    assert math.isfinite(checks[0].error)
    return checks


def exact_lengths(bench: Bench) -> list[Check]:
    """A tilted plate and a ball of triangles behind it, off all axes, near and far."""
    turn = 0.5
    away = np.array([-math.sin(turn), math.cos(turn), 0.0])
    checks = []
    for range_m in (10.0, 100.0, 1e3, 1e4):
        for at_origin in ("radar", "objects"):
            new_scene(2 * math.degrees(math.atan(0.6 / range_m)))
            start_m = 0.0 * away if at_origin == "radar" else -range_m * away
            place_m = start_m + range_m * away
            items = [
                add_plate("Plate", facing_plate(tuple(place_m), 0.7, 40.0), lambert(0.6)),
                add_sphere("Ball", place_m + away, 0.5, lambert(0.6), 2),
            ]
            radar = bpy.data.objects["Radar"]
            radar.location, radar.rotation_euler.z = start_m, radar.rotation_euler.z + turn
            run = acquire(bench, 48, 1, carrier_hz=MILLIMETRE_HZ)
            origin_m = np.array(run.record.receiver.matrix_world)[:3, 3]
            triangles = np.concatenate([_world_triangles(item) for item in items])
            exact_m = 2 * _first_hits(origin_m, run.rows["direction"], triangles)
            error_m = (run.rows["length_m"] - exact_m)[np.isfinite(exact_m)]
            check = absolute_check(
                f"rms error of {error_m.size} lengths at 77 GHz from {range_m:g} m, {at_origin} "
                "at the world's origin",
                0.0,
                float(np.sqrt(np.mean(error_m**2))) / wavelength(MILLIMETRE_HZ),
                1e-3,
                "ray and triangles in float64",
                unit="wavelengths",
            )
            checks.append(check)
    return checks


def _world_triangles(item: Any) -> np.ndarray:
    """Corners (m, 3, 3) of a mesh of triangles and quadrilaterals as Blender holds it [m]."""
    bpy.context.view_layer.update()
    pose = np.array(item.matrix_world, dtype=np.float64)
    corners = np.array([tuple(vertex.co) for vertex in item.data.vertices], dtype=np.float64)
    item.data.calc_loop_triangles()
    faces = np.array([tuple(face.vertices) for face in item.data.loop_triangles])
    return np.asarray((corners @ pose[:3, :3].T + pose[:3, 3])[faces])


def _first_hits(origin: np.ndarray, directions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Distance to the first triangle, (n,); infinite where there is none."""
    best = np.full(len(directions), np.inf)
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        way = ((a - origin) @ normal) / (directions @ normal)
        point = origin + way[:, None] * directions
        inside = way > 0
        for start, end in ((a, b), (b, c), (c, a)):
            inside &= np.cross(end - start, point - start) @ normal >= 0
        best = np.where(inside & (way < best), way, best)
    return best


GROUP = Group(
    "scale",
    "Scale of the scene",
    "The same metres at 0.001, 1 and 1000 Blender units per metre. Lengths at 77 GHz from 10 "
    "m to 10 km.",
    (
        Case("three scales", scales, 20.0),
        Case("near clip", near_clip, 10.0),
        Case("lengths at 77 GHz", exact_lengths, 30.0),
    ),
)
