# SPDX-License-Identifier: GPL-3.0-or-later
"""Range rates and echo phases of what moves, against its motion in closed form."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from radarsim_addon import blender as radarsim
from radarsim_addon import signal
from radarsim_addon.arrays import Real
from radarsim_addon.blender import nodes
from radarsim_addon.blender.scene import active_radar, animation_curves
from radarsim_addon.contract import MOTION_FILE, MotionRecord, frame_dir
from radarsim_addon.signal.decoding import frame_paths, pixel_rays
from radarsim_addon.typed_json import read_record

from .case import Bench, Case, Check, Group, absolute_check
from .scenes import (
    Acquired,
    acquire,
    add_box,
    add_plate,
    facing_plate,
    lambert,
    new_scene,
    wavelength,
)

CARRIER_HZ = 77e9
PULSES = 64
FPS = 24.0
GRAVITY = 9.81
#: Frames from the first pulse to a key; the shorter burst has 0.019 frames.
KEYS = {"on the first pulse": 0.0, "just before": -1.5e-4, "just after": 1.5e-4, "amid": 0.008}


def _measure(bench: Bench, prf_hz: float, frame: int = 1) -> tuple[Acquired, Real, Real]:
    """Run, times of the pulses [s], and lengths of its paths (paths, pulses) [m]."""
    run = acquire(bench, 8, 1, carrier_hz=CARRIER_HZ, prf_hz=prf_hz, pulses=PULSES, frame=frame)
    times_s = np.arange(PULSES) / prf_hz
    paths = frame_paths(signal.open_run(run.folder).frame(frame))
    return run, times_s, paths.lengths.lengths_m(times_s, slice(None))


def _checks(
    label: str, run: Acquired, lengths_m: Real, moved_m: Real, speed_mps: float, source: str
) -> list[Check]:
    """Rms of range rates, and the largest error of phases from pulse to pulse."""
    rows = run.rows
    points = np.repeat(rows["last_scatterer_m"][:, None], PULSES, axis=1)
    points[:, :, 1] += moved_m
    want_m = 2 * np.linalg.norm(points, axis=-1)
    off_m = (lengths_m - lengths_m[:, :1]) - (want_m - want_m[:, :1])
    rate = rows["range_rate_mps"] - rows["direction"][:, 1] * speed_mps
    phase = 2 * math.pi / wavelength(CARRIER_HZ) * float(np.abs(off_m).max())
    rms = float(np.sqrt(np.mean(rate**2)))
    return [
        absolute_check(f"{label}: range rate, rms", 0.0, rms, 1e-4, source, unit="m/s"),
        absolute_check(f"{label}: phase, largest", 0.0, phase, 6e-3, source, unit="rad"),
    ]


def _worst_speed(run: Acquired, speed_mps: float) -> float:
    """The speed along Y, of all paths, that is farthest from the true one [m/s]."""
    speeds_mps = run.rows["range_rate_mps"] / run.rows["direction"][:, 1]
    return float(speeds_mps[np.argmax(np.abs(speeds_mps - speed_mps))])


def _keyed(item: Any, keys: list[tuple[float, float]]) -> None:
    for frame, y in keys:
        item.location = (0.0, y, 0.0)
        item.keyframe_insert("location", frame=frame)
    for curve in animation_curves(item.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def keyframes(bench: Bench) -> list[Check]:
    """A car at 50 m whose speed changes from 10 to 20 m/s at a key."""
    checks = []
    for prf_hz in (20e3, 80e3):
        for place, offset in KEYS.items():
            new_scene(2.0)
            plate = add_plate("Car", facing_plate((0.0, 0.0, 0.0), 1.0), lambert(0.6))
            at = float(np.float32(1 + offset))
            _keyed(plate, [(at - 24, 40.0), (at, 50.0), (at + 24, 70.0)])
            run, times_s, lengths_m = _measure(bench, prf_hz)

            def distance(time_s: Real, corner_s: float = (at - 1) / FPS) -> Real:
                after = time_s - corner_s
                return np.asarray(np.where(after < 0, 10 * after, 20 * after))

            moved_m = distance(times_s) - distance(np.zeros(1))
            label = f"key {place}, PRF {prf_hz / 1e3:g} kHz"
            speed = 10.0 if offset > 0 else 20.0
            checks += _checks(label, run, lengths_m, moved_m, speed, "straight lines between keys")
    return checks


def springs(bench: Bench) -> list[Check]:
    """A walker at 20 m on an Elastic key: a damped spring, from the key on (Penner 2002)."""
    new_scene(2.0)
    plate = add_plate("Walker", facing_plate((0.0, 0.0, 0.0), 1.0), lambert(0.6))
    _keyed(plate, [(1, 20.0), (25, 22.0)])
    for curve in animation_curves(plate.animation_data):
        first, last = curve.keyframe_points
        first.interpolation, first.easing = "ELASTIC", "EASE_OUT"
        first.amplitude, first.period = abs(last.co[1] - first.co[1]), 0.3 * 24

    def distance(time_s: Real) -> Real:
        part = time_s * FPS / 24
        return np.asarray(
            20 + 2 * (2.0 ** (-10 * part) * np.sin((part - 0.075) * 2 * math.pi / 0.3) + 1)
        )

    run, times_s, lengths_m = _measure(bench, 20e3)
    moved_m = distance(times_s) - distance(np.zeros(1))
    speed = 2 * FPS / 24 * 10 * math.log(2)  # the sine is -1 there
    return _checks("on an Elastic key", run, lengths_m, moved_m, speed, "Penner's spring")


def rigid_body(bench: Bench) -> list[Check]:
    """A plate in free fall towards the radar by Blender's rigid bodies, without a bake."""
    checks = []
    frame = 9
    for units_per_m in (1.0, 100.0):
        scene = new_scene(5.0, metres_per_unit=1 / units_per_m)
        scene.gravity = (0.0, -GRAVITY * units_per_m, 0.0)
        plate = add_plate("Falling", facing_plate((0.0, 20.0, 0.0), 1.0), lambert(0.6))
        bpy.context.view_layer.objects.active = plate
        plate.select_set(True)
        bpy.ops.rigidbody.world_add()
        bpy.ops.rigidbody.object_add()
        plate.rigid_body.linear_damping = 0.0
        scene.rigidbody_world.substeps_per_frame = 1000
        run, _, _ = _measure(bench, 20e3, frame)
        fallen_s = (frame - 1) / FPS
        worst = _worst_speed(run, -GRAVITY * fallen_s)
        name = f"free fall after {fallen_s:.3f} s, {units_per_m:g} units per metre"
        source = "g t, in Bullet's steps of 1/24000 s"
        checks.append(absolute_check(name, -GRAVITY * fallen_s, worst, 2e-3, source, unit="m/s"))
    return checks


