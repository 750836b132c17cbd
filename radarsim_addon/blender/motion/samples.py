# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of an animation over the burst: their times, and their poses and vertices.

Within 1e-4 frames of a keyframe, Blender's F-curves give the value of the key itself. A sample
there has the pose of another moment, so none is taken (`SamplingPlan.clear_at`). Blender's time is
float32: each sample has the time that Blender evaluated. Where bodies jump between two samples
(`Sampler.jumps`), the jump gets a key of its own.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...arrays import Indices, Real
from ..plan import Instant, instant_at
from ..scene import Rig, check_poses, check_vertices
from ..state import Layout, Shape, Snapshot
from .bodies import Parts
from .deforming import Deformations

#: Frames from a key within which no sample is taken. Within 1e-4 frames, Blender gives the key's
#: value. float32 times have steps of 1.5e-5 frames at frame 250.
_CLEAR_OF_KEYS = 2.2e-4
#: Samples reach over at least this many frames: velocities of short bursts would be rounding.
_LEAST_FRAMES = 2.0
#: Whole frames within a burst up to which each may be a corner.
_MAX_CORNERS = 64
#: Minimum number of samples between two keys.
_LEAST_BETWEEN_KEYS = 9
#: A jump moves a body this many times faster between two samples than before and after them.
_MIN_JUMP = 4.0
#: Halvings of an interval after which a jump has more than half of its first size; motion has not.
_HALVINGS = 3
#: Steps of float32 up to which a step between two samples is its rounding.
_ROUNDED = 16
#: Maximum number of intervals in which jumps are located.
_MOST_JUMPS = 8


