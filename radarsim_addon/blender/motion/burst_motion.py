# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of the scatterers of paths, sampled from Blender's animation over the burst and fitted.

Blender evaluates the scene at subframes, so constraints, parents, armatures, drivers and modifiers
take part. `BurstMotion.begin` finds the surfaces that deform; after the renders, rows are labelled
with bodies, and `sample` samples the bodies that rows name. The number of samples doubles until the
fit (`Fits`) is accurate enough for the carrier, or a limit is reached. What moves on straight lines
between whole frames, such as simulations, and what scripts hold for each frame
(`stepped_at_frames`) becomes a cubic through whole frames. `complete` fills in range rates, `write`
makes the files.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ... import contract
from ...arrays import Indices, Mask, Real
from ...contract import MotionRecord
from ...findings import Finding, finding, merge
from ...signal.motion import (
    BodyMotions,
    FrameMotion,
    KinematicMotion,
    Tracks,
    body_record,
    write_tracks,
)
from ...signal.paths import PathRows, motion_of_rows
from ...typed_json import file_sha256, write_record
from ..plan import Instant
from ..scene import (
    Rig,
    check_particles_are_baked,
    evaluated_poses,
    may_move_at_whole_frames,
    pose_in_metres,
    simulation_frames,
)
from ..state import Snapshot, marked_points, surface_points, vertex_positions
from .animation import (
    cache_frames,
    deforms_linearly_between_frames,
    displacement_changes,
    is_linear_between_frames,
    moves_in_steps,
)
from .bodies import Bodies, Parts, write_bodies
from .deforming import (
    Deformations,
    DeformingSurface,
    are_same_points,
    is_cut,
    is_on_grid,
    may_change_points,
    may_deform,
)
from .fits import Fits
from .samples import Sampler, SamplingPlan

_FIRST_SAMPLES = 17
#: Number of samples after which only motion that is not resolved gets more.
_MOST_AGAINST_ROUNDING = 257
#: The same where a fit has terms that it cannot tell from rounding, but whose slope counts.
_MOST_AGAINST_BIAS = 1025
#: Work, counted in poses that are read, after which no more samples are added: some 20 s. A limit
#: in seconds would make results depend on the computer.
_MOST_POSES = 1 << 19
#: Reading so many vertices of deforming surfaces takes as long as reading a pose.
_VERTICES_PER_POSE = 256
#: Number of poses that take as long to read as one sample of a body takes to fit.
_POSES_PER_FIT = 4
#: How often samples are searched for jumps: each time, those found divide the burst.
_MOST_SEARCHES = 4
#: Fractions of the burst at which fits are checked; they are on no grid of samples.
_CHECKS = (0.1381966011, 0.4472135955, 0.7639320225)
#: A frame after all simulations begin.
_ANY_FRAME = 1 << 24
#: Error bound above which phases are not reliable [wavelengths]: 0.13 rad two-way.
_WARN_WAVELENGTHS = 0.01
#: Fraction of the power whose motion may be approximated without a caution: left out altogether, it
#: changes a level by 0.04 dB.
_NEGLIGIBLE = 0.01