def caches(bench: Bench) -> list[Check]:
    """What Blender knows at whole frames only: the slope of the parabola through three of them."""
    checks, frame = [], 9
    for kind in ("cloth", "soft body", "Alembic file"):
        scene = new_scene(5.0)
        scene.gravity = (0.0, -GRAVITY, 0.0)
        plate = add_plate("Falling", facing_plate((0.0, 20.0, 0.0), 1.0), lambert(0.6))
        if kind == "cloth":
            plate.modifiers.new("Simulation", "CLOTH")
        elif kind == "soft body":
            plate.modifiers.new("Simulation", "SOFT_BODY").settings.use_goal = False
        else:
            plate = _through_alembic(plate, bench.fresh())
        places = []
        for at in range(1, frame + 3):
            scene.frame_set(at)
            shown = plate.evaluated_get(bpy.context.evaluated_depsgraph_get())
            places.append(np.mean([(shown.matrix_world @ v.co).y for v in shown.data.vertices]))
        scene.frame_set(1)
        want = float(places[frame] - places[frame - 2]) * FPS / 2
        run, _, _ = _measure(bench, 20e3, frame)
        worst = _worst_speed(run, want)
        name = f"range rate of a falling {kind}, frame {frame}"
        source = "Blender's places at frames 8 and 10"
        checks.append(absolute_check(name, want, worst, 2e-3, source, unit="m/s"))
    return checks