@dataclass(frozen=True)
class SamplingPlan:
    """Times at which the animation is sampled: a burst from `frame` on."""

    #: Blender frame at which the burst starts, and frames per second.
    frame: int
    fps: float
    #: Duration of the burst [s].
    duration_s: float
    #: Metres per Blender unit.
    metres_per_unit: float
    #: Wavelength, for the accuracy that motion needs [m].
    wavelength_m: float
    #: Maximum number of samples.
    max_samples: int
    #: Fraction of the burst at which Cycles renders, 0 to 1.
    rendered_fraction: float = 0.0
    #: Frames at which animation may have corners, ascending.
    keys: Sequence[float] = ()
    #: Frames of the scene for each frame of the animation.
    stretch: float = 1.0
    #: Keys at which bodies jump: what Blender gives on them belongs to neither side.
    jumps: Sequence[float] = ()

    @property
    def frames(self) -> float:
        """Duration of the burst in Blender frames."""
        return self.duration_s * self.fps

    @property
    def burst(self) -> tuple[float, float]:
        """First and last Blender frame of the burst."""
        return float(self.frame), self.frame + self.frames

    @functools.cached_property
    def rendered(self) -> tuple[float, Instant]:
        """Time and instant of the render, as `at` returns them."""
        return self.at(self.rendered_fraction)

    def at(self, fraction: float) -> tuple[float, Instant]:
        """Return the time and the instant that Blender evaluates at a fraction of the burst.

        The time since the start of the burst [s] contains Blender's rounding.
        """
        return self._at_frame(self.frame + fraction * self.frames)

    def _at_frame(self, frame: float) -> tuple[float, Instant]:
        instant = instant_at(frame, self.fps)
        return (instant.evaluated_frame - self.frame) / self.fps, instant

    def is_clear(self, at_s: float) -> bool:
        """Return whether no key is so near that it changes the pose at this time. A key exactly at
        this time is allowed.
        """
        frame = self.frame + at_s * self.fps
        key = self._nearest_key(frame)
        if abs(key - frame) > 0.9 * self._clear_of_keys:
            return True
        return key not in self.jumps and abs(key - frame) <= 2 * np.spacing(np.float32(frame))

    def with_jumps(self, frames: Sequence[float]) -> SamplingPlan:
        """Return the plan with keys at the frames at which bodies jump.

        A jump next to a key moves to that key.
        """
        near = [self._nearest_key(frame) for frame in frames]
        jumps = [
            key if abs(key - frame) <= self._clear_of_keys else frame
            for key, frame in zip(near, frames, strict=True)
        ]
        return replace(self, keys=sorted({*self.keys, *jumps}), jumps=jumps)

    @property
    def _clear_of_keys(self) -> float:
        return _CLEAR_OF_KEYS * max(self.stretch, 1.0)

    def _nearest_key(self, frame: float) -> float:
        if not len(self.keys):
            return np.inf
        after = int(np.searchsorted(self.keys, frame))
        return float(
            min(self.keys[max(after - 1, 0) : after + 1], key=lambda key: abs(key - frame))
        )

    def clear_at(self, frame: float) -> tuple[float, Instant]:
        """Return the moment at a frame. If a key is too near, return a moment next to this key."""
        found = self._at_frame(frame)
        if self.is_clear(found[0]):
            return found
        key = self._nearest_key(self.frame + found[0] * self.fps)
        return self._at_frame(key + np.copysign(self._clear_of_keys, frame - key))

    @functools.cached_property
    def window(self) -> tuple[float, float]:
        """First and last frame of the samples.

        They contain the burst, and parts before and after it up to the next keys, so that each
        piece of the motion is long enough for a good velocity.
        """
        first, last = self.burst
        inside = [key for key in self.keys if first < key < last]
        lowest = max((key for key in self.keys if key <= first), default=-np.inf)
        highest = min((key for key in self.keys if key >= last), default=np.inf)
        if inside:
            low, high = min(first, inside[0] - _LEAST_FRAMES), max(last, inside[-1] + _LEAST_FRAMES)
            return max(low, lowest), min(high, highest)
        more = max(_LEAST_FRAMES - self.frames, 0.0)
        low = max(first - more / 2, lowest)
        high = min(max(last, low + _LEAST_FRAMES), highest)
        return max(min(low, high - _LEAST_FRAMES), lowest), high

    def grid(self, count: int, low: float, high: float) -> list[tuple[float, Instant]]:
        """Return about `count` moments between two frames, evenly spaced in each piece between
        keys.
        """
        inside = [key for key in self.keys if low < key < high]
        edges = [low, *inside, high]
        moments: list[tuple[float, Instant]] = []
        pieces = list(itertools.pairwise(edges))
        per_frame = count * min(len(pieces), 2) / (high - low)
        for start, stop in pieces:
            own = max(round(per_frame * (stop - start)), min(_LEAST_BETWEEN_KEYS, count))
            moments += [self.clear_at(frame) for frame in np.linspace(start, stop, own).tolist()]
        corners = (self.frame + at_s * self.fps for at_s in self.corners_s)
        moments += [self.clear_at(frame) for frame in corners if low < frame < high]
        return moments

    def whole_frames(self, start: float = 0.0, step: float = 1.0) -> list[tuple[float, Instant]]:
        """Return the whole frames of the burst, and one more on each side, for a cubic through
        them.

        For a cache, `start` is the scene frame of its frame 0, and `step` the number of scene
        frames per cache frame.
        """
        first, last = (round((frame - start) / step, 6) for frame in self.burst)
        numbers = range(int(np.floor(first)) - 1, int(np.ceil(last)) + 2)
        return [self._at_frame(start + number * step) for number in numbers]

    def between(
        self, one: tuple[float, Instant], other: tuple[float, Instant]
    ) -> tuple[float, Instant]:
        """Return the moment in the middle between two others."""
        return self.moment((one[0] + other[0]) / 2)

    def moment(self, at_s: float) -> tuple[float, Instant]:
        """Return the moment that Blender evaluates at a time since the start of the burst."""
        return self._at_frame(self.frame + at_s * self.fps)

    @property
    def corners_s(self) -> list[float]:
        """Times at which the motion may have corners: keys and whole frames [s]."""
        low, high = self.window
        frames = {key for key in self.keys if low < key < high}
        if high - low <= _MAX_CORNERS:
            frames.update(range(int(np.floor(low)) + 1, int(np.ceil(high))))
        return [(frame - self.frame) / self.fps for frame in sorted(frames)]


