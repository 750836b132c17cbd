# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of an animation over the burst: their times, and their poses and vertices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...array_types import Real
from ..plan import Instant, instant_at
from ..scene import Rig, check_pose, check_vertices, pose_in_metres
from ..state import Key, evaluated_objects
from .bodies import Bodies, Part
from .deforming import Deformations

#: Whole frames within a burst up to which each may be a keyframe.
_MAX_CORNERS = 64


@dataclass(frozen=True)
class SamplingPlan:
    """Times at which the animation is sampled: a burst from `frame` on.

    Attributes
    ----------
    frame, fps
        Blender frame at which the burst starts, and frames per second.
    duration_s
        Duration of the burst [s].
    metres_per_unit
        Metres per Blender unit.
    wavelength_m
        Wavelength, for the accuracy that motion needs [m].
    max_samples
        Maximum number of samples.
    rendered_fraction
        Fraction of the burst at which Cycles renders, 0 to 1.
    """

    frame: int
    fps: float
    duration_s: float
    metres_per_unit: float
    wavelength_m: float
    max_samples: int
    rendered_fraction: float = 0.0

    @property
    def rendered(self) -> tuple[float, Instant]:
        """The moment that is rendered, as `at` returns it."""
        return self.at(self.rendered_fraction)

    def at(self, fraction: float) -> tuple[float, Instant]:
        """Return the moment that Blender evaluates at a fraction of the burst.

        Its time since the start of the burst [s] has Blender's rounding.
        """
        instant = instant_at(self.frame + fraction * self.duration_s * self.fps, self.fps)
        # Blender adds frame and subframe in float32.
        evaluated = float(np.float32(instant.frame) + np.float32(instant.subframe))
        return (evaluated - self.frame) / self.fps, instant

    @property
    def corners(self) -> list[float]:
        """Fractions of the burst at whole frames, where keyframes may be."""
        frames = self.duration_s * self.fps
        if frames <= 1 or frames > _MAX_CORNERS:
            return []
        return [number / frames for number in range(1, int(np.ceil(frames)))]


class Sampler:
    """Poses of antennas and bodies, and vertices, at sample times.

    `poses` by time, (2 + parts, 4, 4) [m]: receiver, transmitter, parts; NaN for an instance that
    does not exist then, whose row is in `lost`. `vertices` by surface and time [m]; None where the
    mesh has another number of vertices, and the surface in `changed`.
    """

    def __init__(
        self,
        show: Callable[[Instant], Any],
        rig: Rig,
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
        # NaN marks an instance that does not exist, so it must not come from Blender.
        check_pose(name, matrix_world, frame)
        return pose_in_metres(matrix_world, self._units)

    def take(self, at_s: float, instant: Instant) -> None:
        """Take a sample, unless this time has one; `SceneError` if a coordinate is not finite."""
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
                row = self._instances.get((name, one.key)) if one.key else None
                if row is not None:
                    poses[row + 2] = self._pose(name, one.matrix_world, frame)
        self.lost.update(np.flatnonzero(np.isnan(poses[:, 0, 0])).tolist())
        self.poses[at_s] = poses
        for name, surface in self.surfaces.items():
            found = surface.sample(depsgraph)
            if found is None:
                self.changed.add(name)
            else:
                check_vertices(name, found, frame)
            self.vertices[name][at_s] = found