def _through_alembic(plate: Any, folder: Path) -> Any:
    """The plate with a shape key in free fall, written to a file and read from it."""
    plate.shape_key_add(name="Basis")
    shape = plate.shape_key_add(name="Near")
    for one in shape.data:
        one.co.y -= 20.0
    for frame in range(1, 41):
        shape.value = GRAVITY * ((frame - 1) / FPS) ** 2 / 2 / 20
        shape.keyframe_insert("value", frame=frame)
    bpy.context.view_layer.objects.active = plate
    plate.select_set(True)
    folder.mkdir(parents=True, exist_ok=True)
    file = str(folder / "fall.abc")
    bpy.ops.wm.alembic_export(filepath=file, start=1, end=40, selected=True)
    bpy.data.objects.remove(plate)
    bpy.ops.wm.alembic_import(filepath=file, set_frame_range=False)
    (read,) = (one for one in bpy.data.objects if one.type == "MESH")
    read.data.materials.clear()
    read.data.materials.append(lambert(0.6))
    return read


def snapshots(bench: Bench) -> list[Check]:
    """Rings, two snapshots 10 ms apart, at frames whose float32 holds times ever more coarsely."""
    checks, speed_mps = [], 10.0
    for frame in (1, 32, 250, 10_000, -7):
        new_scene(30.0)
        ground = nodes.make_material("Ground", 3.0, 0.0, 0.0, 0.5)
        plate = add_plate("Plate", facing_plate((0.0, 0.0, 0.0), 60.0), ground)
        far = 10 * speed_mps / FPS
        _keyed(plate, [(frame - 10, 50.0 - far), (frame + 10, 50.0 + far)])
        run = radarsim.measure(
            active_radar(bpy.context.scene),
            bench.fresh(),
            frames=[frame],
            sampling_mode="rings",
            width_px=16,
            height_px=16,
            samples=1,
            snapshots=2,
            snapshot_interval_s=0.01,
            rings=1,
            ring_step_m=100.0,
        )
        paths = frame_paths(run.frame(frame))
        # Along a fixed ray the range of a plane grows as v over the cosine to its normal.
        cosine = pixel_rays(run.frame(frame).image(0, 0)[0].receiver, 16, 16).direction[
            paths.row, paths.col, 1
        ]
        rates_mps = paths.range_rate_mps * cosine
        worst = float(rates_mps[np.argmax(np.abs(rates_mps - speed_mps))])
        row = absolute_check(
            f"rings, frame {frame}: range rate",
            speed_mps,
            worst,
            2e-3,
            "speed of the plate",
            unit="m/s",
        )
        checks.append(dataclasses.replace(row, points=len(rates_mps)))
    return checks


