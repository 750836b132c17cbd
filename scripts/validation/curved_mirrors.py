# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths over curved mirrors: a sphere, and an ellipsoid by its foci; lengths and powers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from radarsim_addon.arrays import Real
from radarsim_addon.blender.materials import make_physical_material

from .case import Bench, Check, absolute_check, power_check, worst_of
from .scenes import acquire, add_mesh, add_sphere, lambert, new_scene

#: Complex permittivity of the conductor, exp(-j w t), and what the plate reflects.
CONDUCTOR, ALBEDO = 2e8j, 0.6
#: The plate that faces the receiver at the origin, and a transmitter that stands apart [m].
PLATE_M, APART_M = 40.0, (-12.0, 10.0, -1.0)
#: Largest errors of a length [m], and of the power over one mirror [dB].
LENGTH_M, BOUND_DB = 1e-5, 0.05
BALL = "law of reflection at the exact sphere, divergence by 2 / (a cos) and 2 cos / a"
FOCI = "a wave from one focus goes to the other: length by 2a, divergence by the distance left"

#: Length antenna, mirror, place [m], and power over that of the direct path.
Way = Callable[[Real, Real], tuple[float, float]]


def metal() -> Any:
    """A material that mirrors."""
    index = complex(np.sqrt(CONDUCTOR))
    return make_physical_material(
        "Metal", "index", carrier_hz=5.3e9, penetrable=False, n=index.real, k=index.imag
    )


def add_target() -> None:
    """The plate, across the boresight."""
    half, y = 0.5, PLATE_M
    corners = [(-half, y, -half), (half, y, -half), (half, y, half), (-half, y, half)]
    add_mesh("Plate", corners, [(0, 1, 2, 3)], lambert(ALBEDO))


def ball(bench: Bench) -> list[Check]:
    """All families over a smooth sphere, for a radar in one place and with antennas apart."""
    checks = []
    middle_m = np.array([6.0, 25.0, 0.0])
    for radius_m in (0.3, 1.0):
        for apart_m in (None, APART_M):
            new_scene(1.0, transmitter_m=apart_m)
            add_sphere("Ball", middle_m.tolist(), radius_m, metal())
            add_target()

            def way(
                end_m: Real, antenna_m: Real, radius_m: float = radius_m
            ) -> tuple[float, float]:
                return _over_ball(end_m, antenna_m, middle_m, radius_m)

            ends = {"there": (0, 1), "there and back": (1, 1)}
            if apart_m is not None:
                ends = {"transmit": (0, 1), "receive": (1, 0), "both": (1, 1)}
            label = f"over a sphere of {radius_m:g} m"
            label += "" if apart_m is None else ", bistatic"
            checks += _compare(bench, way, label, ends, apart_m or (0.0, 0.0, 0.0), BALL)
    return checks


def ellipsoid(bench: Bench) -> list[Check]:
    """An antenna in a focus of an ellipsoid, the other elsewhere; the plate before the other focus.

    A part of the inside mirrors. A wave from one focus meets the plate where the line from it to
    the other focus does.
    """
    checks = []
    met_m, beyond_m = np.array([8.0, 30.0, 0.0]), 60.0
    onward = np.array([0.0, PLATE_M, 0.0]) - met_m
    other_m = met_m + beyond_m * onward / np.linalg.norm(onward)
    for end, name in enumerate(("receive", "transmit")):
        focus_m = np.array(APART_M) if end else np.zeros(3)
        new_scene(1.0, transmitter_m=APART_M)
        whole_m = float(np.linalg.norm(met_m - focus_m)) + beyond_m
        _add_dish(focus_m, other_m, met_m, whole_m)
        add_target()

        def way(
            end_m: Real, antenna_m: Real, other_m: Real = other_m, whole_m: float = whole_m
        ) -> tuple[float, float]:
            back = end_m - other_m
            left_m = float(np.linalg.norm(back))
            from_m = float(_focal_m(back[None] / left_m, antenna_m - other_m, whole_m)[0])
            power = (from_m / left_m / (whole_m - from_m)) ** 2
            way, onward = other_m + from_m * back / left_m - antenna_m, -back / left_m
            power *= _kept(way / np.linalg.norm(way), onward)
            return whole_m - left_m, power * _projection(end_m, antenna_m, onward)

        label = "over an ellipsoid, an antenna in a focus"
        checks += _compare(bench, way, label, {name: (1 - end, end)}, APART_M, FOCI)
    return checks


def _add_dish(focus_m: Real, other_m: Real, met_m: Real, whole_m: float) -> None:
    """The inside of an ellipsoid of two foci, a part around a point, with exact normals."""
    away_m = met_m - focus_m
    first = np.array([-away_m[1], away_m[0], 0.0]) / np.linalg.norm(away_m[:2])
    second = np.cross(away_m / np.linalg.norm(away_m), first)
    u, v = np.meshgrid(np.linspace(-1.2, 1.2, 25), np.linspace(-1.2, 1.2, 25))
    units = away_m + u[..., None] * first + v[..., None] * second
    units = (units / np.linalg.norm(units, axis=-1)[..., None]).reshape(-1, 3)
    points = focus_m + _focal_m(units, other_m - focus_m, whole_m)[:, None] * units
    onward = other_m - points
    normals = onward / np.linalg.norm(onward, axis=1)[:, None] - units
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    numbers = np.arange(len(points)).reshape(u.shape)
    corners = numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]
    faces = np.stack([one.ravel() for one in corners], axis=1)
    if np.cross(points[1] - points[0], points[len(u)] - points[0]) @ normals[0] < 0:
        faces = faces[:, ::-1]
    mesh = add_mesh("Dish", points.tolist(), list(map(tuple, faces.tolist())), metal()).data
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    mesh.normals_split_custom_set_from_vertices(normals.tolist())


