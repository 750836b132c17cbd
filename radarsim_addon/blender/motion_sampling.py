# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of what paths touch, sampled from Blender's animation over the burst and fitted.

The scene is shown at subframes, so constraints, parents, armatures, drivers and modifiers all
take part. Blender's time is float32: each sample's abscissa is the time that was really shown.
The number of samples is doubled until the fit is good enough for the carrier, or a limit is met.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import contract
from ..sidecar import file_sha256, write_record
from ..signal.kinematics import KinematicMotion, motion_of_rows
from ..signal.motionfile import (
    FrameMotion,
    Tracks,
    VertexSeries,
    body_record,
    write_tracks,
)
from ..signal.motionfit import fit_body, fit_vertices
from ..signal.motionmodel import BodyMotion
from ..signal.pathtable import PathRows
from .acquisition import Instant, instant_at
from .bodies import Bodies, Part
from .deforming import Deformations, DeformingSurface, may_deform, vertex_positions
from .shown import Key, Poses, instance_key, instance_name, pose_in_metres, shown_poses

Real = NDArray[np.float64]

#: Bound of a displacement that needs no more samples, in wavelengths: 2.5e-4 rad two-way.
_TARGET_WAVELENGTHS = 2e-5
_FIRST_SAMPLES = 17
#: No more samples than were taken in this time are added to them [s].
_PATIENCE_S = 20.0
#: Parts of the burst at which fits are checked, off any grid of samples.
_CHECKS = (0.1381966011, 0.4472135955, 0.7639320225)
#: Whole frames within a burst up to which keyframes are taken to be there.
_MOST_CORNERS = 64
#: A fit that misses a check by more than this many times its scatter is not the motion.
_MISSES = 8.0
#: Bound above which phases cannot be trusted [wavelengths]: 0.13 rad two-way.
_WARN_WAVELENGTHS = 0.01
#: Bytes of vertices that are held at once.
_MOST_VERTEX_BYTES = 1 << 29


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


