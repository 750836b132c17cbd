# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene in which no two things are alike, and where each thing is in it by formulas in numpy.

Units of 1 cm, a portrait view that is shifted, both antennas move, objects with uneven scale under
an unevenly scaled and turned parent, one of them mirrored, two mirrors of different size, a wall.
Places are in metres in the world; meshes are these, turned back into the objects' own axes.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from radarsim_addon.blender.materials import make_physical_material, set_mirror
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

UNITS = 100.0  # in a metre
FPS = 24.0
CARRIER_HZ = 5.3e9
#: Time of the render of a frame's burst is that of the frame: keys are at frames.
MOUNT_KEYS = ((-40, (1.6, -4.1, 2.5)), (40, (0.4, 0.7, 3.4)))
EMITTER_KEYS = ((-40, (0.9, 0.1, -0.5)), (40, (0.5, 0.6, 0.3)))
MOUNT_TURN = (1.5, 0.15, 0.05)
#: Of the sled, in the axes of its parent: other velocities before, within and after the burst.
SLED_KEYS = (
    (-40, (0.0, 0.0, 0.0)),
    (-1, (1.0, 5.0, 0.5)),
    (2.5, (1.2, 5.4, 0.3)),
    (30, (-2.0, 9.0, 2.0)),
)
SLED_TURN, SLED_SCALE = (0.2, -0.3, 0.5), (0.7, 1.6, 1.2)
PARENT = ((0.3, 9.0, 3.1), (0.3, -0.2, 0.35), (1.3, 0.8, 1.1))

Corners = list[tuple[float, float, float]]
SLED_AT_FIRST: Corners = [(-1.0, 13.0, 2.9), (0.5, 13.4, 2.8), (0.4, 13.8, 4.2), (-1.1, 13.4, 4.3)]
BACK: Corners = [(1.6, 22.0, 1.4), (3.5, 21.4, 1.5), (3.6, 21.8, 3.8), (1.7, 22.4, 3.7)]
ROAD: Corners = [(-5.0, 2.0, 0.1), (6.0, 2.0, -0.3), (6.0, 12.5, -0.2), (-5.0, 12.5, 0.2)]
WINDOW: Corners = [(-3.6, 5.0, 2.0), (-3.3, 10.5, 2.0), (-3.2, 10.5, 5.5), (-3.5, 5.0, 5.5)]
WINDOW_M = 0.3  # thick: closed, so that it has an inner and an outer side
POST: Corners = [(-3.2, 17.0, 1.0), (-2.4, 17.2, 1.0), (-2.4, 17.6, 2.6), (-3.2, 17.4, 2.6)]
WALL_M, WALL_EPS = 0.06, 4.2 + 0.3j
#: Of rough metal: Radar Materials, so that a wall before them splits no path by chance.
ALBEDO, SCATTERING = 0.9998, ("Back", "Post", "Sled")

#: Location, rotation and scale of objects; the window and the post are mirrored.
OWN = {
    "A wall": ((1.5, 12.0, 2.0), (-0.3, 0.5, 1.0), (1.8, 0.7, 1.2)),
    "Back": ((1.0, 20.0, 2.0), (0.3, 0.2, -0.7), (0.6, 2.0, 1.1)),
    "Post": ((0.0, 1.0, 0.3), (-0.4, 0.3, 0.6), (1.0, 0.6, -1.4)),
    "Road": ((-1.0, 3.0, 1.0), (0.5, -0.4, 0.2), (1.7, 0.5, 1.0)),
    "Window": ((-0.3, 0.4, -0.7), (0.4, 0.9, -0.3), (-1.2, 0.7, 1.5)),
}
UNDER_PARENT = ("Post", "Window")


