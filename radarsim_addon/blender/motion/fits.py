# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of all bodies to the samples of a burst, and their errors.

A fit is accurate where its error bound is far below the wavelength, or below the rounding of
float32 poses, which no number of samples gives back. Poses at a few more times, on no grid of
samples (checks), must agree with the fit, or it does not follow the motion. What Blender moves on
straight lines between whole frames is a cubic through these.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from ...arrays import Real, Single
from ...findings import Finding, finding
from ...signal.motion import (
    BodyMotion,
    BodyMotions,
    VertexSeries,
    cubic_spline,
    fit_body,
    fit_vertices,
    smooth_poses,
)
from .samples import Sampler, SamplingPlan

#: Error bound of a displacement that needs no more samples [wavelengths]: 2.5e-4 rad two-way.
_TARGET_WAVELENGTHS = 2e-5
#: The same in steps of float32 poses. What they round away, no number of samples gives back.
_TARGET_ROUNDING = 0.25
#: Standard error of a velocity that needs no more samples [wavelengths/s]: 6e-5 m/s at 77 GHz.
_TARGET_RATE = 0.015
#: Standard errors over the target that more samples can still bring down to it.
_NEAR_TARGET = 4.0
#: Part of the change from frame to frame that surfaces may be off a straight line between frames.
_ON_FRAMES = 0.01
#: A fit whose error at a check exceeds its scatter by this factor does not follow the motion.
_MAX_MISS = 8.0
#: Number of samples of a cubic between two whole frames.
_BETWEEN_FRAMES = 16
#: Distance from a body's origin at which its turns count at least, as of antennas [m].
_LEAST_REACH_M = 1e-3
#: Larger scatter, in steps of float32, is motion and no rounding.
_MAX_NOISE = 10.0
#: Minimum number of samples for a fit of the burst without what is before and after it.
_LEAST_ALONE = 13
#: Maximum size of the vertices in memory [bytes].
_MAX_VERTEX_BYTES = 1 << 29


