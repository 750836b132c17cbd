# SPDX-License-Identifier: GPL-3.0-or-later
"""The echo of rain: points of the air within the field of view, as rows of a path table.

From each of a grid of directions, cells of range up to the surface that is hit there hold

    dP = EIRP lambda^2 / (4 pi)^3  eta dOmega dr / r_t^2

with eta the reflectivity of rain and r_t the distance to the transmitter; the link budget adds
gains and extinction, as to other paths. Drops fall with the speeds that eta weighs, and drift with
the wind. A direction is blocked from the nearest surface on whose echoes cover half of it; one
without echoes (sky, mirrors) is open.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.radar_equation import effective_area_m2
from ...physics.weather import rain_fall_speeds, rain_reflectivity_per_m
from ..decoding import FrameInput, pixel_rays
from ..paths import PathRows, Paths, geometry_of, make_paths, radiance_of
from ..radar import Weather
from .amplitudes import hash_step, uniform

#: Directions along the longer side of the field of view, and points of a frame, at most.
_DIRECTIONS, _MOST_POINTS = 32, 2_000_000
#: Rows of a table that surfaces are told from, at most.
_LOOKED_AT = 200_000


def rain_rows(frame_input: FrameInput, weather: Weather, seed: int) -> PathRows:
    """Points of rain as rows of reflections of order 1, without an object; `seed` is of the places
    and speeds of the drops. Empty without rain or for an orthographic receiver.
    """
    receiver, radar = frame_input.receiver, frame_input.radar
    if not weather.rain_echo or weather.rain_mm_per_h == 0 or receiver.kind == "orthographic":
        return PathRows.zeros(0)
    waveform, step_m = radar.waveform, radar.waveform.range_resolution_m
    start_m = max(frame_input.range_limits_m[0], step_m)
    count = max(int((frame_input.range_limits_m[1] - start_m) / step_m), 0)
    across = receiver.right - receiver.left, receiver.top - receiver.bottom
    side = max(1, min(_DIRECTIONS, int(np.sqrt(_MOST_POINTS / max(count, 1)))))
    size = [max(1, round(side * abs(one) / max(map(abs, across)))) for one in across]
    rays = pixel_rays(receiver, *size)
    direction, solid_sr = rays.direction.reshape(-1, 3), rays.solid_angle_sr.ravel()
    reach_m = _open_to_m(frame_input, direction, solid_sr)
    edges_m = start_m + step_m * np.arange(count + 1)
    ray, cell = np.nonzero(edges_m[None, :-1] < reach_m[:, None])
    near_m, far_m = edges_m[cell], np.minimum(edges_m[cell + 1], reach_m[ray])
    draws = _draws(ray.size, seed)
    range_m = near_m + (far_m - near_m) * draws[0]
    rows = PathRows.zeros(ray.size)
    way = direction[ray]
    place_m = rays.origin_m + range_m[:, None] * way
    from_emitter = place_m - np.asarray(frame_input.transmitter.matrix_world)[:3, 3]
    emitter_m = np.linalg.norm(from_emitter, axis=1)
    # over the cell dr / r^2 is (far - near) / (near far)
    spread = (far_m - near_m) / (near_m * far_m) * (range_m / emitter_m) ** 2
    eta = rain_reflectivity_per_m(waveform.carrier_hz, weather.rain_mm_per_h)
    # rows hold the power at the carrier of their table
    area_m2 = effective_area_m2(SPEED_OF_LIGHT_MPS / frame_input.table.record.carrier_hz)
    eirp_w = frame_input.transmitter.eirp_w
    rows["power_w"] = eirp_w * area_m2 / (4 * np.pi) ** 2 * eta * solid_sr[ray] * spread
    rows["solid_angle_sr"] = solid_sr[ray]
    rows["length_m"] = range_m + emitter_m
    rows["order"] = 1
    rows["direction"] = way
    rows["first_scatterer_m"] = rows["last_scatterer_m"] = place_m
    mean_mps, spread_mps = rain_fall_speeds(waveform.carrier_hz, weather.rain_mm_per_h)
    gauss = np.sqrt(-2 * np.log(1 - draws[1])) * np.cos(2 * np.pi * draws[2])
    both = (way + from_emitter / emitter_m[:, None]) / 2
    rows["range_rate_mps"] = (
        weather.wind_x_mps * both[:, 0]
        + weather.wind_y_mps * both[:, 1]
        - (mean_mps + spread_mps * gauss) * both[:, 2]
    )
    return rows


def rain_paths(rows: PathRows, frame_input: FrameInput, seed: int) -> Paths:
    """Points of rain as paths with random phases of a seed and constant range rates."""
    phases = np.exp(2j * np.pi * _draws(rows.size, seed ^ 0x5DEECE66D)[0])
    paths = make_paths(
        radiance_of(rows, frame_input.table.record),
        np.array(rows["length_m"]),
        np.array(rows["range_rate_mps"]),
        np.array(rows["solid_angle_sr"]),
    )
    return type(paths)(**{**vars(paths), "geometry": geometry_of(rows), "phasors": phases})


def _draws(count: int, seed: int) -> list[Real]:
    """Three series of numbers even over 0 to 1, (count,) each."""
    state = hash_step(np.arange(count, dtype=np.uint64) ^ hash_step(np.array(seed % 2**64, "u8")))
    found = []
    for _ in range(3):
        state = hash_step(state)
        found.append(uniform(state))
    return found


def _open_to_m(frame_input: FrameInput, direction: Real, solid_sr: Real) -> Real:
    """Ranges up to which each direction is open, (directions,) [m]."""
    from scipy.spatial import cKDTree  # not at import: slow

    table = frame_input.table
    every = max(1, -(-table.rows.size // _LOOKED_AT))
    rows = table.rows[::every]
    rows = rows[(rows["transparent_depth"] == 0) & (rows["order"] >= 1)]
    place_m = np.asarray(frame_input.receiver.matrix_world)[:3, 3]
    hit_m = np.linalg.norm(rows["first_scatterer_m"] - place_m, axis=1)
    rows, hit_m = rows[np.isfinite(hit_m)], hit_m[np.isfinite(hit_m)]
    reach_m = np.full(direction.shape[0], np.inf)
    if not rows.size:
        return reach_m
    _, ray = cKDTree(direction).query(rows["direction"])
    # nearest first: blocked from where the rows so far cover half of the direction
    order = np.lexsort((hit_m, ray))
    ray, hit_m, part = ray[order], hit_m[order], every * rows["solid_angle_sr"][order]
    total = np.cumsum(part)
    first = np.searchsorted(ray, np.arange(direction.shape[0]))
    before = np.concatenate([[0.0], total])[first]
    half = np.flatnonzero(total - before[ray] >= solid_sr[ray] / 2)
    np.minimum.at(reach_m, ray[half], hit_m[half])
    return reach_m
