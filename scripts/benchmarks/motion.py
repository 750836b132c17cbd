# SPDX-License-Identifier: GPL-3.0-or-later
"""Range rates by differencing two renders (rings) and by kinematics (paths), against the truth.

    python -m scripts.benchmarks.motion

Each scene has its velocities in closed form at every point that was rendered. Prints the table
that docs/motion.md quotes. About twenty seconds.
"""

from __future__ import annotations

import itertools
import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from radarsim_addon.arrays import Real

Velocity = Callable[[Real], Real]

#: Time between the two renders [s].
DELTA_T_S = 0.01
CARRIER_HZ = 77e9
PULSES, PRF_HZ = 256, 10_000.0
WIDTH_PX = 64
_FPS = 24.0


@dataclass(frozen=True)
class Case:
    """One scene, as it is built: what it is called, and velocities of its points and of the radar.

    `velocity` takes points at t (n, 3) in metres.
    """

    name: str
    frame: int
    velocity: Velocity
    radar_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)


def run_motion(folder: Path) -> list[dict[str, Any]]:
    """All scenes by both methods."""
    folder.mkdir(exist_ok=True)
    results = []
    for number, build in enumerate(
        (_receding_plate, _crossing_plate, _spinning_sphere, _rotor, _ground, _walking_figure)
    ):
        case = build()
        result: dict[str, Any] = {"scene": case.name}
        for method in ("two-pass", "kinematic"):
            result[method] = _measure(case, method, folder / f"{number}_{method}")
        results.append(result)
    return results


def motion_table(results: list[dict[str, Any]]) -> str:
    """As Markdown."""
    titles = (
        "scene",
        "true range rates [m/s]",
        "two snapshots: rms error [m/s]",
        "kinematics: rms error [m/s]",
        "of a Doppler bin",
    )
    lines = [f"| {' | '.join(titles)} |", "|" + " --- |" * len(titles)]
    bin_mps = 299_792_458.0 / CARRIER_HZ * PRF_HZ / (2 * PULSES)
    for result in results:
        two, one = result["two-pass"], result["kinematic"]
        lines.append(
            f"| {result['scene']} | {one['lowest']:.3g} to {one['highest']:.3g} | "
            f"{two['rms']:.2g} | {one['rms']:.1g} | {one['rms'] / bin_mps:.1g} |"
        )
    return "\n".join(lines)


def _measure(case: Case, method: str, folder: Path) -> dict[str, float]:
    """Power-weighted error of the range rates at the points that were rendered."""
    import bpy

    from radarsim_addon import blender as radarsim
    from radarsim_addon import signal
    from radarsim_addon.blender.scene import active_radar
    from radarsim_addon.signal.decoding import frame_paths

    radarsim.measure(
        active_radar(bpy.context.scene),
        folder,
        frames=[case.frame],
        sampling_mode="rings" if method == "two-pass" else "paths",
        carrier_hz=CARRIER_HZ,
        bandwidth_hz=150e6,
        chirp_duration_s=1e-6,
        sampling_rate_hz=160e6,
        prf_hz=PRF_HZ,
        pulses=PULSES,
        rings=0,
        ring_step_m=1000.0,
        snapshots=2,
        snapshot_interval_s=DELTA_T_S,
        width_px=WIDTH_PX,
        height_px=WIDTH_PX,
        samples=1,
        replicates=1,
    )
    frame = signal.open_run(folder).frame(case.frame)
    paths = frame_paths(frame)
    if method == "two-pass":
        record, _ = frame.image(0, 0)
        pose = np.array(record.receiver.matrix_world)
        u, v = _tangents(record)
        rays = np.stack([u[paths.col], v[paths.row], -np.ones(len(paths))], axis=-1)
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        direction = rays @ pose[:3, :3].T
        points = pose[:3, 3] + direction * paths.range_m[:, None]
    else:
        assert paths.geometry is not None
        direction, points = paths.geometry.direction, paths.geometry.last_scatterer_m
    truth = np.sum(direction * (case.velocity(points) - np.array(case.radar_velocity)), axis=1)
    power = paths.radiance * paths.solid_angle_sr
    error = paths.range_rate_mps - truth
    return {
        "rms": float(np.sqrt(np.sum(power * error**2) / power.sum())),
        "worst": float(np.abs(error).max()),
        "lowest": float(truth.min()),
        "highest": float(truth.max()),
        "points": len(paths),
    }


