# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera of our own that can look at any part of the field of view."""

from __future__ import annotations

from functools import partial
from typing import Any

import bpy
import numpy as np

from ..scene import NEAR_CLIP_UNITS
from ..state import SettingsRestorer
from .view_setup import numbered_objects

_NAME, _SECOND = "radarsim view (temporary)", "radarsim second view (temporary)"


class ViewCamera:
    """A camera that a scene renders with from now on, until `restore`.

    Parameters
    ----------
    scene : bpy.types.Scene

    Attributes
    ----------
    item : bpy.types.Object
        The camera, at the world's origin.
    second : bpy.types.Object
        One more, for `SecondView`: Blender sorts all objects when one is added later.
    """

    def __init__(self, scene: Any) -> None:
        self._recorder = SettingsRestorer()
        self.item, self.second = self._add(_NAME), self._add(_SECOND)
        try:
            for item in (self.item, self.second):
                scene.collection.objects.link(item)
            self._recorder.set(scene, "camera", self.item)
        except BaseException:
            self.restore()
            raise

    def _add(self, name: str) -> Any:
        data = bpy.data.cameras.new(name)
        self._recorder.on_restore(name, lambda: bpy.data.cameras.remove(data))
        data.clip_start, data.clip_end = NEAR_CLIP_UNITS, 1e12
        item = bpy.data.objects.new(name, data)
        self._recorder.on_restore(name, lambda: bpy.data.objects.remove(item))
        return item

    @property
    def names(self) -> frozenset[str]:
        """Names of the cameras and of their data."""
        return frozenset(n for one in (self.item, self.second) for n in (one.name, one.data.name))

    def number_objects(self) -> None:
        """Number the surfaces of a file that Blender has not evaluated yet.

        Later, `PathScene` would have Blender evaluate each of them again.
        """
        objects = bpy.data.objects
        before = np.zeros(len(objects), dtype=np.int32)
        objects.foreach_get("pass_index", before)
        numbers = {item: number for number, item in enumerate(numbered_objects(), 1)}
        after = [numbers.get(item, old) for item, old in zip(objects, before.tolist(), strict=True)]
        for item, old in zip(objects, before.tolist(), strict=True):
            self._recorder.on_restore("pass_index", partial(setattr, item, "pass_index", old))
        objects.foreach_set("pass_index", after)

    def restore(self) -> list[str]:
        """Give the scene its own camera back; what failed. May be called again."""
        return self._recorder.restore()