class BurstMotion:
    """Motion of one radar frame.

    Parameters
    ----------
    show
        Brings the scene to a moment and returns its depsgraph.
    rig : Rig
        Antennas.
    names
        Objects in the order of their numbers, from 1.
    plan
        What is sampled.
    receiver_kind
        As `contract.CameraRecord` names it.
    frozen
        Take everything to stand still as it is at the frame's time.
    render
        Which of the burst's renders this is, from 0.
    """

    def __init__(
        self,
        show: Callable[[Instant], Any],
        rig: Any,
        names: Sequence[str],
        plan: SamplingPlan,
        receiver_kind: str,
        frozen: bool = False,
        render: int = 0,
    ) -> None:
        self.render = render
        self._show, self._rig, self._plan = show, rig, plan
        self._frozen = frozen
        self._kind = receiver_kind
        self._names = names
        self._units = plan.metres_per_unit
        self.warnings: list[str] = []
        #: What of moving power is approximated, and what has no body.
        self._approximated_w = self._unknown_w = self._power_w = 0.0
        self._scene: FrameMotion | None = None
        self._seen: set[int] = set()
        self._touched: list[Part] = []
        self._samples, self._bound_m = 0, 0.0

    # -- before the renders ------------------------------------------------------------------------

    def begin(self) -> Any:
        """Look for deforming surfaces; returns the depsgraph at the frame's time."""
        candidates = self._candidates(self._show(self._plan.shown[1]))
        deforming: dict[str, Any] = {}
        if candidates and not self._frozen:
            deforming = self._find_deforming(candidates)
        depsgraph = self._show(self._plan.shown[1])
        surfaces = {
            name: DeformingSurface(item, depsgraph, self._units) for name, item in deforming.items()
        }
        self._deformations = Deformations(surfaces, self._units)
        self.poses: Poses = shown_poses(depsgraph, self._units)
        self.bodies = Bodies(self._names, self.poses, depsgraph, self._units)
        return depsgraph

    def _candidates(self, depsgraph: Any) -> dict[str, Any]:
        wanted = set(self._names)
        found = {}
        for item in depsgraph.object_instances:
            original = item.object.original
            if original.name in wanted and may_deform(original) and not original.hide_render:
                found[original.name] = original
        return found

    def _find_deforming(self, candidates: dict[str, Any]) -> dict[str, Any]:
        deforming: dict[str, Any] = {}
        changing: list[str] = []
        depsgraph = self._show(self._plan.shown[1])
        before = {name: vertex_positions(item, depsgraph) for name, item in candidates.items()}
        for share in (*_CHECKS, 1.0):
            depsgraph = self._show(self._plan.at(share)[1])
            for name, item in list(candidates.items()):
                now = vertex_positions(item, depsgraph)
                if now.shape != before[name].shape:
                    changing.append(name)
                    deforming.pop(name, None)
                    del candidates[name]
                elif not np.array_equal(now, before[name]):
                    deforming[name] = item
        if changing:
            self.warnings.append(
                f"The mesh of {', '.join(map(repr, changing))} changes its vertices during the "
                "burst (their number): it is moved by the object's matrix alone. Use modifiers "
                "that keep vertices, or a shorter burst."
            )
        return deforming

    # -- rows --------------------------------------------------------------------------------------

    def label(self, rows: PathRows) -> None:
        """Fill in objects and bodies of rows, numbered over all that is shown."""
        self.bodies.label(rows)

    def collect(self, rows: PathRows) -> None:
        """Note what labelled rows touch; for all rows before `sample`."""
        for column in ("body", "first_body"):
            self._seen.update(np.unique(rows[column]).tolist())
        if self._deformations.any:
            self._deformations.attach(rows, self.bodies.parts)

    def complete(self, rows: PathRows) -> PathRows:
        """Labelled rows with their rates, their tracks, and bodies numbered as in the file.

        After `sample`, for the same rows in the same order as `collect`.
        """
        assert self._scene is not None
        if self._deformations.any:
            self._deformations.number(rows, self.bodies.parts)
        for column in ("body", "first_body"):
            rows[column] = self._file_number[rows[column]]
        motion: KinematicMotion = motion_of_rows(rows, self._scene)
        rows["range_rate_mps"] = motion.range_rates_mps()
        power = rows["power_w"]
        self._power_w += float(power.sum())
        self._approximated_w += float(power[motion.approximated].sum())
        self._unknown_w += float(power[motion.unknown].sum())
        return rows

    # -- sampling ----------------------------------------------------------------------------------

    def sample(self) -> FrameMotion:
        """Sample and fit all bodies that were touched; the scene is left at the frame's time."""
        plan = self._plan
        self._touched = [self.bodies.parts[n - 1] for n in sorted(self._seen - {0})]
        self._file_number = np.zeros(len(self.bodies.parts) + 1, dtype=np.int32)
        for number, shown in enumerate(sorted(self._seen - {0}), start=1):
            self._file_number[shown] = number
        if self._frozen:
            return self._stand_still()
        sampler = _Sampler(
            self._show, self._rig, self._touched, self.bodies, self._deformations, self._units
        )
        start_s = time.monotonic()
        checks = [plan.at(share) for share in _CHECKS]
        for at_s, instant in checks:
            sampler.take(at_s, instant)
        grid: set[float] = set()
        for share in [*plan.corners, plan.reference]:
            at_s, instant = plan.at(share)
            grid.add(at_s)
            sampler.take(at_s, instant)
        count = _FIRST_SAMPLES
        fits = _Fits(plan, sampler, [at_s for at_s, _ in checks])
        while True:
            for number in range(count):
                at_s, instant = plan.at(number / (count - 1))
                grid.add(at_s)
                sampler.take(at_s, instant)
            fits.fit(sorted(grid))
            more = fits.more_samples(count)
            if not more or count >= plan.most_samples:
                break
            elapsed_s = time.monotonic() - start_s
            if elapsed_s > _PATIENCE_S:
                self.warnings.append(
                    f"Motion was sampled {len(grid)} times only, as that took {elapsed_s:.0f} s. "
                    f"Displacements are known to {fits.bound_m:.2g} m."
                )
                break
            while count < min(more, plan.most_samples):
                count = 2 * count - 1
        self._show(plan.shown[1])
        self._samples = len(grid)
        self.warnings += fits.warnings()
        tracks = None
        if self._deformations.body:
            tracks = Tracks(
                self._file_number[np.concatenate(self._deformations.body)],
                np.concatenate(self._deformations.vertices),
                np.concatenate(self._deformations.weights),
                fits.series(),
            )
        receiver, emitter, *bodies = fits.motions
        self._scene = FrameMotion(
            plan.span_s,
            receiver,
            emitter,
            self._kind == "orthographic",
            bodies,
            tracks,
            plan.shown[0],
        )
        self._bound_m = fits.bound_m
        return self._scene

    def _stand_still(self) -> FrameMotion:
        depsgraph = self._show(self._plan.shown[1])
        receiver, emitter = (
            BodyMotion(
                pose_in_metres(item.evaluated_get(depsgraph).matrix_world, self._units),
                reference_s=self._plan.shown[0],
            )
            for item in (self._rig.camera, self._rig.emitter)
        )
        at_s = self._plan.shown[0]
        bodies = [BodyMotion(part.shown.pose, reference_s=at_s) for part in self._touched]
        self._samples, self._bound_m = 1, 0.0
        self._scene = FrameMotion(
            self._plan.span_s,
            receiver,
            emitter,
            self._kind == "orthographic",
            bodies,
            reference_s=at_s,
        )
        return self._scene

    def write(self, folder: Path, time_s: float, versions: dict[str, str]) -> Path:
        """Write the motion file (and the tracks) of this frame; after all rows had their rates."""
        assert self._scene is not None
        scene, tracks_file, digest = self._scene, "", ""
        if scene.tracks is not None:
            path = write_tracks(folder, scene.tracks)
            tracks_file, digest = path.name, file_sha256(path)
        antennas = [
            body_record(item.name, "", motion, False)
            for item, motion in (
                (self._rig.camera, scene.receiver),
                (self._rig.emitter, scene.emitter),
            )
        ]
        bodies = [
            body_record(
                part.name,
                instance_name(part.key),
                motion,
                part.name in self._deformations.surfaces,
            )
            for part, motion in zip(self._touched, scene.bodies, strict=True)
        ]
        total = self._power_w or 1.0
        wavelengths = self._bound_m / self._plan.wavelength_m
        if self._approximated_w > 1e-3 * total:
            self.warnings.append(
                f"{100 * self._approximated_w / total:.2g} % of the power moves in paths of three "
                "and more reflections: the way between their first and last scatterer is taken "
                "for a straight line that changes with both."
            )
        if wavelengths > _WARN_WAVELENGTHS:
            self.warnings.append(
                f"Displacements during the burst are known to {self._bound_m:.2g} m, "
                f"{wavelengths:.2g} wavelengths, from Blender's float32. Bring the scene nearer to "
                "the world's origin, or allow more motion samples."
            )
        record = contract.MotionRecord(
            frame=self._plan.frame,
            time_s=time_s,
            span_s=self._plan.span_s,
            samples=self._samples,
            receiver_kind=self._kind,
            antennas=antennas,
            bodies=bodies,
            bound_m=self._bound_m,
            bound_wavelengths=wavelengths,
            approximated_share=self._approximated_w / total,
            unknown_share=self._unknown_w / total,
            tracks_file=tracks_file,
            tracks_sha256=digest,
            reference_s=self._plan.shown[0],
            warnings=list(self.warnings),
            versions=versions,
        )
        path = folder / contract.MOTION_FILE
        write_record(path, record)
        return path