def _tangents(record: Any) -> tuple[Real, Real]:
    camera = record.receiver
    across = (np.arange(record.width_px) + 0.5) / record.width_px
    down = (np.arange(record.height_px) + 0.5) / record.height_px
    return (
        camera.left + (camera.right - camera.left) * across,
        camera.top - (camera.top - camera.bottom) * down,
    )


# -- scenes ----------------------------------------------------------------------------------------


def _new_scene(field_of_view_deg: float) -> Any:
    """A radar at the origin that looks along +Y."""
    import bpy

    from radarsim_addon import blender as radarsim

    bpy.ops.wm.read_factory_settings(use_empty=True)
    radarsim.add_radar(field_of_view_deg=field_of_view_deg, preset="paper")
    return bpy.context.scene


def _mesh(name: str, corners: Any, faces: Any) -> Any:
    import bpy

    from radarsim_addon.blender import nodes

    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, c)) for c in corners], [], [tuple(f) for f in faces])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    nodes.assign_radar_material([item], "metal")
    return item


def _plate(name: str, width: float, height: float) -> Any:
    x, z = width / 2, height / 2
    return _mesh(name, [(-x, 0, -z), (x, 0, -z), (x, 0, z), (-x, 0, z)], [(0, 1, 2, 3)])


def _box(low: tuple[float, ...], high: tuple[float, ...]) -> tuple[list[Any], list[Any]]:
    corners = list(itertools.product(*zip(low, high, strict=True)))
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, faces


def _key(item: Any, path: str, kind: str, *values: tuple[int, Any]) -> None:
    import bpy

    from radarsim_addon.blender.scene.visibility import animation_curves

    for frame, value in values:
        setattr(item, path, value)
        item.keyframe_insert(path, frame=frame)
    owner = item.id_data  # the object of a pose bone
    for curve in animation_curves(owner.animation_data):
        if not curve.data_path.endswith(path):
            continue
        for point in curve.keyframe_points:
            point.interpolation = kind
            if kind == "SINE":
                point.easing = "EASE_IN_OUT"
    bpy.context.scene.frame_set(1)


def _receding_plate() -> Case:
    _new_scene(16)
    plate = _plate("Plate", 4, 4)
    _key(plate, "location", "LINEAR", (1, (0, 20, 0)), (25, (0, 30, 0)))
    return Case("receding plate, 10 m/s", 1, lambda p: np.tile([0, 10.0, 0], (len(p), 1)))


def _crossing_plate() -> Case:
    _new_scene(16)
    plate = _plate("Plate", 4, 4)
    _key(plate, "location", "LINEAR", (1, (0, 20, 0)), (25, (10, 20, 0)))
    return Case("crossing plate, 10 m/s", 1, lambda p: np.tile([10.0, 0, 0], (len(p), 1)))


def _spinning_sphere() -> Case:
    import bpy

    _new_scene(8)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=64, radius=1.0)
    sphere = bpy.context.object
    from radarsim_addon.blender import nodes

    nodes.assign_radar_material([sphere], "metal")
    sphere.location = (0, 20, 0)
    rate = 10.0
    _key(sphere, "rotation_euler", "LINEAR", (1, (0, 0, 0)), (25, (0, 0, rate)))
    return Case(
        "sphere of 1 m spinning in place, 10 rad/s",
        1,
        lambda p: np.cross([0, 0, rate], p - [0, 20, 0]),
    )


def _rotor() -> Case:
    _new_scene(4)
    parts = []
    for sign in (-1, 1):  # blades with a pitch, as of a propeller
        tilt = 0.05 * sign
        tip = sign * 0.5
        parts.append([(0, tilt, -0.05), (tip, tilt, -0.05), (tip, -tilt, 0.05), (0, -tilt, 0.05)])
    rotor = _mesh("Rotor", [c for part in parts for c in part], [(0, 1, 2, 3), (4, 5, 6, 7)])
    rotor.location = (0, 20, 0)
    rate = 100.0  # tips at 50 m/s
    _key(rotor, "rotation_euler", "LINEAR", (1, (0, 0, 0)), (25, (0, 0, rate)))
    return Case(
        "rotor of two blades, tips at 50 m/s",
        1,
        lambda p: np.cross([0, 0, rate], p - [0, 20, 0]),
    )


