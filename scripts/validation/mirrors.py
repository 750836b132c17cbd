# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths over a smooth ground: the two-way pattern of a radar over conductor, sea and wet ground."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarsim_addon.arrays import Complex, Real
from radarsim_addon.blender.materials import make_physical_material
from radarsim_addon.signal import iter_path_chunks, open_run, synthesize
from radarsim_addon.signal.maps import expected_power, range_process
from radarsim_addon.signal.scattering import interference_factors

from .case import Bench, Case, Check, Group, power_check, worst_of
from .curved_mirrors import ball, ellipsoid
from .scenes import EIRP_W, Acquired, acquire, add_mesh, lambert, new_scene, wavelength

ALBEDO = 0.6
#: Radar over the ground, plate behind it, and pixels along the plate [m].
HEIGHT_M, RANGE_M, PIXELS = 10.0, 200.0, 768
#: The plate stays clear of the ground by this [m].
CLEAR_M = 0.05
#: Complex permittivities, exp(-j w t): conductor, sea water and wet ground.
GROUNDS = {
    "conductor": {3e9: 2e8j, 10e9: 2e8j},
    "sea": {3e9: 69 + 40j, 10e9: 52 + 38j},
    "wet ground": {3e9: 24 + 3.6j, 10e9: 14 + 6.2j},
}
#: What is compared lies within this of the strongest [dB].
FLOOR_DB = 30.0
BOUND_DB = 0.05
CHAIN_BOUND_DB = 0.1
TILTED_SOURCE = "co-polar r_s s s + r_p p p' of both ways, with spreading and cosines"
SOURCE = "|1 + Gamma* exp(-jk d)|^4 with spreading and cosines, Gamma of the textbook"


def gamma(epsilon: complex, sine: Real, vertical: bool) -> Complex:
    """Coefficient of a level ground at grazing angles, exp(-j w t)."""
    root = np.sqrt(epsilon - (1 - sine**2))
    first = epsilon * sine if vertical else sine + 0j
    return np.asarray((first - root) / (first + root))