class _Sampler:
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

    def take(self, at_s: float, instant: Instant) -> None:
        """Take a sample unless there is one."""
        if at_s in self.poses:
            return
        depsgraph = self._show(instant)
        poses = np.full((len(self.parts) + 2, 4, 4), np.nan)
        for number, item in enumerate(self._antennas):
            poses[number] = pose_in_metres(item.evaluated_get(depsgraph).matrix_world, self._units)
        for index, part in enumerate(self.parts):
            if not part.key:
                item = self._originals[part.number].evaluated_get(depsgraph)
                poses[index + 2] = pose_in_metres(item.matrix_world, self._units)
        if self._instances:
            for item in depsgraph.object_instances:
                if not item.is_instance:
                    continue
                place = self._instances.get((item.object.original.name, instance_key(item)))
                if place is not None:
                    poses[place + 2] = pose_in_metres(item.matrix_world, self._units)
        self.lost.update(np.flatnonzero(np.isnan(poses[:, 0, 0])).tolist())
        self.poses[at_s] = poses
        for name, surface in self.surfaces.items():
            found = surface.sample(depsgraph)
            if found is None:
                self.changed.add(name)
            self.vertices[name][at_s] = found


class _Fits:
    """Fits of all bodies to what was sampled so far."""

    def __init__(self, plan: SamplingPlan, sampler: _Sampler, checks_s: list[float]) -> None:
        self._plan, self._sampler, self._checks_s = plan, sampler, checks_s
        self._target_m = _TARGET_WAVELENGTHS * plan.wavelength_m
        self.motions: list[BodyMotion] = []
        self._bounds = np.empty(0)
        self._missed: dict[int, float] = {}
        self._vertices: dict[str, tuple[VertexSeries, float, float]] = {}

    @property
    def bound_m(self) -> float:
        """Largest bound of what moves."""
        moving = [m.bound_m for m in self.motions if m.moving]
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
                if self.motions[index].bound_m <= self._target_m:
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
        return dataclasses.replace(motion, bound_m=max(motion.bound_m, miss))

    def more_samples(self, count: int) -> int:
        """How many samples the worst fit asks for; 0: it is good enough."""
        worst = max((m.bound_m for m in self.motions if m.moving), default=0.0)
        worst = max([worst, *self._missed.values(), self.bound_m])
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
    low, high = part.shown.box
    corners = np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    return float(np.linalg.norm(corners @ part.shown.pose[:3, :3].T, axis=-1).max())
