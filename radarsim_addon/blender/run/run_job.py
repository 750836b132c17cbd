# SPDX-License-Identifier: GPL-3.0-or-later
"""A run as a plain object that a loop drives.

`MeasurementJob` keeps what both sampling modes share; `rings.RingJob` and `paths.PathJob` render::

    with RingJob(scene, view_layer, measurement, folder) as job:
        for task in job.pending():
            job.start(task)
            job.render(task)
            job.finish(task)

`prepare` finds the antennas. It looks at all frames for the extent of the scene and for closing
speeds, and makes the plan from them. Then it sets the scene for the measurement, and opens the
folder for this run or joins the processes that measure it. `pending` claims one frame after
another. `restore` restores the user's scene. `SceneTime` sets the scene to a moment, as it renders
at that moment.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
import os
import secrets
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import bpy

from ... import __version__, contract
from ...errors import RadarSimError
from ...findings import Finding, finding, merge
from ...signal.runs import shared_plan
from ...typed_json import read_record, write_record
from ..materials import is_physical, separate_averages
from ..nodes import refresh_groups
from ..plan import (
    Extent,
    Instant,
    Measurement,
    Plan,
    check_frame_rate,
    check_unit_scale,
    config_findings,
    instant_at,
    make_plan,
    run_record,
    shortest_decimal,
)
from ..scene import (
    VELOCITY_FRAMES,
    ClosingSpeeds,
    Rig,
    check_meshes_finite,
    disabled_drivers,
    driven_by_whole_frames,
    find_rig,
    hiding_is_animated,
    receiver_record,
    rendered_rows,
    renders_whole_frames_only,
    show_as_rendered,
    show_what_renders,
    simulation_frames,
    transmitter_record,
    unreadable_files,
)
from ..scene import ground_truth as ground_truth
from ..state import (
    SettingsRestorer,
    Snapshot,
    evaluated_snapshot,
    follow_evaluations,
    forget_snapshot,
    ignore_evaluations,
    read_all_again,
)
from . import shared_folder
from .scene_state import MeasurementSettings
from .shared_folder import SharedFolder


class MeasurementJob:
    """One run of a scene, whose view layer is measured into `folder`.

    The folder is made if its parent exists. `overwrite` removes the frames of any earlier run from
    it, instead of keeping or refusing them. `camera` and `emitter` are the antennas, if the scene
    has several. `unit` is what `done` and `total` count.
    """

    unit = "renders"
    any_projection = False
    #: Current step of the run, in words.
    stage = ""
    #: Whether objects with any material echo.
    code_world = False

    def __init__(
        self,
        scene: bpy.types.Scene,
        view_layer: bpy.types.ViewLayer,
        measurement: Measurement,
        folder: Path,
        *,
        overwrite: bool = False,
        camera: bpy.types.Object | None = None,
        emitter: bpy.types.Object | None = None,
    ) -> None:
        self._scene = scene
        self._view_layer = view_layer
        self._measurement = measurement
        self._antennas = (camera, emitter)
        self._settings: MeasurementSettings | None = None
        self._shown_for_run = SettingsRestorer()
        self._time = SceneTime(scene, view_layer, self._shown_for_run, self._last_needed)
        self._shared = SharedFolder(folder)
        self._records: tuple[contract.ReceiverRecord, contract.TransmitterRecord] | None = None
        self._started_s = 0.0
        self._rendered = 0
        self.total = self.done = 0
        self.folder, self.overwrite = folder, overwrite
        #: Name of the scene's file in the run's record; empty if it was never saved.
        self.file_name = Path(bpy.data.filepath).name
        #: Hash of the scene's files, if they were just opened and nobody can have changed the
        #: scene since. Empty: this run resumes no earlier one, and no later one resumes it.
        self.identity = ""
        #: Whether the file, or a copy of it, was just opened: Blender knows of all changes since.
        self.just_opened = False
        #: Fingerprint in the plan of this run, once that is written.
        self.fingerprint = ""
        #: Camera that renders paths, if one was added after the file was opened: a `ViewCamera`.
        self.view_camera: Any = None
        #: Frames of the run that this process measures, as long as no other one does.
        self.own_frames: Sequence[int] = measurement.frames
        #: Whether the plan of the folder is taken over, if it is this run's: its frames are not
        #: surveyed again. Nothing is written before a frame is measured.
        self.joins = False
        #: Whether another process has taken over the frame that was measured last.
        self.frame_lost = False
        #: Whether Blender reported evaluations before this job, as with the add-on.
        self._followed = follow_evaluations()
        #: Findings before the first render, and on the frames that are done.
        self.early_findings: list[Finding] = []
        self.run_findings: list[Finding] = []
        #: Settings that differ from those of the run that was in the folder, one text each.
        self.changes: list[str] = []
        self.frame_findings: list[Finding] = []
        self.summary = ""
        self.unrestored: list[str] = []
        self.versions = {"blender": bpy.app.version_string, "radarsim": __version__}

    def __enter__(self) -> MeasurementJob:
        self.prepare()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.restore()

    # -- before the first render -------------------------------------------------------------------

    def prepare(self) -> None:
        """Check everything, make the plan, and set the scene for the measurement."""
        self.rig: Rig = find_rig(self._scene, *self._antennas, any_projection=self.any_projection)
        fresh = not os.path.exists(self.folder)  # Path.exists raises for some names
        shared_folder.prepare_folder(self.folder)
        try:
            self._prepare()
        except BaseException:
            self.restore()
            if fresh:
                with contextlib.suppress(OSError):  # a plan was written: it stays
                    self.folder.rmdir()
            raise

    def _prepare(self) -> None:
        # A file of an older radarsim holds older node groups.
        refresh_groups()
        if not (self.identity or self.just_opened):
            read_all_again()  # a script may change data without telling Blender
        earlier = self._plan_of_folder() if self.joins else None
        if earlier is None:
            survey = SettingsRestorer()
            try:
                survey.keep_frame(self._scene)
                extent = self._survey()
            finally:
                self.unrestored += self._shown_for_run.restore() + survey.restore()
            self.plan: Plan = self._make_plan(extent)
        self._settings = self._make_settings()
        self._settings.apply()
        if self._settings.device_kind != "CPU":
            self.versions["device"] = self._settings.device_kind
        self._time.simulate_again()  # changes of the scene empty the caches of simulations
        if earlier is not None:
            record = self._record([])
            self._shared.join(record)
        else:
            self.run_findings = [
                *self.early_findings,
                *self._settings.findings,
                *disabled_drivers(),
                *unreadable_files(),
                *self._config_findings(),
            ]
            record = self._record(self.run_findings)
            self.changes = self._shared.open(record, self.overwrite)
        self.fingerprint = record.fingerprint
        self.take(self.own_frames)

    def take(self, frames: Sequence[int]) -> None:
        """Choose frames of the plan; `pending` then yields the renders of these only."""
        self.own_frames, self.frame_lost = frames, False
        self._plan_renders()
        self._started_s = time.monotonic()

    def _plan_renders(self) -> None:
        """Set `total` and `done` of this process's frames. The scene is set for the measurement."""
        raise NotImplementedError

    def _record(self, findings: list[Finding]) -> contract.RunRecord:
        """Return the content of ``run.json`` of this run.

        Without an `identity`, its digest is random, so no other run has the same.
        """
        identity = self.identity
        if identity:
            chosen = self._scene, self._view_layer, self.rig.camera, self.rig.emitter
            identity += f" {[one.name for one in chosen]!r}"
            # The carrier changes what a physical material reflects; others render alike at any.
            if any(is_physical(material) for material in bpy.data.materials):
                identity += f" {self._measurement.waveform.carrier_hz!r} Hz"
        digest, plan, versions = identity or secrets.token_hex(16), self.plan, self.versions
        record = run_record(plan, digest, self.file_name, self.scene_name, findings, versions)
        record.extra["extent"] = dataclasses.astuple(plan.extent)
        record.extra["resumable"] = bool(identity)
        record.extra["polarisation"] = plan.measurement.polarisation
        return record

    def _plan_of_folder(self) -> contract.RunRecord | None:
        """Return the record in the folder, and make `plan` by its extent, if it is of this run."""
        try:
            record = shared_folder.earlier_run(self.folder)
            if record is None or not self.identity or record.frames != list(self.frames):
                return None
            extent = Extent(*map(float, record.extra["extent"]))
        except (RadarSimError, KeyError, TypeError, ValueError):
            return None
        self.plan = self._make_plan(extent)
        own = self._record([])
        same = record.fingerprint == own.fingerprint and shared_plan(record) == shared_plan(own)
        return own if same else None

    def _make_plan(self, extent: Extent) -> Plan:
        return make_plan(self._measurement, self._metres_per_unit(), self._fps(), extent)

    def _make_settings(self) -> MeasurementSettings:
        return MeasurementSettings(self._scene, self._view_layer, self.rig, self.plan)

    def _metres_per_unit(self) -> float:
        return check_unit_scale(shortest_decimal(self._scene.unit_settings.scale_length))

    def _fps(self) -> float:
        render = self._scene.render
        return check_frame_rate(float(render.fps) / shortest_decimal(render.fps_base))

    def _surveyed(self, frame: int) -> tuple[float, ...]:
        """Return the moments of a radar frame that are surveyed, in Blender frames."""
        if self._measurement.snapshots < 2:
            return (float(frame),)
        return (float(frame), frame + self._measurement.snapshot_interval_s * self._fps())

    def _last_needed(self, frame: int) -> float:
        """Return the last Blender frame whose state `frame`, or a frame of the run, may need."""
        frames = *self._measurement.frames, frame
        # Motion is sampled two frames beyond the burst, and there is one more.
        return max(max(self._surveyed(one)) for one in frames) + 3

    def _survey(self) -> Extent:
        """Look at all frames before the first render. Return the extent; keep closing speeds."""
        units, fps, burst = self._metres_per_unit(), self._fps(), self._measurement.burst
        self._speeds = ClosingSpeeds(units, burst.pulses / burst.prf_hz)
        extent = Extent()
        seen: tuple[Any, ...] = ()
        for frame in self._measurement.frames:
            moments = [instant_at(at, fps) for at in self._surveyed(frame)]
            looks = []
            for instant in moments:
                snapshot = self._time.show(instant)
                self._refuse_unmeasurable(snapshot)
                boxes, antennas = look = self._look(snapshot)
                looks.append(look)
                # If Blender has evaluated nothing since, all is as before.
                now = boxes.snapshot, *(place.tobytes() for place in antennas)
                if now != seen:
                    extent = extent.union(ground_truth.extent_of_boxes(boxes, antennas, units))
                seen = now
            first = moments[0]
            soon = instant_at(first.evaluated_frame + VELOCITY_FRAMES, fps)
            later = self._look(self._time.show(soon))
            self._speeds.add(looks[0], later, soon.time_s - first.time_s)
        self._time.forget()
        return extent

    def _look(self, snapshot: Snapshot) -> tuple[Any, Any]:
        """Return the boxes of all objects that can echo, and the places of the antennas."""
        boxes = ground_truth.echoing_boxes(snapshot, self.code_world)
        return boxes, ground_truth.antenna_positions(snapshot, self.rig)

    def _refuse_unmeasurable(self, snapshot: Snapshot) -> None:
        """Check that everything can be recorded, before a file is written."""
        self._antenna_records(snapshot, self._metres_per_unit())
        check_meshes_finite(snapshot, rendered_rows(snapshot))

    def _config_findings(self) -> list[Finding]:
        interval_s = None
        frames = self._measurement.frames
        if len(frames) > 1:
            interval_s = min(abs(b - a) for a, b in itertools.pairwise(frames)) / self.plan.fps
        found = config_findings(
            self._measurement,
            self.plan.rings,
            self.plan.extent.from_emitter_m or None,
            interval_s,
            self.plan.sampling_mode,
            (self._scene.frame_end - self._scene.frame_start) / self.plan.fps,
            self._speeds.by_object,
        )
        stuck = [one.name for one in self._scene.objects if renders_whole_frames_only(one)]
        stuck += driven_by_whole_frames()
        if stuck and self._renders_between_frames():
            found.append(finding("rendered-at-whole-frames", *stuck))
        assert self._settings is not None
        if self._settings.averages_in_a_row and self._averaged_paths():
            found.append(separate_averages(self._settings.averaging, self._averaged_paths()))
        return found

    def _renders_between_frames(self) -> bool:
        """Return whether Cycles renders at times between whole frames."""
        return self._measurement.snapshots > 1

    def _averaged_paths(self) -> str:
        """Return which paths take the mean of both polarisations at each wall; "" for none."""
        return "all paths, because rings mix them"

    # -- renders -----------------------------------------------------------------------------------

    def _claimed(self, frames: Sequence[int]) -> Iterator[int]:
        """Yield the frames that this process may measure, one after another."""
        left = yield from self._shared.claimed(frames)
        if left:
            who = self._shared.holders(left)
            self.frame_findings.append(finding("frames-left-to-others", *who, count=len(left)))

    def keeps_frame(self) -> bool:
        """Return whether this process still holds the frame. Another one takes over late frames."""
        self.frame_lost = not self._shared.keeps_frame()
        return not self.frame_lost

    def pending(self) -> Iterator[Any]:
        """Yield the renders that are still to be made, in order."""
        raise NotImplementedError

    def start(self, task: Any) -> None:
        """Set the scene for a render."""
        raise NotImplementedError

    def render(self, task: Any) -> None:
        """Render and wait for the end (not for use in the UI)."""
        raise NotImplementedError

    def finish(self, task: Any) -> None:
        """Read or write what was rendered."""
        raise NotImplementedError

    def _antenna_records(
        self, snapshot: Snapshot, metres_per_unit: float
    ) -> tuple[contract.ReceiverRecord, contract.TransmitterRecord]:
        """Return the records of both antennas at the moment of a snapshot."""
        size_px = self._measurement.width_px, self._measurement.height_px
        return (
            receiver_record(self.rig, snapshot, metres_per_unit, *size_px),
            transmitter_record(self.rig, snapshot, metres_per_unit),
        )

    def _write_scene(self, frame: int) -> None:
        """Write the ground truth of a radar frame, unless the folder has that of this run."""
        path = self.folder / contract.frame_dir(frame) / contract.GROUND_TRUTH_FILE
        with contextlib.suppress(RadarSimError):
            if read_record(path, contract.GroundTruthRecord).run_fingerprint == self.fingerprint:
                return
        instants, units = self.plan.instants(frame), self.plan.metres_per_unit
        later, interval_s = None, 0.0
        if len(instants) > 1:
            snapshot = self._time.show(instants[1])
            receiver, _ = ground_truth.antenna_positions(snapshot, self.rig)
            later = ground_truth.rendered_surfaces(snapshot), receiver
            interval_s = instants[1].time_s - instants[0].time_s
        snapshot = self._time.show(instants[0])
        objects = ground_truth.object_records(snapshot, self.rig, units, later, interval_s)
        time_s = instants[0].time_s
        write_record(path, contract.GroundTruthRecord(frame, time_s, objects, self.fingerprint))

    # -- afterwards --------------------------------------------------------------------------------

    @property
    def findings(self) -> list[Finding]:
        """Findings of the run before its first render, and of the frames that are done."""
        return merge(self.run_findings + self.frame_findings)

    @property
    def frames(self) -> tuple[int, ...]:
        return tuple(self._measurement.frames)

    @property
    def scene_name(self) -> str:
        return str(self._scene.name)

    @property
    def fraction(self) -> float:
        """Fraction of the run that is done."""
        return self.done / self.total if self.total else 1.0

    @property
    def seconds_left(self) -> float | None:
        """Return the remaining time [s] from the renders of this session; None before the first."""
        if not self._rendered:
            return None
        per_render_s = (time.monotonic() - self._started_s) / self._rendered
        return per_render_s * (self.total - self.done)

    def restore(self) -> None:
        """Restore the user's scene; `unrestored` lists what failed. May be called again."""
        if self._settings is not None:
            self.unrestored += self._settings.restore()
        self.unrestored += self._shown_for_run.restore()
        if self.view_camera is not None:
            self.unrestored += self.view_camera.restore()
        if not self._followed:
            ignore_evaluations()
        self._shared.close()

    def leave(self) -> None:
        """Release files, but leave the scene as it is, because the process ends."""
        self._shared.close()


