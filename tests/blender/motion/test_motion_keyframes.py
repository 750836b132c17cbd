# SPDX-License-Identifier: GPL-3.0-or-later
"""Bursts on, next to and across keyframes, against F-curves in float64.

Within 1e-4 frames of a key Blender gives the key's own value, so a sample there reads a step.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon.contract import MOTION_FILE, MotionRecord, frame_dir
from radarsim_addon.signal.radar import Burst
from radarsim_addon.typed_json import read_record
from tests.blender import motion_helpers as mh
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.slow

FPS = 24.0
CARRIER_HZ = 77e9
WAVENUMBER = 2 * math.pi * CARRIER_HZ / mh.C0_MPS
SHORT = Burst(80_000.0, 64)
LONG = Burst(20_000.0, 64)
RATE_WITHIN_MPS = 1e-4
PHASE_WITHIN = 6e-3

Curve = Callable[[float], float]


def bounce(s: float) -> float:
    """Penner's bouncing ball: four parabolas."""
    for limit, centre, height in (
        (1.0, 0.0, 0.0),
        (2.0, 1.5, 0.75),
        (2.5, 2.25, 0.9375),
        (np.inf, 2.625, 0.984375),
    ):
        if s < limit / 2.75:
            return 7.5625 * (s - centre / 2.75) ** 2 + height
    raise AssertionError


def elastic(s: float) -> float:
    """Penner's spring of a period of 0.3."""
    return 2.0 ** (-10 * s) * math.sin((s - 0.075) * 2 * math.pi / 0.3) + 1


#: Robert Penner's easing functions from 0 to 1, with the easing that Blender takes for AUTO.
EASINGS: dict[str, Curve] = {
    "LINEAR": lambda s: s,
    "SINE": lambda s: 1 - math.cos(s * math.pi / 2),
    "QUAD": lambda s: s**2,
    "CUBIC": lambda s: s**3,
    "QUART": lambda s: s**4,
    "QUINT": lambda s: s**5,
    "EXPO": lambda s: (2 ** (10 * (s - 1)) - 2**-10) / (1 - 2**-10),
    "CIRC": lambda s: 1 - math.sqrt(1 - s * s),
    "BACK": lambda s: (s - 1) ** 2 * (2.70158 * (s - 1) + 1.70158) + 1,
    "BOUNCE": bounce,
    "ELASTIC": elastic,
    "CONSTANT": lambda s: 0.0,
}


