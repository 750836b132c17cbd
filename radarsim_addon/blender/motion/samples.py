# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of an animation over the burst: when they are taken, and taking them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...array_types import Real
from ..plan import Instant, instant_at
from ..scene import check_pose, check_vertices, pose_in_metres
from ..state import Key, evaluated_objects
from .bodies import Bodies, Part
from .deforming import Deformations

#: Whole frames within a burst up to which keyframes are taken to be there.
_MOST_CORNERS = 64


@dataclass(frozen=True)
class SamplingPlan:
    """What is sampled: `span_s` from `frame` on, for this wavelength, at most so many times."""

    frame: int
    fps: float
    span_s: float
    metres_per_unit: float
    wavelength_m: float
    most_samples: int
    reference: float = 0.0

    @property
    def shown(self) -> tuple[float, Instant]:
        """The moment that is rendered, a share `reference` of the span from t on."""
        return self.at(self.reference)

    def at(self, share: float) -> tuple[float, Instant]:
        """The moment that Blender shows at a share of the span, and its time from t on."""
        instant = instant_at(self.frame + share * self.span_s * self.fps, self.fps)
        # Blender adds frame and subframe in float32
        shown = float(np.float32(instant.frame) + np.float32(instant.subframe))
        return (shown - self.frame) / self.fps, instant

    @property
    def corners(self) -> list[float]:
        """Shares of the span at whole frames, where keyframes are."""
        frames = self.span_s * self.fps
        if frames <= 1 or frames > _MOST_CORNERS:
            return []
        return [number / frames for number in range(1, int(np.ceil(frames)))]


class Sampler:
    """Poses of antennas and touched bodies, and vertices, at sample times."""

    def __init__(
        self,
        show: Callable[[Instant], Any],
        rig: Any,
        parts: list[Part],
        bodies: Bodies,
        deformations: Deformations,
        metres_per_unit: float,
    ) -> None:
        self._show, self._units = show, metres_per_unit
        self._antennas = (rig.camera, rig.emitter)
        self.parts = parts
        self._originals = bodies.originals
        self._instances: dict[tuple[str, Key], int] = {
            (part.name, part.key): index for index, part in enumerate(self.parts) if part.key
        }
        used = {part.name for part in self.parts}
        self.surfaces = {
            name: surface
            for name, surface in deformations.surfaces.items()
            if name in used and surface.needed
        }
        self.poses: dict[float, Real] = {}
        self.vertices: dict[str, dict[float, Any]] = {name: {} for name in self.surfaces}
        self.lost: set[int] = set()
        self.changed: set[str] = set()

    def _pose(self, name: str, matrix_world: Any, frame: float) -> Real:
        # NaN is what stands for an instance that is not there, so it must not come from Blender.
        check_pose(name, matrix_world, frame)
        return pose_in_metres(matrix_world, self._units)

    def take(self, at_s: float, instant: Instant) -> None:
        """Take a sample unless there is one.

        Raises
        ------
        SceneError
            A place or a vertex is no usable number at that moment.
        """
        if at_s in self.poses:
            return
        depsgraph = self._show(instant)
        frame = instant.frame + instant.subframe
        poses = np.full((len(self.parts) + 2, 4, 4), np.nan)
        for number, item in enumerate(self._antennas):
            matrix = item.evaluated_get(depsgraph).matrix_world
            poses[number] = self._pose(item.name, matrix, frame)
        for index, part in enumerate(self.parts):
            if not part.key:
                item = self._originals[part.number].evaluated_get(depsgraph)
                poses[index + 2] = self._pose(part.name, item.matrix_world, frame)
        if self._instances:
            for one in evaluated_objects(depsgraph):
                name = one.original.name
                place = self._instances.get((name, one.key)) if one.key else None
                if place is not None:
                    poses[place + 2] = self._pose(name, one.matrix_world, frame)
        self.lost.update(np.flatnonzero(np.isnan(poses[:, 0, 0])).tolist())
        self.poses[at_s] = poses
        for name, surface in self.surfaces.items():
            found = surface.sample(depsgraph)
            if found is None:
                self.changed.add(name)
            else:
                check_vertices(name, found, frame)
            self.vertices[name][at_s] = found