class Fits:
    """Fits of all bodies to the samples so far.

    Rows of poses are numbered as in `Sampler`. `smooth` are rows that move on straight lines
    between whole frames, to be a cubic; `smooth_surfaces` are such deforming surfaces with their
    frames.
    """

    def __init__(
        self,
        plan: SamplingPlan,
        sampler: Sampler,
        checks_s: list[float],
        smooth: set[int],
        smooth_surfaces: dict[str, tuple[float, float] | None],
    ) -> None:
        self._plan, self._sampler, self._checks_s = plan, sampler, checks_s
        self._smooth, self._smooth_surfaces = smooth, smooth_surfaces
        self._target_m = _TARGET_WAVELENGTHS * plan.wavelength_m
        self._reach_m = cache(
            lambda index: sampler.parts[index - 2].instance.reach_m if index > 1 else 0.0
        )
        #: Motion of the rows that change or are smooth; all others are stationary.
        self._motions: dict[int, BodyMotion] = {}
        self._fitted = False
        self._missed: dict[int, float] = {}
        #: Series of each surface, its noise and its error bound [m].
        self._vertices: dict[str, tuple[VertexSeries, float, float]] = {}
        self._missed_surfaces: dict[str, float] = {}

    @property
    def displacement_error_bound_m(self) -> float:
        """Largest error bound of all moving bodies [m]."""
        moving = [
            motion.displacement_error_bound_m
            for index, motion in self._motions.items()
            if motion.moving or self._is_noisy(index, motion)
        ]
        return max([*moving, *(bound for _, _, bound in self._vertices.values())], default=0.0)

    @property
    def motions(self) -> BodyMotions:
        """Motion of each row of poses."""
        at_s = self._plan.rendered[0]
        return BodyMotions(self._sampler.poses(at_s), self._motions, at_s)

    def fit(self, times_s: list[float]) -> int:
        """Fit again all motions that are not accurate enough; return the number of samples in all
        fits.
        """
        fitted = 0
        sampler, plan = self._sampler, self._plan
        times = np.array(times_s)
        rows = np.union1d(sampler.changing, sorted(self._smooth)).astype(np.intp)
        poses = np.stack([sampler.poses(at_s, rows) for at_s in times_s])
        in_burst = (times >= 0) & (times <= plan.duration_s)
        rendered = sampler.poses(plan.rendered[0], rows)
        # of all samples: what passes the world's origin is rounded more before and after
        farthest_m = np.nanmax(np.abs(poses[:, :, :3, 3]), axis=(0, 2), initial=0.0)
        self._farthest_m = dict(zip(rows.tolist(), farthest_m, strict=True))
        checked = np.stack([sampler.poses(at_s, rows) for at_s in self._checks_s])
        still = (poses == rendered).all(axis=(0, 2, 3)) & (checked == rendered).all(axis=(0, 2, 3))
        for at, index in enumerate(rows.tolist()):
            if self._fitted and self._is_accurate(index):
                continue
            if index in self._smooth:
                self._motions[index] = self._smooth_motion(index)
                continue
            self._missed.pop(index, None)
            if still[at]:
                self._motions.pop(index, None)
                continue
            fitted += times.size
            present = np.isfinite(poses[:, at, 0, 0])
            motion = self._fit_body(index, times[present], poses[present, at])
            follows = index not in self._missed and not self._is_noisy(index, motion)
            if not follows and in_burst.sum() >= _LEAST_ALONE and not in_burst.all():
                # What happens before or after the burst can be harder to follow.
                missed = self._missed.pop(index, None)
                present &= in_burst
                alone = self._fit_body(index, times[present], poses[present, at])
                if alone.noise_m < 0.7 * motion.noise_m and not (
                    missed is None and index in self._missed
                ):
                    motion = alone
                elif missed is None:
                    self._missed.pop(index, None)
                else:
                    self._missed[index] = missed
            self._motions[index] = motion
        self._fitted = True
        return fitted + self._fit_surfaces(times_s)

    def _fit_surfaces(self, times_s: list[float]) -> int:
        fitted, sampler, plan = 0, self._sampler, self._plan
        for name in sampler.surfaces:
            if name in sampler.changed:
                continue
            if name in self._vertices and self._vertices[name][2] <= self._vertex_target_m(name):
                continue
            sampled = sampler.vertices[name]
            if name in self._smooth_surfaces:
                if all(sampled[at_s] is not None for at_s in self._whole_s(name)):
                    if name not in self._vertices:
                        self._vertices[name] = self._smooth_series(name)
                    continue
                del self._smooth_surfaces[name]
            have = [at_s for at_s in times_s if sampled[at_s] is not None]
            size = len(sampler.surfaces[name].needed) * 12
            keep = have[:: max(1, -(-len(have) * size // _MAX_VERTEX_BYTES))]
            found = fit_vertices(
                np.array(keep),
                np.stack([sampled[at_s] for at_s in keep]),
                plan.duration_s,
                corners_s=plan.corners_s,
                epoch_s=plan.rendered[0],
            )
            self._vertices[name] = self._checked_vertices(name, *found)
            fitted += len(keep)
        return fitted

    def _checked_vertices(
        self, name: str, series: VertexSeries, noise_m: float, bound_m: float
    ) -> tuple[VertexSeries, float, float]:
        """Return the fit of a surface. Its error bound includes the error at the check times.

        Vertices stay the same points of the surface, so the error of the vertices is that of the
        surface.
        """
        sampled = self._sampler.vertices[name]
        times_s = [at_s for at_s in self._checks_s if sampled[at_s] is not None]
        self._missed_surfaces.pop(name, None)
        if not times_s:
            return series, noise_m, bound_m
        there_m = np.stack([sampled[at_s] for at_s in times_s])
        every = np.arange(there_m.shape[1], dtype=np.int32)
        miss_m = float(np.abs(series.positions(every, np.array(times_s)) - there_m).max(initial=0))
        # Armatures and targets of modifiers may be anywhere: they round vertices by their places.
        places_m = self._sampler.poses(self._plan.rendered[0])[:, :3, 3]
        step_m = max(
            _rounding_step(there_m, self._plan.metres_per_unit),
            _rounding_step(np.nan_to_num(places_m), self._plan.metres_per_unit),
        )
        allowed_m = _MAX_MISS * (min(noise_m, _MAX_NOISE * step_m) + step_m)
        if miss_m > max(allowed_m, self._target_m):
            self._missed_surfaces[name] = miss_m
            bound_m = max(bound_m, miss_m)
        return series, noise_m, bound_m

    def _smooth_series(self, name: str) -> tuple[VertexSeries, float, float]:
        """Return a cubic through the vertices at whole frames, in the form of `fit_vertices`."""
        plan, sampled = self._plan, self._sampler.vertices[name]
        whole_s = np.array(self._whole_s(name))
        spline = cubic_spline(whole_s, np.stack([sampled[at_s] for at_s in whole_s]).astype(float))
        times_s = np.linspace(0, plan.duration_s, _BETWEEN_FRAMES * (whole_s.size - 3) + 1)
        series, noise_m, bound_m = fit_vertices(
            times_s,
            spline(times_s),
            plan.duration_s,
            corners_s=whole_s.tolist(),
            epoch_s=plan.rendered[0],
        )
        # The rounding of the vertices remains.
        step_m = _rounding_step(sampled[plan.rendered[0]], plan.metres_per_unit)
        return series, noise_m, bound_m + step_m

    def _whole_s(self, name: str) -> list[float]:
        """Return the times of the frames between which a surface moves linearly [s]."""
        return [at_s for at_s, _ in self._plan.whole_frames(*self._smooth_surfaces[name] or ())]

    def _off_whole_frames_mps(self, sampled: Mapping[float, Any]) -> float:
        """Return the largest change of speed of points from one frame to the next [m/s].

        `sampled` has the points, (n, 3) [m], by time. The result is 0 if they move along straight
        lines between whole frames.
        """
        plan = self._plan
        whole = plan.whole_frames()
        middles = [plan.between(*pair)[0] for pair in itertools.pairwise(whole)]
        there = [sampled[at_s] for at_s in (*(at_s for at_s, _ in whole), *middles)]
        if any(one is None or np.isnan(one).any() for one in there):
            return 0.0
        values = np.stack(there).astype(np.float64)
        frames, between = values[: len(whole)], values[len(whole) :]
        if np.array_equal(frames[:-1], between):  # no cache: a script holds them for each frame
            return 0.0
        apart = np.abs((frames[1:] + frames[:-1]) / 2 - between).max()
        bent = float(np.linalg.norm(np.diff(frames, 2, axis=0), axis=2).max())
        step = _rounding_step(values, plan.metres_per_unit)
        return bent * plan.fps if apart > _MAX_MISS * step + _ON_FRAMES * bent else 0.0

    def _places(self, index: int) -> dict[float, Real]:
        """Return the places of a body by time, (1, 3) each [m]."""
        sampler = self._sampler
        return {at_s: sampler.pose(at_s, index)[None, :3, 3] for at_s in sampler.times_s}

    def _turns(self, index: int) -> bool:
        """Return whether the axes of a body change from one whole frame to the next."""
        whole = [self._sampler.pose(at_s, index) for at_s, _ in self._plan.whole_frames()]
        return not all(np.allclose(one[:3, :3], whole[0][:3, :3], atol=1e-5) for one in whole)

    def _fit_body(self, index: int, times_s: Real, poses: Real) -> BodyMotion:
        plan = self._plan
        motion = fit_body(
            times_s,
            poses,
            plan.duration_s,
            self._reach_m(index),
            unit_m=plan.metres_per_unit,
            corners_s=plan.corners_s,
            pose=self._sampler.pose(plan.rendered[0], index),
            epoch_s=plan.rendered[0],
        )
        return self._checked(index, motion, self._reach_m(index))

    def _smooth_motion(self, index: int) -> BodyMotion:
        """Return a cubic through the poses at whole frames."""
        plan = self._plan
        moments = [at_s for at_s, _ in plan.whole_frames()]
        poses = np.stack([self._sampler.pose(at_s, index) for at_s in moments])
        present = np.isfinite(poses[:, 0, 0])
        whole_s = np.array(moments)[present]
        first = max(int(np.searchsorted(whole_s, 0.0, side="right")) - 1, 0)
        needed_s = whole_s[first : int(np.searchsorted(whole_s, plan.duration_s)) + 1]
        steps = np.arange(needed_s.size * _BETWEEN_FRAMES - _BETWEEN_FRAMES + 1) / _BETWEEN_FRAMES
        times_s = np.interp(steps, np.arange(needed_s.size), needed_s)
        motion = fit_body(
            times_s,
            smooth_poses(whole_s, poses[present], times_s),
            plan.duration_s,
            self._reach_m(index),
            unit_m=plan.metres_per_unit,
            corners_s=whole_s.tolist(),
            pose=self._sampler.pose(plan.rendered[0], index),
            epoch_s=plan.rendered[0],
        )
        # The rounding of the poses remains.
        bound_m = motion.displacement_error_bound_m + self._rounding_m(index)
        return dataclasses.replace(motion, displacement_error_bound_m=bound_m)

    def _target_of(self, index: int) -> float:
        """Return the error bound below which a body needs no more samples.

        It follows from the wavelength, or from the rounding of the poses if that is larger.
        """
        return max(self._target_m, _TARGET_ROUNDING * self._rounding_m(index))

    def _rounding_m(self, index: int) -> float:
        """Return the rounding error of float32 at the farthest point of a body [m]."""
        turn_m = max(self._reach_m(index), _LEAST_REACH_M) * float(np.spacing(np.float32(1.0)))
        return _rounding_step(self._farthest_m[index], self._plan.metres_per_unit) + turn_m

    def _vertex_target_m(self, name: str) -> float:
        found = self._sampler.vertices[name][self._plan.rendered[0]]
        step_m = _rounding_step(found, self._plan.metres_per_unit)
        return max(self._target_m, _TARGET_ROUNDING * step_m)

    def _is_noisy(self, index: int, motion: BodyMotion) -> bool:
        """Return whether the residual of a fit is larger than the rounding of the poses."""
        return motion.noise_m > max(self._rounding_m(index), self._target_m)

    def _is_accurate(self, index: int) -> bool:
        motion = self._motions.get(index)
        if motion is None or index in self._smooth:
            return True
        if index in self._missed or self._is_noisy(index, motion):
            return False
        return not motion.moving or (
            motion.displacement_error_bound_m <= self._target_of(index)
            and motion.rate_stderr_mps <= _TARGET_RATE * self._plan.wavelength_m
            and motion.rate_bias_mps <= _TARGET_RATE * self._plan.wavelength_m
        )

    def _checked(self, index: int, motion: BodyMotion, reach_m: float) -> BodyMotion:
        """Return the fit of a body. Its error bound includes the error at the check times."""
        times = np.array(self._checks_s)
        poses = np.stack([self._sampler.pose(at_s, index) for at_s in self._checks_s])
        present = np.isfinite(poses[:, 0, 0])
        if not present.any():
            return motion
        # The origin and three points of the body: together they detect each rotation.
        start = motion.pose
        arms = np.concatenate([np.zeros((1, 3)), np.eye(3) * max(reach_m, _LEAST_REACH_M)])
        size = np.maximum(np.linalg.norm(start[:3, :3], axis=0), 1e-12)
        local = arms / size
        at_start = local @ start[:3, :3].T + start[:3, 3]
        found = motion.displacement(at_start, times[present])
        now = np.einsum("nij,kj->kni", poses[present][:, :3, :3], local) + poses[present][:, :3, 3]
        apart = now - at_start[:, None] - found
        if not self._plan.is_clear(self._plan.rendered[0]):
            # The rendered pose is that of a key nearby, which shifts all displacements alike.
            apart -= apart.mean(axis=1, keepdims=True)
        miss = float(np.linalg.norm(apart, axis=-1).max())
        rounding_m = self._rounding_m(index)
        allowed_m = _MAX_MISS * (min(motion.noise_m, _MAX_NOISE * rounding_m) + rounding_m)
        if miss <= max(allowed_m, self._target_m):
            return motion
        self._missed[index] = miss
        return dataclasses.replace(
            motion, displacement_error_bound_m=max(motion.displacement_error_bound_m, miss)
        )

    @property
    def accurate(self) -> bool:
        """Whether all fits are accurate enough."""
        return all(map(self._is_accurate, self._motions)) and all(
            name in self._smooth_surfaces or bound <= self._vertex_target_m(name)
            for name, (_, _, bound) in self._vertices.items()
        )

    @property
    def resolved(self) -> bool:
        """Whether all fits follow the motion between the samples, except for rounding."""
        return not (self._missed or self._missed_surfaces) and all(
            index in self._smooth
            or motion.displacement_error_bound_m <= _MAX_MISS * self._target_of(index)
            for index, motion in self._motions.items()
            if motion.moving
        )

    @property
    def biased(self) -> bool:
        """Whether the fit of a velocity lacks terms that four times as many samples would show."""
        target_mps = _TARGET_RATE * self._plan.wavelength_m
        return any(
            one.rate_bias_mps > target_mps and one.rate_stderr_mps < _NEAR_TARGET * target_mps
            for one in self._motions.values()
        )

    @property
    def noisy(self) -> bool:
        """Whether the residual of a fit is larger than the rounding of the poses. It
        may be motion.
        """
        return any(self._is_noisy(index, motion) for index, motion in self._motions.items())

    def series(self) -> dict[int, VertexSeries]:
        """Return the series of vertices of each deforming body, by the number of the body."""
        found: dict[int, VertexSeries] = {}
        if not self._sampler.surfaces:
            return found
        for number, part in enumerate(self._sampler.parts, start=1):
            surface = self._sampler.surfaces.get(part.name)
            if surface is None:
                continue
            if part.name in self._vertices:
                found[number] = self._vertices[part.name][0]
            else:  # the number of its vertices changes: they move with the object only
                first = self._sampler.vertices[part.name][min(self._sampler.vertices[part.name])]
                found[number] = VertexSeries(
                    np.array([0.0, self._plan.duration_s]), first[None, None].astype(np.float64)
                )
        return found

    def findings(self) -> list[Finding]:
        """Return findings on the motions that the fits do not follow."""
        found = []
        parts = self._sampler.parts
        smooth = [i for i in sorted(self._smooth) if self._motions[i].moving]
        surfaces = sorted(self._smooth_surfaces.keys() & self._vertices.keys())
        if smooth or surfaces:
            moved = dict.fromkeys("antennas" if i < 2 else parts[i - 2].name for i in smooth)
            moved |= dict.fromkeys(surfaces)
            found.append(finding("motion-between-frames", *moved))
        sampled = [
            (name, self._sampler.vertices[name])
            for name in surfaces
            if self._smooth_surfaces[name] is None  # else its frames are known
        ]
        # What turns is on arcs between the frames of any cache.
        sampled += [
            (parts[i - 2].name if i > 1 else "antennas", self._places(i))
            for i in smooth
            if not self._turns(i)
        ]
        for name, points in sampled:
            off_mps = self._off_whole_frames_mps(points)
            if off_mps > 0:
                found.append(finding("cache-between-frames", name, speed_mps=off_mps))
        missed = {
            "antennas" if index < 2 else parts[index - 2].name: miss_m
            for index, miss_m in self._missed.items()
        } | self._missed_surfaces
        if missed:
            found.append(
                finding(
                    "motion-unresolved",
                    *missed,
                    samples=len(self._sampler.times_s),
                    miss_m=max([*self._missed.values(), *self._missed_surfaces.values()]),
                )
            )
        if self._sampler.lost:
            names = {parts[index - 2].name for index in self._sampler.lost if index > 1}
            found.append(finding("instances-appear-or-vanish", *sorted(names)))
        return found


def _rounding_step(values: Real | Single | float, metres_per_unit: float) -> float:
    """Return the rounding step of float32 at the largest of these coordinates [m]."""
    largest_units = float(np.abs(values).max(initial=0.0)) / metres_per_unit
    return float(np.spacing(np.float32(max(largest_units, 1e-30)))) * metres_per_unit