def matrix(location: Any, rotation: Any, scale: Any) -> np.ndarray:
    """Pose of location, XYZ Euler angles and scale, (4, 4)."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(rotation), np.sin(rotation)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    pose = np.eye(4)
    pose[:3, :3] = about_z @ about_y @ about_x @ np.diag(scale)
    pose[:3, 3] = location
    return pose


def between(keys: Any, frame: float) -> np.ndarray:
    """Value of linear keys at a frame."""
    frames, values = zip(*keys, strict=True)
    return np.array([np.interp(frame, frames, part) for part in zip(*values, strict=True)])


def antennas(frame: float) -> tuple[np.ndarray, np.ndarray]:
    """Places of receiver and transmitter, (3,) each [m]."""
    mount = matrix(between(MOUNT_KEYS, frame), MOUNT_TURN, (1, 1, 1))
    return mount[:3, 3], (mount @ [*between(EMITTER_KEYS, frame), 1])[:3]


def sled_pose(frame: float) -> np.ndarray:
    """Pose of the sled in the world, (4, 4) [m]."""
    return matrix(*PARENT) @ matrix(between(SLED_KEYS, frame), SLED_TURN, SLED_SCALE)


def sled_corners(frame: float) -> np.ndarray:
    """Corners of the sled, (4, 3) [m]."""
    moved = sled_pose(frame) @ np.linalg.inv(sled_pose(1))
    return np.array(SLED_AT_FIRST) @ moved[:3, :3].T + moved[:3, 3]


def wall_corners() -> tuple[np.ndarray, np.ndarray]:
    """Corners of the wall, (8, 3) [m], and its unit normal."""
    pose = matrix((2.1, 13.0, 2.6), (0.15, 0.1, 0.5), (1, 1, 1))
    grid = [(x, y, z) for x in (-1.3, 1.5) for y in (-0.5, 0.5) for z in (-1.6, 1.4)]
    flat = np.array(grid) * (1, WALL_M, 1)
    return flat @ pose[:3, :3].T + pose[:3, 3], pose[:3, 1]


def mirror_plane(corners: Any) -> tuple[np.ndarray, float]:
    """Unit normal towards the radar, and offset, of a plane through corners."""
    a, b, c = np.array(corners)[[0, 1, 3]]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    offset = float(normal @ a)
    side = np.sign(normal @ antennas(1)[1] - offset)
    return side * normal, side * offset


def pose_of(name: str) -> np.ndarray:
    """Pose of an object that does not move, (4, 4) [m]."""
    pose = matrix(*OWN[name])
    return matrix(*PARENT) @ pose if name in UNDER_PARENT else pose


def world_of(name: str) -> np.ndarray:
    """Vertices of an object that does not move, (n, 3) [m]."""
    if name == "A wall":
        return wall_corners()[0]
    corners = np.array({"Back": BACK, "Post": POST, "Road": ROAD, "Window": WINDOW}[name])
    if name == "Window":
        inner = corners - WINDOW_M * mirror_plane(corners)[0]
        return np.concatenate([corners, inner])
    return corners


def put(
    name: str,
    corners: Any,
    faces: Any,
    material: Any,
    own: tuple[Any, Any, Any],
    parent: Any = None,
) -> Any:
    """An object of a pose (location, rotation, scale) whose corners are in the world."""
    pose = matrix(*own) if parent is None else matrix(*PARENT) @ matrix(*own)
    local = (np.asarray(corners) - pose[:3, 3]) @ np.linalg.inv(pose[:3, :3]).T
    mesh = bpy.data.meshes.new(name)
    if np.linalg.det(pose[:3, :3]) < 0:
        faces = [face[::-1] for face in faces]  # outwards in the object's own axes
    mesh.from_pydata((local * UNITS).tolist(), [], faces)
    mesh.materials.append(material)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    item.parent = parent
    item.location = tuple(UNITS * np.array(own[0]))
    item.rotation_euler, item.scale = own[1:]
    return item


def move(item: Any, keys: Any) -> None:
    """Linear keys of a place [m]."""
    mh.key(item, "location", *((frame, tuple(UNITS * np.array(at))) for frame, at in keys))
    mh.interpolation(item, "LINEAR", "LINEAR")


SLAB_FACES = [
    (0, 1, 2, 3),
    (7, 6, 5, 4),
    *((i + 4, (i + 1) % 4 + 4, (i + 1) % 4, i) for i in range(4)),
]
BOX_FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6)]


def build() -> None:
    """Make the scene the current one."""
    scene = rs.new_scene()
    scene.unit_settings.scale_length = 1 / UNITS
    camera = scene.camera.data
    ph.field_of_view(56)
    camera.shift_x, camera.shift_y = 0.04, -0.07
    mount, emitter = bpy.data.objects["Radar"], bpy.data.objects["Radar Emitter"]
    mount.rotation_euler = MOUNT_TURN
    move(mount, MOUNT_KEYS)
    move(emitter, EMITTER_KEYS)
    parent = mh.empty("Carriage", (0, 0, 0))
    parent.location = tuple(UNITS * np.array(PARENT[0]))
    parent.rotation_euler, parent.scale = PARENT[1:]
    quad = [(0, 1, 2, 3)]
    own = (between(SLED_KEYS, 1), SLED_TURN, SLED_SCALE)
    sled = put("Sled", SLED_AT_FIRST, quad, ph.rough_metal(), own, parent)
    move(sled, SLED_KEYS)
    for name, material in (
        ("Back", ph.rough_metal()),
        ("Road", ph.mirror("Road")),
        ("Window", ph.mirror("Window")),
        ("Post", ph.rough_metal()),
    ):
        under = parent if name in UNDER_PARENT else None
        faces = SLAB_FACES if name == "Window" else quad
        put(name, world_of(name), faces, material, OWN[name], under)
    concrete = make_physical_material(
        "Concrete", "permittivity", carrier_hz=CARRIER_HZ,
        eps_real=WALL_EPS.real, eps_imag=WALL_EPS.imag,
    )  # fmt: skip
    wall = put("A wall", wall_corners()[0], BOX_FACES, concrete, OWN["A wall"])
    set_mirror(wall, "never")
    scene.frame_set(1)