class BurstMotion:
    """Motion of one radar frame.

    `show` sets the scene to a moment and returns its snapshot. `names` are objects in the order of
    their numbers, from 1. `receiver_kind` is as `contract.ReceiverRecord` names it, `motion` as
    `PathOptions` has it. `render` is the number of this render within the burst, from 0.
    """

    def __init__(
        self,
        show: Callable[[Instant], Any],
        rig: Rig,
        names: Sequence[str],
        plan: SamplingPlan,
        receiver_kind: str,
        motion: str = "kinematic",
        render: int = 0,
    ) -> None:
        self.render = render
        self._show, self._rig, self._plan = show, rig, plan
        self._smooth, self._frozen = motion != "linear", motion == "off"
        self._by_scripts = may_move_at_whole_frames()
        self._kind = receiver_kind
        self._names = names
        self._units = plan.metres_per_unit
        self.findings: list[Finding] = []
        #: Images of the antennas that rows name; after `sample` with the file's numbers of bodies.
        self.images: Sequence[contract.ImageRecord] = ()
        #: Power: motion approximated, no body known, in all.
        self._approximated_w = self._unknown_w = self._power_w = 0.0
        self._seen: set[int] = set()
        self._samples, self._bound_m = 0, 0.0
        #: Distance from their surfaces of points that do not follow them [m].
        self._apart_m = 0.0

    # -- before the renders ------------------------------------------------------------------------

    def begin(self) -> Any:
        """Find deforming surfaces; return the snapshot at the frame's time."""
        instant = self._plan.rendered[1]
        snapshot = self._show(instant)
        self._measured_scene = snapshot.scene
        self.poses = evaluated_poses(snapshot, self._units)
        wanted = set(self._names)
        if not self._frozen:
            assert self.poses.snapshot is not None
            check_particles_are_baked(
                self.poses.snapshot,
                "Without the motion of particles, set Motion to Off (--motion off).",
            )
        candidates = {
            name: item
            for name, item in self.poses.rendered.items()
            if name in wanted and may_deform(item)
        }
        deforming: dict[str, Any] = {}
        if candidates and not self._frozen:
            deforming = self._find_deforming(candidates, snapshot)
            snapshot = self._show(instant)
            self.poses = evaluated_poses(snapshot, self._units)
        surfaces = {
            name: DeformingSurface(item, snapshot, self._units) for name, item in deforming.items()
        }
        self._deformations = Deformations(surfaces, self._units)
        self.bodies = Bodies(self._names, self.poses, self._units)
        self._touched = Parts(self.bodies, np.empty(0, dtype=np.intp))
        return snapshot

    def _find_deforming(self, candidates: dict[str, Any], snapshot: Snapshot) -> dict[str, Any]:
        deforming: dict[str, Any] = {}
        changing: dict[str, Any] = {}
        before = {
            name: vertex_positions(snapshot.evaluated(item)) for name, item in candidates.items()
        }
        items, deforming_points = list(candidates.values()), set[str]()
        within = snapshot.points_within(items)
        moments = [self._plan.at(fraction) for fraction in (*_CHECKS, 1.0)]
        cached = any(map(deforms_linearly_between_frames, candidates.values()))
        if self._by_scripts or (self._smooth and cached):
            # A cache or a script may hold its vertices from frame to frame.
            moments += self._plan.whole_frames()
        for _, moment in moments:
            snapshot = self._show(moment)
            for name, item in list(candidates.items()):
                now = vertex_positions(snapshot.evaluated(item))
                if now.shape != before[name].shape:
                    changing[name] = item
                    deforming.pop(name, None)
                    del candidates[name]
                elif not np.array_equal(now, before[name]):
                    deforming[name] = item
            now_within = snapshot.points_within(items) if within else {}
            deforming_points |= {name for name, at in within.items() if now_within.get(name) != at}
        changing |= self._with_other_points(
            {name: item for name, item in deforming.items() if may_change_points(item)},
            [moment for _, moment in moments],
        )
        self._say_not_followed(changing)
        if deforming_points:
            self.findings.append(finding("points-deform-within", *sorted(deforming_points)))
        return {name: item for name, item in deforming.items() if name not in changing}

    def _with_other_points(
        self, items: dict[str, Any], moments: Sequence[Instant]
    ) -> dict[str, Any]:
        """Return the objects whose vertices do not stay the same points of the surface at all of
        these moments.
        """
        found: dict[str, Any] = {}
        if not items:
            return found
        # Marks change meshes, and Blender then forgets simulations that are not baked.
        simulated = bool(simulation_frames(self._measured_scene, _ANY_FRAME))
        if simulated:
            found = {name: item for name, item in items.items() if is_cut(item)}
        with marked_points(() if simulated else items.values()):
            snapshot = self._show(self._plan.rendered[1])
            first = {name: surface_points(snapshot.evaluated(item)) for name, item in items.items()}
            for moment in moments:
                snapshot = self._show(moment)
                for name, item in items.items():
                    now = surface_points(snapshot.evaluated(item))
                    same = are_same_points(first[name], now, on_grid=is_on_grid(item))
                    if name not in found and not same:
                        found[name] = item
        return found

    def _say_not_followed(self, items: dict[str, Any]) -> None:
        """Add findings on objects whose surface changes, but that move as a whole in the result.

        The findings give the largest distance between the true surface and the moved one.
        """
        if not items:
            return
        rendered_s, rendered = self._plan.rendered
        other_s, other = self._plan.at(0.0 if self._plan.rendered_fraction > 0.5 else 1.0)
        snapshot = self._show(rendered)
        first = {
            name: DeformingSurface(item, snapshot, self._units) for name, item in items.items()
        }
        snapshot = self._show(other)
        agree: dict[str, float] = {}
        apart: dict[str, float] = {}
        for name, item in items.items():
            now = DeformingSurface(item, snapshot, self._units)
            scale = max(snapshot.evaluated(item).matrix_world.to_scale(), key=abs)
            apart_m = first[name].apart_m(now, abs(scale))
            allowed_m = max(_WARN_WAVELENGTHS * self._plan.wavelength_m, first[name].rounding_m)
            (agree if apart_m <= allowed_m else apart)[name] = apart_m
        if agree:
            self.findings.append(finding("surface-changes", *agree, apart_m=max(agree.values())))
        if apart:
            apart_m = self._apart_m = max(self._apart_m, *apart.values())
            speed_mps = apart_m / max(abs(other_s - rendered_s), 1e-12)
            self.findings.append(
                finding("surface-not-followed", *apart, apart_m=apart_m, speed_mps=speed_mps)
            )

    # -- rows --------------------------------------------------------------------------------------

    def label(self, rows: PathRows) -> None:
        """Fill in the objects and bodies of rows; bodies have the numbers of all
        rendered bodies.
        """
        self.bodies.label(rows)

    def collect(self, bodies: Iterable[int], chunks: Iterable[PathRows]) -> None:
        """Collect the numbers of all bodies that occur in rows, before `sample`.

        `chunks` are all labelled rows. Their scatterers are read if surfaces deform.
        """
        self._seen.update(bodies)
        if self._deformations.any:
            for rows in chunks:
                self._deformations.attach(rows, self.bodies)

    def complete(self, rows: PathRows) -> PathRows:
        """Fill in range rates and surface points, and give bodies the numbers that they have in the
        file.

        Call this method after `sample`, for the same rows and in the same order as `collect`.
        """
        if self._deformations.any:
            self._deformations.number(rows, self.bodies)
        for column in ("last_body", "first_body"):
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
        """Sample and fit the collected bodies; the scene is at the frame's time afterwards."""
        plan = self._plan
        touched = np.array(sorted(self._seen - {0}), dtype=np.intp)
        self._touched = Parts(self.bodies, touched - 1)
        self._file_number = np.zeros(len(self.bodies) + 1, dtype=np.int32)
        self._file_number[touched] = 1 + np.arange(touched.size)
        self.images = [
            dataclasses.replace(one, bodies=self._file_number[one.bodies].tolist())
            for one in self.images
        ]
        if self._frozen:
            return self._stationary()
        sampler = Sampler(self._show, self._rig, self._touched, self._deformations, plan)
        sampler.take(*plan.rendered)
        fits, jumps = self._fit(sampler)
        self._say_not_followed({name: sampler.surfaces[name].item for name in sampler.changed})
        self._show(self._plan.rendered[1])
        self.findings += fits.findings()
        self._say_sudden(jumps)
        self._bound_m = fits.displacement_error_bound_m
        if not self._deformations.body:
            return self._frame_motion(fits.motions)
        tracks = Tracks(
            self._file_number[np.concatenate(self._deformations.body)],
            np.concatenate(self._deformations.vertices),
            np.concatenate(self._deformations.weights),
            fits.series(),
        )
        return self._frame_motion(fits.motions, tracks)

    def _fit(self, sampler: Sampler) -> tuple[Fits, dict[float, dict[str, float]]]:
        """Return fits to enough samples, and the jumps of bodies in the form of `Sampler.jumps`.

        The number of samples doubles until the fits are accurate, or until more samples would only
        average rounding errors, or cost too much. If bodies jump, the plan gets a key at each jump,
        and the fits begin again.
        """
        plan = self._plan
        smooth, smooth_surfaces = self._take_whole_frames(sampler)

        def begin() -> tuple[Fits, set[float], list[tuple[float, Instant]]]:
            """Begin fits without samples; return them, with the times and the moments of the first
            samples.

            All times avoid the keys of the plan, because motion may jump there.
            """
            checks = [plan.clear_at(plan.frame + part * plan.frames) for part in _CHECKS]
            for moment in checks:
                sampler.take(*moment)
            fits = Fits(plan, sampler, [at_s for at_s, _ in checks], smooth, smooth_surfaces)
            times_s = {plan.rendered[0]} if plan.is_clear(plan.rendered[0]) else set()
            return fits, times_s, plan.grid(count, *plan.window)

        vertices = sum(surface.count for surface in sampler.surfaces.values())
        poses = self.bodies.snapshot.layout.shape.size + vertices // _VERTICES_PER_POSE
        work = 0
        count = min(_FIRST_SAMPLES, plan.max_samples)
        fits, grid, moments = begin()
        jumps: dict[float, dict[str, float]] = {}
        searches = _MOST_SEARCHES
        while True:
            for moment in moments:
                sampler.take(*moment)
            grid.update(at_s for at_s, _ in moments)
            work += _POSES_PER_FIT * fits.fit(sorted(grid))
            if searches and not (fits.resolved and fits.accurate):
                found = sampler.jumps(sorted(grid))
                searches -= 1
                if found:
                    jumps |= found
                    plan = self._plan = sampler.plan = plan.with_jumps([*jumps])
                    fits, grid, moments = begin()
                    continue
            most = _MOST_AGAINST_BIAS if fits.biased else _MOST_AGAINST_ROUNDING
            most = plan.max_samples if not fits.resolved else most
            if fits.accurate or count >= min(most, plan.max_samples):
                break
            if work + len(sampler.times_s) * poses > _MOST_POSES:
                self.findings.append(
                    finding(
                        "motion-sampling-slow",
                        samples=len(grid),
                        displacement_error_bound_m=fits.displacement_error_bound_m,
                    )
                )
                break
            count = min(2 * count - 1, plan.max_samples)
            follows = fits.resolved and not fits.noisy
            moments = plan.grid(count, *(plan.window if follows else plan.burst))
        self._samples = len(grid)
        return fits, jumps

    def _take_whole_frames(
        self, sampler: Sampler
    ) -> tuple[set[int], dict[str, tuple[float, float] | None]]:
        """Find what moves smoothly through whole frames only, and sample these frames.

        Return the rows of such poses, and such surfaces by name, with their frames as
        `cache_frames` gives them.
        """
        rows: set[int] = set()
        surfaces: dict[str, tuple[float, float] | None] = {}
        kinds, of_row = self._moving_items()
        if self._smooth:
            linear = cache(lambda item: is_linear_between_frames(self._measured_scene, item))
            found = np.array([any(map(linear, items)) for items in kinds])
            rows = set(np.flatnonzero(found[of_row]).tolist())
            surfaces = {
                name: cache_frames(one.item)
                for name, one in self._deformations.surfaces.items()
                if deforms_linearly_between_frames(one.item)
            }
        if self._by_scripts:
            stepped, names, said = stepped_at_frames(sampler, lambda row: kinds[of_row[row]])
            self.findings += said
            if self._smooth:
                rows |= stepped
                surfaces |= dict.fromkeys(names, (0.0, 1.0))
        if rows or surfaces:
            plan = self._plan
            whole = plan.whole_frames()
            own = [plan.whole_frames(*frames) for frames in surfaces.values() if frames]
            own.append([plan.between(*pair) for pair in itertools.pairwise(whole)])
            for moment in itertools.chain(whole, *own):
                sampler.take(*moment)
        return rows, surfaces

    def _say_sudden(self, jumps: dict[float, dict[str, float]]) -> None:
        """Add findings on shader displacement, on motion in steps, and on other jumps within the
        burst.
        """
        first, last = self._plan.burst
        moving = self._moving_items()[0]
        displaced = [i[0].name for i in moving[2:] if displacement_changes(i[0], first, last)]
        if displaced:
            self.findings.append(finding("displacement-changes", *dict.fromkeys(displaced)))
        in_steps = cache(lambda item: moves_in_steps(item, first, last))
        steps = dict.fromkeys(items[0].name for items in moving if any(map(in_steps, items)))
        if steps:
            self.findings.append(finding("motion-in-steps", *steps))
        within = {
            frame: sizes
            for frame, sizes in zip(self._plan.jumps, jumps.values(), strict=True)
            if first <= frame <= last and not sizes.keys() <= steps.keys()
        }
        if within:
            names = dict.fromkeys(name for sizes in within.values() for name in sizes)
            size_m = max(size for sizes in within.values() for size in sizes.values())
            self.findings.append(finding("motion-jumps", *names, frame=min(within), size_m=size_m))

    def _moving_items(self) -> tuple[list[list[Any]], Indices]:
        """Return the groups of objects that move poses, and the group of each row of poses.

        The rows are the antennas, then the collected bodies. Thousands of instances may share one
        group.
        """
        layout, numbers = self.bodies.snapshot.layout, self._touched.number
        instancer = layout.instancer[self.bodies.row[self._touched.index]]
        pairs = numbers * (len(layout.instancers) + 1) + instancer + 1
        _, first, of_part = np.unique(pairs, return_index=True, return_inverse=True)
        order = np.argsort(first)  # as they come
        found = [[self._rig.camera], [self._rig.emitter]]
        for at in first[order].tolist():
            index = int(instancer[at])
            instancers = [layout.instancers[index]] if index >= 0 else []
            found.append([self.bodies.originals[int(numbers[at])], *instancers])
        return found, np.concatenate([[0, 1], 2 + np.argsort(order)[of_part]])

    def _frame_motion(self, motions: BodyMotions, tracks: Tracks | None = None) -> FrameMotion:
        receiver, transmitter, self._motions = motions[0], motions[1], motions[2:]
        self._scene = FrameMotion(
            self._plan.duration_s,
            receiver,
            transmitter,
            self._kind == "orthographic",
            self._motions,
            tracks,
            self._plan.rendered[0],
            images=self.images,
        )
        return self._scene

    def moves(self, body: int) -> bool:
        """Return whether a collected body moves during the burst. Call this after `sample`."""
        return bool(self._scene.bodies[self._file_number[body] - 1].moving)

    def deforms(self, body: int) -> bool:
        """Return whether a collected body has a surface that deforms. Call this after `sample`."""
        tracks = self._scene.tracks
        return tracks is not None and self._file_number[body] in tracks.series

    def _stationary(self) -> FrameMotion:
        at_s, instant = self._plan.rendered
        snapshot = self._show(instant)
        antennas = (
            pose_in_metres(snapshot.evaluated(item).matrix_world, self._units)
            for item in (self._rig.camera, self._rig.emitter)
        )
        poses = np.concatenate([list(antennas), self.bodies.pose[self._touched.index]])
        self._samples, self._bound_m = 1, 0.0
        return self._frame_motion(BodyMotions(poses, {}, at_s))

    def write(self, folder: Path, time_s: float, versions: dict[str, str]) -> Path:
        """Write the files of this frame; return the motion file. Call this after `complete` of all
        rows.
        """
        scene, tracks_file, digest = self._scene, "", ""
        if scene.tracks is not None:
            path = write_tracks(folder, scene.tracks)
            tracks_file, digest = path.name, file_sha256(path)
        pairs = (self._rig.camera, scene.receiver), (self._rig.emitter, scene.emitter)
        antennas = [body_record(item.name, "", motion, False) for item, motion in pairs]
        surfaces = self._deformations.surfaces
        bodies, still_file, still_digest = write_bodies(
            folder, self._touched, self._motions, surfaces
        )
        total = self._power_w or 1.0
        wavelengths = self._bound_m / self._plan.wavelength_m
        self.findings += _approximated(self._approximated_w / total)
        if wavelengths > _WARN_WAVELENGTHS:
            self.findings.append(
                finding(
                    "displacement-error",
                    displacement_error_bound_m=self._bound_m,
                    wavelengths=wavelengths,
                )
            )
        self.record = record = MotionRecord(
            frame=self._plan.frame,
            time_s=time_s,
            duration_s=self._plan.duration_s,
            samples=self._samples,
            receiver_kind=self._kind,
            antennas=antennas,
            bodies=bodies,
            displacement_error_bound_m=max(self._bound_m, self._apart_m),
            displacement_error_bound_wavelengths=max(
                wavelengths, self._apart_m / self._plan.wavelength_m
            ),
            approximated_motion_fraction=self._approximated_w / total,
            unknown_motion_fraction=self._unknown_w / total,
            deforming_surfaces_file=tracks_file,
            deforming_surfaces_sha256=digest,
            epoch_offset_s=self._plan.rendered[0],
            still_bodies_file=still_file,
            still_bodies_sha256=still_digest,
            findings=merge(self.findings),
            versions=versions,
        )
        path = folder / contract.MOTION_FILE
        write_record(path, record)
        return path