class Sampler:
    """Poses of antennas and bodies, and vertices, at sample times.

    Poses have 2 + parts rows: receiver, transmitter, parts; NaN for an instance that does not exist
    then, whose row is in `lost`. Few of many instances move: but for the first sample, only the
    rows that differ from it are kept. `vertices` by surface and time [m]; None where the mesh has
    another number of vertices, and the surface in `changed`.
    """

    def __init__(
        self,
        show: Callable[[Instant], Any],
        rig: Rig,
        parts: Parts,
        deformations: Deformations,
        plan: SamplingPlan,
    ) -> None:
        self._show, self._units = show, plan.metres_per_unit
        self._antennas = (rig.camera, rig.emitter)
        bodies = parts.bodies
        self.parts = parts
        self._originals = bodies.originals
        self._layout = bodies.snapshot.layout
        self._rows = bodies.row[parts.index]
        used = {bodies.name(number) for number in np.unique(parts.number).tolist()}
        self.surfaces = {
            name: surface
            for name, surface in deformations.surfaces.items()
            if name in used and surface.needed
        }
        self.plan = plan
        #: Snapshot and poses (n, 4, 4) [m] of the first sample; the rows that differ, by time.
        self._first: tuple[Snapshot, Real] | None = None
        self._others: dict[float, tuple[Indices, Real]] = {}
        self.vertices: dict[str, dict[float, Any]] = {name: {} for name in self.surfaces}
        self.lost: set[int] = set()
        self.changed: set[str] = set()

    def take(self, at_s: float, instant: Instant) -> None:
        """Take a sample, unless there is one of this time. `SceneError` if a coordinate is not
        finite.
        """
        if at_s in self._others:
            return
        snapshot = self._show(instant)
        frame = instant.frame + instant.subframe
        snapshot, rows, poses = self._matrices(snapshot, frame)
        poses[:, :3, 3] *= self._units
        if self._first is None:
            self._first = snapshot, poses
        differs = (poses != self._first[1][rows]).any(axis=(1, 2))
        self._others[at_s] = rows[differs], poses[differs]
        inside = 0 <= at_s <= self.plan.duration_s
        if inside:
            self.lost.update(rows[np.isnan(poses[:, 0, 0])].tolist())
        for name, surface in self.surfaces.items():
            vertices = surface.sample(snapshot)
            if vertices is None:
                if inside:
                    self.changed.add(name)
            else:
                check_vertices(name, vertices, frame)
            self.vertices[name][at_s] = vertices

    def _matrices(self, snapshot: Snapshot, frame: float) -> tuple[Snapshot, Indices, Real]:
        """Return the snapshot, the rows that may differ from the first sample, and their world
        matrices.

        The rows are those of antennas and bodies. A matrix is NaN if the instance does not exist.
        """
        in_layout = self._rows_in(snapshot.layout, snapshot.shapes)
        chosen = self._may_differ(snapshot)
        rows = in_layout[chosen[2:] - 2]
        there = rows >= 0
        matrices = np.full((chosen.size, 4, 4), np.nan)
        matrices[2:][there] = snapshot.matrices_of(rows[there])
        for at in np.flatnonzero(~there).tolist():
            part = self.parts[int(chosen[2 + at]) - 2]
            if not part.key:  # hidden
                item = self._originals[part.number]
                matrices[2 + at] = snapshot.evaluated(item).matrix_world
                there[at] = True
        for at, item in enumerate(self._antennas):
            matrices[at] = snapshot.evaluated(item).matrix_world
        # NaN marks an instance that does not exist, so it must not come from Blender.
        found = np.concatenate([[0, 1], 2 + np.flatnonzero(there)])
        check_poses(lambda at: self._name(int(chosen[found[at]])), matrices[found], frame)
        return snapshot, chosen, matrices

    def _may_differ(self, snapshot: Snapshot) -> Indices:
        """Return the rows whose pose may differ from the first sample, in rising order."""
        if self._first is None or self._first[0].walked is not snapshot.walked:
            return np.arange(len(self.parts) + 2)
        # Of all others, both snapshots have the pose of one walk.
        again = np.union1d(self._first[0].moved, snapshot.moved)
        parts = np.flatnonzero(np.isin(self._rows, again) | (self._rows < 0))
        return np.concatenate([[0, 1], 2 + parts])

    def _rows_in(self, layout: Layout, shapes: Sequence[Shape]) -> Indices:
        """Return the row of each body in a snapshot; -1 for bodies that it does not have."""
        if layout is not self._layout:
            wanted = {part.name for part in self.parts if part.key}
            mine = [shape.original.name_full in wanted for shape in shapes]
            there = np.flatnonzero(np.array(mine)[layout.shape] & (layout.instancer >= 0))
            names = (shapes[index].original.name_full for index in layout.shape[there])
            row_of = dict(
                zip(zip(names, layout.keys(there), strict=True), there.tolist(), strict=True)
            )
            itself = layout.row_of
            rows = [
                row_of.get((part.name, part.key), -1)
                if part.key
                else itself.get(self._originals[part.number], -1)
                for part in self.parts
            ]
            self._layout, self._rows = layout, np.array(rows, dtype=np.intp)
        return self._rows

    def _name(self, row: int) -> str:
        return self._antennas[row].name if row < 2 else self.parts[row - 2].name

    @property
    def times_s(self) -> list[float]:
        """Times of all samples [s]."""
        return list(self._others)

    @property
    def changing(self) -> Indices:
        """Rows whose pose changes between samples, in rising order."""
        return np.unique(np.concatenate([rows for rows, _ in self._others.values()]))

    def poses(self, at_s: float, rows: Indices | None = None) -> Real:
        """Return the poses of some rows, or of all, at the time of a sample, (n, 4, 4) [m]."""
        assert self._first is not None
        other, values = self._others[at_s]
        rows = np.arange(len(self._first[1])) if rows is None else rows
        found = self._first[1][rows]
        if other.size:
            at = np.minimum(np.searchsorted(other, rows), other.size - 1)
            own = other[at] == rows
            found[own] = values[at[own]]
        return found

    def pose(self, at_s: float, row: int) -> Real:
        """Return the pose of one row at the time of a sample, (4, 4) [m]."""
        found: Real = self.poses(at_s, np.array([row]))[0]
        return found

    def jumps(self, times_s: Sequence[float]) -> dict[float, dict[str, float]]:
        """Find jumps of bodies between samples. For each Blender frame: the size of the jump [m] by
        name.

        If an interval is halved again and again, a jump keeps its size in the half that contains
        it; a motion does not.
        """
        rows = self.changing
        names = [*map(self._name, rows.tolist()), *self.surfaces]
        if len(times_s) < 3 or not names:
            return {}
        steps_m = np.stack([self._steps_m(rows, *pair) for pair in itertools.pairwise(times_s)])
        speed = steps_m / np.diff(times_s)[:, None]
        before = np.concatenate([speed[1:2], speed[:-1]])
        after = np.concatenate([speed[1:], speed[-2:-1]])
        sudden_m = np.where(speed > _MIN_JUMP * np.maximum(before, after), steps_m, 0.0)
        found: dict[float, dict[str, float]] = {}
        for at in np.argsort(-sudden_m.max(axis=1))[:_MOST_JUMPS].tolist():
            jumping = np.flatnonzero(sudden_m[at])
            if not jumping.size:
                break
            around = self._around_jump(rows, int(sudden_m[at].argmax()), *times_s[at : at + 2])
            if around is None:
                continue
            size_m = self._steps_m(rows, *around)
            least_m = np.maximum(steps_m[at] / 2, self._least_jumps_m(rows, times_s[at]))
            jumping = jumping[size_m[jumping] > least_m[jumping]]
            if jumping.size:
                frame = self.plan.frame + sum(around) / 2 * self.plan.fps
                found[frame] = {names[one]: float(size_m[one]) for one in jumping}
        return found

    def _least_jumps_m(self, rows: Indices, at_s: float) -> Real:
        """Return the size up to which a step may be rounding of float32, in the form of `_steps_m`
        [m].
        """
        places = [np.abs(self.poses(at_s, rows)[:, :3, 3]).max(axis=1), self._reaches_m(rows)]
        surfaces = [sampled[at_s] for sampled in self.vertices.values()]
        sizes = [0.0 if one is None else np.abs(one).max(initial=0.0) for one in surfaces]
        largest = np.concatenate([np.nan_to_num(np.maximum(*places)), sizes])
        return np.asarray(_ROUNDED * np.spacing(np.maximum(largest, 1e-6).astype(np.float32)))

    def _reaches_m(self, rows: Indices) -> Real:
        """Return the largest distance of the surface of each body from its origin [m]."""
        return np.array(
            [self.parts[row - 2].instance.reach_m if row > 1 else 0.0 for row in rows.tolist()]
        )

    def _around_jump(
        self, rows: Indices, one: int, low_s: float, high_s: float
    ) -> tuple[float, float] | None:
        """Return the times just before and just after a jump between two samples; None if it is a
        motion.
        """
        if (high_s - low_s) * self.plan.fps < 2**_HALVINGS * _CLEAR_OF_KEYS:
            return None  # too short to tell a jump from a motion
        sizes_m = [float(self._steps_m(rows, low_s, high_s)[one])]
        while (high_s - low_s) * self.plan.fps > _CLEAR_OF_KEYS:
            middle_s, instant = self.plan.moment((low_s + high_s) / 2)
            if not low_s < middle_s < high_s:
                break  # float32 has no time between them
            self.take(middle_s, instant)
            left_m, right_m = (
                float(self._steps_m(rows, *pair)[one])
                for pair in ((low_s, middle_s), (middle_s, high_s))
            )
            low_s, high_s = (low_s, middle_s) if left_m > right_m else (middle_s, high_s)
            sizes_m.append(max(left_m, right_m))
            if len(sizes_m) > _HALVINGS and sizes_m[-1] < sizes_m[-1 - _HALVINGS] / 2:
                return None
        return low_s, high_s

    def _steps_m(self, rows: Indices, one_s: float, other_s: float) -> Real:
        """Return the largest step of each row of poses, then of each surface, between two samples,
        (n,) [m].
        """
        apart = np.nan_to_num(self.poses(other_s, rows) - self.poses(one_s, rows))
        turned_m = self._reaches_m(rows) * np.abs(apart[:, :3, :3]).max(axis=(1, 2), initial=0.0)
        moved_m = [np.linalg.norm(apart[:, :3, 3], axis=1) + turned_m]
        for sampled in self.vertices.values():
            pair = sampled[one_s], sampled[other_s]
            there = all(one is not None and one.size for one in pair)
            moved_m.append(np.array([np.abs(pair[1] - pair[0]).max() if there else 0.0]))
        return np.concatenate(moved_m)
