# SPDX-License-Identifier: GPL-3.0-or-later
"""The radar in the scene: a camera that receives and a Point light that transmits, on an empty.

The parent of the light keeps the settings of the radar. Patterns of the antennas can be drawn as
wire surfaces, for the viewport only.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Real
from ...errors import SceneError
from ...physics.antennas import Antenna
from ...signal.radar import RadarSystem, peak_direction
from ..nodes import setup_emitter
from ..nodes.groups import ring_emitters
from .finite_checks import check_pose

#: Scene property: the radar that measures.
ACTIVE_RADAR_PROPERTY = "radarsim_rig"
EMITTER_NAME = "Radar Emitter"
#: Largest deviation of the products of an antenna's axes from 0 and 1: half of it is a deviation
#: of a length. float32 matrices are within 1e-6.
_SCALE_TOLERANCE = 1e-4


@dataclass(frozen=True)
class Rig:
    """Antennas of a radar in the scene."""

    #: The receiver, of type CAMERA.
    camera: bpy.types.Object
    #: The transmitter, a Point light with the Ring Emitter.
    emitter: bpy.types.Object


def setup_rig(
    scene: bpy.types.Scene,
    location: tuple[float, float, float] = (0.0, 0.0, 0.0),
    eirp_w: float = 1.0,
) -> Any:
    """Add a radar to a scene: an empty, which is returned, with a camera and a transmitter on it.

    Both move with the empty, which can be animated. Like a camera, the radar points along its own
    -Z, with its +Y up. A new radar is level and points along the world's +Y. The camera becomes the
    scene's camera if there is none. `location` is in Blender units.
    """
    empty = bpy.data.objects.new("Radar", None)
    camera = bpy.data.objects.new("Radar Receiver", bpy.data.cameras.new("Radar Receiver"))
    emitter = bpy.data.objects.new(EMITTER_NAME, bpy.data.lights.new(EMITTER_NAME, "POINT"))
    try:
        emitter.data.energy = eirp_w
        setup_emitter(emitter.data)
    except BaseException:
        bpy.data.lights.remove(emitter.data)
        bpy.data.cameras.remove(camera.data)
        bpy.data.objects.remove(empty)
        raise
    empty.empty_display_type = "ARROWS"
    for item in (empty, camera, emitter):
        scene.collection.objects.link(item)
    for child in (camera, emitter):
        child.parent = empty
    empty.rotation_euler = (math.pi / 2, 0.0, 0.0)
    empty.location = location
    if scene.camera is None:
        scene.camera = camera
    if hasattr(scene, ACTIVE_RADAR_PROPERTY):
        setattr(scene, ACTIVE_RADAR_PROPERTY, empty)
    return empty


def radar_of(light: Any) -> Any:
    """Return the object that keeps the settings of a transmitter: its parent, else itself."""
    return light.parent or light


def radars(scene: bpy.types.Scene) -> list[Any]:
    """Return the radars of a scene, as `radar_of` does, in the order of its objects."""
    return list(dict.fromkeys(map(radar_of, _transmitters(scene))))


def active_radar(scene: bpy.types.Scene) -> Any:
    """Return the radar that a scene measures with: the chosen one, else the only one.

    `SceneError` if the scene has none, or several of which none is chosen.
    """
    chosen = getattr(scene, ACTIVE_RADAR_PROPERTY, None)
    if chosen is not None and chosen.name in scene.objects:
        return chosen
    found = {radar_of(item) for item in _transmitters(scene) if not item.hide_render}
    return found.pop() if len(found) == 1 else radar_of(_only_emitter(scene))


def antennas_of(scene: bpy.types.Scene, radar: Any) -> dict[str, Any]:
    """Return the arguments ``camera`` and ``emitter`` of `find_rig`; None for one that it finds.

    `SceneError` if the radar has no transmitter.
    """
    group = getattr(radar, "radarsim", None)
    camera, light = (getattr(group, name, None) for name in ("camera", "light"))
    own = [item for item in _transmitters(scene) if radar_of(item) == radar]
    if light is None and not own:
        raise SceneError(
            f"{radar.name!r} has no transmitter. Choose another radar in the Radar tab, or press "
            "Radar > Set Up Radar."
        )
    rendered = [item for item in own if not item.hide_render] or own
    return {"camera": camera, "emitter": light or (rendered[0] if len(rendered) == 1 else None)}


def find_rig(
    scene: bpy.types.Scene,
    camera: bpy.types.Object | None = None,
    emitter: bpy.types.Object | None = None,
    any_projection: bool = False,
) -> Rig:
    """Return the radar of a scene; `SceneError` if an antenna is missing, unclear or unsuitable.

    `camera` and `emitter` are what the user chose. None: the only light with a Ring Emitter, and
    the camera on the same parent, else the scene's camera. Cameras that are not perspective need
    `any_projection`.
    """
    emitter = emitter or _only_emitter(scene)
    if not is_transmitter(emitter) or emitter.name not in scene.objects:
        raise SceneError(
            f"{emitter.name!r} is not a transmitter of this scene: a Point light with the Ring "
            "Emitter node group. Choose another light, or press Radar > Set Up Radar."
        )
    if not emitter.data.energy > 0:
        raise SceneError(
            f"The transmitter {emitter.name!r} has a power of {emitter.data.energy:g} W, so there "
            "is no echo. Set Power of the light to a positive number of watts."
        )
    camera = camera or _receiver(scene, emitter)
    if camera is None or camera.type != "CAMERA" or camera.name not in scene.objects:
        raise SceneError(
            "The scene has no camera, which is the receiver. Press Radar > Set Up Radar, or set "
            "Scene > Camera. In a script, call radarsim.add_radar, or set scene.camera; for "
            "radarsim render, save the file with the camera."
        )
    if camera.data.type != "PERSP" and not any_projection:
        raise SceneError(
            f"Camera {camera.name!r} is of type {camera.data.type}, but ring sampling needs a "
            "perspective one. Set Camera > Lens > Type to Perspective, or Sampling mode to Paths."
        )
    return Rig(camera, emitter)


def is_transmitter(item: bpy.types.Object) -> bool:
    """Return whether an object, or None, is a Point light with the Ring Emitter."""
    if item is None or item.type != "LIGHT":
        return False
    light = item.data
    if light is None or light.type != "POINT" or light.node_tree is None:
        return False
    if bpy.app.version < (5, 0, 0) and not light.use_nodes:  # Blender 5 always uses the nodes
        return False
    return bool(ring_emitters(light))


def _transmitters(scene: bpy.types.Scene) -> list[Any]:
    lights = (item for item in scene.objects if item.type == "LIGHT")
    return [item for item in lights if is_transmitter(item)]


def _only_emitter(scene: bpy.types.Scene) -> Any:
    transmitters = _transmitters(scene)
    found = [item for item in transmitters if not item.hide_render]
    if not found:
        if transmitters:
            raise SceneError(
                f"The transmitter {transmitters[0].name!r} is hidden from renders, so there is no "
                "echo. Enable it in the outliner (camera icon)."
            )
        raise SceneError(
            "The scene has no transmitter: no Point light has the Ring Emitter node group. "
            "Press Radar > Set Up Radar."
        )
    if len(found) > 1:
        names = ", ".join(repr(item.name) for item in found)
        raise SceneError(
            f"The scene has {len(found)} transmitters ({names}), but a measurement has one. "
            "Hide the others from renders, or choose one in the Radar tab."
        )
    return found[0]


def _receiver(scene: bpy.types.Scene, emitter: bpy.types.Object) -> Any:
    """Return the camera on the transmitter's parent, else the scene's camera."""
    if emitter.parent is not None:
        siblings = [
            item
            for item in scene.objects
            if item.type == "CAMERA" and item.parent == emitter.parent
        ]
        if len(siblings) == 1:
            return siblings[0]
    return scene.camera


def check_scale(item: bpy.types.Object, matrix_world: Any) -> None:
    """Check that the pose (4, 4) of an antenna is finite and has scale 1; `SceneError` if not.

    Cycles would change angles (camera) or power (light).
    """
    check_pose(item.name, matrix_world)
    axes = np.array(matrix_world, dtype=np.float64)[:3, :3]
    if np.abs(axes.T @ axes - np.eye(3)).max() > _SCALE_TOLERANCE or np.linalg.det(axes) < 0:
        lengths = ", ".join(f"{value:.6g}" for value in np.linalg.norm(axes, axis=0))
        raise SceneError(
            f"{item.name!r} is scaled by ({lengths}), mirrored or sheared, which changes the "
            "angles or the power of an antenna. Apply or clear its scale and that of its parents "
            "(Object > Apply > Scale)."
        )


#: Marks the pattern objects; its value is "transmit" or "receive".
PATTERN_PROPERTY = "radarsim_pattern"
NAMES = {"transmit": "Radar Transmit Pattern", "receive": "Radar Receive Pattern"}
#: A gain this far below the peak is at the centre [dB].
_DYNAMICS_DB = 40.0
_RINGS, _SPOKES = 96, 72


def draw_patterns(
    scene: bpy.types.Scene,
    rig: Rig,
    system: RadarSystem,
    size: float,
    which: Iterable[str] = ("transmit", "receive"),
) -> list[Any]:
    """Draw antenna patterns on their antennas, and remove earlier ones; return the wire surfaces.

    `size` is the length of the peak [Blender units].
    """
    remove_patterns()
    made = []
    for kind in which:
        antenna = system.transmitter if kind == "transmit" else system.receiver
        carrier = rig.emitter if kind == "transmit" else rig.camera
        vertices, faces = pattern_surface(antenna)
        mesh = bpy.data.meshes.new(NAMES[kind])
        mesh.from_pydata((size * vertices).tolist(), [], faces.tolist())
        item = bpy.data.objects.new(NAMES[kind], mesh)
        item[PATTERN_PROPERTY] = kind
        scene.collection.objects.link(item)
        item.parent = carrier
        item.display_type = "WIRE"
        item.hide_render = True
        item.hide_select = True
        item.color = (1.0, 0.55, 0.1, 1.0) if kind == "transmit" else (0.2, 0.6, 1.0, 1.0)
        made.append(item)
    return made


def remove_patterns() -> int:
    """Remove the pattern objects and their meshes; return their number."""
    found = [item for item in bpy.data.objects if PATTERN_PROPERTY in item]
    for item in found:
        mesh = item.data
        bpy.data.objects.remove(item)
        if mesh is not None and mesh.users == 0:
            bpy.data.meshes.remove(mesh)
    return len(found)


def pattern_surface(antenna: Antenna) -> tuple[Real, NDArray[np.int64]]:
    """Return vertices (n, 3) and quadrilaterals (m, 4) of a pattern in the antenna's own axes.

    Radius 1 is the peak, 0 is `_DYNAMICS_DB` below. Rings around the peak are densest there.
    """
    axis = peak_direction(antenna)
    side = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, axis)
    # Cubic: steps of 0.3 degrees at 2 degrees from the peak, 6 degrees behind.
    theta = np.pi * (np.arange(_RINGS + 1) / _RINGS)[:, None, None] ** 3
    phi = (2 * np.pi * np.arange(_SPOKES) / _SPOKES)[None, :, None]
    direction = np.cos(theta) * axis + np.sin(theta) * (np.cos(phi) * side + np.sin(phi) * up)
    with np.errstate(divide="ignore"):
        gain_db = 10 * np.log10(antenna.gain(direction))
    radius = np.clip(1 + (gain_db - gain_db.max()) / _DYNAMICS_DB, 0.0, 1.0)
    vertices = (radius[..., None] * direction).reshape(-1, 3)
    ring, spoke = np.meshgrid(np.arange(_RINGS), np.arange(_SPOKES), indexing="ij")
    next_spoke = (spoke + 1) % _SPOKES
    faces = np.stack(
        [
            ring * _SPOKES + spoke,
            ring * _SPOKES + next_spoke,
            (ring + 1) * _SPOKES + next_spoke,
            (ring + 1) * _SPOKES + spoke,
        ],
        axis=-1,
    ).reshape(-1, 4)
    return vertices, faces