def _compare(
    bench: Bench,
    way: Way,
    label: str,
    ends: dict[str, tuple[int, int]],
    transmitter_m: tuple[float, float, float],
    source: str,
) -> list[Check]:
    """Check the paths over mirrors at some ends, receiver and transmitter, of all places."""
    options: Any = {"carrier_hz": 10e9, "max_reflections": 3, "max_refinement_level": 0}
    rows = acquire(bench, 12, 1, **options).rows
    labels = np.stack([rows[name] for name in ("tile", "replicate", "point")])
    _, point = np.unique(labels, axis=1, return_inverse=True)
    direct = np.flatnonzero(rows["mirrors"] == 0)
    order = direct[np.argsort(point[direct])]
    checks = []
    known: dict[tuple[bytes, bytes], tuple[float, float]] = {}

    def way_once(end_m: Real, antenna_m: Real) -> tuple[float, float]:
        """Find the way; several families share it, and the search takes most of the case's time."""
        key = end_m.tobytes(), antenna_m.tobytes()
        if key not in known:
            known[key] = way(end_m, antenna_m)
        return known[key]

    for name, (back, there) in ends.items():
        mine = (rows["receiver_image"] == -back) & (rows["transmitter_image"] == -there)
        base = rows[order[np.searchsorted(point[order], point[mine])]]
        antennas_m = [np.zeros(3)] * back + [np.array(transmitter_m)] * there
        lengths, powers = [], []
        for one, of in zip(rows[mine], base, strict=True):
            end_m = one["last_scatterer_m"]
            over = [way_once(end_m, antenna_m) for antenna_m in antennas_m]
            direct_m = sum(float(np.linalg.norm(end_m - antenna_m)) for antenna_m in antennas_m)
            longer_m = sum(length_m for length_m, _ in over) - direct_m
            found_m = float(one["length_m"] - of["length_m"])
            lengths.append(absolute_check("", longer_m, found_m, LENGTH_M, source, unit="m"))
            level, found = math.prod(power for _, power in over), one["power_w"] / of["power_w"]
            powers.append(
                power_check("", level, float(found), BOUND_DB * len(over), source, unit="dB")
            )
        checks.append(worst_of(f"length {label}, {name}", lengths))
        checks.append(worst_of(f"power {label}, {name}", powers))
    return checks


def _over_ball(
    end_m: Real, antenna_m: Real, middle_m: Real, radius_m: float
) -> tuple[float, float]:
    """The way over a sphere, as `Way`."""
    from scipy.optimize import brentq

    first = antenna_m - middle_m
    first = first / np.linalg.norm(first)
    second = end_m - middle_m - (end_m - middle_m) @ first * first
    second /= np.linalg.norm(second)

    def legs(angle: float) -> tuple[Real, Real, Real]:
        normal = math.cos(angle) * first + math.sin(angle) * second
        point_m = middle_m + radius_m * normal
        return normal, antenna_m - point_m, end_m - point_m

    def tilt(angle: float) -> float:
        """Difference of the sines of incidence and reflection."""
        _, back_m, on_m = legs(angle)
        along = math.cos(angle) * second - math.sin(angle) * first
        return float((back_m / np.linalg.norm(back_m) + on_m / np.linalg.norm(on_m)) @ along)

    widest = math.atan2((end_m - middle_m) @ second, (end_m - middle_m) @ first)
    normal, back_m, on_m = legs(brentq(tilt, 0.0, widest, xtol=1e-14))
    before_m, after_m = float(np.linalg.norm(back_m)), float(np.linalg.norm(on_m))
    cosine = float(back_m @ normal) / before_m
    across = 1 + after_m * (1 / before_m + 2 * cosine / radius_m)
    along = 1 + after_m * (1 / before_m + 2 / (radius_m * cosine))
    power = _kept(-back_m / before_m, on_m / after_m) / (before_m**2 * across * along)
    return before_m + after_m, power * _projection(end_m, antenna_m, on_m / after_m)


def _kept(way: Real, onward: Real) -> float:
    """Part of the power that a conductor leaves in the polarisation, mean of level and upright.

    The field is turned about the normal by half a turn: E' = 2 n (n . E) - E.
    """
    normal = onward - way
    normal /= np.linalg.norm(normal)
    parts = []
    for upright in (False, True):
        fields = []
        for along in (way, onward):
            level = np.array([along[1], -along[0], 0.0]) / math.hypot(along[0], along[1])
            fields.append(np.cross(level, along) if upright else level)
        parts.append(float((2 * normal * (normal @ fields[0]) - fields[0]) @ fields[1]) ** 2)
    return sum(parts) / 2


def _projection(end_m: Real, antenna_m: Real, arrival: Real) -> float:
    """What turns an irradiance across unit vectors `arrival` into one over the direct one's."""
    # The plate faces the receiver: cosines are y over the length.
    direct_m = end_m - antenna_m
    return float(arrival[1] * np.linalg.norm(direct_m) ** 3 / direct_m[1])


def _focal_m(units: Real, to_other_m: Real, whole_m: float) -> Real:
    """Distances of an ellipsoid of two foci, in directions (n, 3) from one of them, (n,) [m]."""
    apart_m2 = float(to_other_m @ to_other_m)
    return np.asarray((whole_m**2 - apart_m2) / 2 / (whole_m - units @ to_other_m))