def pattern(
    points_m: Real,
    epsilon: complex,
    carrier_hz: float,
    vertical: bool,
    transmitter_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Real:
    """Two-way power over that of the direct path, of points before a receiver at the origin."""
    found = np.ones(len(points_m))
    for antenna_m in (np.zeros(3), np.array(transmitter_m)):
        image_m = antenna_m * [1, 1, -1] - [0, 0, 2 * HEIGHT_M]
        direct_m = np.linalg.norm(points_m - antenna_m, axis=1)
        over_m = np.linalg.norm(points_m - image_m, axis=1)
        sine = (points_m - image_m)[:, 2] / over_m
        # Irradiance of a vertical surface: 1/R^2 and the cosine y/R.
        field = np.sqrt((direct_m / over_m) ** 3)
        turn = np.exp(-2j * math.pi / wavelength(carrier_hz) * (over_m - direct_m))
        one_way = 1 + np.conj(gamma(epsilon, sine, vertical)) * field * turn
        found *= np.abs(one_way) ** 2
    return found


def _scene(
    epsilon: complex,
    fov_deg: float,
    low_m: float,
    high_m: float,
    width_m: float,
    transmitter_m: tuple[float, float, float] | None = None,
) -> None:
    """A radar, a smooth ground, and a vertical strip of a Lambert plate."""
    new_scene(fov_deg, transmitter_m=transmitter_m)
    index = complex(np.sqrt(epsilon))
    ground = make_physical_material(
        "Ground", "index", carrier_hz=5.3e9, penetrable=False, n=index.real, k=index.imag
    )
    side, z = 150.0, -HEIGHT_M
    corners = [(-side, -10, z), (side, -10, z), (side, 500, z), (-side, 500, z)]
    add_mesh("Ground", corners, [(0, 1, 2, 3)], ground)
    half = width_m / 2
    strip = [
        (-half, RANGE_M, low_m),
        (half, RANGE_M, low_m),
        (half, RANGE_M, high_m),
        (-half, RANGE_M, high_m),
    ]
    add_mesh("Plate", strip, [(0, 1, 2, 3)], lambert(ALBEDO))


def expected_points(run: Acquired, carrier_hz: float) -> tuple[Real, Real]:
    """Points of the plate and the expected power of all paths over each, over the direct one."""
    rows = run.rows[run.rows["point"] > 0]
    resolution_m = 1e3  # all paths of a point in one range cell
    factor = interference_factors(rows, rows["power_w"], carrier_hz, resolution_m)
    key = rows["tile"].astype(np.int64) << 32 | rows["point"]
    points, place = np.unique(key, return_inverse=True)
    total_w = np.bincount(place, rows["power_w"] * factor)
    direct = rows["mirrors"] == 0
    direct_w = np.bincount(place, rows["power_w"] * direct)
    point_m = np.empty((points.size, 3))
    point_m[place[direct]] = rows["last_scatterer_m"][direct]
    return point_m, total_w / direct_w


def _pattern_check(
    name: str,
    expected: Real,
    found: Real,
    source: str,
    apart: tuple[float, float, float] | None,
) -> Check:
    """The worst point of a pattern, of those that are not below its floor."""
    strong = expected > expected.max() * 10 ** (-FLOOR_DB / 10)
    points = [
        power_check("", one, other, BOUND_DB, source, unit="dB")
        for one, other in zip(expected[strong], found[strong], strict=True)
    ]
    return worst_of(name + ("" if apart is None else ", bistatic"), points)


#: A transmitter that stands apart from the receiver at the origin [m].
APART_M = (30.0, 60.0, -4.0)


def swept(
    bench: Bench, ground: str, transmitter_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> list[Check]:
    """The pattern over the height of a target, every pixel of the strip a target."""
    apart = transmitter_m if any(transmitter_m) else None
    checks = []
    fov_deg = 2 * math.degrees(math.atan(1.005 * HEIGHT_M / RANGE_M))
    for carrier_hz, epsilon in GROUNDS[ground].items():
        for polarisation in ("horizontal", "vertical"):
            _scene(epsilon, fov_deg, CLEAR_M - HEIGHT_M, HEIGHT_M, 2.0, apart)
            run = acquire(
                bench,
                2,
                1,
                height_px=PIXELS,
                carrier_hz=carrier_hz,
                max_reflections=3,
                polarisation=polarisation,
            )
            point_m, found = expected_points(run, carrier_hz)
            expected = pattern(
                point_m, epsilon, carrier_hz, polarisation == "vertical", transmitter_m
            )
            name = f"{ground}, {carrier_hz / 1e9:g} GHz, {polarisation}"
            checks.append(_pattern_check(name, expected, found, SOURCE, apart))
    return checks


#: Tilts of the ground about the line of sight [degrees].
TILTS_DEG = (0.0, 20.0, 45.0, 90.0)
TILTED_PIXELS = 192


def _field_vector(ways: Real, vertical: bool) -> Real:
    """Level unit vectors across ways, (n, 3), or upright ones."""
    level = np.stack([ways[:, 1], -ways[:, 0], 0 * ways[:, 0]], axis=1)
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    return np.cross(level, ways) if vertical else level


def tilted_pattern(
    points_m: Real,
    normal: Real,
    epsilon: complex,
    carrier_hz: float,
    vertical: bool,
    transmitter_m: Real,
) -> Real:
    """As `pattern`, over a ground with any normal: its co-polar coefficient from vectors."""
    found = np.ones(len(points_m))
    for antenna_m in (np.zeros(3), transmitter_m):
        image_m = antenna_m - 2 * (antenna_m @ normal + HEIGHT_M) * normal
        onward = points_m - image_m
        over_m = np.linalg.norm(onward, axis=1, keepdims=True)
        onward = onward / over_m
        sine = onward @ normal
        ways = onward - 2 * sine[:, None] * normal
        across = np.cross(normal, ways)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        sent, kept = _field_vector(ways, vertical), _field_vector(onward, vertical)
        coefficient = np.zeros(len(points_m), dtype=complex)
        for in_plane, before, after in (
            (False, across, across),
            (True, np.cross(ways, across), np.cross(onward, across)),
        ):
            parts = np.sum(sent * before, axis=1) * np.sum(kept * after, axis=1)
            coefficient += gamma(epsilon, sine, in_plane) * parts
        direct_m = np.linalg.norm(points_m - antenna_m, axis=1)
        longer_m = over_m[:, 0] - direct_m
        # irradiance of a surface across y: 1/R^2 and the cosine y/R
        field = np.sqrt((points_m - image_m)[:, 1] / (points_m - antenna_m)[:, 1])
        field *= np.sqrt((direct_m / over_m[:, 0]) ** 3)
        turn = np.exp(-2j * math.pi / wavelength(carrier_hz) * longer_m)
        found *= np.abs(1 + np.conj(coefficient) * field * turn) ** 2
    return found


def tilted(
    bench: Bench, ground: str, transmitter_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> list[Check]:
    """The pattern of the scene that is turned about the line of sight, for a radar that is not."""
    import bpy
    from mathutils import Matrix

    checks = []
    carrier_hz, epsilon = 3e9, GROUNDS[ground][3e9]
    fov_deg = 2 * math.degrees(math.atan(1.005 * HEIGHT_M / RANGE_M))
    apart = transmitter_m if any(transmitter_m) else None
    for tilt_deg in TILTS_DEG:
        turn = Matrix.Rotation(math.radians(tilt_deg), 4, "Y")
        matrix = np.array(turn)[:3, :3]
        for vertical in (False, True):
            _scene(epsilon, fov_deg, CLEAR_M - HEIGHT_M, HEIGHT_M, 2.0, apart)
            bpy.context.view_layer.update()
            for item in bpy.context.scene.objects:
                if item.parent is None:
                    item.matrix_world = turn @ item.matrix_world
            run = acquire(
                bench, 2, 1, height_px=TILTED_PIXELS, carrier_hz=carrier_hz, max_reflections=3,
                polarisation="vertical" if vertical else "horizontal",
            )  # fmt: skip
            point_m, found = expected_points(run, carrier_hz)
            place_m = matrix @ np.array(transmitter_m)
            expected = tilted_pattern(point_m, matrix[:, 2], epsilon, carrier_hz, vertical, place_m)
            name = f"{ground} tilted by {tilt_deg:g} deg, {'V' if vertical else 'H'}"
            checks.append(_pattern_check(name, expected, found, TILTED_SOURCE, apart))
    return checks


def _heights(epsilon: complex, carrier_hz: float, vertical: bool) -> NDArray[np.float64]:
    """Heights of a target at a lobe's peak and on its way down to the floor [m]."""
    z = np.linspace(CLEAR_M, 2 * HEIGHT_M, 20_001)
    points = np.stack([0 * z, np.full(z.size, RANGE_M), z - HEIGHT_M], axis=1)
    level = 10 * np.log10(pattern(points, epsilon, carrier_hz, vertical))
    peak = int(np.argmax(level))
    down = level[peak:] - level[peak]
    chosen = [peak + int(np.argmax(down <= -d)) for d in (0.0, 3.0, 10.0, 20.0)]
    return z[chosen]


def chain(bench: Bench) -> list[Check]:
    """A target of one pixel, from the scene to the power in echoes' map and expected power."""
    checks = []
    aperture_m2 = {c: wavelength(c) ** 2 / (4 * math.pi) for c in (3e9, 10e9)}
    for ground, grounds in GROUNDS.items():
        for carrier_hz, epsilon in grounds.items():
            for vertical in (False, True):
                echoes: list[Check] = []
                means: list[Check] = []
                for height_m in _heights(epsilon, carrier_hz, vertical).tolist():
                    z = height_m - HEIGHT_M
                    angle_deg = math.degrees(math.atan2(z, RANGE_M))
                    _scene(epsilon, 0.01, z - 0.5, z + 0.5, 1.0)
                    _turn_up(angle_deg)
                    run = acquire(
                        bench, 1, 1, carrier_hz=carrier_hz, pulses=4, max_reflections=3,
                        polarisation="vertical" if vertical else "horizontal",
                    )  # fmt: skip
                    seen = run.rows[run.rows["mirrors"] == 0]
                    point_m = seen["last_scatterer_m"]
                    reach_m = float(np.linalg.norm(point_m[0]))
                    radiance = ALBEDO / math.pi * EIRP_W / (4 * math.pi) * RANGE_M / reach_m**3
                    watts = radiance * aperture_m2[carrier_hz] * float(seen["solid_angle_sr"][0])
                    watts *= float(pattern(point_m, epsilon, carrier_hz, vertical)[0])
                    found = _in_the_map(open_run(run.folder))
                    name = f"{height_m:.3f} m"
                    for kept, power in zip((echoes, means), found, strict=True):
                        kept.append(power_check(name, watts, power, CHAIN_BOUND_DB, SOURCE))
                label = f"{ground}, {carrier_hz / 1e9:g} GHz, {'V' if vertical else 'H'}"
                checks.append(worst_of(f"echo in the map, {label}", echoes))
                checks.append(worst_of(f"expected power, {label}", means))
    return checks


def _turn_up(angle_deg: float) -> None:
    import bpy

    radar = bpy.context.scene.camera
    while radar.parent is not None:
        radar = radar.parent
    radar.rotation_euler.x += math.radians(angle_deg)


def _in_the_map(run: Any) -> tuple[float, float]:
    """Strongest power in the range profile of one pulse's echo, and in the expected profile [W]."""
    frame, radar = run.frame(1), run.radar
    limits_m = (RANGE_M - 60.0, RANGE_M + 60.0)
    echoes = synthesize(iter_path_chunks(frame), radar, range_limits_m=limits_m, speckle_seed=None)
    profiles = range_process(echoes, range_taper="hamming", oversample=16)
    mean = expected_power(frame, range_taper="hamming", cells_per_sample=16)
    return float((np.abs(profiles.plane[0]) ** 2).max()), float(mean.profile.max())


GROUP = Group(
    "mirrors",
    "Mirrors",
    "A radar and a Lambert plate 10 m above smooth ground, 200 m apart, with four paths: direct, "
    "via the ground on transmit, on receive, and on both. Compared down to 30 dB below the "
    "strongest. A metal sphere and an ellipsoid as curved mirrors: lengths, and powers relative "
    "to the direct path.",
    (
        Case("two-way pattern, conductor", lambda bench: swept(bench, "conductor"), 40.0),
        Case("two-way pattern, sea", lambda bench: swept(bench, "sea"), 40.0, quick=True),
        Case("two-way pattern, wet ground", lambda bench: swept(bench, "wet ground"), 40.0),
        Case("two-way pattern, bistatic, sea", lambda bench: swept(bench, "sea", APART_M), 40.0),
        Case("tilted conductor", lambda bench: tilted(bench, "conductor"), 40.0),
        Case("tilted wet ground", lambda bench: tilted(bench, "wet ground"), 40.0),
        Case("tilted sea, bistatic", lambda bench: tilted(bench, "sea", APART_M), 40.0),
        Case("from the scene to the map", chain, 120.0),
        Case("sphere", ball, 20.0),
        Case("ellipsoid", ellipsoid, 10.0),
    ),
)
