# SPDX-License-Identifier: GPL-3.0-or-later
"""A look at all frames of a run before the first render: extent and closing speeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ...signal.radar import Burst
from ..plan import Extent, Instant, instant_at
from ..scene import VELOCITY_FRAMES, ClosingSpeeds, Rig
from ..scene import ground_truth as ground_truth


class Survey:
    """What is known of the frames looked at so far.

    Parameters
    ----------
    show
        Brings the scene to a moment and returns the depsgraph at it.
    rig
        Both antennas.
    metres_per_unit
        Length of a Blender unit [m].
    fps
        Frames per second.
    burst
        Pulses of a frame.
    """

    def __init__(
        self,
        show: Callable[[Instant], Any],
        rig: Rig,
        metres_per_unit: float,
        fps: float,
        burst: Burst,
    ) -> None:
        self._show, self._rig, self._units, self._fps = show, rig, metres_per_unit, fps
        self._seen: tuple[Any, ...] = ()
        self.extent = Extent()
        self.speeds = ClosingSpeeds(metres_per_unit, burst.pulses / burst.prf_hz)

    def look_at(
        self, moments: Sequence[Instant], any_material: bool, check: Callable[[Any], None]
    ) -> None:
        """Look at the moments of a radar frame; `check` is called with each depsgraph."""
        looks = []
        for instant in moments:
            depsgraph = self._show(instant)
            check(depsgraph)
            boxes, antennas = look = self._look(depsgraph, any_material)
            looks.append(look)
            # Where Blender has evaluated nothing since, all is as before.
            now = boxes.snapshot, *(place.tobytes() for place in antennas)
            if now != self._seen:
                found = ground_truth.extent_of_boxes(boxes, antennas, self._units)
                self.extent = self.extent.union(found)
            self._seen = now
        first = moments[0]
        soon = instant_at(first.evaluated_frame + VELOCITY_FRAMES, self._fps)
        later = self._look(self._show(soon), any_material)
        self.speeds.add(looks[0], later, soon.time_s - first.time_s)

    def _look(self, depsgraph: Any, any_material: bool) -> tuple[Any, Any]:
        """Boxes of what echoes, and places of the antennas."""
        boxes = ground_truth.echoing_boxes(depsgraph, any_material)
        return boxes, ground_truth.antenna_positions(depsgraph, self._rig)