def _ground() -> Case:
    import bpy

    _new_scene(30)
    radar = bpy.data.objects["Radar"]
    radar.rotation_euler.x -= math.radians(45)
    _key(radar, "location", "LINEAR", (1, (0, 0, 30)), (25, (0, 30, 30)))
    far = 300.0
    corners = [(-far, -far, 0), (far, -far, 0), (far, far, 0), (-far, far, 0)]
    _mesh("Ground", corners, [(0, 1, 2, 3)])
    return Case(
        "flat ground under a radar at 30 m/s", 1, lambda p: np.zeros_like(p), (0.0, 30.0, 0.0)
    )


def _walking_figure() -> Case:
    """A body and two legs in one mesh, deformed by an armature that walks."""
    import bpy

    scene = _new_scene(7)
    boxes = {
        "Body": _box((-0.25, -0.12, 0.0), (0.25, 0.12, 0.8)),
        "Left": _box((-0.22, -0.08, -0.85), (-0.04, 0.08, -0.02)),
        "Right": _box((0.04, -0.08, -0.85), (0.22, 0.08, -0.02)),
    }
    corners: list[Any] = []
    faces: list[Any] = []
    for own_corners, own_faces in boxes.values():
        faces += [tuple(n + len(corners) for n in face) for face in own_faces]
        corners += own_corners
    figure = _mesh("Figure", corners, faces)
    data = bpy.data.armatures.new("Skeleton")
    skeleton = bpy.data.objects.new("Skeleton", data)
    scene.collection.objects.link(skeleton)
    bpy.context.view_layer.objects.active = skeleton
    bpy.ops.object.mode_set(mode="EDIT")
    heads = {"Body": (0, 0, 0), "Left": (-0.13, 0, 0), "Right": (0.13, 0, 0)}
    for name, head in heads.items():
        bone = data.edit_bones.new(name)
        up = 0.8 if name == "Body" else -0.85
        bone.head, bone.tail = head, (head[0], 0, up)
        bone.roll = 0.0
    bpy.ops.object.mode_set(mode="OBJECT")
    for number, name in enumerate(boxes):
        group = figure.vertex_groups.new(name=name)
        group.add(list(range(8 * number, 8 * number + 8)), 1.0, "REPLACE")
    figure.modifiers.new("Armature", "ARMATURE").object = skeleton
    figure.parent = skeleton
    swing, half_period = math.radians(25), 12
    for name, sign in (("Left", 1), ("Right", -1)):
        bone = skeleton.pose.bones[name]
        bone.rotation_mode = "XYZ"
        # a bone that hangs down has its X axis along the world's, up to sign
        scene.frame_set(1)
        bpy.context.view_layer.update()
        along = float(np.sign(np.array(bone.matrix)[0, 0])) * sign
        _key(
            bone,
            "rotation_euler",
            "SINE",
            (1, (-swing * along, 0, 0)),
            (1 + half_period, (swing * along, 0, 0)),
        )
    _key(skeleton, "location", "LINEAR", (1, (0, 20, 0)), (25, (0, 20 - 1.4, 0)))
    frame = 6
    place = np.array([0, 20 - 1.4 * (frame - 1) / 24, 0])
    period_s = half_period / _FPS
    rate = swing * math.pi / period_s * math.sin(math.pi * (frame - 1) / half_period)

    def velocity(points: Real) -> Real:
        own = points - place
        speed = np.tile([0.0, -1.4, 0.0], (len(points), 1))
        # about the hips, along X; boxes do not meet, and legs stay on their sides
        for sign, leg in ((1, own[:, 0] < -0.02), (-1, own[:, 0] > 0.02)):
            leg = leg & (own[:, 2] < -0.01)
            speed[leg] += np.cross([sign * rate, 0, 0], own[leg])
        return speed

    return Case("walking figure, 1.4 m/s, armature", frame, velocity)


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory(prefix="radarsim_motion_") as name:
        print(motion_table(run_motion(Path(name))))


if __name__ == "__main__":
    main()
