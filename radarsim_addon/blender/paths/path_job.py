# SPDX-License-Identifier: GPL-3.0-or-later
"""Sampling mode "paths": one path per pixel, tile by tile, until the error or the time is reached.

Driven like `run.MeasurementJob`: `PathJob.pending` yields renders, each goes through `start`,
`render` and `finish`, and which one comes next depends on the last. A radar frame has one render
of its burst or several (visibility updates). For each, `PathJob` evaluates the scene, sets up what
`frame.FrameWork` needs (tracer, motion, hit points, clutter, mirrors), and has it measure the tiles
and write the table. A render whose files are whole is skipped; a frame that is as the one before
gets copies of its files (`StillFrames`).
"""

from __future__ import annotations

import dataclasses
import shutil
import time
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import bpy

from ... import contract
from ...contract import MotionRecord
from ...errors import RadarSimError
from ...findings import Finding, finding, percent_text
from ...signal.motion import read_motion
from ...signal.paths import has_digests, open_table
from ...signal.scene import Mesh
from ...signal.tracing import BodyMesh, MirrorPaths, Obstacles
from ...typed_json import file_sha256, read_record, write_record
from ..materials import (
    EXACT_FACETS,
    SURFACE_TYPES,
    Interiors,
    assigned_materials,
    foreign_objects,
    found_inside,
    has_no_faces,
    mirror_choice,
    read_surface,
)
from ..motion import BurstMotion, SamplingPlan, key_frames
from ..nodes import is_radar_material
from ..nodes.shader_trees import trees_within
from ..plan import Extent, Instant, Measurement, PathOptions, Plan, make_plan
from ..run import MeasurementJob, MeasurementSettings, shared_folder
from ..scene import ground_truth as ground_truth
from ..scene import is_hidden_at_times, may_move_at_whole_frames, no_echo_findings
from ..state import Snapshot, evaluated_snapshot, latest_snapshot, watch_evaluations
from ..views import PathScene
from .clutter_weights import ClutterWeights
from .frame import FrameWork
from .hit_points import HitPoints, Holders
from .measured_tiles import TileCheckpoints
from .obstacles import ways_to_transmitter
from .view_tracer import PathRun, PathTask, ViewTracer


