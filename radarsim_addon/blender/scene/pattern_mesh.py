# SPDX-License-Identifier: GPL-3.0-or-later
"""Antenna patterns as wire surfaces in the scene, visible in the viewport only."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...array_types import Real
from ...physics.antennas import Antenna
from ...signal.radar import RadarSystem, peak_direction
from .rig import Rig

#: Marks the pattern objects; its value is "transmit" or "receive".
PATTERN_PROPERTY = "radarsim_pattern"
NAMES = {"transmit": "Radar Transmit Pattern", "receive": "Radar Receive Pattern"}
#: A gain this far below the peak is at the centre [dB].
_DYNAMICS_DB = 40.0
_RINGS, _SPOKES = 96, 72


def pattern_surface(
    antenna: Antenna, dynamics_db: float = _DYNAMICS_DB
) -> tuple[Real, NDArray[np.int64]]:
    """Return vertices, (n, 3), and quadrilaterals, (m, 4), of a pattern in the antenna's own axes.

    Radius 1 is the peak, 0 is `dynamics_db` below. Rings around the peak are densest there.
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
    radius = np.clip(1 + (gain_db - gain_db.max()) / dynamics_db, 0.0, 1.0)
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


def remove_patterns() -> int:
    """Remove the pattern objects and their meshes.

    Returns
    -------
    int
        Number of objects removed.
    """
    found = [item for item in bpy.data.objects if PATTERN_PROPERTY in item]
    for item in found:
        mesh = item.data
        bpy.data.objects.remove(item)
        if mesh is not None and mesh.users == 0:
            bpy.data.meshes.remove(mesh)
    return len(found)


def draw_patterns(
    scene: Any,
    rig: Rig,
    system: RadarSystem,
    size: float,
    which: Iterable[str] = ("transmit", "receive"),
) -> list[Any]:
    """Draw antenna patterns on their antennas, and remove earlier ones.

    Parameters
    ----------
    scene : bpy.types.Scene
    rig
        Receiver and transmitter, the parents of the patterns.
    system
        Antennas.
    size
        Length of the peak, Blender units.
    which
        "transmit", "receive" or both.

    Returns
    -------
    list of bpy.types.Object
        Wire surfaces that are hidden from renders and not selectable.
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
