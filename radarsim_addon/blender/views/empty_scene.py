# SPDX-License-Identifier: GPL-3.0-or-later
"""An empty scene from which another one is rendered.

An operator that Python calls first evaluates the scene of the context, all objects of it: 10 ms for
1000 objects, before each render. The render evaluates objects of its own, and reads none of these.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import bpy

from ..scene import reads_context
from ..state import SettingsRestorer

#: Objects of the file from which on it is worth another scene.
_MANY = 500
_NAME = "radarsim empty (temporary)"


class EmptyScene:
    """A scene without objects, which is made where it is first worth it.

    Parameters
    ----------
    recorder
        Removes it.
    """

    def __init__(self, recorder: SettingsRestorer) -> None:
        self._recorder = recorder
        self._scene: Any = None
        self._useful: bool | None = None

    @contextlib.contextmanager
    def entered(self, rendered: Any) -> Iterator[None]:
        """Call the operator that renders a scene, which it is told, from the empty one.

        From the user's, where there are few objects, or scripts may read which scene is active.
        """
        if self._useful is None:
            self._useful = len(bpy.data.objects) >= _MANY and not reads_context()
        if not self._useful:
            yield
            return
        if self._scene is None:
            scene = self._scene = bpy.data.scenes.new(_NAME)
            self._recorder.on_restore(_NAME, lambda: bpy.data.scenes.remove(scene))
        # the operator takes the whole number of the frame from the context, nothing else
        self._scene.frame_current = rendered.frame_current
        layer = self._scene.view_layers[0]
        with bpy.context.temp_override(scene=self._scene, view_layer=layer):
            yield
