# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps in the places of the transmitter's images, of which one at a time shines.

An image lamp has the transmitter's own light data. Nothing blocks it: what lies between a surface
and the place behind a mirror is no obstacle, and what is one is found in numpy. Light linking does
this with a blocker collection that holds one empty mesh; an empty collection would block
everything. Both range encodings stay right, because the ray goes straight to the image.
"""

from __future__ import annotations

from typing import Any

import bpy
from mathutils import Matrix

from ...array_types import Real
from ..state import SettingsRestorer
from .view_setup import LIGHT_GROUP

_LAMP = "radarsim image (temporary)"
_NOTHING = "radarsim no obstacle (temporary)"


class ImageLamps:
    """The transmitter of a scene, and lamps in the places of its images."""

    def __init__(self, recorder: SettingsRestorer, scene: Any, emitter: Any) -> None:
        self._recorder, self._scene, self._emitter = recorder, scene, emitter
        self._lamps: list[Any] = []
        self._blocker: Any = None
        self._shining = 0

    def place(self, places: Real) -> None:
        """Put a lamp at each place, (n, 3) [Blender units]; the transmitter shines."""
        while len(self._lamps) < len(places):
            self._add()
        for lamp, place in zip(self._lamps, places, strict=False):
            lamp.matrix_world = Matrix.Translation(place)
        self.shine(0)

    def shine(self, number: int) -> None:
        """Let the transmitter shine, 0, or an image, from 1; all others are off."""
        if number == self._shining:
            return
        self._shining = number
        self._emitter.hide_render = number != 0
        for index, lamp in enumerate(self._lamps, start=1):
            lamp.hide_render = index != number

    def _add(self) -> None:
        if self._blocker is None:
            self._make_blocker()
            # Changed from render to render: the recorder leaves equal values alone.
            emitter = self._emitter
            self._recorder.on_restore(
                "transmitter: hidden", lambda: setattr(emitter, "hide_render", False)
            )
        lamp = bpy.data.objects.new(_LAMP, self._emitter.data)
        self._recorder.on_restore(_LAMP, lambda: bpy.data.objects.remove(lamp))
        lamp.hide_render = True
        lamp.lightgroup = LIGHT_GROUP
        lamp.light_linking.blocker_collection = self._blocker
        self._scene.collection.objects.link(lamp)
        self._lamps.append(lamp)

    def _make_blocker(self) -> None:
        mesh = bpy.data.meshes.new(_NOTHING)
        self._recorder.on_restore(_NOTHING, lambda: bpy.data.meshes.remove(mesh))
        dummy = bpy.data.objects.new(_NOTHING, mesh)
        self._recorder.on_restore(_NOTHING, lambda: bpy.data.objects.remove(dummy))
        blocker = bpy.data.collections.new(_NOTHING)
        self._recorder.on_restore(_NOTHING, lambda: bpy.data.collections.remove(blocker))
        blocker.objects.link(dummy)
        self._blocker = blocker
