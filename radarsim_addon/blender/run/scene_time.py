# SPDX-License-Identifier: GPL-3.0-or-later
"""Brings a scene to a moment, as it renders there: hidden objects, simulations, instances."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ..plan import Instant
from ..scene import (
    hiding_is_animated,
    show_as_rendered,
    show_what_renders,
    simulation_frames,
)
from ..state import SettingsRestorer, evaluated_depsgraph


class SceneTime:
    """The moment that a scene shows.

    Parameters
    ----------
    scene : bpy.types.Scene
    view_layer : bpy.types.ViewLayer
    restorer
        Takes back what is shown for the run.
    last_needed
        Last Blender frame that the run needs, if it needs a given one.
    """

    def __init__(
        self,
        scene: Any,
        view_layer: Any,
        restorer: SettingsRestorer,
        last_needed: Callable[[int], float],
    ) -> None:
        self._scene, self._view_layer = scene, view_layer
        self._restorer, self._last_needed = restorer, last_needed
        self._simulated_to = -math.inf
        self._shown: Instant | None = None
        self._hiding_moves = True

    def show(self, instant: Instant) -> Any:
        """Bring the scene to a moment; returns the depsgraph at it."""
        # Before the time is set: what appears later would keep the place of another time.
        if self._shown is None:
            show_as_rendered(self._restorer, self._scene)
            self._hiding_moves = hiding_is_animated()
        if self._shown is None or (self._hiding_moves and self._shown.frame != instant.frame):
            show_what_renders(self._restorer, self._view_layer)
        if instant.frame + 1 > self._simulated_to:
            # All at once: a cache that is played further later on is no longer exact, and loses
            # frames when a time between two of them is read.
            self._simulated_to = math.ceil(self._last_needed(instant.frame))
            for frame in simulation_frames(self._scene, int(self._simulated_to)):
                self._scene.frame_set(frame)
        self._scene.frame_set(instant.frame, subframe=instant.subframe)
        self._shown = instant
        return evaluated_depsgraph(self._view_layer)

    def shows(self, instant: Instant) -> bool:
        """Whether the scene is at a moment; the user may have scrubbed the timeline since."""
        now = self._scene.frame_current + self._scene.frame_subframe
        return self._shown == instant and bool(now == instant.evaluated_frame)

    def forget(self) -> None:
        """Take what is shown as unknown: it was taken back."""
        self._shown = None

    def simulate_again(self) -> None:
        """Play simulations before the next moment that is shown."""
        self._simulated_to = -math.inf
