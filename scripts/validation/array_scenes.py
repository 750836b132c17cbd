# SPDX-License-Identifier: GPL-3.0-or-later
"""Points that move, seen by an array, and their maps; no renders."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from radarsim_addon.contract import ImageRecord
from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal.angles import ArrayGeometry
from radarsim_addon.signal.detection import Detection, DirectedDetection
from radarsim_addon.signal.echoes import Echoes, EchoOptions, synthesizer_for
from radarsim_addon.signal.maps import RangeDopplerMap, range_doppler, range_process
from radarsim_addon.signal.motion import AntennaMotion, BodyMotion, FrameMotion
from radarsim_addon.signal.motion.body_motion import Segment
from radarsim_addon.signal.paths import (
    IMAGE_DTYPE,
    PATH_DTYPE,
    PathRows,
    geometry_of,
    make_paths,
    motion_of_rows,
)
from radarsim_addon.signal.radar import Burst, FmcwWaveform, Radar, array_preset

CARRIER_HZ = 77e9
WAVELENGTH_M = SPEED_OF_LIGHT_MPS / CARRIER_HZ
#: 500 MHz: cells of 0.3 m, 128 of them.
WAVEFORM = FmcwWaveform(CARRIER_HZ, 500e6, 256, 20e6)
BURST = Burst(10e3, 64)
SPAN_S = 0.01


def radar_of(preset: str, burst: Burst = BURST, waveform: FmcwWaveform = WAVEFORM) -> Radar:
    return Radar(waveform, burst, array_preset(preset, WAVELENGTH_M).channels(burst))


def moving(place_m: np.ndarray, velocity_mps: np.ndarray) -> BodyMotion:
    """A body at a place that moves steadily."""
    pose = np.eye(4)
    pose[:3, 3] = place_m
    if not np.any(velocity_mps):
        return BodyMotion(pose)
    half = np.asarray(velocity_mps) * SPAN_S / 2
    translation = np.array([np.asarray(place_m) + half, half])
    still = np.zeros((1, 3)), np.eye(3)
    return BodyMotion(pose, (Segment(0.0, SPAN_S, translation, np.zeros(3), *still),))


def antennas_at(
    receiver_m: tuple[float, float, float] = (0, 0, 0),
    apart_m: tuple[float, float, float] = (0, 0, 0),
    velocity_mps: tuple[float, float, float] = (0, 0, 0),
) -> AntennaMotion:
    """Antennas that look along -z, moving together."""
    places = np.array(receiver_m, float), np.add(receiver_m, apart_m)
    receiver, transmitter = (moving(place, np.array(velocity_mps)) for place in places)
    return AntennaMotion(receiver, transmitter)


def direction_of(azimuth_deg: float, elevation_deg: float = 0.0) -> np.ndarray:
    """Unit vector in the antenna's axes: x right, y up, z back."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    return np.array(
        [
            math.cos(elevation) * math.sin(azimuth),
            math.sin(elevation),
            -math.cos(elevation) * math.cos(azimuth),
        ]
    )


#: A wall to the right of the radar, along its boresight.
MIRROR = ImageRecord([[-1.0, 0.0, 0.0]], [-6.0], ["Mirror"])


def mirrored(place_m: np.ndarray) -> np.ndarray:
    """A place behind `MIRROR`."""
    normal, offset_m = np.array(MIRROR.normals[0]), MIRROR.offsets_m[0]
    return np.asarray(place_m - 2 * (place_m @ normal - offset_m) * normal)


def echoes_of(
    radar: Radar,
    points_m: list[np.ndarray],
    *,
    radial_mps: float = 0.0,
    powers_w: list[float] | None = None,
    antennas: AntennaMotion | None = None,
    range_limits_m: tuple[float, float] | None = None,
    over: list[tuple[int, int]] | None = None,
) -> Echoes:
    """Echoes of points that recede from the receiver, each of a power in every channel; `over`:
    whether `MIRROR` is on the way from each point to the receiver, and to the transmitter.
    """
    antennas = antennas or antennas_at()
    ends = [np.asarray(one.pose[:3, 3]) for one in (antennas.receiver, antennas.transmitter)]
    rows = PathRows.zeros(len(points_m), IMAGE_DTYPE if over else PATH_DTYPE)
    bodies = []
    for number, point in enumerate(points_m):
        row = rows[number : number + 1]
        way = [np.asarray(point) - end for end in ends]
        if over:
            row["receiver_image"], row["transmitter_image"] = over[number]
            both = zip(ends, over[number], strict=True)
            way = [point - (mirrored(end) if image else end) for end, image in both]
        row["length_m"] = sum(np.linalg.norm(leg) for leg in way)
        row["order"] = 1
        row["first_scatterer_m"] = row["last_scatterer_m"] = point
        row["first_body"] = row["last_body"] = number + 1
        row["direction"] = way[0] / np.linalg.norm(way[0])
        bodies.append(moving(np.asarray(point), radial_mps * way[0] / np.linalg.norm(way[0])))
    images = [MIRROR] if over else []
    scene = FrameMotion(
        SPAN_S, antennas.receiver, antennas.transmitter, False, bodies, images=images
    )
    aperture_m2 = WAVELENGTH_M**2 / (4 * math.pi)
    paths = dataclasses.replace(
        make_paths(np.array(powers_w or [1.0] * len(points_m)) / aperture_m2, rows["length_m"]),
        geometry=geometry_of(rows, images),
        motion=motion_of_rows(rows, scene),
    )
    limits_m = range_limits_m or (0.0, radar.waveform.unambiguous_range_m)
    synthesizer = synthesizer_for(
        radar, limits_m, EchoOptions(speckle_seed=None), antennas=antennas
    )
    synthesizer.add(paths)
    return synthesizer.result()


def map_of(echoes: Echoes, taper: str = "hann") -> RangeDopplerMap:
    return range_doppler(range_process(echoes, taper), taper)


def angles_of(target: Detection) -> tuple[float, float]:
    """Azimuth and elevation of a target of an array [degrees]; NaN where not measured."""
    assert isinstance(target, DirectedDetection)
    angles = target.azimuth_deg, target.elevation_deg
    azimuth, elevation = (math.nan if angle is None else angle for angle in angles)
    return azimuth, elevation


def geometry_at(
    radar: Radar, antennas: AntennaMotion | None = None, time_s: float = 0.0
) -> ArrayGeometry:
    return ArrayGeometry.of(radar, antennas or antennas_at(), time_s)
