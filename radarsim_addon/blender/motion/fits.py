# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of all bodies to the samples of a burst, and what they miss."""

from __future__ import annotations

import dataclasses

import numpy as np

from ...signal.motion import BodyMotion, VertexSeries, fit_body, fit_vertices
from .bodies import Part
from .samples import Sampler, SamplingPlan

#: Bound of a displacement that needs no more samples, in wavelengths: 2.5e-4 rad two-way.
_TARGET_WAVELENGTHS = 2e-5
#: A fit that misses a check by more than this many times its scatter is not the motion.
_MISSES = 8.0
#: Bytes of vertices that are held at once.
_MOST_VERTEX_BYTES = 1 << 29


class Fits:
    """Fits of all bodies to what was sampled so far."""

    def __init__(self, plan: SamplingPlan, sampler: Sampler, checks_s: list[float]) -> None:
        self._plan, self._sampler, self._checks_s = plan, sampler, checks_s
        self._target_m = _TARGET_WAVELENGTHS * plan.wavelength_m
        self.motions: list[BodyMotion] = []
        self._bounds = np.empty(0)
        self._missed: dict[int, float] = {}
        self._vertices: dict[str, tuple[VertexSeries, float, float]] = {}

    @property
    def displacement_error_bound_m(self) -> float:
        """Largest bound of what moves."""
        moving = [m.displacement_error_bound_m for m in self.motions if m.moving]
        return max([*moving, *(bound for _, _, bound in self._vertices.values())], default=0.0)

    def fit(self, times_s: list[float]) -> None:
        """Fit what is not good enough yet."""
        sampler, plan = self._sampler, self._plan
        times = np.array(times_s)
        poses = np.stack([sampler.poses[at_s] for at_s in times_s])
        corners = [plan.at(share)[0] for share in plan.corners]
        reaches = [0.0, 0.0, *(_reach(part) for part in sampler.parts)]
        motions = []
        for index, reach_m in enumerate(reaches):
            if self.motions and index not in self._missed:
                motions.append(self.motions[index])
                if self.motions[index].displacement_error_bound_m <= self._target_m:
                    continue
                motions.pop()
            there = np.isfinite(poses[:, index, 0, 0])
            motion = fit_body(
                times[there],
                poses[there, index],
                plan.span_s,
                reach_m,
                unit_m=plan.metres_per_unit,
                corners_s=corners,
                reference=int(np.searchsorted(times[there], plan.shown[0])),
            )
            self._missed.pop(index, None)
            motions.append(self._checked(index, motion, reach_m))
        self.motions = motions
        for name in sampler.surfaces:
            if name in sampler.changed:
                continue
            old = self._vertices.get(name)
            if old is not None and old[2] <= self._target_m:
                continue
            sampled = sampler.vertices[name]
            size = len(sampler.surfaces[name].needed) * 12
            keep = times_s[:: max(1, -(-len(times_s) * size // _MOST_VERTEX_BYTES))]
            self._vertices[name] = fit_vertices(
                np.array(keep),
                np.stack([sampled[at_s] for at_s in keep]),
                plan.span_s,
                corners_s=corners,
            )

    def _checked(self, index: int, motion: BodyMotion, reach_m: float) -> BodyMotion:
        """The fit, with what it misses the checks by in its bound."""
        times = np.array(self._checks_s)
        poses = np.stack([self._sampler.poses[at_s][index] for at_s in self._checks_s])
        there = np.isfinite(poses[:, 0, 0])
        if not there.any():
            return motion
        # three points of the body that see every turn
        start = motion.pose
        arms = np.concatenate([np.zeros((1, 3)), np.eye(3) * max(reach_m, 1e-3)])
        size = np.maximum(np.linalg.norm(start[:3, :3], axis=0), 1e-12)
        local = arms / size
        at_start = local @ start[:3, :3].T + start[:3, 3]
        found = motion.displacement(at_start, times[there])
        now = np.einsum("nij,kj->kni", poses[there][:, :3, :3], local) + poses[there][:, :3, 3]
        miss = float(np.linalg.norm(now - at_start[:, None] - found, axis=-1).max())
        scale = float(np.abs(start[:3, 3]).max()) + reach_m
        rounding = float(np.spacing(np.float32(max(scale, 1e-6))))
        if miss <= _MISSES * (motion.noise_m + rounding):
            return motion
        self._missed[index] = miss
        return dataclasses.replace(
            motion, displacement_error_bound_m=max(motion.displacement_error_bound_m, miss)
        )

    def more_samples(self, count: int) -> int:
        """How many samples the worst fit asks for; 0: it is good enough."""
        worst = max((m.displacement_error_bound_m for m in self.motions if m.moving), default=0.0)
        worst = max([worst, *self._missed.values(), self.displacement_error_bound_m])
        if worst <= self._target_m:
            return 0
        # bounds fall with the root of the number
        return int(min(count * max(2.0, (worst / self._target_m) ** 2), 1e6))

    def series(self) -> dict[int, VertexSeries]:
        """Vertex series by number of the body."""
        found = {}
        for number, part in enumerate(self._sampler.parts, start=1):
            surface = self._sampler.surfaces.get(part.name)
            if surface is None:
                continue
            if part.name in self._vertices:
                found[number] = self._vertices[part.name][0]
            else:  # its vertices changed: they stay where they are on the object
                first = self._sampler.vertices[part.name][min(self._sampler.vertices[part.name])]
                found[number] = VertexSeries(
                    np.array([0.0, self._plan.span_s]), first[None, None].astype(np.float64)
                )
        return found

    def warnings(self) -> list[str]:
        """What did not fit."""
        found = []
        parts = self._sampler.parts
        bad = ["an antenna" if index < 2 else repr(parts[index - 2].name) for index in self._missed]
        if bad:
            found.append(
                f"Motion of {', '.join(dict.fromkeys(bad))} is not resolved by "
                f"{len(self._sampler.poses)} samples in the burst (misses of up to "
                f"{max(self._missed.values()):.2g} m): it turns or shakes too fast. Shorten the "
                "burst or allow more motion samples."
            )
        if self._sampler.lost:
            names = {repr(parts[index - 2].name) for index in self._sampler.lost if index > 1}
            found.append(
                f"Instances of {', '.join(sorted(names))} are not there during the whole burst; "
                "they are taken to be."
            )
        if self._sampler.changed:
            found.append(
                f"The mesh of {', '.join(map(repr, sorted(self._sampler.changed)))} changes its "
                "vertices during the burst (their number): it is moved by the object's matrix "
                "alone."
            )
        return found


def _reach(part: Part) -> float:
    """Farthest corner of a body's box from its origin [m]."""
    low, high = part.instance.box
    corners = np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    return float(np.linalg.norm(corners @ part.instance.pose[:3, :3].T, axis=-1).max())