class SceneTime:
    """The moment at which a scene is evaluated.

    `restorer` restores objects that are shown for the run. `last_needed` returns the last Blender
    frame that the run needs after a given one.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        view_layer: bpy.types.ViewLayer,
        restorer: SettingsRestorer,
        last_needed: Callable[[int], float],
    ) -> None:
        self._scene, self._view_layer = scene, view_layer
        self._restorer, self._last_needed = restorer, last_needed
        self._simulated_to = -math.inf
        self._shown: Instant | None = None
        self._hiding_moves = True

    def show(self, instant: Instant) -> Snapshot:
        """Set the scene to a moment; return the snapshot at that moment."""
        # Before the time is set: what appears later would keep the place of another time.
        if self._shown is None:
            if show_as_rendered(self._restorer, self._scene):
                forget_snapshot()  # meshes are those of renders from now on
            self._hiding_moves = hiding_is_animated()
        if self._shown is None or (self._hiding_moves and self._shown.frame != instant.frame):
            show_what_renders(self._restorer, self._view_layer)
        if instant.frame + 1 > self._simulated_to:
            # All at once: a cache that is played further later is no longer exact, and loses
            # frames when a time between two of them is read.
            self._simulated_to = math.ceil(self._last_needed(instant.frame))
            for frame in simulation_frames(self._scene, int(self._simulated_to)):
                self._scene.frame_set(frame)
        self._scene.frame_set(instant.frame, subframe=instant.subframe)
        self._shown = instant
        return evaluated_snapshot(self._view_layer)

    def shows(self, instant: Instant) -> bool:
        """Return whether the scene is at a moment; the user may have changed the frame since."""
        now = self._scene.frame_current + self._scene.frame_subframe
        return self._shown == instant and bool(now == instant.evaluated_frame)

    def forget(self) -> None:
        """Forget the moment, because objects that were shown were restored."""
        self._shown = None

    def simulate_again(self) -> None:
        """Play simulations before the next moment that is shown."""
        self._simulated_to = -math.inf