def bezier(first: Any, last: Any, frame: float) -> float:
    """Value of a cubic between two keys whose handles do not overlap."""
    points = np.array([first.co, first.handle_right, last.handle_left, last.co], dtype=np.float64)

    def at(u: float) -> np.ndarray:
        weights = ((1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3)
        return np.asarray(np.array(weights) @ points)

    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if at(middle)[0] < frame else (low, middle)
    return float(at(low)[1])


def value(curve: Any, frame: float) -> float:
    """What an F-curve is meant to be, in float64."""
    keys = curve.keyframe_points
    if frame <= keys[0].co[0]:
        return float(keys[0].co[1])
    for first, last in itertools.pairwise(keys):
        if frame < last.co[0]:
            if first.interpolation == "BEZIER":
                return bezier(first, last, frame)
            part = (frame - first.co[0]) / (last.co[0] - first.co[0])
            change = last.co[1] - first.co[1]
            return float(first.co[1] + change * EASINGS[first.interpolation](part))
    return float(keys[-1].co[1])


def keyed(item: Any, kind: str, *keys: tuple[float, float]) -> Any:
    """Key the distance along +Y; return the F-curve."""
    mh.key(item, "location", *((frame, (0.0, y, 0.0)) for frame, y in keys))
    mh.interpolation(item, kind)
    curves = list(rs.animation_curves(item.animation_data))
    for curve in curves:
        for point, after in itertools.pairwise(curve.keyframe_points):
            point.easing = "AUTO"  # mh.interpolation sets others
            point.period = 0.3 * (after.co[0] - point.co[0])
            point.amplitude = abs(after.co[1] - point.co[1])
        curve.update()
    return next(curve for curve in curves if curve.array_index == 1)


def errors(
    folder: Path, burst: Burst, curve: Curve, frame: int = 1
) -> tuple[float, float, MotionRecord]:
    """Rms error of range rates [m/s], largest of phases from pulse to pulse [rad], motion file."""
    rows, paths, run = mh.measured(folder, CARRIER_HZ, burst, frame, width_px=8, height_px=8)
    assert rows.size >= 16
    times_s = np.arange(burst.pulses) / burst.prf_hz
    moved = np.array([curve(frame + at * FPS) for at in times_s])
    points = np.repeat(rows["last_scatterer_m"][:, None], burst.pulses, axis=1)
    points[:, :, 1] += moved - moved[0]
    want_m = 2 * np.linalg.norm(points, axis=-1)
    found_m = paths.lengths.lengths_m(times_s, slice(None))
    off = (found_m - found_m[:, :1]) - (want_m - want_m[:, :1])
    step_s = 2e-7  # less than from any frame here to the next key
    ends = [curve(frame + number * step_s * FPS) for number in range(3)]
    speed_mps = (-1.5 * ends[0] + 2 * ends[1] - 0.5 * ends[2]) / step_s
    rate = rows["range_rate_mps"] - rows["direction"][:, 1] * speed_mps
    record = read_record(run.folder / frame_dir(frame) / MOTION_FILE, MotionRecord)
    return float(np.sqrt(np.mean(rate**2))), float(np.abs(WAVENUMBER * off).max()), record


#: Where a key is, in frames from the burst's first; the burst has 0.019 or 0.077 frames.
PLACES = {
    "on": 0.0,
    "hidden before": -5e-5,
    "just before": -1.5e-4,
    "just after": 1.5e-4,
    "amid": 0.008,
    "near the end": 0.0187,
    "far": -7.3,
}


@pytest.mark.parametrize("burst", [SHORT, LONG], ids=["80 kHz", "20 kHz"])
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", ["LINEAR", "BEZIER"])
def test_a_car_with_a_key_near_the_burst(
    tmp_path: Path, kind: str, place: str, burst: Burst
) -> None:
    at = 1 + PLACES[place]
    mh.scene_at(50.0, 1.0)
    car = mh.facets("Car", [(0, 0, 0)], 0.6)
    curve = keyed(car, kind, (at - 12, 45.0), (at, 50.0), (at + 24, 70.0))
    rate_mps, phase, record = errors(tmp_path, burst, lambda frame: value(curve, frame))
    assert rate_mps < RATE_WITHIN_MPS
    assert phase < PHASE_WITHIN
    assert not record.findings
    assert record.samples < 150
    if kind == "LINEAR" and place in ("on", "far"):
        assert record.samples < 30


def test_every_interpolation(tmp_path: Path) -> None:
    """Range rates within the bound, for each of them."""
    for kind in EASINGS:
        for place in ("on", "amid"):
            if kind == "CONSTANT" or (kind, place) == ("CIRC", "amid"):  # its slope is infinite
                continue
            at = 1 + PLACES[place]
            mh.scene_at(20.0, 1.0)
            walker = mh.facets("Walker", [(0, 0, 0)], 0.6)
            curve = keyed(walker, kind, (at - 24, 19.0), (at, 20.0), (at + 24, 22.0))
            folder = tmp_path / f"{kind}_{place}"
            rate_mps, phase, _ = errors(folder, LONG, lambda frame, c=curve: value(c, frame))
            assert rate_mps < RATE_WITHIN_MPS, (kind, place)
            assert phase < PHASE_WITHIN, (kind, place)


@pytest.mark.parametrize("place", ["on", "amid", "far"])
def test_steps_are_followed_and_named(tmp_path: Path, place: str) -> None:
    at = 1 + PLACES[place]
    mh.scene_at(50.0, 1.0)
    item = mh.facets("Stepped", [(0, 0, 0)], 0.6)
    curve = keyed(item, "CONSTANT", (at - 12, 45.0), (at, 50.0), (at + 24, 50.25))
    rate_mps, phase, record = errors(tmp_path, SHORT, lambda frame: value(curve, frame))
    assert rate_mps == 0
    assert phase < 1e-9
    assert [(f.code, f.subjects) for f in record.findings] == [("motion-in-steps", ("Stepped",))]


@pytest.mark.parametrize("how", ["parent", "constraint", "cycles", "strip"])
def test_keys_that_act_from_elsewhere(tmp_path: Path, how: str) -> None:
    """Keys of a parent and of a target, repeated by a Cycles modifier, and moved by a strip."""
    mh.scene_at(20.0, 1.0)
    item = mh.facets("Moved", [(0, 0, 0)], 0.6)
    other = mh.empty("Other", (0, 0, 0))
    driving = item if how in ("cycles", "strip") else other
    curve = keyed(driving, "LINEAR", (3.0, 19.0), (9.0, 20.0), (15.0, 20.5))
    times = lambda frame: frame  # noqa: E731
    if how == "parent":
        item.parent = other
    elif how == "constraint":
        item.constraints.new("COPY_LOCATION").target = other
    elif how == "cycles":  # frame 21 shows frame 9
        for one in rs.animation_curves(item.animation_data):
            one.modifiers.new("CYCLES")
        times = lambda frame: frame - 12  # noqa: E731
    else:  # twice as slow from frame 9 on: frame 21 shows frame 9
        action = item.animation_data.action
        strip = item.animation_data.nla_tracks.new().strips.new("Strip", 9, action)
        if hasattr(strip, "action_slot") and strip.action_slot is None:
            strip.action_slot = action.slots[0]
        strip.scale = 2.0
        item.animation_data.action = None
        times = lambda frame: 3 + (frame - 9) / 2  # noqa: E731
    frame = 21 if how in ("cycles", "strip") else 9
    rate_mps, phase, _ = errors(tmp_path, SHORT, lambda at: value(curve, times(at)), frame)
    assert rate_mps < RATE_WITHIN_MPS
    assert phase < PHASE_WITHIN
    assert bpy.context.scene.frame_current == 1


@pytest.mark.parametrize("new", [50, 200])
@pytest.mark.parametrize("place", ["on", "just before", "just after", "amid"])
def test_keys_of_an_animation_that_is_stretched(tmp_path: Path, place: str, new: int) -> None:
    """Frame 18 of the scene shows frame 9 of the animation at a time stretching of 100 to 200."""
    mh.scene_at(20.0, 1.0)
    render = bpy.context.scene.render
    render.frame_map_old, render.frame_map_new = 100, new
    at = (18 + PLACES[place]) * 100 / new
    car = mh.facets("Car", [(0, 0, 0)], 0.6)
    curve = keyed(car, "LINEAR", (at - 8, 16.0), (at, 20.0), (at + 24, 44.0))
    rate_mps, phase, record = errors(
        tmp_path, LONG, lambda frame: value(curve, frame * 100 / new), 18
    )
    assert rate_mps < RATE_WITHIN_MPS
    assert phase < PHASE_WITHIN
    assert not record.findings


@pytest.mark.parametrize("rate", [20, 150])
@pytest.mark.parametrize("amplitude_m", [1e-2, 1e-4])
def test_vibration_that_is_fast_for_the_samples(
    tmp_path: Path, amplitude_m: float, rate: float
) -> None:
    """A hundredth of a wavelength counts too: scatter above float32's rounding is motion."""
    mh.scene_at(20.0, 1.0)
    target = mh.facets("Target", [(0, 0, 0)], 0.6)
    target.location = (0, 20, 0)
    curve = target.driver_add("location", 1)
    curve.driver.expression = f"20 + {amplitude_m} * sin(frame * {rate})"

    def motion(frame: float) -> float:
        return 20 + amplitude_m * math.sin(frame * rate)

    _, phase, record = errors(tmp_path, LONG, motion, 3)
    assert phase < PHASE_WITHIN
    assert not record.findings