def rotor(bench: Bench) -> list[Check]:
    """A blade of 0.3 m turns 80 times per second, seen with a range resolution of 3 m: the largest
    frequency at which the echoes have power, -40 dB below the whole, against the tips' Doppler.
    """
    half_m, turns_per_s, prf_hz, pulses = 0.15, 80.0, 40e3, 512
    new_scene(1.2)
    blade = add_box("Blade", (-half_m, 19.99, -0.01), (half_m, 20.01, 0.01), lambert(0.6))
    for frame in (1, 25):
        blade.rotation_euler.z = 2 * math.pi * turns_per_s * (frame - 1) / FPS
        blade.keyframe_insert("rotation_euler", frame=frame)
    for curve in animation_curves(blade.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    run = acquire(
        bench, 64, 2, carrier_hz=24e9, prf_hz=prf_hz, pulses=pulses,
        bandwidth_hz=50e6, sampling_rate_hz=60e6,
    )  # fmt: skip
    options = signal.ProcessOptions(plots=False, products=False)
    events = signal.process_run(run.folder, options)
    (result,) = (event for event in events if isinstance(event, signal.FrameResult))
    lines = result.compressed.plane.sum(axis=1) * np.blackman(pulses)
    power = np.abs(np.fft.fft(lines)) ** 2
    seen_hz = np.abs(np.fft.fftfreq(pulses, 1 / prf_hz))[power > 1e-4 * power.sum()]
    tips_hz = 4 * math.pi * turns_per_s * math.hypot(half_m, 0.01) / wavelength(24e9)
    leakage_hz = 3 * prf_hz / pulses
    return [
        absolute_check(
            "rotor's blade: largest Doppler frequency",
            tips_hz,
            float(seen_hz.max()),
            leakage_hz + 0.02 * tips_hz,
            "speed of the tips",
            unit="Hz",
        )
    ]


def _wavy_plate(speed_mps: float) -> Any:
    """A plate of 144 faces whose vertices move along Y by a shape key."""
    new_scene(2.6)
    ticks = np.linspace(-1, 1, 13).tolist()
    corners = [(x, 0.05 * math.sin(7 * x) * math.cos(5 * z), z) for z in ticks for x in ticks]
    starts = [13 * row + column for row in range(12) for column in range(12)]
    mesh = bpy.data.meshes.new("Plate")
    mesh.from_pydata(corners, [], [(n, n + 1, n + 14, n + 13) for n in starts])
    mesh.materials.append(lambert(0.6))
    plate = bpy.data.objects.new("Plate", mesh)
    plate.location.y = 20.0
    bpy.context.scene.collection.objects.link(plate)
    plate.shape_key_add(name="Basis")
    moved = plate.shape_key_add(name="Moved")
    for point in moved.data:
        point.co.y += speed_mps
    for frame in (1, 25):
        moved.value = (frame - 1) / FPS
        moved.keyframe_insert("value", frame=frame)
    for curve in animation_curves(mesh.shape_keys.animation_data):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    return plate


def changing_vertices(bench: Bench) -> list[Check]:
    """Modifiers that make other vertices at each moment: the speed is right, or its size named."""
    checks, speed_mps = [], 20.0
    for kind in ("none", "Decimate", "Remesh"):
        plate = _wavy_plate(speed_mps)
        if kind == "Decimate":
            plate.modifiers.new("Decimate", "DECIMATE").ratio = 0.5
        elif kind == "Remesh":
            plate.modifiers.new("Solid", "SOLIDIFY").thickness = 0.3
            remesh = plate.modifiers.new("Remesh", "REMESH")
            remesh.mode, remesh.voxel_size = "VOXEL", 0.1
        run = acquire(bench, 16, 1, carrier_hz=CARRIER_HZ, prf_hz=10e3, pulses=256)
        worst = _worst_speed(run, speed_mps)
        named = [
            one
            for one in read_record(run.folder / frame_dir(1) / MOTION_FILE, MotionRecord).findings
            if one.code == "surface-not-followed"
        ]
        said = named[0].numbers["speed_mps"] if named else worst
        assert isinstance(said, float)
        bound = 0.05 * speed_mps if named else 1e-3
        label = f"plate by a shape key, {kind}: {'speed that is named' if named else 'range rate'}"
        checks.append(
            absolute_check(label, speed_mps, said, bound, "speed of the shape key", unit="m/s")
        )
    return checks


def jumps(bench: Bench) -> list[Check]:
    """A Cycles modifier that begins again on the burst's first pulse, and amid the burst."""
    checks, speed_mps = [], 10.0
    for frame, prf_hz in ((25, 20e3), (24, 1e3)):
        new_scene(2.0)
        plate = add_plate("Car", facing_plate((0.0, 0.0, 0.0), 1.0), lambert(0.6))
        _keyed(plate, [(1, 20.0), (25, 20.0 + speed_mps)])
        for curve in animation_curves(plate.animation_data):
            curve.modifiers.new("CYCLES")
        run, _, _ = _measure(bench, prf_hz, frame)
        worst = _worst_speed(run, speed_mps)
        label = f"Cycles modifier, jump of {speed_mps:g} m at frame 25, burst from frame {frame}"
        source = "straight line between keys"
        checks.append(absolute_check(label, speed_mps, worst, 1e-3, source, unit="m/s"))
    return checks


GROUP = Group(
    "motion",
    "Motion",
    "A plate at 50 m, 77 GHz, 64 pulses, with a corner at a keyframe: errors of range rates "
    "and of phases. Rigid bodies and caches; a rotor; modifiers that make other vertices at "
    "each moment; positions that jump.",
    (
        Case("keyframes", keyframes, 20.0),
        Case("elastic key", springs, 5.0),
        Case("rigid bodies", rigid_body, 10.0),
        Case("caches", caches, 10.0),
        Case("snapshots of rings", snapshots, 20.0),
        Case("rotor", rotor, 10.0),
        Case("changing vertices", changing_vertices, 10.0),
        Case("jumps", jumps, 5.0),
    ),
)
