# SPDX-License-Identifier: GPL-3.0-or-later
"""Several looks at a scene in one render: Blender's views of several cameras ("multi-view").

Of few pixels, a render takes longer to begin than to trace: Cycles compiles all shaders again that
read the scene's attributes whenever the camera has changed. With the four replicates of 64 x 64
pixels in one render it does so once, and they take about half of the processor time.

All views have one seed. So this is for rays that need no chance: one reflection off surfaces that
let nothing through.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import bpy

from ..state import SettingsRestorer
from .requests import RenderRequest, View
from .window import ViewWindow

#: A part of the field of view, and by what fraction of a pixel a look at it is moved.
Look = tuple[ViewWindow, tuple[float, float]]

#: Most looks that share a render: Blender keeps the passes of all.
MOST_TOGETHER = 16
_NAME = "radarsim view (temporary)"
_VIEW = "radarsim"


class JointRender:
    """Cameras of a scene whose views come out of one render, `count` of them.

    Parameters
    ----------
    recorder
        Takes all back.
    scene : bpy.types.Scene
    camera : bpy.types.Object
        The one whose kind and place the others have.
    count
        Number of views.
    """

    def __init__(self, recorder: SettingsRestorer, scene: Any, camera: Any, count: int) -> None:
        self._scene, self._camera = scene, camera
        self.cameras: list[Any] = []
        #: Looks of the next joint render, and what came out of the last one, by look.
        self.looks: list[Look] = []
        #: Whether the last render was a joint one.
        self.rendered = False
        self._ready: dict[Look, View] = {}
        self._request: RenderRequest | None = None
        render = scene.render
        recorder.set(render, "views_format", "MULTIVIEW")
        active = render.views.active_index
        recorder.on_restore("active view", lambda: setattr(render.views, "active_index", active))
        for view in render.views:
            recorder.set(view, "use", False)
        for number in range(count):
            self._add(recorder, number)

    def _add(self, recorder: SettingsRestorer, number: int) -> None:
        suffix, views = self._suffix(number), self._scene.render.views
        data = self._camera.data.copy()
        data.name = _NAME + suffix
        recorder.on_restore(data.name, lambda: bpy.data.cameras.remove(data))
        item = bpy.data.objects.new(_NAME + suffix, data)
        recorder.on_restore(item.name, lambda: bpy.data.objects.remove(item))
        self._scene.collection.objects.link(item)
        view = views.new(_VIEW + suffix)
        recorder.on_restore(view.name, lambda: views.remove(view))
        view.camera_suffix = view.file_suffix = suffix
        self.cameras.append(item)

    @property
    def names(self) -> list[str]:
        """Names of the passes' views, in the order of the cameras."""
        return [_VIEW + self._suffix(number) for number in range(len(self.cameras))]

    @staticmethod
    def _suffix(number: int) -> str:
        return f"_{number:05d}"

    def plan(self, looks: Sequence[Look]) -> None:
        """Say which looks come next, at the scene as it is now; drop the views of others."""
        # Blender finds the cameras by their names, which nothing else may have.
        names = (camera.name for camera in self.cameras)
        found = all(name == _NAME + self._suffix(n) for n, name in enumerate(names))
        self.looks = list(looks) if found else []
        self._ready, self.rendered = {}, False

    def begins_at(self, look: Look | None) -> bool:
        """Whether a joint render may stand for this look, the first of those planned."""
        return bool(self.looks) and look == self.looks[0] and not self._ready

    def has(self, look: Look | None, request: RenderRequest) -> bool:
        """Whether the view of a look is there."""
        return look in self._ready and request == self._request

    def keep(self, views: Sequence[View], request: RenderRequest) -> None:
        """Keep the views of all looks that were planned."""
        self._ready, self._request = dict(zip(self.looks, views, strict=True)), request
        self.looks, self.rendered = [], False

    def take(self, look: Look | None) -> View:
        """Return the view of a look, and drop it."""
        assert look is not None
        return self._ready.pop(look)

    @contextmanager
    def entered(self) -> Iterator[None]:
        """Have the scene render all views meanwhile, from the camera's present place."""
        own, render = self._camera, self._scene.render
        for item in self.cameras:
            for name in ("location", "rotation_mode", "rotation_euler", "scale"):
                if getattr(item, name) != getattr(own, name):
                    setattr(item, name, getattr(own, name))
        image = render.image_settings
        views_format = image.views_format
        render.use_multiview, self._scene.camera = True, self.cameras[0]
        image.views_format = "MULTIVIEW"
        try:
            yield
            self.rendered = True
        finally:
            image.views_format = views_format
            render.use_multiview, self._scene.camera = False, own
