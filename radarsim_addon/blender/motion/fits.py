# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of all bodies to the samples of a burst, and their errors."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from ...findings import Finding, finding
from ...signal.motion import BodyMotion, VertexSeries, fit_body, fit_vertices
from .bodies import Part
from .samples import Sampler, SamplingPlan

#: Error bound of a displacement that needs no more samples [wavelengths]: 2.5e-4 rad two-way.
_TARGET_WAVELENGTHS = 2e-5
#: A fit whose error at a check exceeds its scatter by this factor does not follow the motion.
_MAX_MISS = 8.0
#: Maximum size of the vertices in memory [bytes].
_MAX_VERTEX_BYTES = 1 << 29


class Fits:
    """Fits of all bodies to the samples so far."""

    def __init__(self, plan: SamplingPlan, sampler: Sampler, checks_s: list[float]) -> None:
        self._plan, self._sampler, self._checks_s = plan, sampler, checks_s
        self._target_m = _TARGET_WAVELENGTHS * plan.wavelength_m
        self.motions: list[BodyMotion] = []
        self._bounds = np.empty(0)
        self._missed: dict[int, float] = {}
        self._vertices: dict[str, tuple[VertexSeries, float, float]] = {}

    @property
    def displacement_error_bound_m(self) -> float:
        """Largest error bound of all moving bodies [m]."""
        moving = [m.displacement_error_bound_m for m in self.motions if m.moving]
        return max([*moving, *(bound for _, _, bound in self._vertices.values())], default=0.0)

    def fit(self, times_s: list[float]) -> None:
        """Fit all bodies again that are not yet accurate enough."""
        sampler, plan = self._sampler, self._plan
        times = np.array(times_s)
        poses = np.stack([sampler.poses[at_s] for at_s in times_s])
        corners = [plan.at(fraction)[0] for fraction in plan.corners]
        reaches = [0.0, 0.0, *(_reach(part) for part in sampler.parts)]
        motions = []
        for index, reach_m in enumerate(reaches):
            if self.motions and index not in self._missed:
                old = self.motions[index]
                if old.displacement_error_bound_m <= self._target_m:
                    motions.append(old)
                    continue
            present = np.isfinite(poses[:, index, 0, 0])
            motion = fit_body(
                times[present],
                poses[present, index],
                plan.duration_s,
                reach_m,
                unit_m=plan.metres_per_unit,
                corners_s=corners,
                reference=int(np.searchsorted(times[present], plan.rendered[0])),
            )
            self._missed.pop(index, None)
            motions.append(self._checked(index, motion, reach_m))
        self.motions = motions
        for name in sampler.surfaces:
            if name in sampler.changed:
                continue
            if name in self._vertices and self._vertices[name][2] <= self._target_m:
                continue
            sampled = sampler.vertices[name]
            size = len(sampler.surfaces[name].needed) * 12
            keep = times_s[:: max(1, -(-len(times_s) * size // _MAX_VERTEX_BYTES))]
            self._vertices[name] = fit_vertices(
                np.array(keep),
                np.stack([sampled[at_s] for at_s in keep]),
                plan.duration_s,
                corners_s=corners,
            )

    def _checked(self, index: int, motion: BodyMotion, reach_m: float) -> BodyMotion:
        """Return the fit, with its error at the checks in its bound."""
        times = np.array(self._checks_s)
        poses = np.stack([self._sampler.poses[at_s][index] for at_s in self._checks_s])
        present = np.isfinite(poses[:, 0, 0])
        if not present.any():
            return motion
        # The origin and three points of the body: together they detect each rotation.
        start = motion.pose
        arms = np.concatenate([np.zeros((1, 3)), np.eye(3) * max(reach_m, 1e-3)])
        size = np.maximum(np.linalg.norm(start[:3, :3], axis=0), 1e-12)
        local = arms / size
        at_start = local @ start[:3, :3].T + start[:3, 3]
        found = motion.displacement(at_start, times[present])
        now = np.einsum("nij,kj->kni", poses[present][:, :3, :3], local) + poses[present][:, :3, 3]
        miss = float(np.linalg.norm(now - at_start[:, None] - found, axis=-1).max())
        scale = float(np.abs(start[:3, 3]).max()) + reach_m
        rounding = float(np.spacing(np.float32(max(scale, 1e-6))))
        if miss <= _MAX_MISS * (motion.noise_m + rounding):
            return motion
        self._missed[index] = miss
        return dataclasses.replace(
            motion, displacement_error_bound_m=max(motion.displacement_error_bound_m, miss)
        )

    def more_samples(self, count: int) -> int:
        """Return the number of samples that the worst fit needs; 0 if all are accurate enough."""
        worst = max((m.displacement_error_bound_m for m in self.motions if m.moving), default=0.0)
        worst = max([worst, *self._missed.values(), self.displacement_error_bound_m])
        if worst <= self._target_m:
            return 0
        # Bounds fall with the square root of the number of samples.
        return int(min(count * max(2.0, (worst / self._target_m) ** 2), 1e6))

    def series(self) -> dict[int, VertexSeries]:
        """Return the vertex series by number of the body."""
        found = {}
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
        """Return what did not fit."""
        found = []
        parts = self._sampler.parts
        if self._missed:
            bad = ["antennas" if index < 2 else parts[index - 2].name for index in self._missed]
            found.append(
                finding(
                    "motion-unresolved",
                    *bad,
                    samples=len(self._sampler.poses),
                    miss_m=max(self._missed.values()),
                )
            )
        if self._sampler.lost:
            names = {parts[index - 2].name for index in self._sampler.lost if index > 1}
            found.append(finding("instances-appear-or-vanish", *sorted(names)))
        if self._sampler.changed:
            found.append(finding("vertex-count-changes", *sorted(self._sampler.changed)))
        return found


def _reach(part: Part) -> float:
    """Return the distance of the farthest corner of a body's box from its origin [m]."""
    corners = np.array(list(itertools.product(*part.instance.box.T)))
    return float(np.linalg.norm(corners @ part.instance.pose[:3, :3].T, axis=-1).max())