def stepped_at_frames(
    sampler: Sampler, moving_items: Callable[[int], Sequence[Any]]
) -> tuple[set[int], set[str], list[Finding]]:
    """Find poses and surfaces that stay for a whole frame and then jump; return them with a
    finding.

    Constant keys, which are meant to jump, do not count. The results are rows of poses and names of
    surfaces. `moving_items` returns the objects that move a row. This function samples whole frames
    and the middles between them.
    """
    whole = sampler.plan.whole_frames()
    middles = [sampler.plan.between(*pair) for pair in itertools.pairwise(whole)]
    for moment in (*whole, *middles):
        sampler.take(*moment)
    whole_s, middles_s = ([at_s for at_s, _ in moments] for moments in (whole, middles))
    burst = sampler.plan.burst

    def jumps(values: dict[float, Real]) -> Mask:
        at_whole = np.stack([values[at_s] for at_s in whole_s])
        amid = np.stack([values[at_s] for at_s in middles_s])
        moved = (at_whole[1:] != at_whole[:-1]).any(axis=(0, 2, 3))
        return np.asarray(moved & (at_whole[:-1] == amid).all(axis=(0, 2, 3)))

    changing = sampler.changing
    poses = {at_s: sampler.poses(at_s, changing) for at_s in (*whole_s, *middles_s)}
    rows = {
        row
        for row in changing[jumps(poses)].tolist()
        if not any(moves_in_steps(item, *burst) for item in moving_items(row))
    }
    names = set()
    for name, surface in sampler.surfaces.items():
        vertices = {at_s: sampler.vertices[name][at_s] for at_s in (*whole_s, *middles_s)}
        if any(one is None for one in vertices.values()):
            continue
        jumping = jumps({at_s: one[None] for at_s, one in vertices.items()}).item()
        if jumping and not moves_in_steps(surface.item, *burst):
            names.add(name)
    moved = ["antennas" if row < 2 else sampler.parts[row - 2].name for row in sorted(rows)]
    subjects = dict.fromkeys([*moved, *sorted(names)])
    return rows, names, [finding("moves-at-whole-frames", *subjects)] if subjects else []


def _approximated(fraction: float) -> list[Finding]:
    """Return the finding on the fraction of the power in paths whose motion is not exact."""
    if fraction <= _NEGLIGIBLE / 10:
        return []
    found = finding("motion-approximated", fraction=fraction)
    return [found if fraction > _NEGLIGIBLE else found.as_information()]