class PathJob(MeasurementJob):
    """A run that measures paths; `options` say how they are followed, and when the result is good.

    `prepare` raises SceneError, ConfigError and OutputError, as that of `MeasurementJob`.
    """

    unit = "steps"
    any_projection = True

    def __init__(
        self,
        scene: bpy.types.Scene,
        view_layer: bpy.types.ViewLayer,
        measurement: Measurement,
        folder: Path,
        options: PathOptions,
        **keywords: Any,
    ) -> None:
        # One sample a pixel; bounces follow from the order.
        measurement = dataclasses.replace(
            measurement, samples=1, max_reflections=options.max_reflections
        )
        super().__init__(scene, view_layer, measurement, folder, **keywords)
        self.options = options
        self._restores: list[Callable[[], list[str]]] = []
        self._holders: Holders = WeakKeyDictionary()
        self._body_meshes: WeakKeyDictionary[Mesh, BodyMesh] = WeakKeyDictionary()
        snapshot = evaluated_snapshot(view_layer)
        foreign = holds_foreign_materials(snapshot)
        choice = options.range_encoding
        by_facets = options.max_reflections > 1 and holds_rough_facets(snapshot)
        self.code_world = choice == "world" or (choice == "auto" and (foreign or by_facets))
        self._rounds_by_channel = by_facets and not self.code_world
        # Light of other materials would count as marks.
        self._vertex_marks = options.max_reflections > 1 and not (foreign and self.code_world)
        self.deterministic = not self.code_world or (choice == "auto" and not foreign)

    # -- before the first render -------------------------------------------------------------------

    def _config_findings(self) -> list[Finding]:
        found = super()._config_findings()
        return [*found, finding("facets-encode-range")] if self._rounds_by_channel else found

    def _renders_between_frames(self) -> bool:
        return self.options.visibility_updates > 1

    def _averaged_paths(self) -> str:
        if not self.deterministic:
            return "all paths, because other than Radar Materials leave them to chance"
        return "paths of several reflections" if self.options.max_reflections > 1 else ""

    def _surveyed(self, frame: int) -> tuple[float, ...]:
        # what flies away in the burst stays in the window
        return (float(frame), frame + self._span_s * self._fps())

    def _make_plan(self, extent: Extent) -> Plan:
        # One "ring" as wide as the scene, and 1.25 for optical delays: the range limits, and what
        # the range encoding has to reach.
        reach_m = max(extent.from_emitter_m, extent.from_receiver_m) * 1.25
        encoding = "world" if self.code_world else "materials"
        self._measurement = dataclasses.replace(
            self._measurement, rings=1, ring_step_m=max(reach_m, self._metres_per_unit() * 1e-3)
        )
        return make_plan(
            self._measurement,
            self._metres_per_unit(),
            self._fps(),
            extent,
            sampling_mode="paths",
            options=f"{self.options!r} {encoding}",
            visibility_updates=self.options.visibility_updates,
        )

    def _make_settings(self) -> MeasurementSettings:
        return MeasurementSettings(
            self._scene, self._view_layer, self.rig, self.plan, self.code_world, self.view_camera
        )

    def prepare(self) -> None:
        super().prepare()
        try:
            self.path_scene = PathScene(
                self._scene,
                self._view_layer,
                self.rig.camera,
                self.rig.emitter,
                self.plan.metres_per_unit,
                self.plan.range_encoding_length_m,
                self.code_world,
                self.view_camera,
                self._vertex_marks and "device" not in self.versions,  # tested on the CPU
            )
            self._restores.append(self.path_scene.restore)
            self.path_scene.apply()
            options = self.options
            # Replicates of small tiles share a render.
            small = self._measurement.width_px <= 128 or options.refines
            if options.max_reflections == 1 and self.deterministic and small:
                self.path_scene.join_looks(options.replicates)
            self._still = StillFrames(self.folder, self.path_scene.own_names)
            self._restores.append(self._still.restore)
        except BaseException:
            self.restore()
            raise
        self._run = PathRun(
            self.path_scene,
            self.plan,
            self._measurement,
            self.options,
            self.code_world,
            self.deterministic,
            bool(self._settings is not None and self._settings.averaging),
            self._settings.interiors if self._settings is not None else Interiors(),
            self.versions,
            self.fingerprint,
        )

    def _plan_renders(self) -> None:
        """Count the steps of the frames of this process, and the steps that earlier sessions did.

        A step is one replicate of a tile, or the table of one render. Refinement adds steps later.
        """
        frames = self.own_frames
        self._frames_left = [n for n in frames if not self._is_done(n)]
        side = self.options.tile_px
        tiles = -(-self._measurement.width_px // side) * -(-self._measurement.height_px // side)
        renders = self.options.visibility_updates
        self._steps = steps = tiles * self.options.replicates + 1
        self.total = steps * len(frames) * renders
        kept = [
            (frame, render)
            for frame in frames
            for render in range(renders)
            if self._render_is_done(frame, render)
        ]
        self.done = self._done_before = steps * len(kept)
        for frame, render in kept:  # a kill may have left them
            TileCheckpoints(self.folder / contract.burst_dir(frame, render), "").remove()

    @property
    def rays(self) -> int:
        """Number of rays times reflections of all frames, before refinement. The time of a run
        grows with it.
        """
        pixels = self._measurement.width_px * self._measurement.height_px
        looks = len(self._measurement.frames) * self.options.visibility_updates
        return pixels * looks * self.options.replicates * self.options.max_reflections

    @property
    def _span_s(self) -> float:
        burst = self._measurement.burst
        return burst.pulses / burst.prf_hz

    def _is_done(self, frame: int) -> bool:
        renders = range(self.options.visibility_updates)
        return all(self._render_is_done(frame, render) for render in renders)

    def _render_is_done(self, frame: int, render: int) -> bool:
        """Return whether all files of a render are complete, from this run, and cover this burst or
        a longer one.

        The ground truth of the frame, which is written before its renders, must be there too.
        """
        folder = self.folder / contract.burst_dir(frame, render)
        labels_file = self.folder / contract.frame_dir(frame) / contract.GROUND_TRUTH_FILE
        try:
            record = read_record(folder / contract.PATHS_FILE, contract.PathsRecord)
            labels = read_record(labels_file, contract.GroundTruthRecord)
            if {record.run_fingerprint, labels.run_fingerprint} != {self.fingerprint}:
                return False
            motion = read_motion(folder, frame, record.motion_sha256)
            whole = motion.span_s >= self._span_s * (1 - 1e-9)
            table = open_table(folder / record.table_file, record.column_groups)
            return whole and has_digests(table, record.column_sha256)
        except (RadarSimError, OSError):
            return False

    # -- renders -----------------------------------------------------------------------------------

    def pending(self) -> Iterator[Any]:
        """Yield the renders that are not done yet."""
        for frame in self._claimed(self._frames_left):
            if self._is_done(frame):  # by another process, meanwhile
                continue
            try:
                yield from self._frame_tasks(frame)
            except (OSError, RadarSimError):
                # If the run folder was removed, report that instead.
                shared_folder.check_there(self.folder, frame)
                raise
        self.total = self.done

    def start(self, task: Any) -> None:
        if task.request is None:
            self.stage = f"frame {task.frame}, {task.stage}"
            return
        self.stage = f"frame {task.frame}, tile {task.tile + 1}, replicate {task.replicate + 1}"
        task.tracer.start(task.request)

    def render(self, task: Any) -> None:
        if task.request is not None:
            self.path_scene.render()

    def finish(self, task: Any) -> None:
        if task.request is not None:
            task.tracer.finish()
            self._rendered += 1

    @property
    def seconds_left(self) -> float | None:
        """Estimate of the remaining time [s] from the steps of this session. Refinement may add
        steps.
        """
        measured = self.done - self._done_before
        if measured <= 0:
            return None
        return (time.monotonic() - self._started_s) / measured * (self.total - self.done)

    def restore(self) -> None:
        for restore in self._restores:
            self.unrestored += restore()
        super().restore()

    def leave(self) -> None:
        self.path_scene.remove_files()
        super().leave()

    # -- one radar frame ---------------------------------------------------------------------------

    def _frame_tasks(self, frame: int) -> Generator[PathTask, None, None]:
        shared_folder.make_frame_folder(self.folder, frame)
        self._write_scene(frame)
        if not self._time.shows(begins := self.plan.instants(frame)[0]):
            self._time.show(begins)
        self.path_scene.choose_views(self._measurement.width_px * self._measurement.height_px)
        self._still.begin()
        for render in range(self.options.visibility_updates):
            if not self._render_is_done(frame, render):
                shared_folder.make_frame_folder(self.folder, frame, render)
                yield from self._render_tasks(frame, render)

    def _render_tasks(self, frame: int, render: int) -> Generator[PathTask, None, None]:
        """Measure one render of a burst and write its table."""
        units = self.plan.metres_per_unit
        last = self.options.visibility_updates - 1
        stretch = self._scene.render.frame_map_new / self._scene.render.frame_map_old
        sampling = SamplingPlan(
            frame,
            self._fps(),
            self._span_s,
            units,
            self._measurement.waveform.wavelength_m,
            self.options.motion_samples,
            render / last if last else 0.0,
            key_frames(frame - 3, frame + 3 + self._span_s * self._fps(), stretch),
            stretch,
        )
        if self._still.holds(render, sampling.rendered[0]):
            yield from self._repeat(frame, render, sampling.rendered[1])
            return
        motion = BurstMotion(
            self._time.show,
            self.rig,
            self.path_scene.objects,
            sampling,
            self.path_scene.kind,
            motion=self.options.motion,
            render=render,
        )
        snapshot = motion.begin()
        receiver, transmitter = self._antenna_records(snapshot, units)
        receiver = dataclasses.replace(receiver, matrix_world=self.path_scene.place(snapshot))
        ways = None
        if self._run.interiors.delay:
            antennas = ground_truth.antenna_positions(snapshot, self.rig)
            motion.findings += found_inside(snapshot, antennas)
            reach_m = self.plan.extent.from_receiver_m
            ways = ways_to_transmitter(
                motion.bodies.snapshot, receiver, transmitter, reach_m, units
            )
        tracer = ViewTracer(self._run, frame, sampling.rendered[1], receiver, transmitter, ways)
        hits = HitPoints(
            motion.bodies,
            self._measurement.waveform.wavelength_m,
            self.path_scene.all_opaque,
            self._holders,
            ways,
        )
        marks = {n: mirror_choice(item) for n, item in motion.bodies.originals.items()}
        mirrors = MirrorPaths(
            Obstacles(motion.bodies, self._body_meshes),
            hits.normals,
            receiver,
            tracer.transmitter_m,
            self.plan.extent.from_receiver_m,
            self._measurement.polarisation,
            self._measurement.waveform.wavelength_m,
            self.options.max_reflections,
            self.options.mirror_images,
            [number for number, mark in marks.items() if mark == "first"],
            [number for number, mark in marks.items() if mark == "never"],
        )
        tracer.lamps_m = mirrors.lamps_m
        self.path_scene.lamps.place(mirrors.lamps_m / units)
        folder = self.folder / contract.burst_dir(frame, render)
        work = FrameWork(
            tracer,
            motion,
            hits,
            ClutterWeights(
                hits,
                motion.bodies,
                self._measurement.waveform.carrier_hz,
                self._measurement.polarisation,
            ),
            mirrors,
            folder,
            self,
            lambda seen: no_echo_findings(latest_snapshot(self._view_layer), self.rig, seen),
        )
        try:
            stop_reason = yield from work.measure()
            yield PathTask(tracer, 0, 0, None, "motion and path table")
        except BaseException:  # stopped, or failed
            work.keep_tiles()
            raise
        if not self.keeps_frame():  # another process has taken over: it writes the frame
            return
        record = work.write(stop_reason)
        self._still.keep(render, record, motion.record)
        self.done += 1
        self.frame_findings += record.findings
        if render:  # the other commands, too, tell of the first render of a burst
            return
        known = percent_text(record.relative_error) if record.path_count else "unknown"
        for item in record.findings:
            if item.code == "power-uncertain":
                known += f" (caution: uncertain power of {', '.join(item.subjects[:3])})"
        where = f"frame {frame}: " if len(self.frames) > 1 else ""
        self.summary = f"{where}{record.path_count:,} paths, standard error {known}"
        if record.length_sigma_wavelengths >= _SAID_WAVELENGTHS:
            self.summary += f", lengths within {record.length_sigma_wavelengths:.2g} wavelengths"
        if self.options.refines:
            self.summary += f"; refined until: {stop_reason}"

    def _repeat(self, frame: int, render: int, at: Instant) -> Generator[PathTask, None, None]:
        """Write the files of a render of a frame in which nothing has changed, without
        rendering.
        """
        receiver, transmitter = self._antenna_records(latest_snapshot(self._view_layer), 1.0)
        tracer = ViewTracer(self._run, frame, at, receiver, transmitter, None)
        yield PathTask(tracer, 0, 0, None, "motion and path table")
        if self.keeps_frame():
            record = self._still.write(render, frame, at.time_s)
            self.done += self._steps
            self.frame_findings += record.findings

    # -- progress of a frame -----------------------------------------------------------------------

    def add_tiles(self, count: int) -> None:
        self.total += count * self.options.replicates

    def replicates_measured(self, count: int, *, earlier: bool) -> None:
        self.done += count
        self._done_before += count * earlier


class StillFrames:
    """Frames that are as the one before: their files are copied, without a render.

    Blender reports every data-block that it evaluates, also where its values stay the same. If it
    has evaluated nothing since the last frame began, and nothing can change unreported
    (`_is_steady`), renders with the same seeds would give the same rows, and nothing moves in the
    burst. `folder` is the run's; `own` are the names of data-blocks that the run itself changes
    from render to render.
    """

    def __init__(self, folder: Path, own: frozenset[str]) -> None:
        self._folder, self._own = folder, own
        self._changed, self._alike = True, False
        self._records: dict[int, tuple[contract.PathsRecord, MotionRecord]] = {}
        self._stop = watch_evaluations(self._note)

    def restore(self) -> list[str]:
        """Stop watching evaluations. A second call does nothing."""
        self._stop()
        return []

    def _note(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Record which data-blocks Blender has evaluated. None: evaluations may have
        been missed.
        """
        items = [None] if depsgraph is None else [one.id.original for one in depsgraph.updates]
        # settings of the scene itself are the run's
        self._changed |= any(
            not isinstance(item, bpy.types.Scene) and getattr(item, "name", "") not in self._own
            for item in items
        )

    def begin(self) -> None:
        """Begin a frame. The scene is set to this frame already."""
        self._alike = not self._changed and _is_steady()
        if not self._alike:
            self._records.clear()
        self._changed = False

    def holds(self, render: int, offset_s: float) -> bool:
        """Return whether a render of this frame would give the files that are kept.

        `offset_s` is the time of the render after the time of the frame.
        """
        kept = self._records.get(render)
        if not self._alike or kept is None or kept[1].epoch_offset_s != offset_s:
            return False
        return (self._folder / contract.burst_dir(kept[0].frame, render)).is_dir()

    def keep(self, render: int, record: contract.PathsRecord, motion: MotionRecord) -> None:
        self._records[render] = record, motion

    def write(self, render: int, frame: int, time_s: float) -> contract.PathsRecord:
        """Copy the files of a render from those that are kept; return the record."""
        record, motion = self._records[render]
        source, target = (
            self._folder / contract.burst_dir(one, render) for one in (record.frame, frame)
        )
        for name in filter(None, (record.table_file, motion.still_bodies_file)):
            shutil.copyfile(source / name, target / name)
        motion_file = target / record.motion_file
        write_record(motion_file, dataclasses.replace(motion, frame=frame, time_s=time_s))
        record = dataclasses.replace(
            record,
            frame=frame,
            time_s=time_s,
            renders=0,
            render_time_s=0.0,
            motion_sha256=file_sha256(motion_file),
            findings=[item.in_frame(frame) for item in record.findings],
        )
        write_record(target / contract.PATHS_FILE, record)
        return record


def _is_steady() -> bool:
    """Return whether nothing can change from frame to frame without an evaluation that Blender
    reports.
    """
    owners = (*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights)
    trees = [*bpy.data.node_groups, *(one.node_tree for one in owners if one.node_tree)]
    return not (
        may_move_at_whole_frames()
        or bpy.app.handlers.render_pre
        or any(image.source in {"SEQUENCE", "MOVIE"} for image in bpy.data.images)
        or any(map(_reads_settings, trees))
    )


def _reads_settings(tree: bpy.types.NodeTree) -> bool:
    """Return whether a shader reads settings of the scene that radarsim has not made, such as the
    frame.
    """
    return any(
        node.bl_idname == "ShaderNodeScript"
        or (
            node.bl_idname == "ShaderNodeAttribute"
            and node.attribute_type == "VIEW_LAYER"
            and not node.attribute_name.startswith("radarsim_")
        )
        for node in tree.nodes
    )


#: Random errors of lengths that a summary gives [wavelengths].
_SAID_WAVELENGTHS = 1e-3
#: Nodes whose output changes from frame to frame.
_NODES_OF_TIME = {"GeometryNodeInputSceneTime", "GeometryNodeSimulationInput"}


def holds_foreign_materials(snapshot: Snapshot) -> bool:
    """Return whether an object that can echo has a material other than the Radar Material."""
    if next(foreign_objects(snapshot, is_radar_material), None) is not None:
        return True
    evaluated = {one.item for one in assigned_materials(snapshot) if _same_faces_always(one.item)}
    shown = [
        one
        for one in bpy.data.objects
        if one.type in SURFACE_TYPES
        and one not in evaluated
        and not has_no_faces(one)
        and (not one.hide_render or is_hidden_at_times(one))
    ]
    slots = [tuple(slot.material for slot in item.material_slots) or (None,) for item in shown]
    return not all(is_radar_material(material) for of_one in slots for material in of_one)


def _same_faces_always(item: bpy.types.Object) -> bool:
    """Return whether the object has the same faces in the viewport, in renders and at all times.

    Only then the evaluated faces of the current moment show all of its materials.
    """
    if not item.modifiers:
        return True
    still = not item.animation_data and not getattr(item.data, "animation_data", None)
    return still and all(
        one.show_viewport == one.show_render
        and one.type == "NODES"
        and not _depends_on_time(one.node_group)
        for one in item.modifiers
    )


def _depends_on_time(tree: bpy.types.NodeTree) -> bool:
    """Return whether a group of Geometry Nodes, or a group inside it, is animated or reads the
    time.
    """
    return any(
        inner.animation_data or any(node.bl_idname in _NODES_OF_TIME for node in inner.nodes)
        for inner in trees_within(tree)
    )


def holds_rough_facets(snapshot: Snapshot) -> bool:
    """Return whether an object that can echo has rough facets.

    If materials carry the range encoding, Cycles rounds the brightness of such facets differently
    in each colour channel. Materials that Geometry Nodes assign are found on evaluated objects
    only.
    """
    assigned = {m for one in assigned_materials(snapshot) for m in one.materials}
    return EXACT_FACETS and any(read_surface(material).has_rough_facets for material in assigned)
